#include <fielddeform/volume/detail/reduced.h>

#include <cmath>

namespace fielddeform::volume::detail {

void Core::displacements(const Eigen::VectorXd& x, std::vector<Vec3>& d) const {
  d = start;
  for (std::size_t k = 0; k < free.size(); ++k) d[free[k]] = size * x.segment<3>(3 * static_cast<Eigen::Index>(k));
}

Eigen::VectorXd Core::variablesOf(Points d) const {
  Eigen::VectorXd x(variables());
  for (std::size_t k = 0; k < free.size(); ++k) x.segment<3>(3 * static_cast<Eigen::Index>(k)) = d[free[k]] / size;
  return x;
}

void Core::projectLinear(Eigen::VectorXd& v) const {
  if (linear.rows.rows() == 0) return;
  Eigen::Map<Eigen::Matrix<double, 3, Eigen::Dynamic>> nodes(v.data(), 3, v.size() / 3);
  const Eigen::MatrixXd along = nodes * linear.rows.transpose();
  nodes -= along * linear.rows;
}

void Core::meetLinear(Eigen::VectorXd& x) const {
  if (linear.rows.rows() == 0) return;
  Eigen::Map<Eigen::Matrix<double, 3, Eigen::Dynamic>> nodes(x.data(), 3, x.size() / 3);
  const Eigen::MatrixXd gap = linear.value.transpose() - nodes * linear.rows.transpose();
  nodes += gap * linear.rows;
}

Reduced::Reduced(const Core& core, NodeConstraints& values, NodeConstraints& curvature, LinearMode mode)
    : core_(core), values_(values), curvature_(curvature), mode_(mode), g_(core.start.size()) {}

Eigen::Index Reduced::constraints() const { return values_.count() + (rowsCount() ? 3 * core_.linear.rows.rows() : 0); }

void Reduced::linearValues(const Vector& x, Vector& c, Eigen::Index from) const {
  if (!rowsCount()) return;
  const Eigen::Index q = core_.linear.rows.rows();
  c.conservativeResize(from + 3 * q);
  const Eigen::Map<const Eigen::Matrix<double, 3, Eigen::Dynamic>> nodes(x.data(), 3, x.size() / 3);
  Eigen::Map<Eigen::Matrix<double, 3, Eigen::Dynamic>>(c.data() + from, 3, q) =
      nodes * core_.linear.rows.transpose() - core_.linear.value.transpose();
}

double Reduced::values(const Vector& x, Vector& c) {
  core_.displacements(x, d_);
  values_.values(d_, c);
  linearValues(x, c, values_.count());
  return core_.problem->energy->value(d_) / core_.energyUnit;
}

double Reduced::energyGradient(Vector& gradient) {
  const double energy = core_.problem->energy->gradient(d_, g_) / core_.energyUnit;
  gradient.resize(variables());
  const double unit = core_.size / core_.energyUnit;
  for (std::size_t k = 0; k < core_.free.size(); ++k) gradient.segment<3>(3 * static_cast<Eigen::Index>(k)) = unit * g_[core_.free[k]];
  return energy;
}

double Reduced::derivatives(const Vector& x, Vector& gradient, Vector& c, Matrix& jacobian) {
  core_.displacements(x, d_);
  values_.derivatives(d_, c, jacobian_);
  const Eigen::Index m = values_.count();
  jacobian.setZero(variables(), constraints());
  for (std::size_t k = 0; k < core_.free.size(); ++k)
    jacobian.block(3 * static_cast<Eigen::Index>(k), 0, 3, m) = core_.size * jacobian_.block(3 * static_cast<Eigen::Index>(core_.free[k]), 0, 3, m);
  linearValues(x, c, m);
  if (rowsCount())
    for (Eigen::Index q = 0; q < core_.linear.rows.rows(); ++q)
      for (Eigen::Index k = 0; k < core_.linear.rows.cols(); ++k)
        jacobian.block<3, 3>(3 * k, m + 3 * q).diagonal().setConstant(core_.linear.rows(q, k));
  const double energy = energyGradient(gradient);
  if (mode_ == LinearMode::Projected) {
    core_.projectLinear(gradient);
    Vector column;
    for (Eigen::Index k = 0; k < m && core_.linear.rows.rows() > 0; ++k) {
      column = jacobian.col(k);
      core_.projectLinear(column);
      jacobian.col(k) = column;
    }
  }
  return energy;
}

double Reduced::weightedGradient(const Vector& x, const std::function<Vector(const Vector&)>& weights, Vector& gradient, Vector& c) {
  if (mode_ == LinearMode::AsConstraints) return ConstrainedProblem::weightedGradient(x, weights, gradient, c);
  core_.displacements(x, d_);
  p_.resize(d_.size());
  values_.weightedGradient(d_, weights, c, p_);
  const double energy = energyGradient(gradient);
  for (std::size_t k = 0; k < core_.free.size(); ++k) gradient.segment<3>(3 * static_cast<Eigen::Index>(k)) += core_.size * p_[core_.free[k]];
  core_.projectLinear(gradient);
  return energy;
}

SparseMatrix Reduced::freeHessian(Points d) const {
  const SparseMatrix all = core_.problem->energy->hessian(d);
  const double unit = core_.size * core_.size / core_.energyUnit;
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<std::size_t>(all.nonZeros()));
  for (Eigen::Index j = 0; j < all.outerSize(); ++j) {
    const Index column = core_.rowOf[static_cast<std::size_t>(j / 3)];
    if (column == kNoIndex) continue;
    for (SparseMatrix::InnerIterator it(all, j); it; ++it) {
      const Index row = core_.rowOf[static_cast<std::size_t>(it.row() / 3)];
      if (row != kNoIndex)
        entries.emplace_back(static_cast<int>(3 * row) + static_cast<int>(it.row() % 3), static_cast<int>(3 * column) + static_cast<int>(j % 3), unit * it.value());
    }
  }
  SparseMatrix out(variables(), variables());
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

void Reduced::hessian(const Vector& x, const Vector& multiplier, Matrix& h) {
  core_.displacements(x, d_);
  h.setZero(variables(), variables());
  if (curvature_.count() > 0) {
    curvature_.addHessian(d_, multiplier.head(curvature_.count()), core_.rowOf, h);
    h *= core_.size * core_.size;
  }
  core_.problem->energy->addHessian(d_, core_.size * core_.size / core_.energyUnit, core_.rowOf, h);
}

void Reduced::linearize(const Vector& x, const Vector& multiplier) {
  core_.displacements(x, d_);
  curvature_.linearize(d_, multiplier.head(curvature_.count()));
  hessian_ = freeHessian(d_);
}

void Reduced::hessianTimes(const Vector& p, Vector& out) {
  p_.assign(core_.start.size(), Vec3::Zero());
  for (std::size_t k = 0; k < core_.free.size(); ++k) p_[core_.free[k]] = p.segment<3>(3 * static_cast<Eigen::Index>(k));
  curvature_.hessianTimes(p_, g_);
  out = hessian_ * p;
  const double unit = core_.size * core_.size;
  for (std::size_t k = 0; k < core_.free.size(); ++k) out.segment<3>(3 * static_cast<Eigen::Index>(k)) += unit * g_[core_.free[k]];
}

void Reduced::precondition(const Vector& r, Vector& out) {
  if (!factor_) {
    // At rest an energy is at a minimum, so its Hessian is positive semidefinite; what it leaves free (rigid motions) gets
    // a small stiffness. More of it where rounding or an odd energy asks for it.
    const SparseMatrix rest = freeHessian(std::vector<Vec3>(core_.start.size(), Vec3::Zero()));
    SparseMatrix identity(rest.rows(), rest.cols());
    identity.setIdentity();
    factor_ = std::make_unique<Eigen::SimplicialLDLT<SparseMatrix>>();
    for (double shift = 1e-4; shift < 1e9; shift *= 10) {
      factor_->compute(rest + shift * identity);
      if (factor_->info() == Eigen::Success && factor_->vectorD().minCoeff() > 0) break;
    }
  }
  out = factor_->solve(r);
}

}  // namespace fielddeform::volume::detail
