// What an edit moved, and the volumes of the components that it touched.
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/detail/local_edit.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>

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
  ExactSum& operator+=(const ExactSum& o) { return add(o.sum), add(o.rest), *this; }
  double value() const { return sum + rest; }
};

// Of the faces of one component.
struct FaceSums {
  Vec3 corners = Vec3::Zero();
  double count = 0;
  std::size_t broken = 0;
  FaceSums& operator+=(const FaceSums& o) { return corners += o.corners, count += o.count, broken += o.broken, *this; }
};

double sixthVolume(const Vec3& a, const Vec3& b, const Vec3& c) { return a.dot(b.cross(c)) / 6; }

Box boxOf(Points points) {
  return deterministicReduce(
      points.size(), kGrain, Box(),
      [&](std::size_t begin, std::size_t end) { return mesh::boundingBox(points.subspan(begin, end - begin)); },
      [](const Box& a, const Box& b) { return Box(a).extend(b); });
}

int exponentOf(const Box& rest, const Box& posed) {
  const Box box = Box(rest).extend(posed);
  if (box.isEmpty()) return 0;
  const double extent = box.sizes().maxCoeff();
  return extent > 0 ? std::ilogb(extent) : 0;
}

double sizeOf(const Box& box, int exponent) {
  if (box.isEmpty()) return 0;
  const std::array<Vec3, 2> corners{box.min(), box.max()};
  const ScaledPoints scaled(corners, exponent);
  return (scaled[1] - scaled[0]).norm();
}

// Points that are not finite come out of a deformation as they went in.
bool same(const Vec3& a, const Vec3& b) { return a == b || (!a.allFinite() && !b.allFinite()); }

void mark(std::uint8_t& flag) { std::atomic_ref(flag).store(1, std::memory_order_relaxed); }

void findStill(LocalEdit& e) {
  const std::size_t n = e.vertexCount();
  std::vector<std::uint8_t> hasFace(n, 0);
  e.touched.assign(e.components.count(), 0);
  parallelFor(e.mesh.faceCount(), kGrain, [&](std::size_t begin, std::size_t end) {
    Index last = kNoIndex;
    for (std::size_t f = begin; f < end; ++f) {
      bool moved = false;
      for (const Index v : e.mesh.face(f)) moved = moved || !same(e.rest[v], e.posed[v]);
      for (const Index v : e.mesh.face(f)) {
        mark(hasFace[v]);
        if (!moved) mark(e.still[v]);
      }
      const Index c = e.components.ofFace[f];
      if (moved && c != kNoIndex && c != last) mark(e.touched[c]), last = c;
    }
  });
  // A single vertex that happens to stay (on the axis of a turn) belongs to what moved; one on a rim holds it.
  parallelFor(n, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      if ((!hasFace[v] || e.rim[v]) && same(e.rest[v], e.posed[v])) e.still[v] = 1;
  });
}

Index rootOf(std::vector<Index>& parent, Index i) {
  for (; parent[i] != i; i = parent[i]) parent[i] = parent[parent[i]];
  return i;
}

// Faces joined by shared edges, as numbers from 0; kNoIndex for faces that do not count.
struct Patches {
  std::vector<Index> own;
  std::span<const Index> ofFace;  ///< of `own`, or the components'
  std::size_t count = 0;
  bool closed = false;  ///< for certain
};

