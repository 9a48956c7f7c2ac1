// What an edit moved, and the volumes of the components that it touched.
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/detail/local_edit.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kGrain = 8192;
constexpr double kThinnest = 1.0 / 60;  // of sqrt(A): what a flat patch counts as thick

// Sums whose error does not grow with the number of terms. [Neumaier 1974]
struct ExactSum {
  double sum = 0, rest = 0;
  void add(double x) {
    const double t = sum + x;
    rest += std::abs(sum) >= std::abs(x) ? (sum - t) + x : (x - t) + sum;
    sum = t;
  }
  double value() const { return sum + rest; }
};

double sixthVolume(const Vec3& a, const Vec3& b, const Vec3& c) { return a.dot(b.cross(c)) / 6; }

int exponentOf(Points a, Points b) {
  Box box = mesh::boundingBox(a);
  box.extend(mesh::boundingBox(b));
  if (box.isEmpty()) return 0;
  const double extent = box.sizes().maxCoeff();
  return extent > 0 ? std::ilogb(extent) : 0;
}

std::vector<Vec3> scaled(Points points, int exponent) {
  std::vector<Vec3> out(points.begin(), points.end());
  const double factor = std::ldexp(1.0, -exponent);
  const bool direct = std::isnormal(factor);
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      for (int k = 0; k < 3; ++k) out[v][k] = direct ? out[v][k] * factor : std::ldexp(out[v][k], -exponent);
  });
  return out;
}

// Points that are not finite come out of a deformation as they went in.
bool same(const Vec3& a, const Vec3& b) { return a == b || (!a.allFinite() && !b.allFinite()); }

void findStill(LocalEdit& e) {
  const std::size_t n = e.vertexCount();
  std::vector<std::uint8_t> hasFace(n, 0);
  e.touched.assign(e.components.count(), 0);
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f) {
    bool moved = false;
    for (const Index v : e.mesh.face(f)) moved = moved || !same(e.rest[v], e.posed[v]);
    for (const Index v : e.mesh.face(f)) {
      hasFace[v] = 1;
      if (!moved) e.still[v] = 1;
    }
    if (moved && e.components.ofFace[f] != kNoIndex) e.touched[e.components.ofFace[f]] = 1;
  }
  // A single vertex that happens to stay (on the axis of a turn) belongs to what moved; one on a rim holds it.
  for (std::size_t v = 0; v < n; ++v)
    if ((!hasFace[v] || e.rim[v]) && same(e.rest[v], e.posed[v])) e.still[v] = 1;
}

void makeRings(LocalEdit& e) {
  e.ringStart.assign(e.vertexCount() + 1, 0);
  for (std::size_t k = 0; k < e.edges.size(); ++k)
    for (const Index v : e.edges.vertices(k)) ++e.ringStart[v + 1];
  std::partial_sum(e.ringStart.begin(), e.ringStart.end(), e.ringStart.begin());
  e.ring.resize(e.ringStart.back());
  std::vector<std::size_t> at(e.ringStart.begin(), e.ringStart.end() - 1);
  for (std::size_t k = 0; k < e.edges.size(); ++k) {
    const auto [a, b] = e.edges.vertices(k);
    e.ring[at[a]++] = b;
    e.ring[at[b]++] = a;
  }
}

Index rootOf(std::vector<Index>& parent, Index i) {
  for (; parent[i] != i; i = parent[i]) parent[i] = parent[parent[i]];
  return i;
}

// Faces joined by shared edges, as numbers from 0; kNoIndex for faces that do not count.
struct Patches {
  std::vector<Index> ofFace;
  std::size_t count = 0;
  bool closed = false;  ///< for certain
};

