// Where the pass may move the surface, and how freely.
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/detail/local_mask.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kGrain = 8192;
constexpr double kSlow = 1e-3, kSlowRamp = 0.02, kSlowShare = 0.1;  // of the size; of the vertices
constexpr double kReach = 20;       // small edits: "slow" is measured by the longest move, not by the object
constexpr double kStillWeight = 0.05;
constexpr double kRestEnd = 0.3;

// smoothstep(d / reach), d along rest edges from the nearest vertex that stays; 1 where none is connected. [Dijkstra 1959]
std::vector<double> distanceMask(const LocalEdit& e, double reach) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const IndexLists neighbours = e.neighbours();
  std::vector<double> distance(e.vertexCount(), kFar);
  using Entry = std::pair<double, Index>;  // ties by index: the same order always
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (Index v = 0; v < e.vertexCount(); ++v) {
    if (!e.still[v]) continue;
    distance[v] = 0;
    const auto ring = neighbours[v];
    if (std::any_of(ring.begin(), ring.end(), [&](Index w) { return !e.still[w]; })) queue.emplace(0, v);
  }
  while (!queue.empty()) {
    const auto [d, v] = queue.top();
    queue.pop();
    if (d > distance[v]) continue;
    for (const Index w : neighbours[v]) {
      const double next = d + (e.rest[w] - e.rest[v]).norm();
      if (!(next < distance[w]) || next >= reach) continue;
      distance[w] = next;
      queue.emplace(next, w);
    }
  }
  std::vector<double> mask(e.vertexCount());
  for (std::size_t v = 0; v < mask.size(); ++v)
    mask[v] = e.still[v] ? 0 : distance[v] == kFar ? 1 : reach > 0 ? smoothstep(distance[v] / reach) : 1;
  return mask;
}

// A falloff weight serves if it is what holds the rest: where the object stays for another reason, it would jump there.
bool falloffServes(const LocalEdit& e, std::span<const double> weight) {
  if (weight.empty()) return false;
  bool holds = false;
  for (std::size_t v = 0; v < weight.size(); ++v) {
    if (e.still[v] && weight[v] > kStillWeight) return false;
    holds = holds || weight[v] < 1;
  }
  return holds;
}

struct Longest {
  double move = 0;
  Longest& operator+=(const Longest& o) { return move = std::max(move, o.move), *this; }
};
struct SlowCounts {
  std::size_t strong = 0, slow = 0;
  SlowCounts& operator+=(const SlowCounts& o) { return strong += o.strong, slow += o.slow, *this; }
};

// Much of a component that "moved" hardly did, because its part of the skeleton stayed: it must not pay for the rest.
void leaveSlowParts(const LocalEdit& e, const std::vector<Index>& componentOf, std::vector<double>& mask) {
  const std::size_t n = e.vertexCount(), count = e.components.count();
  const auto moveOf = [&](std::size_t v) { return (e.posed[v] - e.rest[v]).norm(); };
  const auto longest = sumByComponent<Longest>(count, n, [&](std::size_t begin, std::size_t end, Longest* row) {
    for (std::size_t v = begin; v < end; ++v)
      if (componentOf[v] != kNoIndex && mask[v] != 0) row[componentOf[v]] += {moveOf(v)};
  });
  const auto reachOf = [&](Index c) { return std::min(e.size, kReach * longest[c].move); };
  const auto counts = sumByComponent<SlowCounts>(count, n, [&](std::size_t begin, std::size_t end, SlowCounts* row) {
    for (std::size_t v = begin; v < end; ++v)
      if (const Index c = componentOf[v]; c != kNoIndex && mask[v] > 0.5) row[c] += {1, moveOf(v) < kSlow * reachOf(c)};
  });
  if (std::all_of(counts.begin(), counts.end(), [](const SlowCounts& c) { return c.slow == 0; })) return;
  parallelFor(n, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const Index c = componentOf[v];
      if (c == kNoIndex || mask[v] == 0 || counts[c].slow == 0) continue;
      if (static_cast<double>(counts[c].slow) < kSlowShare * static_cast<double>(counts[c].strong)) continue;
      mask[v] *= smoothstep((moveOf(v) / reachOf(c) - kSlow) / kSlowRamp);
    }
  });
}

// The lowest component with a face at each vertex.
std::vector<Index> vertexComponents(const LocalEdit& e) {
  std::vector<Index> of(e.vertexCount(), kNoIndex);
  parallelFor(e.mesh.faceCount(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      for (const Index v : e.mesh.face(f)) {
        const std::atomic_ref own(of[v]);
        Index now = own.load(std::memory_order_relaxed);
        while (e.components.ofFace[f] < now && !own.compare_exchange_weak(now, e.components.ofFace[f], std::memory_order_relaxed)) {}
      }
  });
  return of;
}

std::vector<std::uint8_t> above0(const std::vector<double>& mask) {
  std::vector<std::uint8_t> out(mask.size());
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) out[v] = mask[v] > 0;
  });
  return out;
}

