#include <fielddeform/core/error.h>
#include <fielddeform/solid/bezier.h>
#include <fielddeform/solid/object.h>
#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <stdexcept>

namespace fielddeform::solid {
namespace {

/// One of the eight ways that a grid lies on another.
struct Symmetry {
  bool transposed = false, flipFirst = false, flipSecond = false;

  static std::array<Symmetry, 8> all() {
    std::array<Symmetry, 8> out;
    for (int k = 0; k < 8; ++k) out[static_cast<std::size_t>(k)] = {(k & 4) != 0, (k & 1) != 0, (k & 2) != 0};
    return out;
  }
  bool fits(const Layer& a, const Layer& b) const {
    return transposed ? a.first == b.second && a.second == b.first : a.first == b.first && a.second == b.second;
  }
  std::size_t entry(const Layer& a, std::size_t e) const {
    int i = static_cast<int>(e) % a.first, j = static_cast<int>(e) / a.first;
    if (flipFirst) i = a.first - 1 - i;
    if (flipSecond) j = a.second - 1 - j;
    return static_cast<std::size_t>(transposed ? j + a.second * i : i + a.first * j);
  }
};

void validateSolid(const Object& object, std::size_t s) {
  const Solid& solid = object.solids[s];
  if (solid.name.empty()) throw std::invalid_argument(fmt::format("solids: number {} has no name", s));
  for (const int d : solid.degree)
    if (d < 1 || d > kMaxDegree) throw std::invalid_argument(fmt::format("solid \"{}\": degree {}, expected 1 to {}", solid.name, d, kMaxDegree));
  if (solid.points.size() != solid.slots())
    throw std::invalid_argument(fmt::format("solid \"{}\": {} points, degrees {}, {}, {} have {}", solid.name, solid.points.size(), solid.degree[0],
                                            solid.degree[1], solid.degree[2], solid.slots()));
  for (const Index i : solid.points)
    if (i >= object.points.size()) throw std::invalid_argument(fmt::format("solid \"{}\": point {} of {}", solid.name, i, object.points.size()));
}

int across(const Solid& solid, Side side) { return solid.degree[static_cast<std::size_t>(side) / 2]; }

void validateJoint(const Object& object, const Joint& joint) {
  for (const FaceRef& f : {joint.a, joint.b})
    if (f.solid >= object.solids.size()) throw std::invalid_argument("joints: a solid is out of range");
  const int most = std::min(across(object.solids[joint.a.solid], joint.a.side), across(object.solids[joint.b.solid], joint.b.side));
  if (joint.continuity < 0 || joint.continuity > most)
    throw std::invalid_argument(fmt::format("joint {} - {}: continuity {}, expected 0 to {}, the degree across it", describe(object, joint.a),
                                            describe(object, joint.b), joint.continuity, most));
  requirePositive("ratio", joint.ratio);
  if (joint.a == joint.b) throw std::invalid_argument(fmt::format("joint {}: with itself", describe(object, joint.a)));
}

}  // namespace

std::string_view toString(Side side) noexcept {
  return std::array<std::string_view, 6>{"u0", "u1", "v0", "v1", "w0", "w1"}[static_cast<std::size_t>(side)];
}

Layer layerOf(const Solid& solid, Side side, int depth) {
  const auto axis = static_cast<std::size_t>(side) / 2;
  const int at = static_cast<std::size_t>(side) % 2 ? solid.degree[axis] - depth : depth;
  const std::size_t p = axis == 0 ? 1 : 0, q = axis == 2 ? 1 : 2;
  Layer out{solid.degree[p] + 1, solid.degree[q] + 1, {}};
  for (int j = 0; j < out.second; ++j)
    for (int i = 0; i < out.first; ++i) {
      std::array<int, 3> ijk{};
      ijk[axis] = at, ijk[p] = i, ijk[q] = j;
      out.slots.push_back(solid.slot(ijk[0], ijk[1], ijk[2]));
    }
  return out;
}

std::vector<std::size_t> matching(const Object& object, const Joint& joint) {
  const Solid &sa = object.solids[joint.a.solid], &sb = object.solids[joint.b.solid];
  const Layer a = layerOf(sa, joint.a.side), b = layerOf(sb, joint.b.side);
  for (const Symmetry& symmetry : Symmetry::all()) {
    if (!symmetry.fits(a, b)) continue;
    std::vector<std::size_t> out(a.slots.size());
    bool same = true;
    for (std::size_t e = 0; e < out.size() && same; ++e) {
      out[e] = symmetry.entry(a, e);
      same = sa.points[a.slots[e]] == sb.points[b.slots[out[e]]];
    }
    if (same) return out;
  }
  throw std::invalid_argument(fmt::format("joint {} - {}: the faces do not share their control points", describe(object, joint.a), describe(object, joint.b)));
}

void Object::validate() const {
  if (solids.empty()) throw std::invalid_argument("solids: none, needs at least 1");
  if (points.size() > kMaxPoints) throw std::invalid_argument(fmt::format("points: {}, at most {}", points.size(), kMaxPoints));
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!points[i].allFinite()) throw std::invalid_argument(fmt::format("points: {} is not finite", i));
  std::set<std::string_view> names;
  for (std::size_t s = 0; s < solids.size(); ++s) {
    validateSolid(*this, s);
    if (!names.insert(solids[s].name).second) throw std::invalid_argument(fmt::format("solids: two are named \"{}\"", solids[s].name));
  }
  std::vector<FaceRef> used;
  for (const Joint& joint : joints) {
    validateJoint(*this, joint);
    matching(*this, joint);
    for (const FaceRef& f : {joint.a, joint.b}) {
      if (std::find(used.begin(), used.end(), f) != used.end()) throw std::invalid_argument(fmt::format("joints: face {} stands in two", describe(*this, f)));
      used.push_back(f);
    }
  }
}

