#include <Eigen/QR>
#include <fielddeform/core/error.h>
#include <fielddeform/numeric/cubic.h>
#include <fielddeform/volume/detail/prepared.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::volume::detail {
namespace {

constexpr double kMet = 1e-13;  // of the volume: rounding of a mesh's sum

double largest(const Eigen::VectorXd& v) { return v.size() ? v.cwiseAbs().maxCoeff() : 0; }

/// Longest move of one node.
double longest(const Eigen::VectorXd& p) {
  double out = 0;
  for (Eigen::Index k = 0; k + 2 < p.size(); k += 3) out = std::max(out, p.segment<3>(k).norm());
  return out;
}

/// One step along the gradient, its length the nearest root of the volume along it.
bool alongGradient(const Core& core, MeshConstraints& fine, const VolumeTarget& target, const Eigen::VectorXd& gradient, Eigen::VectorXd& x, double& moved) {
  Core still = core;  // displacements of the direction alone
  for (Vec3& d : still.start) d.setZero();
  Eigen::VectorXd p = gradient;
  core.projectLinear(p);
  const double norm = p.norm();
  if (!(norm > 0)) return false;
  p /= norm;
  std::vector<Vec3> d, direction, along;
  core.displacements(x, d);
  still.displacements(p, direction);
  fine.model().combine(direction, along);
  auto c = fine.model().volume().alongLine(fine.positions(d), along, target.region);
  c[0] -= target.target;
  const auto t = numeric::smallestCubicRoot(c);
  if (!t || !(std::abs(*t) < std::sqrt(static_cast<double>(core.free.size())))) return false;
  x += *t * p;
  moved = std::max(moved, std::abs(*t) * longest(p));
  return true;
}

}  // namespace

double projectOnto(const Core& core, MeshConstraints& fine, Eigen::VectorXd& x) {
  double moved = 0;
  core.meetLinear(x);
  Reduced reduced(core, fine, fine, LinearMode::Projected);
  Eigen::VectorXd c, gradient;
  Eigen::MatrixXd jacobian;
  reduced.values(x, c);
  const bool single = fine.single().has_value();
  for (int step = 0; step < 40 && largest(c) > kMet; ++step) {
    reduced.derivatives(x, gradient, c, jacobian);
    if (!(jacobian.cwiseAbs().maxCoeff() > 1e-12))
      throw InfeasibleError("no free node moves the surface: the volume cannot be changed (pin fewer nodes)");
    const double before = largest(c);
    Eigen::VectorXd next = x, cn;
    double step_ = 0;
    if (single && step < 8 && alongGradient(core, fine, *fine.single(), jacobian.col(0), next, step_)) {
      reduced.values(next, cn);
    } else {
      // Shortest Newton step, shortened to what a node may move at once and halved while it does not help.
      Eigen::VectorXd p = -jacobian.transpose().completeOrthogonalDecomposition().solve(c);
      core.projectLinear(p);
      if (const double length = longest(p); length > 0.3) p *= 0.3 / length;
      double t = 1;
      for (; t > 1e-3; t *= 0.5) {
        next = x + t * p;
        reduced.values(next, cn);
        if (largest(cn) < before) break;
      }
      step_ = t * longest(p);
    }
    if (!(largest(cn) < before)) break;
    x = next, c = cn, moved += step_;
  }
  return moved * core.size / core.extent;
}

}  // namespace fielddeform::volume::detail
