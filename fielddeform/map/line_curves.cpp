#include <fielddeform/map/detail/line_curves.h>
#include <fmt/format.h>

#include <stdexcept>

namespace fielddeform::map::detail {

LineCurves lineCurves(const SkeletonMotion& motion, Index i, std::string_view method) {
  const skeleton::Primitive &rest = motion.rest.primitives[i], &posed = motion.posed.primitives[i];
  if (rest.type != skeleton::PrimitiveType::Polyline)
    throw std::invalid_argument(fmt::format("method '{}': primitive '{}' is of type {}, expected a line", method, rest.name,
                                            skeleton::toString(rest.type)));
  std::vector<Index> points;
  for (Index v = 0; v < rest.points.size(); ++v)
    if (points.empty() || rest.points[v] != rest.points[points.back()]) points.push_back(v);
  while (rest.closed && points.size() > 1 && rest.points[points.back()] == rest.points[points.front()]) points.pop_back();
  if (points.size() < (rest.closed ? 3u : 2u))
    throw std::invalid_argument(fmt::format("method '{}': the line '{}' has no length", method, rest.name));
  std::vector<Vec3> p, q, numbers;
  for (const Index v : points) {
    p.push_back(rest.points[v]);
    q.push_back(posed.points[v]);
    const double roll = (posed.roll.empty() ? 0 : posed.roll[v]) - (rest.roll.empty() ? 0 : rest.roll[v]);
    const double radius = skeleton::radiusOf(rest, v);
    numbers.emplace_back(roll, skeleton::radiusOf(posed, v) / radius, radius);
  }
  const std::vector<double> t = SplineCurve::chordParameters(p, rest.closed);
  return {SplineCurve(p, rest.closed, t), SplineCurve(q, rest.closed, t), SplineCurve(numbers, rest.closed, t), std::move(points)};
}

}  // namespace fielddeform::map::detail