std::size_t Object::find(std::string_view name) const noexcept {
  std::size_t s = 0;
  while (s < solids.size() && solids[s].name != name) ++s;
  return s;
}

std::vector<Vec3> Object::pointsOf(std::size_t solid) const {
  std::vector<Vec3> out;
  for (const Index i : solids[solid].points) out.push_back(points[i]);
  return out;
}

namespace {

/// Union of slots by joints; the lowest number leads.
class Merge {
 public:
  explicit Merge(std::size_t n) : lead_(n) { std::iota(lead_.begin(), lead_.end(), std::size_t{0}); }
  std::size_t leader(std::size_t i) {
    while (lead_[i] != i) i = lead_[i] = lead_[lead_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) {
    a = leader(a), b = leader(b);
    lead_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> lead_;
};

/// The symmetry under which b's layer lies on a's best, and by how much it misses.
std::pair<Symmetry, double> bestSymmetry(const Layer& a, const Layer& b, const std::vector<Vec3>& pa, const std::vector<Vec3>& pb) {
  std::pair<Symmetry, double> best{{}, std::numeric_limits<double>::infinity()};
  for (const Symmetry& symmetry : Symmetry::all()) {
    if (!symmetry.fits(a, b)) continue;
    double off = 0;
    for (std::size_t e = 0; e < a.slots.size(); ++e) off = std::max(off, (pa[a.slots[e]] - pb[b.slots[symmetry.entry(a, e)]]).norm());
    if (off < best.second) best = {symmetry, off};
  }
  return best;
}

}  // namespace

Object makeObject(const std::vector<LooseSolid>& loose, std::vector<Joint> joints, double tolerance) {
  Object object;
  std::vector<std::size_t> first;
  Box box;
  for (const LooseSolid& l : loose) {
    first.push_back(object.points.size());
    Solid solid{l.name, l.degree, {}};
    for (const Vec3& p : l.points) {
      if (object.points.size() >= 4 * kMaxPoints) throw std::invalid_argument(fmt::format("points: more than {}", 4 * kMaxPoints));
      if (p.allFinite()) box.extend(p);
      solid.points.push_back(static_cast<Index>(object.points.size()));
      object.points.push_back(p);
    }
    object.solids.push_back(std::move(solid));
  }
  for (std::size_t s = 0; s < object.solids.size(); ++s) validateSolid(object, s);
  Merge merge(object.points.size());
  const double size = box.isEmpty() ? 0 : box.sizes().norm();
  for (const Joint& joint : joints) {
    validateJoint(object, joint);
    const Layer a = layerOf(object.solids[joint.a.solid], joint.a.side), b = layerOf(object.solids[joint.b.solid], joint.b.side);
    const auto [symmetry, off] = bestSymmetry(a, b, loose[joint.a.solid].points, loose[joint.b.solid].points);
    if (!(off <= tolerance * size))
      throw std::invalid_argument(fmt::format("joint {} - {}: the control points of the faces do not coincide ({})", describe(object, joint.a), describe(object, joint.b),
                                              std::isfinite(off) ? fmt::format("off by {:.3g}", off) : "their degrees differ"));
    for (std::size_t e = 0; e < a.slots.size(); ++e) merge.join(first[joint.a.solid] + a.slots[e], first[joint.b.solid] + b.slots[symmetry.entry(a, e)]);
  }
  std::vector<Index> number(object.points.size(), kNoIndex);
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < number.size(); ++i) {
    if (merge.leader(i) == i) number[i] = static_cast<Index>(points.size()), points.push_back(object.points[i]);
    else number[i] = number[merge.leader(i)];
  }
  object.points = std::move(points);
  for (Solid& solid : object.solids)
    for (Index& i : solid.points) i = number[i];
  object.joints = std::move(joints);
  object.validate();
  return object;
}

std::vector<std::pair<Index, double>> combination(const Object& object, const PointRef& ref) {
  if (ref.solid >= object.solids.size()) throw std::invalid_argument("a solid is out of range");
  const Solid& solid = object.solids[ref.solid];
  if (const auto* ijk = std::get_if<std::array<int, 3>>(&ref.at)) {
    for (std::size_t a = 0; a < 3; ++a)
      if ((*ijk)[a] < 0 || (*ijk)[a] > solid.degree[a])
        throw std::invalid_argument(fmt::format("{}: degrees are {}, {}, {}", describe(object, ref), solid.degree[0], solid.degree[1], solid.degree[2]));
    return {{solid.points[solid.slot((*ijk)[0], (*ijk)[1], (*ijk)[2])], 1.0}};
  }
  const Vec3& u = std::get<Vec3>(ref.at);
  if (!((u.array() >= 0).all() && (u.array() <= 1).all())) throw std::invalid_argument(fmt::format("{}: expected numbers from 0 to 1", describe(object, ref)));
  std::vector<double> weight(solid.slots());
  weights(solid.degree, u, weight);
  std::vector<std::pair<Index, double>> out;
  for (std::size_t s = 0; s < weight.size(); ++s) {
    if (weight[s] == 0) continue;
    const auto same = std::find_if(out.begin(), out.end(), [&](const auto& e) { return e.first == solid.points[s]; });
    if (same != out.end()) same->second += weight[s];
    else out.emplace_back(solid.points[s], weight[s]);
  }
  return out;
}

std::string describe(const Object& object, const PointRef& ref) {
  const std::string& name = object.solids[ref.solid].name;
  if (const auto* ijk = std::get_if<std::array<int, 3>>(&ref.at)) return fmt::format("{}[{},{},{}]", name, (*ijk)[0], (*ijk)[1], (*ijk)[2]);
  const Vec3& u = std::get<Vec3>(ref.at);
  return fmt::format("{}({:.4g},{:.4g},{:.4g})", name, u.x(), u.y(), u.z());
}

std::string describe(const Object& object, const FaceRef& ref) { return fmt::format("{}.{}", object.solids[ref.solid].name, toString(ref.side)); }

}  // namespace fielddeform::solid