std::vector<double> autoMask(const LocalEdit& e, const LocalInput& input, const std::vector<Index>& componentOf, bool& fromFalloff) {
  std::vector<double> mask;
  fromFalloff = falloffServes(e, input.weight);
  if (fromFalloff) {
    mask.assign(input.weight.begin(), input.weight.end());
  } else if (std::find(e.still.begin(), e.still.end(), 1) == e.still.end()) {
    mask.assign(e.vertexCount(), 1);
  } else {
    std::vector<std::uint8_t> counts(e.vertexCount());
    for (std::size_t v = 0; v < counts.size(); ++v) counts[v] = !e.still[v];
    mask = distanceMask(e, 2 * partLength(e, counts));
  }
  parallelFor(mask.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      if (e.still[v] || (componentOf[v] != kNoIndex && !e.touched[componentOf[v]])) mask[v] = 0;
  });
  leaveSlowParts(e, componentOf, mask);
  return mask;
}

// Which masks a component's faces have.
struct MaskKinds {
  bool zero = false, one = false, between = false;
  void add(double m) { (m == 0 ? zero : m == 1 ? one : between) = true; }
  MaskKinds& operator+=(const MaskKinds& o) { return zero |= o.zero, one |= o.one, between |= o.between, *this; }
};
std::vector<MaskKinds> maskKinds(const LocalEdit& e, const std::vector<double>& mask) {
  return sumByComponent<MaskKinds>(e.components.count(), e.mesh.faceCount(), [&](std::size_t begin, std::size_t end, MaskKinds* row) {
    for (std::size_t f = begin; f < end; ++f)
      if (const Index c = e.components.ofFace[f]; c != kNoIndex)
        for (const Index v : e.mesh.face(f)) row[c].add(mask[v]);
  });
}

// Nothing is held anywhere: every component has 1 all over it, or 0.
bool isFree(const std::vector<MaskKinds>& kinds) {
  return std::none_of(kinds.begin(), kinds.end(), [](const MaskKinds& k) { return k.between || (k.zero && k.one); });
}

void requireSomething(const LocalEdit& e, const LocalMask& mask, const std::vector<MaskKinds>& kinds, MaskKind kind,
                      const std::vector<std::uint8_t>& held) {
  std::size_t rims = 0;
  for (std::size_t k = 0; !e.closed() && k < e.edges->size(); ++k) {
    const auto [a, b] = e.edges->vertices(k);
    rims += e.edges->uses(k).size() % 2 == 1 && (mask.value[a] > 0 || mask.value[b] > 0);
  }
  if (rims > 0)
    throw InfeasibleError(fmt::format("the surface is open and its volume mask would move {} boundary edge{}; close it, or use "
                                      "a mask that is 0 there", rims, rims == 1 ? "" : "s"));
  for (std::size_t c = 0; c < held.size(); ++c) {
    if (!held[c] || kinds[c].one || kinds[c].between) continue;
    if (kind == MaskKind::Rest)
      throw InfeasibleError("volume mask 'rest': the edit moved all of a component, nothing is left to take its volume from");
    throw InfeasibleError("the volume mask is 0 all over a component that the edit changed: nothing can give its volume back");
  }
}

}  // namespace

std::vector<std::uint8_t> heldComponents(const LocalEdit& e, const LocalInput& input, MaskKind kind) {
  std::vector<std::uint8_t> held = e.touched;
  if (kind == MaskKind::Auto || kind == MaskKind::Rest) return held;
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f)
    if (const Index c = e.components.ofFace[f]; c != kNoIndex)
      for (const Index v : e.mesh.face(f)) held[c] |= kind == MaskKind::None || input.mask[v] > 0;
  return held;
}

LocalMask makeMask(const LocalEdit& e, const LocalInput& input, MaskKind kind, const std::vector<std::uint8_t>& held) {
  LocalMask mask;
  const std::size_t n = e.vertexCount();
  const std::vector<Index> componentOf = vertexComponents(e);
  if (kind == MaskKind::None) mask.value.assign(n, 1);
  else if (kind == MaskKind::Given) mask.value.assign(input.mask.begin(), input.mask.end());
  else mask.value = autoMask(e, input, componentOf, mask.fromFalloff);
  if (kind == MaskKind::Rest)
    for (double& m : mask.value) m = 1 - smoothstep(m / kRestEnd);
  mask.moved = deterministicReduce(
      n, kGrain, std::size_t{0},
      [&](std::size_t begin, std::size_t end) {
        std::size_t moved = 0;
        for (std::size_t v = begin; v < end; ++v) {
          if (!e.posed[v].allFinite() || componentOf[v] == kNoIndex || !held[componentOf[v]]) mask.value[v] = 0;
          moved += mask.value[v] > 0;
        }
        return moved;
      },
      std::plus<>());
  const std::vector<MaskKinds> kinds = maskKinds(e, mask.value);
  requireSomething(e, mask, kinds, kind, held);
  mask.free = isFree(kinds);
  mask.length = partLength(e, above0(mask.value));
  return mask;
}

}  // namespace fielddeform::volume::detail
