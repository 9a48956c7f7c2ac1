// The surfaces that the pass works on, and where each one's volume came from.
#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/volume/detail/local_part.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::volume::detail {
namespace {

constexpr int kSmoothings = 10;
constexpr double kLeastShare = 0.05, kLargestRatio = 4;

double triangleArea(const Vec3& a, const Vec3& b, const Vec3& c) { return 0.5 * (b - a).cross(c - a).norm(); }

// q = ln(A' / A) of every vertex near what moves.
std::vector<double> logAreaRatios(const std::vector<double>& rest, const std::vector<double>& posed) {
  std::vector<double> q(rest.size(), 0);
  for (std::size_t v = 0; v < q.size(); ++v)
    if (rest[v] > 0 && posed[v] > 0) q[v] = numeric::log(posed[v] / rest[v]);
  return q;
}

// Means over the ring and the vertex itself, of the moved vertices alone: those that stay keep theirs.
void smooth(const LocalEdit& e, const std::vector<double>& mask, std::vector<double>& q) {
  std::vector<double> next = q;
  for (int i = 0; i < kSmoothings; ++i) {
    parallelFor(q.size(), 8192, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        if (mask[v] == 0) continue;
        double sum = q[v];
        for (const Index w : e.neighbours(static_cast<Index>(v))) sum += q[w];
        next[v] = sum / static_cast<double>(1 + e.neighbours(static_cast<Index>(v)).size());
      }
    });
    std::swap(q, next);
  }
}

// s = (1 - kappa) + kappa (.05 + .95 min(4, r / mean r)): all alike where gains and losses cancel (a bend), where the volume
// came from if it came from somewhere (a stretch).
void setShares(LocalPart& part, const std::vector<double>& q, const std::vector<double>& smoothed, double sign) {
  double net = 0, gross = 0, mean = 0, total = 0;
  part.share.assign(part.size(), 1);
  std::vector<double> r(part.size());
  for (std::size_t i = 0; i < part.size(); ++i) {
    const double weight = part.area[i] * part.mask[i];
    r[i] = std::max(0.0, sign * smoothed[part.vertex[i]]);
    net += weight * q[part.vertex[i]];
    gross += weight * std::abs(q[part.vertex[i]]);
    mean += weight * r[i];
    total += weight;
  }
  if (!(gross > 0 && total > 0 && mean > 0)) return;
  mean /= total;
  const double kappa = std::abs(net) / gross;
  for (std::size_t i = 0; i < part.size(); ++i)
    part.share[i] = (1 - kappa) + kappa * (kLeastShare + (1 - kLeastShare) * std::min(kLargestRatio, r[i] / mean));
}

// The part's vertices, ascending, and its triangles by their numbers among them. A part that is most of the mesh is marked, not
// sorted: there may be as many small ones as components.
void numberVertices(LocalPart& part, std::vector<Index>& local) {
  if (part.triangles.size() > local.size()) {
    std::vector<std::uint8_t> used(local.size(), 0);
    for (const Index v : part.triangles) used[v] = 1;
    part.vertex.reserve(static_cast<std::size_t>(std::count(used.begin(), used.end(), 1)));
    for (Index v = 0; v < used.size(); ++v)
      if (used[v]) part.vertex.push_back(v);
  } else {
    part.vertex = part.triangles;
    std::sort(part.vertex.begin(), part.vertex.end());
    part.vertex.erase(std::unique(part.vertex.begin(), part.vertex.end()), part.vertex.end());
  }
  for (Index i = 0; i < part.size(); ++i) local[part.vertex[i]] = i;
  for (Index& v : part.triangles) v = local[v];
}

// How many triangles of every held component have a vertex that may move.
void reserveTriangles(const LocalEdit& e, const LocalMask& mask, const std::vector<Index>& slot, LocalParts& out) {
  std::vector<std::size_t> count(out.part.size(), 0);
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f) {
    const Index c = e.components.ofFace[f];
    if (c == kNoIndex || slot[c] == kNoIndex) continue;
    e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) { count[slot[c]] += mask.value[i] > 0 || mask.value[j] > 0 || mask.value[k] > 0; });
  }
  for (std::size_t s = 0; s < count.size(); ++s) out.part[s].triangles.reserve(3 * count[s]);
}

}  // namespace

LocalParts makeParts(const LocalEdit& e, const LocalMask& mask, const std::vector<ComponentVolumes::Value>& volumes) {
  const std::size_t n = e.vertexCount();
  LocalParts out;
  out.part.resize(volumes.size());
  std::vector<Index> slot(e.components.count(), kNoIndex);
  for (Index s = 0; s < volumes.size(); ++s) slot[volumes[s].component] = s;
  reserveTriangles(e, mask, slot, out);
  std::vector<double> rest(n, 0), posed(n, 0);
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f) {
    const Index c = e.components.ofFace[f];
    if (c == kNoIndex || slot[c] == kNoIndex) continue;
    e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
      const double a = triangleArea(e.rest[i], e.rest[j], e.rest[k]) / 3, b = triangleArea(e.posed[i], e.posed[j], e.posed[k]) / 3;
      for (const Index v : {i, j, k}) rest[v] += a, posed[v] += b;
      if (mask.value[i] == 0 && mask.value[j] == 0 && mask.value[k] == 0) return;
      for (const Index v : {i, j, k}) out.part[slot[c]].triangles.push_back(v);
    });
  }
  for (std::size_t v = 0; v < n; ++v)
    if (mask.value[v] > 0) out.area += rest[v];
  const std::vector<double> q = logAreaRatios(rest, posed);
  std::vector<double> smoothed = q;
  smooth(e, mask.value, smoothed);
  std::vector<Index> local(n, kNoIndex);
  for (std::size_t s = 0; s < out.part.size(); ++s) {
    LocalPart& part = out.part[s];
    numberVertices(part, local);
    part.base.reserve(part.size()), part.mask.reserve(part.size()), part.area.reserve(part.size());
    for (const Index v : part.vertex) {
      part.base.push_back(e.posed[v]);
      part.mask.push_back(mask.value[v]);
      part.area.push_back(out.area > 0 ? rest[v] / out.area : 0);
    }
    setShares(part, q, smoothed, (volumes[s].change() < 0) == (volumes[s].rest < 0) ? 1 : -1);
    part.surface.emplace(part.base, part.triangles, std::vector<Index>{}, Rims::Fixed);
    part.before = part.surface->value(part.base);
    part.target = part.before - volumes[s].change();
  }
  return out;
}

}  // namespace fielddeform::volume::detail
