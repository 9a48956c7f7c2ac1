// The surfaces that the pass works on, and where each one's volume came from.
#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/volume/detail/local_part.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kGrain = 8192, kFacesAtOnce = std::size_t{1} << 17;
constexpr int kSmoothings = 10;
constexpr double kLeastShare = 0.05, kLargestRatio = 4;

double triangleArea(const Vec3& a, const Vec3& b, const Vec3& c) { return 0.5 * (b - a).cross(c - a).norm(); }

// Part of every component, kNoIndex for those that are not held.
std::vector<Index> partOfComponent(const LocalEdit& e, const std::vector<ComponentVolumes::Value>& volumes) {
  std::vector<Index> part(e.components.count(), kNoIndex);
  for (Index s = 0; s < volumes.size(); ++s) part[volumes[s].component] = s;
  return part;
}
Index partOfFace(const LocalEdit& e, const std::vector<Index>& part, std::size_t f) {
  const Index c = e.components.ofFace[f];
  return c == kNoIndex ? kNoIndex : part[c];
}

// A third of every triangle to its vertices, face by face: areas are found side by side, some faces at a time, then added.
void addAreas(const LocalEdit& e, const std::vector<Index>& part, std::vector<double>& rest, std::vector<double>& posed) {
  std::vector<std::array<double, 2>> thirds;
  const auto eachTriangle = [&](std::size_t first, std::size_t begin, std::size_t end, auto&& call) {
    for (std::size_t f = begin; f < end; ++f) {
      if (partOfFace(e, part, f) == kNoIndex) continue;
      std::size_t at = e.mesh.faceBegin(f) - e.mesh.faceBegin(first);
      e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) { call(thirds[at++], i, j, k); });
    }
  };
  for (std::size_t first = 0; first < e.mesh.faceCount(); first += kFacesAtOnce) {
    const std::size_t count = std::min(kFacesAtOnce, e.mesh.faceCount() - first);
    thirds.resize(e.mesh.faceBegin(first + count) - e.mesh.faceBegin(first));
    parallelFor(count, kGrain, [&](std::size_t begin, std::size_t end) {
      eachTriangle(first, first + begin, first + end, [&](std::array<double, 2>& third, Index i, Index j, Index k) {
        third = {triangleArea(e.rest[i], e.rest[j], e.rest[k]) / 3, triangleArea(e.posed[i], e.posed[j], e.posed[k]) / 3};
      });
    });
    eachTriangle(first, first, first + count, [&](const std::array<double, 2>& third, Index i, Index j, Index k) {
      for (const Index v : {i, j, k}) rest[v] += third[0], posed[v] += third[1];
    });
  }
}

// Means over the ring and the vertex itself, of the moved vertices alone: those that stay keep theirs.
std::vector<double> smoothed(const LocalEdit& e, const std::vector<double>& mask, const std::vector<double>& values) {
  const IndexLists neighbours = e.neighbours();
  std::vector<double> q = values, next = values;
  for (int i = 0; i < kSmoothings; ++i) {
    parallelFor(q.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        if (mask[v] == 0) continue;
        double sum = q[v];
        for (const Index w : neighbours[v]) sum += q[w];
        next[v] = sum / static_cast<double>(1 + neighbours[v].size());
      }
    });
    std::swap(q, next);
  }
  return q;
}

// s = (1 - kappa) + kappa (.05 + .95 min(4, r / mean r)): all alike where gains and losses cancel (a bend), where the volume
// came from if it came from somewhere (a stretch).
void setShares(LocalPart& part, const AreaChanges& areas, double sign) {
  struct Sums {
    double net = 0, gross = 0, mean = 0, total = 0;
  };
  const auto r = [&](std::size_t i) { return std::max(0.0, sign * areas.smoothed[part.vertex[i]]); };
  part.share.assign(part.size(), 1);
  const Sums sums = deterministicReduce(
      part.size(), kGrain, Sums(),
      [&](std::size_t begin, std::size_t end) {
        Sums s;
        for (std::size_t i = begin; i < end; ++i) {
          const double weight = part.area[i] * part.mask[i], q = areas.logRatio[part.vertex[i]];
          s.net += weight * q;
          s.gross += weight * std::abs(q);
          s.mean += weight * r(i);
          s.total += weight;
        }
        return s;
      },
      [](const Sums& a, const Sums& b) { return Sums{a.net + b.net, a.gross + b.gross, a.mean + b.mean, a.total + b.total}; });
  if (!(sums.gross > 0 && sums.total > 0 && sums.mean > 0)) return;
  const double mean = sums.mean / sums.total, kappa = std::abs(sums.net) / sums.gross;
  parallelFor(part.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      part.share[i] = (1 - kappa) + kappa * (kLeastShare + (1 - kLeastShare) * std::min(kLargestRatio, r(i) / mean));
  });
}