Patches patchesOf(const LocalEdit& e, const std::vector<std::uint8_t>& counts) {
  const std::size_t faces = e.mesh.faceCount();
  Patches out;
  std::vector<Index>& parent = out.ofFace;
  parent.assign(faces, kNoIndex);
  for (std::size_t f = 0; f < faces; ++f)
    for (const Index v : e.mesh.face(f))
      if (counts[v]) parent[f] = static_cast<Index>(f);
  if (std::find(parent.begin(), parent.end(), kNoIndex) == parent.end()) {
    const auto& edges = e.components.edges;
    return {e.components.ofFace, edges.size(), std::all_of(edges.begin(), edges.end(), [](const auto& c) { return c.open == 0; })};
  }
  for (std::size_t k = 0; k < e.edges.size(); ++k) {
    Index first = kNoIndex;
    for (const Index corner : e.edges.uses(k)) {
      const Index f = e.edges.faceOf(corner);
      if (parent[f] == kNoIndex) continue;
      if (first == kNoIndex) first = rootOf(parent, f);
      const Index root = rootOf(parent, f), low = std::min(first, root);
      parent[root] = parent[first] = low;
      first = low;
    }
  }
  // A root is its patch's smallest face, and no face's parent is larger than itself.
  for (std::size_t f = 0; f < faces; ++f)
    if (parent[f] != kNoIndex) parent[f] = parent[f] == f ? static_cast<Index>(out.count++) : parent[parent[f]];
  return out;
}

std::string plural(std::size_t n, const char* one, const char* many) { return fmt::format("{} {}", n, n == 1 ? one : many); }

}  // namespace

LocalEdit::LocalEdit(const LocalInput& input)
    : mesh(input.rest),
      exponent(exponentOf(input.rest.positions(), input.posed)),
      rest(scaled(input.rest.positions(), exponent)),
      posed(scaled(input.posed, exponent)),
      size(mesh::objectSize(rest)),
      ownEdges(input.edges ? std::nullopt : std::optional<mesh::EdgeTable>(input.rest)),
      edges(input.edges ? *input.edges : *ownEdges),
      components(mesh::components(edges, input.rest.faceCount())),
      still(rest.size(), 0),
      rim(rest.size(), 0) {
  for (std::size_t e = 0; e < edges.size(); ++e)
    if (edges.uses(e).size() % 2 == 1)
      for (const Index v : edges.vertices(e)) rim[v] = 1;
  findStill(*this);
  makeRings(*this);
}

double partLength(const LocalEdit& e, const std::vector<std::uint8_t>& counts) {
  const Patches patches = patchesOf(e, counts);
  std::vector<Vec3> centre(patches.count, Vec3::Zero());
  std::vector<double> rim(patches.count, 0);
  for (std::size_t k = 0; !patches.closed && k < e.edges.size(); ++k) {
    const auto eachUse = [&](auto&& call) {
      for (const Index corner : e.edges.uses(k))
        if (const Index p = patches.ofFace[e.edges.faceOf(corner)]; p != kNoIndex) call(p);
    };
    std::size_t uses = 0;
    eachUse([&](Index) { ++uses; });
    if (uses % 2 == 0) continue;
    const auto [a, b] = e.edges.vertices(k);
    const Vec3 middle = 0.5 * (e.rest[a] + e.rest[b]);
    if (middle.allFinite()) eachUse([&](Index p) { centre[p] += middle, rim[p] += 1; });
  }
  for (std::size_t p = 0; p < patches.count; ++p)
    if (rim[p] > 0) centre[p] /= rim[p];
  std::vector<double> volume(patches.count, 0);
  std::vector<std::uint8_t> known(patches.count, 0);
  double area = 0;
  for (std::size_t f = 0; f < patches.ofFace.size(); ++f) {
    const Index p = patches.ofFace[f];
    if (p == kNoIndex) continue;
    if (!known[p] && rim[p] == 0) centre[p] = e.rest[e.mesh.face(f)[0]];
    known[p] = 1;
    e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
      const Vec3 a = e.rest[i] - centre[p], b = e.rest[j] - centre[p], c = e.rest[k] - centre[p];
      const double v = sixthVolume(a, b, c), s = 0.5 * (b - a).cross(c - a).norm();
      if (!std::isfinite(v) || !std::isfinite(s)) return;
      volume[p] += v;
      area += s;
    });
  }
  double enclosed = 0;
  for (const double v : volume) enclosed += std::abs(v);
  return area > 0 ? std::max(2 * enclosed / area, kThinnest * std::sqrt(area)) : 0;
}

