#include <Eigen/QR>
#include <fielddeform/core/error.h>
#include <fielddeform/solid/detail/prepared.h>
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace fielddeform::solid::detail {
namespace {

/// Objectives that do not hold the object as a whole get this much of least squares, so that what is not determined stays.
constexpr double kHold = 1e-9;

std::vector<Row> allRows(const Problem& p) {
  std::vector<Row> rows = p.rows;
  const auto add = [&](std::vector<Row> more) { rows.insert(rows.end(), more.begin(), more.end()); };
  for (const Joint& joint : p.object.joints) add(continuity(p.object, joint));
  if (p.inner == Problem::Inner::Coons) add(coonsInside(p.object));
  return rows;
}

Problem validated(Problem p) {
  p.validate();
  if (p.wanted.empty()) p.wanted = p.object.points;
  const Sizes sizes(p.object);
  if (p.sizes.empty())
    for (std::size_t s = 0; s < p.object.solids.size(); ++s) p.sizes.push_back(sizes.value(s, p.object.points));
  return p;
}

}  // namespace

Matrix matrixOf(Points points) {
  Matrix out(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) out.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  return out;
}

void pointsFrom(const Matrix& m, std::vector<Vec3>& points) {
  points.resize(static_cast<std::size_t>(m.rows()));
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = m.row(static_cast<Eigen::Index>(i)).transpose();
}

Prepared::Prepared(Problem p)
    : problem(validated(std::move(p))), sizes(problem.object), rows(allRows(problem)), space(rows, problem.object.points.size()) {
  Box box;
  for (const Vec3& x : problem.object.points) box.extend(x);
  const double extent = box.isEmpty() ? 0 : box.sizes().maxCoeff();
  if (!(extent > 0)) throw InfeasibleError("the object is a single point: it has no size");
  size = std::ldexp(1.0, std::ilogb(extent));
  h = objectiveMatrix(problem.object, problem.objective);
  const auto n = h.rows();
  unit = std::ldexp(1.0, std::ilogb(h.trace() / static_cast<double>(n)));
  h /= unit;
  if (problem.objective.leastSquares == 0) h.diagonal().array() += kHold;
  const Eigen::Index rank = space.rank();
  null = Matrix::Identity(n, n);
  if (rank > 0) null = (Eigen::HouseholderQR<Matrix>(space.basis().transpose()).householderQ() * Matrix::Identity(n, n)).rightCols(n - rank);
  reduced.compute(null.transpose() * h * null);
  if (n > rank && reduced.info() != Eigen::Success) throw std::invalid_argument("objective: its matrix is not positive definite within the rows");
  map = n > rank ? Matrix(reduced.matrixL().solve(null.transpose()).transpose()) : Matrix(n, 0);
  for (std::size_t s = 0; s < problem.sizes.size(); ++s)
    if (problem.sizes[s]) held.push_back(s);
}

Matrix Prepared::base(const Matrix& wanted, const Matrix& values) const {
  const Matrix y = space.solve(rows, values, size);
  Matrix p = wanted;
  // Where the rows hold already every bit stays.
  std::vector<Vec3> points;
  pointsFrom(wanted, points);
  if (rows.empty() || (residualsOf(rows, points) + valuesOf(rows) - values).cwiseAbs().maxCoeff() <= 1e-14 * size) return p;
  if (space.rank() > 0) p += space.basis().transpose() * (y - space.basis() * wanted);
  if (map.cols() > 0) p -= map * (map.transpose() * (h * (p - wanted)));
  return p;
}

Vector Prepared::variables(const Matrix& base, Points points) const {
  const Matrix y = null.transpose() * ((matrixOf(points) - base) / size);
  const Matrix x = (reduced.matrixL().transpose() * y).transpose();
  return Eigen::Map<const Vector>(x.data(), x.size());
}

std::vector<double> checkedTargets(const Prepared& prepared, const std::vector<std::optional<double>>& sizes) {
  const auto& solids = prepared.problem.object.solids;
  if (sizes.size() != solids.size()) throw std::invalid_argument(fmt::format("sizes: {}, expected {}, one a solid", sizes.size(), solids.size()));
  std::vector<double> out;
  for (const std::size_t s : prepared.held) {
    if (!sizes[s]) throw std::invalid_argument("sizes: a solid has lost its target");
    const double rest = prepared.sizes.value(s, prepared.problem.object.points);
    if (!(rest > 0))
      throw InfeasibleError(fmt::format("solid \"{}\": its size is {:.6g}, not positive: its axes are left-handed, or it is turned inside out", solids[s].name, rest));
    if (!std::isfinite(*sizes[s]) || !(*sizes[s] > 0))
      throw InfeasibleError(fmt::format("solid \"{}\": the target size is {:.6g}, expected a positive number", solids[s].name, *sizes[s]));
    out.push_back(*sizes[s]);
  }
  return out;
}

void requireMovable(const Prepared& prepared, Points at) {
  for (const std::size_t s : prepared.held) {
    std::vector<Vec3> g(at.size(), Vec3::Zero());
    const double v = prepared.sizes.addGradient(s, at, 1, g);
    const Matrix free = prepared.null.transpose() * matrixOf(g);
    if (free.size() == 0 || !(free.norm() * prepared.size > 1e-10 * std::abs(v)))
      throw InfeasibleError(fmt::format("solid \"{}\": its constraints leave nothing that changes its size", prepared.problem.object.solids[s].name));
  }
}

SizeProblem::SizeProblem(const Prepared& prepared, const Matrix& base, std::vector<double> targets)
    : prepared_(prepared), base_(base), targets_(std::move(targets)) {}

const std::vector<Vec3>& SizeProblem::points(const Vector& x) {
  // x holds three numbers a free variable: a 3 by M matrix.
  const Eigen::Map<const Matrix> free(x.data(), 3, prepared_.freePoints());
  pointsFrom(base_ + prepared_.size * (prepared_.map * free.transpose()), points_);
  return points_;
}

Vector SizeProblem::pulledBack(Points gradient) const {
  const Matrix g = prepared_.size * (matrixOf(gradient).transpose() * prepared_.map);  // 3 by M
  return Eigen::Map<const Vector>(g.data(), g.size());
}

double SizeProblem::values(const Vector& x, Vector& c) {
  points(x);
  c.resize(constraints());
  for (std::size_t k = 0; k < targets_.size(); ++k)
    c[static_cast<Eigen::Index>(k)] = prepared_.sizes.value(prepared_.held[k], points_) / targets_[k] - 1;
  return 0.5 * x.squaredNorm();
}

double SizeProblem::derivatives(const Vector& x, Vector& gradient, Vector& c, Matrix& jacobian) {
  points(x);
  gradient = x;
  c.resize(constraints());
  jacobian.resize(variables(), constraints());
  for (std::size_t k = 0; k < targets_.size(); ++k) {
    out_.assign(points_.size(), Vec3::Zero());
    c[static_cast<Eigen::Index>(k)] = prepared_.sizes.addGradient(prepared_.held[k], points_, 1 / targets_[k], out_) / targets_[k] - 1;
    jacobian.col(static_cast<Eigen::Index>(k)) = pulledBack(out_);
  }
  return 0.5 * x.squaredNorm();
}

void SizeProblem::hessian(const Vector& x, const Vector& multiplier, Matrix& h) {
  points(x);
  const auto n = static_cast<Eigen::Index>(points_.size()), m = prepared_.freePoints();
  Matrix full = Matrix::Zero(3 * n, 3 * n);
  for (std::size_t k = 0; k < targets_.size(); ++k)
    prepared_.sizes.addHessian(prepared_.held[k], points_, multiplier[static_cast<Eigen::Index>(k)] / targets_[k], full);
  h = Matrix::Identity(3 * m, 3 * m);
  const double s = prepared_.size * prepared_.size;
  for (Eigen::Index a = 0; a < 3; ++a)
    for (Eigen::Index b = 0; b < 3; ++b) {
      if (a == b) continue;  // the blocks are antisymmetric 3 by 3 matrices: their diagonals vanish
      Matrix part(n, n);
      for (Eigen::Index i = 0; i < n; ++i)
        for (Eigen::Index j = 0; j < n; ++j) part(i, j) = full(3 * i + a, 3 * j + b);
      const Matrix turned = s * (prepared_.map.transpose() * part * prepared_.map);
      for (Eigen::Index i = 0; i < m; ++i)
        for (Eigen::Index j = 0; j < m; ++j) h(3 * i + a, 3 * j + b) += turned(i, j);
    }
}

void SizeProblem::linearize(const Vector& x, const Vector& multiplier) {
  points(x);
  multiplier_ = multiplier;
}

void SizeProblem::hessianTimes(const Vector& p, Vector& out) {
  const Eigen::Map<const Matrix> free(p.data(), 3, prepared_.freePoints());
  pointsFrom(prepared_.size * (prepared_.map * free.transpose()), direction_);
  out_.assign(points_.size(), Vec3::Zero());
  for (std::size_t k = 0; k < targets_.size(); ++k)
    prepared_.sizes.addHessianTimes(prepared_.held[k], points_, multiplier_[static_cast<Eigen::Index>(k)] / targets_[k], direction_, out_);
  out = p + pulledBack(out_);
}

void describeResult(const Prepared& prepared, const Matrix& wanted, const Matrix& values, const std::vector<std::optional<double>>& sizes, Result& result) {
  const Object& object = prepared.problem.object;
  Report& r = result.report;
  r.rows = prepared.rows.size(), r.rank = static_cast<std::size_t>(prepared.space.rank());
  r.redundant.clear();
  for (const std::size_t k : prepared.space.redundant()) r.redundant.push_back(prepared.rows[k].name);
  const Matrix d = matrixOf(result.points) - wanted;
  r.objective = 0.5 * prepared.unit * (d.transpose() * prepared.h * d).trace();
  r.rowResidual = 0;
  if (!prepared.rows.empty()) r.rowResidual = (residualsOf(prepared.rows, result.points) + valuesOf(prepared.rows) - values).rowwise().norm().maxCoeff();
  r.sizes.clear();
  r.deviation = 0;
  std::vector<Vec3> w;
  pointsFrom(wanted, w);
  for (std::size_t s = 0; s < object.solids.size(); ++s) {
    r.sizes.push_back({object.solids[s].name, prepared.sizes.value(s, object.points), prepared.sizes.value(s, w), prepared.sizes.value(s, result.points), sizes[s]});
    if (sizes[s]) r.deviation = std::max(r.deviation, std::abs(r.sizes[s].after / *sizes[s] - 1));
  }
}

}  // namespace fielddeform::solid::detail
