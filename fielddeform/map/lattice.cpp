#include <fielddeform/core/error.h>
#include <fielddeform/map/lattice.h>
#include <fielddeform/skeleton/principal_axes.h>
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

constexpr double kThin = 1e-3;       // thickness that a flat set gets, of the longest edge
constexpr double kFar = 1e-13;       // no box is thinner than this share of its coordinates, or rounding would flatten it
constexpr double kCoplanar = 1e-12;  // of the volume that edges of the same lengths can span

std::vector<Vec3> finiteOnly(Points points) {
  std::vector<Vec3> finite;
  finite.reserve(points.size());
  for (const Vec3& p : points)
    if (p.allFinite()) finite.push_back(p);
  return finite;
}

// The box over `range` of coordinates along orthonormal axes, measured from `origin`.
LatticeBox boxOver(const Box& range, const Vec3& origin, const Mat3& axes, double padding) {
  Vec3 low = range.min(), high = range.max();
  const double longest = (high - low).maxCoeff();
  const double far = std::max({low.cwiseAbs().maxCoeff(), high.cwiseAbs().maxCoeff(), origin.cwiseAbs().maxCoeff()});
  const double unit = longest > 0 ? longest : std::max(1.0, kFar * far);
  const double least = std::max((longest > 0 ? kThin : 1) * unit, kFar * far);
  for (int k = 0; k < 3; ++k) {
    const double missing = least - (high[k] - low[k]);
    if (missing > 0) {
      low[k] -= 0.5 * missing;
      high[k] += 0.5 * missing;
    }
    low[k] -= padding * unit;
    high[k] += padding * unit;
  }
  LatticeBox box;
  box.origin = origin + axes * low;
  box.axes = axes * (high - low).asDiagonal();
  return box;
}

void requirePadding(double padding) { requireInRange("padding", padding, 0, 1e6); }

}  // namespace

void LatticeBox::validate() const {
  if (!origin.allFinite() || !axes.allFinite()) throw std::invalid_argument("box: a coordinate is not finite");
  Mat3 unit = axes;
  for (int k = 0; k < 3; ++k) {
    const double length = axes.col(k).stableNorm();
    if (!(length > 0) || !std::isfinite(length)) throw std::invalid_argument(fmt::format("box: edge {} has length {}", k, length));
    unit.col(k) /= length;
  }
  const double volume = std::abs(unit.determinant());
  if (!(volume > kCoplanar))
    throw std::invalid_argument(fmt::format("box: its edges are nearly in one plane (volume {:.3g} of edges of length 1)", volume));
}

LatticeBox fitBox(Points points, double padding) {
  requirePadding(padding);
  Box range;
  for (const Vec3& p : points)
    if (p.allFinite()) range.extend(p);
  if (range.isEmpty()) range.extend(Vec3(Vec3::Zero()));
  return boxOver(range, Vec3::Zero(), Mat3::Identity(), padding);
}

LatticeBox fitOrientedBox(Points points, double padding) {
  requirePadding(padding);
  skeleton::Primitive cloud;
  cloud.points = finiteOnly(points);
  double largest = 0;
  for (const Vec3& p : cloud.points) largest = std::max(largest, p.cwiseAbs().maxCoeff());
  if (!(largest > 0)) return fitBox(points, padding);
  // A power of two first, so that squares stay in range.
  const int exponent = std::clamp(std::ilogb(largest), -1022, 1022);
  for (Vec3& p : cloud.points) p *= std::ldexp(1.0, -exponent);
  const skeleton::Primitive* const one = &cloud;
  const skeleton::Bulk bulk = skeleton::bulkOf({&one, 1});
  Mat3 axes;
  axes.col(0) = skeleton::autoAxis(bulk);
  axes.col(1) = skeleton::autoAbout(bulk, axes.col(0));
  axes.col(2) = axes.col(0).cross(axes.col(1)).normalized();
  Box range;
  for (const Vec3& p : cloud.points) range.extend(Vec3(axes.transpose() * (p - bulk.centre)));
  if (!(range.sizes().maxCoeff() > 0)) return fitBox(points, padding);
  LatticeBox box = boxOver(range, bulk.centre, axes, padding);
  box.origin *= std::ldexp(1.0, exponent);
  box.axes *= std::ldexp(1.0, exponent);
  return box;
}

std::string_view toString(Outside outside) noexcept { return outside == Outside::Extend ? "extend" : "keep"; }

Lattice refit(Lattice lattice, const LatticeBox& box) {
  lattice.validate();
  box.validate();
  if (box.axes != lattice.box.axes) {
    // Powers of two first, so that determinants stay in range.
    const int from = std::clamp(std::ilogb(lattice.box.axes.cwiseAbs().maxCoeff()), -1022, 1022);
    const int to = std::clamp(std::ilogb(box.axes.cwiseAbs().maxCoeff()), -1022, 1022);
    const Mat3 inverse = Mat3(lattice.box.axes * std::ldexp(1.0, -from)).inverse(), axes = box.axes * std::ldexp(1.0, -to);
    for (Vec3& d : lattice.displacements)
      if (d != Vec3::Zero()) d = Vec3(axes * (inverse * Vec3(d * std::ldexp(1.0, -from)))) * std::ldexp(1.0, to);
  }
  lattice.box = box;
  lattice.validate();
  return lattice;
}

std::array<int, 3> Lattice::nodes() const noexcept { return {axis[0].nodes(), axis[1].nodes(), axis[2].nodes()}; }

std::size_t Lattice::nodeCount() const noexcept {
  std::size_t n = 1;
  for (const AxisBasis& a : axis) n *= static_cast<std::size_t>(a.nodes());
  return n;
}

Index Lattice::index(int i, int j, int k) const noexcept {
  const auto [n0, n1, n2] = nodes();
  return static_cast<Index>(i + static_cast<std::int64_t>(n0) * (j + static_cast<std::int64_t>(n1) * k));
}

std::vector<Vec3> Lattice::restNodes() const {
  std::vector<Vec3> rest;
  rest.reserve(nodeCount());
  const auto [n0, n1, n2] = nodes();
  for (int k = 0; k < n2; ++k)
    for (int j = 0; j < n1; ++j)
      for (int i = 0; i < n0; ++i)
        rest.push_back(box.origin + box.axes * Vec3(axis[0].restNode(i), axis[1].restNode(j), axis[2].restNode(k)));
  return rest;
}

void Lattice::validate() const {
  box.validate();
  double count = 1;
  for (const AxisBasis& a : axis) count *= a.nodes();
  if (!(count < kNoIndex)) throw std::invalid_argument(fmt::format("lattice: {} nodes, must be < {}", count, kNoIndex));
  if (!displacements.empty() && displacements.size() != nodeCount())
    throw std::invalid_argument(fmt::format("displacements: {}, expected {}, one a node", displacements.size(), nodeCount()));
  for (std::size_t i = 0; i < displacements.size(); ++i)
    if (!displacements[i].allFinite()) throw std::invalid_argument(fmt::format("displacements: that of node {} is not finite", i));
}

}  // namespace fielddeform::map