Patches patchesOf(const LocalEdit& e, const std::vector<std::uint8_t>& counts) {
  const std::size_t faces = e.mesh.faceCount();
  Patches out;
  const auto faceCounts = [&](std::size_t f) {
    const auto face = e.mesh.face(f);
    return std::any_of(face.begin(), face.end(), [&](Index v) { return counts[v] != 0; });
  };
  const bool all = deterministicReduce(
      faces, kGrain, 1,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t f = begin; f < end; ++f)
          if (!faceCounts(f)) return 0;
        return 1;
      },
      std::bit_and<>()) != 0;
  if (all) {
    out.ofFace = e.components.ofFace;
    out.count = e.components.count();
    out.closed = e.closed();
    return out;
  }
  std::vector<Index>& parent = out.own;
  parent.resize(faces);
  parallelFor(faces, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) parent[f] = faceCounts(f) ? static_cast<Index>(f) : kNoIndex;
  });
  for (std::size_t k = 0; k < e.edges->size(); ++k) {
    Index first = kNoIndex;
    for (const Index corner : e.edges->uses(k)) {
      const Index f = e.edges->faceOf(corner);
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
  out.ofFace = out.own;
  return out;
}

// The middle of every patch's rim, or a vertex of a patch without one.
std::vector<Vec3> patchCentres(const LocalEdit& e, const Patches& patches) {
  std::vector<Vec3> centre(patches.count, Vec3::Zero());
  std::vector<double> rim(patches.count, 0);
  for (std::size_t k = 0; !patches.closed && k < e.edges->size(); ++k) {
    const auto eachUse = [&](auto&& call) {
      for (const Index corner : e.edges->uses(k))
        if (const Index p = patches.ofFace[e.edges->faceOf(corner)]; p != kNoIndex) call(p);
    };
    std::size_t uses = 0;
    eachUse([&](Index) { ++uses; });
    if (uses % 2 == 0) continue;
    const auto [a, b] = e.edges->vertices(k);
    const Vec3 middle = 0.5 * (e.rest[a] + e.rest[b]);
    if (middle.allFinite()) eachUse([&](Index p) { centre[p] += middle, rim[p] += 1; });
  }
  std::size_t missing = 0;
  for (std::size_t p = 0; p < patches.count; ++p) {
    if (rim[p] > 0) centre[p] /= rim[p];
    missing += rim[p] == 0;
  }
  for (std::size_t f = 0; missing > 0 && f < patches.ofFace.size(); ++f) {
    const Index p = patches.ofFace[f];
    if (p == kNoIndex || rim[p] > 0) continue;
    centre[p] = e.rest[e.mesh.face(f)[0]];
    rim[p] = 1;
    --missing;
  }
  return centre;
}

std::string plural(std::size_t n, const char* one, const char* many) { return fmt::format("{} {}", n, n == 1 ? one : many); }

}  // namespace

ScaledPoints::ScaledPoints(Points points, int exponent) : points_(points) {
  const double factor = std::ldexp(1.0, -exponent);
  if (std::isnormal(factor)) {
    factor_ = factor;
    return;
  }
  own_.assign(points.begin(), points.end());
  for (Vec3& p : own_)
    for (int k = 0; k < 3; ++k) p[k] = std::ldexp(p[k], -exponent);
  points_ = own_;
}

LocalEdit::LocalEdit(const LocalInput& input) : LocalEdit(input, boxOf(input.rest.positions()), boxOf(input.posed)) {}

LocalEdit::LocalEdit(const LocalInput& input, const Box& restBox, const Box& posedBox)
    : mesh(input.rest),
      exponent(exponentOf(restBox, posedBox)),
      rest(input.rest.positions(), exponent),
      posed(input.posed, exponent),
      size(sizeOf(restBox, exponent)),
      ownEdges(input.edges ? std::nullopt : std::optional<mesh::EdgeTable>(input.rest)),
      edges(input.edges ? input.edges : &*ownEdges),
      components(mesh::components(*edges, input.rest.faceCount())),
      still(rest.size(), 0),
      rim(rest.size(), 0) {
  for (std::size_t e = 0; !closed() && e < edges->size(); ++e)
    if (edges->uses(e).size() % 2 == 1)
      for (const Index v : edges->vertices(e)) rim[v] = 1;
  findStill(*this);
}

bool LocalEdit::closed() const noexcept {
  return std::all_of(components.edges.begin(), components.edges.end(), [](const auto& c) { return c.open == 0; });
}

IndexLists LocalEdit::neighbours() const {
  return makeIndexLists(vertexCount(), edges->size(), [&](std::size_t begin, std::size_t end, auto&& put) {
    for (std::size_t k = begin; k < end; ++k) {
      const auto [a, b] = edges->vertices(k);
      put(a, b);
      put(b, a);
    }
  });
}

