#pragma once

#include <fielddeform/core/parallel.h>
#include <fielddeform/map/detail/line_curves.h>
#include <fielddeform/map/pointwise_map.h>

namespace fielddeform::map::detail {

/// The closest points of several curves, kept for other poses.
struct Feet final : RestSide {
  std::size_t curves = 0;
  std::vector<SplineCurve::Foot> foot;  ///< #P by #curves
  const SplineCurve::Foot* of(std::size_t point) const { return foot.data() + point * curves; }
};

/// @param curve  curve(i): the SplineCurve of line i
template <class Curve>
std::shared_ptr<Feet> feetOf(Points rest, std::size_t curves, Curve&& curve) {
  auto feet = std::make_shared<Feet>();
  feet->curves = curves;
  feet->foot.resize(rest.size() * curves);
  parallelFor(rest.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p)
      for (std::size_t i = 0; i < curves && rest[p].allFinite(); ++i) feet->foot[p * curves + i] = curve(i).closest(rest[p]);
  });
  return feet;
}

/// The numbers of lines at rest that closest points depend on.
inline std::vector<double> restNumbers(const SkeletonMotion& motion) {
  std::vector<double> out;
  for (const skeleton::Primitive& p : motion.rest.primitives) {
    out.push_back(static_cast<double>(p.points.size()));
    out.push_back(p.closed ? 1 : 0);
    for (const Vec3& x : p.points) out.insert(out.end(), {x.x(), x.y(), x.z()});
  }
  return out;
}

}  // namespace fielddeform::map::detail
