#include <fielddeform/map/casteljau_skeleton.h>
#include <fielddeform/map/detail/line_curves.h>
#include <fmt/format.h>

#include <stdexcept>

namespace fielddeform::map {

CasteljauMap casteljauAlong(const SkeletonMotion& motion) {
  const auto& lines = motion.rest.primitives;
  if (lines.size() != 1 || lines[0].closed)
    throw std::invalid_argument(fmt::format("method 'casteljau': {} primitives{}, expected one open line", lines.size(),
                                            lines[0].closed ? ", a closed one" : ""));
  const detail::LineCurves curves = detail::lineCurves(motion, 0, "casteljau");
  std::vector<Vec3> rest, posed;
  std::vector<Quat> rotation;
  std::vector<double> scale;
  for (const Index v : curves.points) {
    const Index sample = motion.samples.set.vertexSample[0][v];
    rest.push_back(lines[0].points[v]);
    posed.push_back(motion.posed.primitives[0].points[v]);
    rotation.push_back(motion.samples.rotation[sample]);
    scale.push_back(motion.samples.scale[sample]);
  }
  CasteljauPair pair = curvesAlong(rest, posed, rotation, scale);
  if (motion.unedited) pair.posed = pair.rest;
  return CasteljauMap(std::move(pair.rest), std::move(pair.posed));
}

}  // namespace fielddeform::map
