#include <fielddeform/field/detail/normal_regions.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fielddeform::field::detail {
namespace {

constexpr double kThin = 1e-8;       // squared sine of a triangle's corner whose normal says nothing
constexpr double kSteep = 0.87;      // cosine of 30 degrees: a vertex's faces keep within, or its cone counts as every direction.
// If all of them do, so do the cone's directions: one of more than 30 degrees goes into the quadrant of some face.
constexpr double kClipped = 20;      // where the clipping of a cone begins, beyond all such directions
constexpr double kWidest = 3;        // of w: wider, a vertex's cone is no pencil
constexpr double kTileOfSteps = 32;  // voxels
constexpr double kSlope = 1e-9;      // rounding of a direction
constexpr double kArc = std::numbers::pi / 6;  // of a wedge, in one pencil

using Polygon = std::vector<std::array<double, 2>>;

// What is left of a polygon where a x + b y <= c.
void clip(Polygon& polygon, double a, double b, double c, Polygon& scratch) {
  scratch.clear();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto& p = polygon[i];
    const auto& q = polygon[(i + 1) % polygon.size()];
    const double at = a * p[0] + b * p[1] - c, next = a * q[0] + b * q[1] - c;
    if (at <= 0) scratch.push_back(p);
    if ((at < 0 && next > 0) || (at > 0 && next < 0)) {
      const double t = at / (at - next);
      scratch.push_back({p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])});
    }
  }
  polygon.swap(scratch);
}

int longest(const Vec3& v) {
  int axis = 0;
  v.cwiseAbs().maxCoeff(&axis);
  return axis;
}

// The greatest t at which q + t (w, 1) is still within reach, for the shortest w of the rectangle.
float lengthOf(const Region& r, double reach) {
  double square = 1;
  for (int k = 0; k < 2; ++k) {
    const double w = std::max({static_cast<double>(r.low[k]), -static_cast<double>(r.high[k]), 0.0});
    square += w * w;
  }
  return static_cast<float>(reach / std::sqrt(square) * (1 + 1e-6));
}

}  // namespace

NormalRegions::NormalRegions(const PrimitiveDistance& mesh, const Lattice& lattice, double reach)
    : faces_(mesh.elements()), reach_(reach) {
  for (const Vec3& p : mesh.points()) points_.push_back(lattice.local(p));
}

std::optional<NormalRegions> NormalRegions::of(const PrimitiveDistance& mesh, const Lattice& lattice, double reach, double mostSteps) {
  NormalRegions r(mesh, lattice, reach);
  r.findFaces();
  if (!(r.margin_ < 0.1)) return std::nullopt;  // coordinates or elements out of proportion
  r.findEdges();
  r.findVertices();
  const auto all = [&](std::size_t count, void (NormalRegions::*add)(Index)) {
    for (Index i = 0; i < count && r.steps_ <= mostSteps; ++i) (r.*add)(i);
  };
  all(r.faces_.size(), &NormalRegions::addFace);
  all(r.edges_.size(), &NormalRegions::addEdge);
  all(r.points_.size(), &NormalRegions::addVertex);
  if (r.steps_ > mostSteps) return std::nullopt;
  return r;
}

void NormalRegions::findFaces() {
  double greatest = 0, extent = 0;
  for (const Vec3& p : points_) greatest = p.allFinite() ? std::max(greatest, p.cwiseAbs().maxCoeff()) : HUGE_VAL;
  normal_.reserve(faces_.size());
  self_.reserve(faces_.size());
  for (const auto& f : faces_) {
    const Vec3 ab = points_[f[1]] - points_[f[0]], ac = points_[f[2]] - points_[f[0]], bc = ac - ab, n = ab.cross(ac);
    const double size = std::max({ab.squaredNorm(), ac.squaredNorm(), bc.squaredNorm()});
    extent = std::max(extent, size);
    normal_.push_back(n.squaredNorm() > kThin * size * size ? Vec3(n.normalized()) : Vec3(Vec3::Zero()));
    self_.push_back(static_cast<Index>(self_.size()));
  }
  margin_ = 1e-6 * (1 + reach_) + 1e-9 * std::sqrt(extent) + 1e-12 * greatest;
}

void NormalRegions::findEdges() {
  struct Side {
    Index a, b, face;
  };
  std::vector<Side> sides;
  sides.reserve(3 * faces_.size());
  for (Index f = 0; f < faces_.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(faces_[f][k], faces_[f][(k + 1) % 3]);
      if (a != b) sides.push_back({a, b, f});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return x.a != y.a ? x.a < y.a : x.b != y.b ? x.b < y.b : x.face < y.face;
  });
  edgeFaces_.reserve(sides.size());
  for (const Side& s : sides) {
    if (edges_.empty() || edges_.back().a != s.a || edges_.back().b != s.b) {
      const Index at = static_cast<Index>(edgeFaces_.size());
      edges_.push_back({s.a, s.b, at, at});
    }
    edgeFaces_.push_back(s.face);
    ++edges_.back().end;
  }
  vertexOpen_.assign(points_.size(), 0);
  for (const Edge& e : edges_)
    if (e.end - e.begin < 2) vertexOpen_[e.a] = vertexOpen_[e.b] = 1;
}