double ComponentVolumes::Value::deviation() const noexcept {
  return rest == 0 ? (change() == 0 ? 0 : std::numeric_limits<double>::infinity()) : std::abs(change() / rest);
}

ComponentVolumes::ComponentVolumes(const LocalEdit& e, const std::vector<std::uint8_t>& held)
    : edit_(e), slot_(held.size(), kNoIndex) {
  for (Index c = 0; c < held.size(); ++c) {
    if (!held[c]) continue;
    slot_[c] = static_cast<Index>(component_.size());
    component_.push_back(c);
    const mesh::EdgeCounts& edges = e.components.edges[c];
    open_.push_back(!edges.closed());
    if (!edges.oriented())
      throw InfeasibleError(fmt::format("the surface has no volume to preserve: {}", plural(edges.inconsistent,
          "inconsistently oriented edge", "inconsistently oriented edges")));
  }
  centre_.assign(component_.size(), Vec3::Zero());
  std::vector<double> weight(component_.size(), 0);
  std::size_t movedRims = 0, broken = 0;
  for (std::size_t k = 0; k < e.edges.size(); ++k) {
    const Index s = slot(e.components.ofFace[e.edges.faceOf(e.edges.uses(k)[0])]);
    if (s == kNoIndex || !open_[s] || e.edges.uses(k).size() % 2 == 0) continue;
    const auto [a, b] = e.edges.vertices(k);
    movedRims += !same(e.rest[a], e.posed[a]) || !same(e.rest[b], e.posed[b]);
    centre_[s] += 0.5 * (e.rest[a] + e.rest[b]);
    weight[s] += 1;
  }
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f) {
    const Index s = slot(e.components.ofFace[f]);
    if (s == kNoIndex) continue;
    bool finite = true;
    for (const Index v : e.mesh.face(f)) finite = finite && e.rest[v].allFinite() && e.posed[v].allFinite();
    broken += !finite;
    if (open_[s] || !finite) continue;
    centre_[s] += e.rest[e.mesh.face(f)[0]];
    weight[s] += 1;
  }
  if (broken > 0)
    throw InfeasibleError(fmt::format("the surface has no volume to preserve: {} with coordinates that are not finite",
                                      plural(broken, "face", "faces")));
  if (movedRims > 0)
    throw InfeasibleError(fmt::format("the surface is open and {} moved: it has no volume to preserve; close it, or leave its "
                                      "rims where they are", plural(movedRims, "boundary edge", "boundary edges")));
  for (std::size_t s = 0; s < centre_.size(); ++s)
    if (weight[s] > 0) centre_[s] /= weight[s];
}

std::vector<ComponentVolumes::Value> ComponentVolumes::measure(Points posed) const {
  const LocalEdit& e = edit_;
  // A closed surface may be summed about any centre: its own, wherever it was moved.
  std::vector<Vec3> there = centre_;
  std::vector<std::uint8_t> known(count(), 0);
  std::vector<ExactSum> before(count()), after(count());
  for (std::size_t f = 0; f < e.mesh.faceCount(); ++f) {
    const Index s = slot(e.components.ofFace[f]);
    if (s == kNoIndex) continue;
    if (!known[s] && !open_[s]) {
      const Index v = e.mesh.face(f)[0];
      there[s] = centre_[s] + (posed[v] - e.rest[v]);
      known[s] = 1;
    }
    e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
      before[s].add(sixthVolume(e.rest[i] - centre_[s], e.rest[j] - centre_[s], e.rest[k] - centre_[s]));
      after[s].add(sixthVolume(posed[i] - there[s], posed[j] - there[s], posed[k] - there[s]));
    });
  }
  std::vector<Value> values(count());
  for (std::size_t s = 0; s < values.size(); ++s) values[s] = {component_[s], before[s].value(), after[s].value()};
  return values;
}

}  // namespace fielddeform::volume::detail
