#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/cover.h>
#include <fielddeform/field/detail/polygonise.h>
#include <fielddeform/field/isosurface.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::field {
namespace {

constexpr double kSamplesARadius = 16;
constexpr double kSamplesAValue = 3;
constexpr double kBytesEach = 2048 + 64;  // a block's floats, and its place in lists
// In voxels: skeletons and radii are round numbers, and a surface through lattice points has needles there.
const Vec3 kAside(0.377, 0.291, 0.423);
constexpr int kSteps = 12;                // of a bracketing secant: the bracket shrinks to rounding

double voxelOf(const Field& field, double value, const SampleOptions& options) {
  if (options.voxel) return *options.voxel;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < field.primitiveCount(); ++i)
    if (field.weight(i) > 0) least = std::min(least, field.radius(i));
  const double share = value > 0 ? std::min(1 / kSamplesARadius, value / field.referenceRadius() / kSamplesAValue) : 1 / kSamplesARadius;
  return least * share;
}

// Where D = value on the edge from a to b. [regula falsi, Illinois rule]
Vec3 crossing(const Field& field, double value, const Vec3& a, const Vec3& b) {
  const auto at = [&](double t) -> Vec3 { return a + t * (b - a); };
  const auto f = [&](double t) { return field.evaluate(at(t)).pseudoDistance - value; };
  double s = 0, t = 1, fs = f(s), ft = f(t);
  if (!((fs < 0) != (ft < 0))) return at(0.5);  // a difference that floats did not see
  for (int k = 0; k < kSteps; ++k) {
    const double middle = t - ft * (t - s) / (ft - fs), fm = f(middle);
    if ((fm < 0) == (ft < 0)) fs *= 0.5;
    else s = t, fs = ft;
    t = middle, ft = fm;
    if (std::abs(fm) <= 1e-7 * (b - a).norm()) break;
  }
  return at(detail::betweenEnds(t));
}

}  // namespace

void SampleOptions::validate() const {
  if (voxel) requirePositive("voxel", *voxel);
  requireInRange("memory (MB)", maxMegabytes, 1e-3, 1e9);
}

mesh::Mesh isosurface(const Field& field, double value, const SampleOptions& options, Progress& progress) {
  options.validate();
  requireFinite("isovalue", value);
  detail::Lattice lattice = detail::latticeOf(field, voxelOf(field, value, options));
  lattice.origin += lattice.voxel * kAside;
  // Beyond all radii D is the least R d / r; within, the surface is where some primitive reaches.
  const double reach = std::max(1.0, value / field.referenceRadius());
  const detail::BlockBudget budget{options.maxMegabytes, kBytesEach, fmt::format("the isosurface {:.4g}", value)};
  const std::vector<detail::Cell> corners = detail::coverField(field, lattice, reach, 2, budget);
  std::vector<float> values(corners.size() * detail::kBlockSize);
  parallelFor(corners.size(), 4, progress, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin * detail::kBlockSize; i < end * detail::kBlockSize; ++i) {
      const Vec3 p = lattice.point(detail::pointOf(corners[i / detail::kBlockSize], i % detail::kBlockSize));
      const double d = field.evaluate(p).pseudoDistance - value;
      values[i] = static_cast<float>(std::clamp(d, -1e30, 1e30));
    }
  });
  mesh::Mesh surface;
  try {
    surface = detail::polygonise(corners, values, options.maxMegabytes, [&](const detail::Cell& a, const detail::Cell& b, double, double) {
      return crossing(field, value, lattice.point(a), lattice.point(b));
    });
  } catch (const std::length_error&) {
    throw std::invalid_argument(fmt::format("{} needs more than {:.4g} MB with voxels of {:.4g}", budget.what, options.maxMegabytes, lattice.voxel));
  }
  mesh::Attribute attribute{"isovalue", mesh::Element::Vertex, 1, mesh::Interpolation::Linear,
                            std::vector<double>(surface.vertexCount(), value), {}, {}};
  surface.attributes().push_back(std::move(attribute));
  return surface;
}

}  // namespace fielddeform::field