void NormalRegions::findVertices() {
  vertexBegin_.assign(points_.size() + 1, 0);
  for (const auto& f : faces_)
    for (const Index v : f) ++vertexBegin_[v + 1];
  for (std::size_t v = 0; v < points_.size(); ++v) vertexBegin_[v + 1] += vertexBegin_[v];
  vertexFaces_.resize(vertexBegin_.back());
  std::vector<Index> next(vertexBegin_.begin(), vertexBegin_.end() - 1);
  for (Index f = 0; f < faces_.size(); ++f)
    for (const Index v : faces_[f]) vertexFaces_[next[v]++] = f;
}

void NormalRegions::add(const Region& r) {
  regions_.push_back(r);
  const Vec3 size = boxOf(r).sizes();
  steps_ += (size.array() / kTileOfSteps + 1).prod();  // to look which tiles it meets
  if (r.axis > 2) {
    steps_ += (size.array() + 1).prod();
    return;
  }
  // Slices, and in each the box of the part and half of the pencil's width.
  double area = 1;
  std::array<Vec3, 3> held;
  Box part;
  for (const Vec3& p : corners(r, held)) part.extend(p);
  for (int k = 0; k < 2; ++k)
    area *= 1 + part.sizes()[(r.axis + 1 + k) % 3] + 0.5 * static_cast<double>(r.length) * static_cast<double>(r.high[k] - r.low[k]);
  steps_ += (1 + size[r.axis]) * area;
}

void NormalRegions::addFace(Index f) {
  const Vec3& n = normal_[f];
  Region r{f, Part::Face};
  if (n.isZero(0)) {
    r.axis = 3;
    return add(r);
  }
  const int axis = longest(n);
  r.axis = static_cast<std::uint8_t>(axis);
  for (int k = 0; k < 2; ++k) r.low[k] = r.high[k] = static_cast<float>(n[(axis + 1 + k) % 3] / n[axis]);
  r.length = lengthOf(r, reach_);
  add(r);
  r.sign = -1;
  for (int k = 0; k < 2; ++k) r.low[k] = r.high[k] = -r.low[k];
  add(r);
}

// Into the face, across the edge; zero: the face is thin.
Vec3 NormalRegions::inward(const Edge& e, Index face) const {
  const Vec3 along = points_[e.b] - points_[e.a];
  Vec3 m = normal_[face].cross(along);
  if (m.isZero(0)) return m;
  m.normalize();
  for (const Index v : faces_[face])
    if (v != e.a && v != e.b) return m.dot(points_[v] - points_[e.a]) < 0 ? Vec3(-m) : m;
  return Vec3::Zero();
}

// Directions across the edge that point into none of its faces: half a turn is left by the first, and less by every other.
void NormalRegions::addEdge(Index index) {
  constexpr double kPi = std::numbers::pi;
  const Edge& e = edges_[index];
  Vec3 x = Vec3::Zero(), y = x;  // away from the first face, and across
  double low = -kPi / 2, high = kPi / 2;
  for (Index i = e.begin; i < e.end; ++i) {
    const Vec3 m = -inward(e, edgeFaces_[i]);
    if (m.isZero(0)) continue;
    if (x.isZero(0)) {
      x = m;
      y = (points_[e.b] - points_[e.a]).normalized().cross(x);
      continue;
    }
    const double turn = std::atan2(m.dot(y), m.dot(x));
    if (turn >= 0) low = std::max(low, turn - kPi / 2);
    else high = std::min(high, turn + kPi / 2);
  }
  if (x.isZero(0)) {  // thin faces alone
    Region r{index, Part::Edge};
    r.axis = 3;
    return add(r);
  }
  low -= kSlope, high += kSlope;
  if (low > high) return;
  const int pieces = std::max(1, static_cast<int>(std::ceil((high - low) / kArc)));
  for (int i = 0; i < pieces; ++i) {
    const auto at = [&](double share) {
      const double angle = low + (high - low) * (i + share) / pieces;
      return Vec3(std::cos(angle) * x + std::sin(angle) * y);
    };
    const Vec3 middle = at(0.5), ends[2] = {at(0), at(1)};
    const int axis = longest(middle);
    Region r{index, Part::Edge};
    r.axis = static_cast<std::uint8_t>(axis);
    r.sign = middle[axis] < 0 ? -1 : 1;
    for (int k = 0; k < 2; ++k) {
      const int other = (axis + 1 + k) % 3;
      const double a = ends[0][other] / std::abs(ends[0][axis]), b = ends[1][other] / std::abs(ends[1][axis]);
      r.low[k] = static_cast<float>(std::min(a, b));
      r.high[k] = static_cast<float>(std::max(a, b));
    }
    r.length = lengthOf(r, reach_);
    add(r);
  }
}