double partLength(const LocalEdit& e, const std::vector<std::uint8_t>& counts) {
  struct Row {
    double volume = 0, area = 0;
    Row& operator+=(const Row& o) { return volume += o.volume, area += o.area, *this; }
  };
  const Patches patches = patchesOf(e, counts);
  const std::vector<Vec3> centre = patchCentres(e, patches);
  const auto rows = sumByComponent<Row>(patches.count, patches.ofFace.size(), [&](std::size_t begin, std::size_t end, Row* row) {
    for (std::size_t f = begin; f < end; ++f) {
      const Index p = patches.ofFace[f];
      if (p == kNoIndex) continue;
      e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
        const Vec3 a = e.rest[i] - centre[p], b = e.rest[j] - centre[p], c = e.rest[k] - centre[p];
        const double v = sixthVolume(a, b, c), s = 0.5 * (b - a).cross(c - a).norm();
        if (std::isfinite(v) && std::isfinite(s)) row[p].volume += v, row[p].area += s;
      });
    }
  });
  double enclosed = 0, area = 0;
  for (const Row& row : rows) enclosed += std::abs(row.volume), area += row.area;
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
  const bool anyOpen = std::find(open_.begin(), open_.end(), 1) != open_.end();
  std::size_t movedRims = 0, broken = 0;
  for (std::size_t k = 0; anyOpen && k < e.edges->size(); ++k) {
    const Index s = slot(e.components.ofFace[e.edges->faceOf(e.edges->uses(k)[0])]);
    if (s == kNoIndex || !open_[s] || e.edges->uses(k).size() % 2 == 0) continue;
    const auto [a, b] = e.edges->vertices(k);
    movedRims += !same(e.rest[a], e.posed[a]) || !same(e.rest[b], e.posed[b]);
    centre_[s] += 0.5 * (e.rest[a] + e.rest[b]);
    weight[s] += 1;
  }
  const auto sums = sumByComponent<FaceSums>(count(), e.mesh.faceCount(), [&](std::size_t begin, std::size_t end, FaceSums* row) {
    for (std::size_t f = begin; f < end; ++f) {
      const Index s = slot(e.components.ofFace[f]);
      if (s == kNoIndex) continue;
      bool finite = true;
      for (const Index v : e.mesh.face(f)) finite = finite && e.rest[v].allFinite() && e.posed[v].allFinite();
      row[s].broken += !finite;
      if (finite) row[s].corners += e.rest[e.mesh.face(f)[0]], row[s].count += 1;
    }
  });
  for (std::size_t s = 0; s < sums.size(); ++s) {
    broken += sums[s].broken;
    if (!open_[s]) centre_[s] = sums[s].corners, weight[s] = sums[s].count;
  }
  if (broken > 0)
    throw InfeasibleError(fmt::format("the surface has no volume to preserve: {} with coordinates that are not finite",
                                      plural(broken, "face", "faces")));
  if (movedRims > 0)
    throw InfeasibleError(fmt::format("the surface is open and {} moved: it has no volume to preserve; close it, or leave its "
                                      "rims where they are", plural(movedRims, "boundary edge", "boundary edges")));
  for (std::size_t s = 0; s < centre_.size(); ++s)
    if (weight[s] > 0) centre_[s] /= weight[s];
  findFirst();
  rest_ = volumes(centre_, [&](Index v) { return e.rest[v]; });
}

void ComponentVolumes::findFirst() {
  first_.assign(count(), kNoIndex);
  std::size_t missing = count();
  for (std::size_t f = 0; missing > 0 && f < edit_.mesh.faceCount(); ++f) {
    const Index s = slot(edit_.components.ofFace[f]);
    if (s == kNoIndex || first_[s] != kNoIndex) continue;
    first_[s] = edit_.mesh.face(f)[0];
    --missing;
  }
}

template <class Position>
std::vector<double> ComponentVolumes::volumes(const std::vector<Vec3>& centre, const Position& position) const {
  const LocalEdit& e = edit_;
  const auto sums = sumByComponent<ExactSum>(count(), e.mesh.faceCount(), [&](std::size_t begin, std::size_t end, ExactSum* row) {
    for (std::size_t f = begin; f < end; ++f)
      if (const Index s = slot(e.components.ofFace[f]); s != kNoIndex)
        e.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
          row[s].add(sixthVolume(position(i) - centre[s], position(j) - centre[s], position(k) - centre[s]));
        });
  });
  std::vector<double> out;
  for (const ExactSum& s : sums) out.push_back(s.value());
  return out;
}

template <class Position>
std::vector<ComponentVolumes::Value> ComponentVolumes::measureAt(const Position& posed) const {
  // A closed surface may be summed about any centre: its own, wherever it was moved.
  std::vector<Vec3> there = centre_;
  for (std::size_t s = 0; s < there.size(); ++s)
    if (!open_[s]) there[s] += posed(first_[s]) - edit_.rest[first_[s]];
  const std::vector<double> after = volumes(there, posed);
  std::vector<Value> values(count());
  for (std::size_t s = 0; s < values.size(); ++s) values[s] = {component_[s], rest_[s], after[s]};
  return values;
}

std::vector<ComponentVolumes::Value> ComponentVolumes::measure(const ScaledPoints& posed) const {
  return measureAt([&](Index v) { return posed[v]; });
}

std::vector<ComponentVolumes::Value> ComponentVolumes::measureDisplaced(Points displacement) const {
  return measureAt([&](Index v) { return Vec3(edit_.posed[v] + displacement[v]); });
}

}  // namespace fielddeform::volume::detail