// The part's vertices, ascending, and its triangles by their numbers among them. A part that is most of the mesh is marked, not
// sorted: there may be as many small ones as components.
void numberVertices(LocalPart& part, std::vector<Index>& triangles, std::size_t n, std::vector<Index>& local) {
  if (triangles.size() > n) {
    std::vector<std::uint8_t> used(n, 0);
    parallelFor(triangles.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t c = begin; c < end; ++c) std::atomic_ref(used[triangles[c]]).store(1, std::memory_order_relaxed);
    });
    part.vertex.reserve(static_cast<std::size_t>(std::count(used.begin(), used.end(), 1)));
    for (Index v = 0; v < used.size(); ++v)
      if (used[v]) part.vertex.push_back(v);
  } else {
    part.vertex = triangles;
    std::sort(part.vertex.begin(), part.vertex.end());
    part.vertex.erase(std::unique(part.vertex.begin(), part.vertex.end()), part.vertex.end());
  }
  if (part.size() == n) return;  // by the mesh's own numbers
  local.resize(n);
  for (Index i = 0; i < part.size(); ++i) local[part.vertex[i]] = i;
  parallelFor(triangles.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c) triangles[c] = local[triangles[c]];
  });
}

struct Count {
  std::size_t n = 0;
  Count& operator+=(const Count& o) { return n += o.n, *this; }
};

// Every part's triangles with a vertex that may move, by the mesh's vertices.
std::vector<std::vector<Index>> trianglesOf(const LocalEdit& e, const LocalMask& mask, const std::vector<Index>& part, std::size_t parts) {
  const auto moves = [&](Index i, Index j, Index k) { return mask.value[i] > 0 || mask.value[j] > 0 || mask.value[k] > 0; };
  const auto counts = sumByComponent<Count>(parts, e.mesh.faceCount(), [&](std::size_t begin, std::size_t end, Count* row) {
    for (std::size_t f = begin; f < end; ++f)
      if (const Index p = partOfFace(e, part, f); p != kNoIndex)
        e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) { row[p].n += moves(i, j, k); });
  });
  std::vector<std::vector<Index>> out(parts);
  if (parts == 1 && e.mesh.allTriangles() && counts[0].n == e.mesh.faceCount()) {
    out[0] = e.mesh.corners();
    return out;
  }
  for (std::size_t p = 0; p < parts; ++p) out[p].reserve(3 * counts[p].n);
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f)
    if (const Index p = partOfFace(e, part, f); p != kNoIndex)
      e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
        if (moves(i, j, k)) out[p].insert(out[p].end(), {i, j, k});
      });
  return out;
}

void copyVertices(LocalPart& part, const LocalEdit& e, const LocalMask& mask, const AreaChanges& areas, double total) {
  part.base.resize(part.size()), part.mask.resize(part.size()), part.area.resize(part.size());
  parallelFor(part.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Index v = part.vertex[i];
      part.base[i] = e.posed[v];
      part.mask[i] = mask.value[v];
      part.area[i] = total > 0 ? areas.rest[v] / total : 0;
    }
  });
}

}  // namespace

AreaChanges measureAreas(const LocalEdit& e, const LocalMask& mask, const std::vector<ComponentVolumes::Value>& volumes) {
  AreaChanges out;
  out.rest.assign(e.vertexCount(), 0), out.logRatio.assign(e.vertexCount(), 0);
  addAreas(e, partOfComponent(e, volumes), out.rest, out.logRatio);
  parallelFor(e.vertexCount(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const double posed = out.logRatio[v];
      out.logRatio[v] = out.rest[v] > 0 && posed > 0 ? numeric::log(posed / out.rest[v]) : 0;
    }
  });
  out.smoothed = smoothed(e, mask.value, out.logRatio);
  return out;
}

LocalParts makeParts(const LocalEdit& e, const LocalMask& mask, const std::vector<ComponentVolumes::Value>& volumes, AreaChanges areas) {
  const std::size_t n = e.vertexCount();
  LocalParts out;
  out.part.resize(volumes.size());
  for (std::size_t v = 0; v < n; ++v)
    if (mask.value[v] > 0) out.area += areas.rest[v];
  std::vector<std::vector<Index>> triangles = trianglesOf(e, mask, partOfComponent(e, volumes), volumes.size());
  std::vector<Index> local;
  for (std::size_t s = 0; s < out.part.size(); ++s) {
    LocalPart& part = out.part[s];
    numberVertices(part, triangles[s], n, local);
    copyVertices(part, e, mask, areas, out.area);
    setShares(part, areas, (volumes[s].change() < 0) == (volumes[s].rest < 0) ? 1 : -1);
  }
  areas = {}, local = {};
  for (std::size_t s = 0; s < out.part.size(); ++s) {
    LocalPart& part = out.part[s];
    part.surface.emplace(part.base, std::move(triangles[s]), std::vector<Index>{}, Rims::Fixed);
    part.before = part.surface->value(part.base);
    part.target = part.before - volumes[s].change();
  }
  return out;
}

LocalParts makeParts(const LocalEdit& e, const LocalMask& mask, const std::vector<ComponentVolumes::Value>& volumes) {
  return makeParts(e, mask, volumes, measureAreas(e, mask, volumes));
}

}  // namespace fielddeform::volume::detail
