// Where the pass may move the surface, and how freely.
#include <fielddeform/core/error.h>
#include <fielddeform/volume/detail/local_mask.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

namespace fielddeform::volume::detail {
namespace {

constexpr double kSlow = 1e-3, kSlowRamp = 0.02, kSlowShare = 0.1;  // of the size; of the vertices
constexpr double kReach = 20;       // small edits: "slow" is measured by the longest move, not by the object
constexpr double kStillWeight = 0.05;
constexpr double kRestEnd = 0.3;

// smoothstep(d / reach), d along rest edges from the nearest vertex that stays; 1 where none is connected. [Dijkstra 1959]
std::vector<double> distanceMask(const LocalEdit& e, double reach) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  std::vector<double> distance(e.vertexCount(), kFar);
  using Entry = std::pair<double, Index>;  // ties by index: the same order always
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (Index v = 0; v < e.vertexCount(); ++v) {
    if (!e.still[v]) continue;
    distance[v] = 0;
    const auto ring = e.neighbours(v);
    if (std::any_of(ring.begin(), ring.end(), [&](Index w) { return !e.still[w]; })) queue.emplace(0, v);
  }
  while (!queue.empty()) {
    const auto [d, v] = queue.top();
    queue.pop();
    if (d > distance[v]) continue;
    for (const Index w : e.neighbours(v)) {
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

// Much of a component that "moved" hardly did, because its part of the skeleton stayed: it must not pay for the rest.
void leaveSlowParts(const LocalEdit& e, const std::vector<Index>& componentOf, std::vector<double>& mask) {
  const std::size_t n = e.vertexCount(), count = e.components.count();
  std::vector<double> move(n, 0), longest(count, 0);
  std::vector<std::size_t> strong(count, 0), slow(count, 0);
  for (std::size_t v = 0; v < n; ++v) {
    if (componentOf[v] == kNoIndex || mask[v] == 0) continue;
    move[v] = (e.posed[v] - e.rest[v]).norm();
    longest[componentOf[v]] = std::max(longest[componentOf[v]], move[v]);
  }
  const auto reachOf = [&](Index c) { return std::min(e.size, kReach * longest[c]); };
  for (std::size_t v = 0; v < n; ++v) {
    const Index c = componentOf[v];
    if (c == kNoIndex || mask[v] <= 0.5) continue;
    ++strong[c];
    slow[c] += move[v] < kSlow * reachOf(c);
  }
  for (std::size_t v = 0; v < n; ++v) {
    const Index c = componentOf[v];
    if (c == kNoIndex || mask[v] == 0 || slow[c] == 0) continue;
    if (static_cast<double>(slow[c]) < kSlowShare * static_cast<double>(strong[c])) continue;
    mask[v] *= smoothstep((move[v] / reachOf(c) - kSlow) / kSlowRamp);
  }
}

std::vector<Index> vertexComponents(const LocalEdit& e) {
  std::vector<Index> of(e.vertexCount(), kNoIndex);
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f)
    for (const Index v : e.mesh.face(f)) of[v] = std::min(of[v], e.components.ofFace[f]);
  return of;
}

std::vector<std::uint8_t> above0(const std::vector<double>& mask) {
  std::vector<std::uint8_t> out(mask.size());
  for (std::size_t v = 0; v < out.size(); ++v) out[v] = mask[v] > 0;
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
  for (std::size_t v = 0; v < mask.size(); ++v)
    if (e.still[v] || (componentOf[v] != kNoIndex && !e.touched[componentOf[v]])) mask[v] = 0;
  leaveSlowParts(e, componentOf, mask);
  return mask;
}

// Nothing is held anywhere: every component has 1 all over it, or 0.
bool isFree(const LocalEdit& e, const std::vector<double>& mask) {
  std::vector<double> of(e.components.count(), -1);
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f) {
    const Index c = e.components.ofFace[f];
    if (c == kNoIndex) continue;
    for (const Index v : e.mesh.face(f)) {
      if (of[c] < 0) of[c] = mask[v];
      if (mask[v] != of[c] || (mask[v] != 0 && mask[v] != 1)) return false;
    }
  }
  return true;
}

void requireSomething(const LocalEdit& e, const LocalMask& mask, MaskKind kind, const std::vector<std::uint8_t>& held) {
  std::vector<std::uint8_t> moves(held.size(), 0);
  std::size_t rims = 0;
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f)
    if (const Index c = e.components.ofFace[f]; c != kNoIndex)
      for (const Index v : e.mesh.face(f)) moves[c] |= mask.value[v] > 0;
  for (std::size_t k = 0; k < e.edges.size(); ++k) {
    const auto [a, b] = e.edges.vertices(k);
    rims += e.edges.uses(k).size() % 2 == 1 && (mask.value[a] > 0 || mask.value[b] > 0);
  }
  if (rims > 0)
    throw InfeasibleError(fmt::format("the surface is open and its volume mask would move {} boundary edge{}; close it, or use "
                                      "a mask that is 0 there", rims, rims == 1 ? "" : "s"));
  for (std::size_t c = 0; c < held.size(); ++c)
    if (held[c] && !moves[c] && kind == MaskKind::Rest)
      throw InfeasibleError("volume mask 'rest': the edit moved all of a component, nothing is left to take its volume from");
    else if (held[c] && !moves[c])
      throw InfeasibleError("the volume mask is 0 all over a component that the edit changed: nothing can give its volume back");
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
  for (std::size_t v = 0; v < n; ++v)
    if (!e.posed[v].allFinite() || componentOf[v] == kNoIndex || !held[componentOf[v]]) mask.value[v] = 0;
  requireSomething(e, mask, kind, held);
  mask.moved = static_cast<std::size_t>(std::count_if(mask.value.begin(), mask.value.end(), [](double m) { return m > 0; }));
  mask.free = isFree(e, mask.value);
  mask.length = partLength(e, above0(mask.value));
  return mask;
}

}  // namespace fielddeform::volume::detail