void NormalRegions::addVertex(Index v) {
  const auto faces = std::span(vertexFaces_).subspan(vertexBegin_[v], vertexBegin_[v + 1] - vertexBegin_[v]);
  if (faces.empty()) return;
  Vec3 normal = Vec3::Zero();
  for (const Index f : faces) normal += normal_[f];
  const double least = kSteep * normal.norm();
  if (vertexOpen_[v] || !std::all_of(faces.begin(), faces.end(), [&](Index f) { return normal_[f].dot(normal) > least; })) {
    Region r{v, Part::Vertex};
    r.axis = 3;
    return add(r);
  }
  addVertexSide(v, normal);
  addVertexSide(v, -normal);
}

// The directions near a normal that point along none of the vertex's edges.
void NormalRegions::addVertexSide(Index v, const Vec3& normal) {
  const int axis = longest(normal), b = (axis + 1) % 3, c = (axis + 2) % 3;
  const double sign = normal[axis] < 0 ? -1 : 1;
  Polygon polygon{{-kClipped, -kClipped}, {kClipped, -kClipped}, {kClipped, kClipped}, {-kClipped, kClipped}}, scratch;
  for (Index i = vertexBegin_[v]; i < vertexBegin_[v + 1] && !polygon.empty(); ++i)
    for (const Index other : faces_[vertexFaces_[i]]) {
      const Vec3 e = points_[other] - points_[v];
      const double length = e.norm();
      if (length > 0) clip(polygon, e[b] / length, e[c] / length, -sign * e[axis] / length + 10 * kSlope, scratch);
    }
  if (polygon.empty()) return;
  Region r{v, Part::Vertex};
  double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
  for (const auto& p : polygon)
    for (std::size_t k = 0; k < 2; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  if (high[0] - low[0] > kWidest || high[1] - low[1] > kWidest) {
    r.axis = 3;
    return add(r);
  }
  r.axis = static_cast<std::uint8_t>(axis);
  r.sign = static_cast<std::int8_t>(sign);
  for (int k = 0; k < 2; ++k) r.low[k] = static_cast<float>(low[k]), r.high[k] = static_cast<float>(high[k]);
  r.length = lengthOf(r, reach_);
  add(r);
}

std::span<const Vec3> NormalRegions::corners(const Region& r, std::array<Vec3, 3>& out) const {
  switch (r.kind) {
    case Part::Face:
      for (std::size_t k = 0; k < 3; ++k) out[k] = points_[faces_[r.part][k]];
      return out;
    case Part::Edge: out[0] = points_[edges_[r.part].a], out[1] = points_[edges_[r.part].b]; return std::span(out).first(2);
    case Part::Vertex: break;
  }
  out[0] = points_[r.part];
  return std::span(out).first(1);
}

std::span<const Index> NormalRegions::elements(const Region& r) const {
  switch (r.kind) {
    case Part::Face: return std::span(self_).subspan(r.part, 1);
    case Part::Edge: return std::span(edgeFaces_).subspan(edges_[r.part].begin, edges_[r.part].end - edges_[r.part].begin);
    case Part::Vertex: break;
  }
  return std::span(vertexFaces_).subspan(vertexBegin_[r.part], vertexBegin_[r.part + 1] - vertexBegin_[r.part]);
}

void NormalRegions::conditions(const Region& r, std::vector<HalfSpace>& out) const {
  out.clear();
  const auto add = [&](const Vec3& direction, const Vec3& at) { out.push_back({direction, direction.dot(at) + margin_}); };
  const auto addAlong = [&](Index from, Index to) {  // not beyond `from`, towards `to`
    const Vec3 e = points_[to] - points_[from];
    const double length = e.norm();
    if (length > 0) add(e / length, points_[from]);
  };
  if (r.kind == Part::Vertex) {
    for (const Index f : elements(r))
      for (const Index other : faces_[f]) addAlong(r.part, other);
  } else if (r.kind == Part::Edge) {
    const Edge& e = edges_[r.part];
    const Vec3 along = points_[e.b] - points_[e.a];
    const double length = along.norm();
    if (length > 0) add(along / length, points_[e.b]), add(-along / length, points_[e.a]);
    for (const Index f : elements(r)) {
      const Vec3 m = inward(e, f);
      if (!m.isZero(0)) add(m, points_[e.a]);
    }
  } else if (!normal_[r.part].isZero(0)) {
    const auto& f = faces_[r.part];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 &a = points_[f[k]], &b = points_[f[(k + 1) % 3]];
      add((b - a).cross(normal_[r.part]).normalized(), a);
    }
  }
}

Box NormalRegions::boxOf(const Region& r) const {
  std::array<Vec3, 3> held;
  Box box;
  for (const Vec3& q : corners(r, held)) {
    box.extend(q);
    if (r.axis > 2) continue;
    for (int side = 0; side < 2; ++side) {
      Vec3 end = q;
      end[r.axis] += r.sign * static_cast<double>(r.length);
      for (int k = 0; k < 2; ++k) end[(r.axis + 1 + k) % 3] += static_cast<double>(r.length) * static_cast<double>(side ? r.high[k] : r.low[k]);
      box.extend(end);
    }
  }
  const double more = margin_ + (r.axis > 2 ? reach_ : 0);
  box.min().array() -= more;
  box.max().array() += more;
  return box;
}

}  // namespace fielddeform::field::detail
