#include <fielddeform/core/error.h>
#include <fielddeform/skeleton/detail/edit_target.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace fielddeform::skeleton::detail {
namespace {

void requireDirection(const char* argument, const Vec3& v) {
  if (!v.allFinite() || !(v.norm() > 0))
    throw std::invalid_argument(fmt::format("{} is ({}, {}, {}), must be finite and not 0", argument, v.x(), v.y(), v.z()));
}

void requireFinitePoint(const char* argument, const Vec3& v) {
  if (!v.allFinite())
    throw std::invalid_argument(fmt::format("{} is ({}, {}, {}), must be finite", argument, v.x(), v.y(), v.z()));
}

// A thousand turns; far beyond, the sine of an angle holds no digit of it.
void requireAngle(double radians) {
  constexpr double kTurns = 1000;
  if (!(std::abs(radians) <= kTurns * 2 * std::numbers::pi))
    throw std::invalid_argument(fmt::format("angle is {:.6g} degrees, expected at most {:.0f} either way",
                                            radians * 180 / std::numbers::pi, kTurns * 360));
}

// A unit vector as it is: what an earlier run saved must come back with the same bits.
Vec3 unit(const Vec3& v) {
  const double length = v.norm();
  return std::abs(length - 1) <= 1e-15 ? v : Vec3(v / length);
}

// Fills one operation in; the extent of its range goes to `out`.
class Preparation {
 public:
  Preparation(const Skeleton& rest, std::vector<Index> targets, Prepared& out) : out_(out) {
    for (const Index i : targets) primitives_.push_back(&rest.primitives[i]);
    bulk_ = bulkOf(primitives_);
  }

  void operator()(Bend& b) {
    spine(b.spine);
    if (b.angle.has_value() == b.radius.has_value())
      throw std::invalid_argument("either angle or radius must be given, and not both");
    if (b.radius) {
      requireFinite("radius", *b.radius);
      if (*b.radius == 0) throw std::invalid_argument("radius is 0, must not be");
      b.angle = (out_.end - out_.begin) / *b.radius;
      b.radius.reset();
    }
    requireAngle(*b.angle);
    if (!b.about) b.about = autoAbout(bulk_, *b.spine.axis);
    requireDirection("about", *b.about);
    const Vec3 about = unit(*b.about);
    const double along = about.dot(*b.spine.axis);
    const Vec3 across = std::abs(along) <= 1e-15 ? about : Vec3(about - along * *b.spine.axis);
    if (!(across.norm() > 1e-6)) throw std::invalid_argument("about lies along the axis, must point across it");
    b.about = unit(across);
  }
  void operator()(Twist& t) {
    spine(t.spine);
    requireAngle(t.angle);
  }
  void operator()(Taper& t) {
    spine(t.spine);
    requirePositive("factor", t.factor);
  }
  void operator()(Stretch& s) {
    spine(s.spine);
    requirePositive("factor", s.factor);
  }
  void operator()(Translate& t) { requireFinitePoint("by", t.by); }
  void operator()(Rotate& r) {
    requireAngle(r.angle);
    if (!r.axis) r.axis = autoAxis(bulk_);
    requireDirection("axis", *r.axis);
    r.axis = unit(*r.axis);
    if (!r.pivot) r.pivot = bulk_.centre;
    requireFinitePoint("pivot", *r.pivot);
  }
  void operator()(Scale& s) {
    for (int k = 0; k < 3; ++k) requirePositive("factor", s.factor[k]);
    if (!s.pivot) s.pivot = bulk_.centre;
    requireFinitePoint("pivot", *s.pivot);
  }
  void operator()(MovePoints& m) {
    const std::size_t count = primitives_[0]->points.size();
    if (m.by.size() != 1 && m.by.size() != m.points.size())
      throw std::invalid_argument(fmt::format("{} displacements for {} points, must be 1 or as many", m.by.size(), m.points.size()));
    for (const Vec3& v : m.by) requireFinitePoint("by", v);
    for (const Index i : m.points)
      if (i >= count) throw std::invalid_argument(fmt::format("point {}, the last one is {}", i, count - 1));
    std::vector<Index> sorted = m.points;
    std::sort(sorted.begin(), sorted.end());
    const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
    if (twice != sorted.end()) throw std::invalid_argument(fmt::format("point {} is given twice", *twice));
  }
  void operator()(Press& p) {
    requireFinitePoint("point", p.point);
    requireDirection("normal", p.normal);
    p.normal = unit(p.normal);
    if (!(p.softness >= 0) || !std::isfinite(p.softness))
      throw std::invalid_argument(fmt::format("softness is {}, must be finite and >= 0", p.softness));
  }
  void operator()(Replace& r) {
    r.with.name = primitives_[0]->name;
    validate(Skeleton{{r.with}, {}});
  }

 private:
  void spine(Spine& s) {
    requireInRange("from", s.from, 0, 1);
    requireInRange("to", s.to, 0, 1);
    if (!(s.from < s.to)) throw std::invalid_argument(fmt::format("from is {}, must be less than to, which is {}", s.from, s.to));
    if (!s.axis) s.axis = autoAxis(bulk_);
    requireDirection("axis", *s.axis);
    s.axis = unit(*s.axis);
    extent(s, s.pivot.value_or(bulk_.centre));
    if (!s.pivot) {
      s.pivot = bulk_.centre + out_.begin * *s.axis;
      extent(s, *s.pivot);
    }
    requireFinitePoint("pivot", *s.pivot);
  }

  void extent(const Spine& s, const Vec3& pivot) {
    double low = INFINITY, high = -INFINITY;
    for (const Primitive* p : primitives_)
      for (const Vec3& x : p->points) {
        const double at = s.axis->dot(x - pivot);
        low = std::min(low, at);
        high = std::max(high, at);
      }
    if (!(high - low > 1e-12 * bulk_.box.diagonal().norm()))
      throw std::invalid_argument("the primitive has no extent along the axis");
    out_.begin = low + s.from * (high - low);
    out_.end = low + s.to * (high - low);
  }

  std::vector<const Primitive*> primitives_;
  Bulk bulk_;
  Prepared& out_;
};

}  // namespace

std::vector<Index> targetsOf(const Skeleton& rest, const Edit& edit) {
  std::vector<Index> targets;
  for (Index i = 0; i < rest.primitives.size(); ++i)
    if (edit.primitive.empty() || rest.primitives[i].name == edit.primitive) targets.push_back(i);
  if (targets.empty()) throw std::invalid_argument(fmt::format("the skeleton has no primitive \"{}\"", edit.primitive));
  const bool needsName = std::holds_alternative<MovePoints>(edit.operation) || std::holds_alternative<Replace>(edit.operation);
  if (needsName && edit.primitive.empty()) throw std::invalid_argument("a primitive must be named");
  return targets;
}

Prepared prepare(const Skeleton& rest, const Edit& edit) {
  Prepared prepared{edit, 0, 0};
  try {
    Preparation preparation(rest, targetsOf(rest, edit), prepared);
    std::visit(preparation, prepared.edit.operation);
  } catch (const std::invalid_argument& error) {
    const std::string target = edit.primitive.empty() ? "all primitives" : fmt::format("\"{}\"", edit.primitive);
    throw std::invalid_argument(fmt::format("{} of {}: {}", operationName(edit), target, error.what()));
  }
  return prepared;
}

}  // namespace fielddeform::skeleton::detail
