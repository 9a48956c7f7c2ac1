#include <fielddeform/mesh/mesh.h>
#include <fielddeform/scene/detail/free_points.h>
#include <fielddeform/scene/symmetry.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <stdexcept>

namespace fielddeform::scene {
namespace {

using skeleton::PairKind;
using skeleton::Primitive;
using skeleton::Skeleton;
using skeleton::SkeletonPair;

class Mirror {
 public:
  explicit Mirror(const MirrorPlane& plane) : plane_(plane) {}
  Vec3 point(Vec3 p) const {
    p[plane_.axis] = 2 * plane_.at - p[plane_.axis];
    return p;
  }
  Vec3 direction(Vec3 d) const {
    d[plane_.axis] = -d[plane_.axis];
    return d;
  }
  // Reflecting a turn reflects its axis and reverses its sense.
  Quat rotation(const Quat& q) const {
    const Vec3 v = -direction(q.vec());
    return {q.w(), v.x(), v.y(), v.z()};
  }
  Primitive primitive(const Primitive& p) const {
    Primitive twin = p;
    for (Vec3& x : twin.points) x = point(x);
    for (double& r : twin.roll) r = -r;
    for (auto& face : twin.faces) std::reverse(face.begin() + 1, face.end());
    if (p.rotation) twin.rotation = rotation(*p.rotation);
    return twin;
  }

 private:
  MirrorPlane plane_;
};

// For each of a's points the partner's, if `b` is a's mirror image; empty if it is not.
std::vector<Index> correspondence(const Primitive& a, const Primitive& b, detail::FreePoints& pointsOfB, const Mirror& mirror,
                                  double tolerance) {
  if (a.type != b.type || a.closed != b.closed || a.points.size() != b.points.size()) return {};
  std::vector<Index> partner;
  for (const Vec3& p : a.points) {
    partner.push_back(pointsOfB.take(mirror.point(p), tolerance));
    if (partner.back() == kNoIndex) break;
  }
  pointsOfB.release();
  if (!partner.empty() && partner.back() == kNoIndex) return {};
  return partner;
}

bool sameValues(const Primitive& a, const Primitive& b) {
  const auto coefficients = [](const Primitive& p) { return p.rotation ? p.rotation->coeffs() : Quat::Identity().coeffs(); };
  return a.radius == b.radius && a.pointRadius == b.pointRadius && a.weight == b.weight && a.potential == b.potential &&
         a.roll == b.roll && coefficients(a) == coefficients(b);
}

template <class T>
std::vector<T> permuted(const std::vector<T>& values, const std::vector<Index>& partner) {
  std::vector<T> out(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) out[partner[k]] = values[k];
  return out;
}

// Values other than points, taken from `from` to its mirror partner.
void mirrorValues(const Primitive& from, const std::vector<Index>& partner, const Mirror& mirror, Primitive& to) {
  to.radius = from.radius;
  to.weight = from.weight;
  to.potential = from.potential;
  to.pointRadius = permuted(from.pointRadius, partner);
  to.roll = permuted(from.roll, partner);
  // A partner listed in the opposite order runs the other way: its tangent, too, is reversed, and the sign with it.
  const bool reversed = partner.size() > 1 && partner[0] > partner[1];
  if (!reversed)
    for (double& r : to.roll) r = -r;
  if (from.rotation) to.rotation = mirror.rotation(*from.rotation);
}

class Symmetriser {
 public:
  Symmetriser(const SkeletonPair& pair, const MirrorPlane& plane) : in_(pair), mirror_(plane) {
    std::vector<Vec3> all;
    for (const Primitive& p : in_.rest.primitives) all.insert(all.end(), p.points.begin(), p.points.end());
    tolerance_ = 1e-3 * mesh::objectSize(all);
    rest_ = in_.rest;
    posed_ = in_.posed;
    for (const auto& p : in_.pairs)
      if (p.rest != kNoIndex && p.posed != kNoIndex) names_.push_back({restOf(p).name, posedOf(p).name});
  }

  SkeletonPair run() {
    for (std::size_t i = 0; i < in_.pairs.size(); ++i) {
      if (in_.pairs[i].kind == PairKind::Added) mirrorAdded(i);
      else mirrorPair(i);
    }
    drop();
    return pairSkeletons(std::move(rest_), std::move(posed_), names_);
  }

 private:
  const Primitive& restOf(const skeleton::PrimitivePair& p) const { return in_.rest.primitives[p.rest]; }
  const Primitive& posedOf(const skeleton::PrimitivePair& p) const { return in_.posed.primitives[p.posed]; }
  bool edited(const skeleton::PrimitivePair& p) const {
    return p.kind != PairKind::Matched || restOf(p).points != posedOf(p).points || !sameValues(restOf(p), posedOf(p));
  }

  std::vector<Index> partnersOf(const Primitive& a, const Primitive& b) {
    if (a.points.size() != b.points.size()) return {};
    const auto [free, fresh] = free_.try_emplace(&b, b.points);
    return correspondence(a, b, free->second, mirror_, tolerance_);
  }

  void mirrorPair(std::size_t i) {
    const auto& a = in_.pairs[i];
    if (!edited(a)) return;
    for (std::size_t j = 0; j < in_.pairs.size(); ++j) {
      const auto& b = in_.pairs[j];
      if (b.kind == PairKind::Added) continue;
      const auto partner = partnersOf(restOf(a), restOf(b));
      if (partner.empty()) continue;
      carryOver(a, b, partner);
      return;
    }
    addTwin(a);
  }

  void carryOver(const skeleton::PrimitivePair& a, const skeleton::PrimitivePair& b, const std::vector<Index>& partner) {
    if (a.kind == PairKind::Matched && b.kind == PairKind::Matched) {
      movePoints(a, b, partner);
      if (a.rest == b.rest) mergeSections(a, partner);
      if (a.rest != b.rest && !sameValues(restOf(a), posedOf(a)) && sameValues(restOf(b), posedOf(b)))
        mirrorValues(posedOf(a), partner, mirror_, posed_.primitives[b.posed]);
    } else if (a.rest != b.rest && !edited(b)) {
      if (a.kind == PairKind::Removed) {
        dropped_.push_back(posedOf(b).name);
      } else {
        const std::string name = posedOf(b).name;
        posed_.primitives[b.posed] = mirror_.primitive(posedOf(a));
        posed_.primitives[b.posed].name = name;
      }
    }
  }

  void movePoints(const skeleton::PrimitivePair& a, const skeleton::PrimitivePair& b, const std::vector<Index>& partner) {
    for (Index k = 0; k < partner.size(); ++k) {
      const Index m = partner[k];
      const Vec3 here = posedOf(a).points[k] - restOf(a).points[k];
      const Vec3 there = posedOf(b).points[m] - restOf(b).points[m];
      const Vec3 image = mirror_.direction(here);
      const bool movedHere = !here.isZero(0), movedThere = !there.isZero(0);
      if (!movedHere) continue;  // the partner's turn will move it
      const Vec3 moved = movedThere || (a.rest == b.rest && m == k) ? Vec3(0.5 * (image + there)) : image;
      posed_.primitives[b.posed].points[m] = restOf(b).points[m] + moved;
    }
  }

  // Rolls and point radii of a primitive that is its own image, point by point as movePoints does. Radii by their ratio to
  // those at rest, so that they stay positive.
  void mergeSections(const skeleton::PrimitivePair& a, const std::vector<Index>& partner) {
    const Primitive &rest = restOf(a), &posed = posedOf(a);
    Primitive& out = posed_.primitives[a.posed];
    const std::size_t n = partner.size();
    const bool reversed = n > 1 && (rest.closed ? (partner[0] + n - partner[1]) % n == 1 : partner[0] > partner[1]);
    const auto merged = [](double image, double there, double unmoved, bool self) {
      return there != unmoved || self ? 0.5 * (image + there) : image;
    };
    const auto restRoll = [&](Index k) { return rest.roll.empty() ? 0.0 : rest.roll[k]; };
    const auto restRadius = [&](Index k) { return rest.pointRadius.empty() ? rest.radius.value_or(1) : rest.pointRadius[k]; };
    for (Index k = 0; k < n; ++k) {
      const Index m = partner[k];
      if (!posed.roll.empty() && posed.roll[k] != restRoll(k)) {
        const double here = posed.roll[k] - restRoll(k), there = posed.roll[m] - restRoll(m);
        out.roll[m] = restRoll(m) + merged(reversed ? here : -here, there, 0, m == k);
      }
      if (!posed.pointRadius.empty() && posed.pointRadius[k] != restRadius(k)) {
        const double here = posed.pointRadius[k] / restRadius(k), there = posed.pointRadius[m] / restRadius(m);
        out.pointRadius[m] = restRadius(m) * merged(here, there, 1, m == k);
      }
    }
  }

  void addTwin(const skeleton::PrimitivePair& a) {
    const std::string name = restOf(a).name + ".mirror";
    rest_.primitives.push_back(mirror_.primitive(restOf(a)));
    rest_.primitives.back().name = name;
    requireFree(in_.rest, name);
    if (a.posed == kNoIndex) return;
    requireFree(in_.posed, name);
    posed_.primitives.push_back(mirror_.primitive(posedOf(a)));
    posed_.primitives.back().name = name;
    names_.push_back({name, name});
  }

  void mirrorAdded(std::size_t i) {
    for (const auto& b : in_.pairs) {
      if (b.kind != PairKind::Added) continue;
      if (!partnersOf(posedOf(in_.pairs[i]), posedOf(b)).empty()) return;
    }
    const std::string name = posedOf(in_.pairs[i]).name + ".mirror";
    requireFree(in_.posed, name);
    posed_.primitives.push_back(mirror_.primitive(posedOf(in_.pairs[i])));
    posed_.primitives.back().name = name;
  }

  static void requireFree(const Skeleton& skeleton, const std::string& name) {
    if (skeleton.find(name))
      throw std::invalid_argument(fmt::format("symmetry: the name \"{}\" for a mirrored twin is taken", name));
  }

  // Removes the posed partners of removed primitives, last, so that indices stay valid until here.
  void drop() {
    for (const std::string& name : dropped_) {
      std::erase_if(posed_.primitives, [&](const Primitive& p) { return p.name == name; });
      std::erase_if(names_, [&](const skeleton::NamedPair& p) { return p.posed == name; });
    }
  }

  const SkeletonPair& in_;
  Mirror mirror_;
  double tolerance_ = 0;
  std::map<const Primitive*, detail::FreePoints> free_;  // of the input's primitives
  Skeleton rest_, posed_;
  std::vector<skeleton::NamedPair> names_;
  std::vector<std::string> dropped_;
};

}  // namespace

SkeletonPair mirrorEdits(const SkeletonPair& pair, const MirrorPlane& plane) {
  if (plane.axis < 0 || plane.axis > 2)
    throw std::invalid_argument(fmt::format("symmetry axis is {}, must be 0, 1 or 2", plane.axis));
  return Symmetriser(pair, plane).run();
}

}  // namespace fielddeform::scene
