#include <fielddeform/volume/energy.h>
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace fielddeform::volume {

void Energy::addHessian(Points d, double weight, std::span<const Index> rows, Eigen::MatrixXd& h) const {
  const SparseMatrix all = hessian(d);
  for (Eigen::Index j = 0; j < all.outerSize(); ++j) {
    const Index column = rows[static_cast<std::size_t>(j / 3)];
    if (column == kNoIndex) continue;
    for (SparseMatrix::InnerIterator it(all, j); it; ++it)
      if (const Index row = rows[static_cast<std::size_t>(it.row() / 3)]; row != kNoIndex)
        h(3 * static_cast<Eigen::Index>(row) + it.row() % 3, 3 * static_cast<Eigen::Index>(column) + j % 3) += weight * it.value();
  }
}

QuadraticEnergy::QuadraticEnergy(SparseMatrix matrix) : matrix_(std::move(matrix)) {
  if (matrix_.rows() != matrix_.cols())
    throw std::invalid_argument(fmt::format("matrix: {} by {}, expected a square one", matrix_.rows(), matrix_.cols()));
  matrix_.makeCompressed();
  double largest = 0;
  for (Eigen::Index k = 0; k < matrix_.nonZeros(); ++k) {
    if (!std::isfinite(matrix_.valuePtr()[k])) throw std::invalid_argument("matrix: an entry is not finite");
    largest = std::max(largest, std::abs(matrix_.valuePtr()[k]));
  }
  const SparseMatrix turned = matrix_.transpose();
  const SparseMatrix difference = matrix_ - turned;
  for (Eigen::Index k = 0; k < difference.nonZeros(); ++k)
    if (!(std::abs(difference.valuePtr()[k]) <= 1e-12 * largest)) throw std::invalid_argument("matrix: not symmetric");
}

double QuadraticEnergy::value(Points d) const {
  std::vector<Vec3> g(d.size());
  return gradient(d, g);
}

double QuadraticEnergy::gradient(Points d, std::span<Vec3> out) const {
  if (d.size() != nodeCount() || out.size() != nodeCount())
    throw std::invalid_argument(fmt::format("{} node displacements, expected {}", d.size(), nodeCount()));
  double sum = 0;
  for (Eigen::Index j = 0; j < matrix_.outerSize(); ++j) {
    Vec3 g = Vec3::Zero();
    for (SparseMatrix::InnerIterator it(matrix_, j); it; ++it) g += it.value() * d[static_cast<std::size_t>(it.row())];
    out[static_cast<std::size_t>(j)] = g;
    sum += 0.5 * g.dot(d[static_cast<std::size_t>(j)]);
  }
  return sum;
}

SparseMatrix QuadraticEnergy::hessian(Points) const {
  SparseMatrix out(3 * matrix_.rows(), 3 * matrix_.cols());
  Eigen::VectorXi count(out.cols());
  for (Eigen::Index j = 0; j < matrix_.outerSize(); ++j)
    count.segment<3>(3 * j).setConstant(matrix_.outerIndexPtr()[j + 1] - matrix_.outerIndexPtr()[j]);
  out.reserve(count);
  for (Eigen::Index j = 0; j < matrix_.outerSize(); ++j)
    for (Eigen::Index c = 0; c < 3; ++c)
      for (SparseMatrix::InnerIterator it(matrix_, j); it; ++it) out.insert(3 * it.row() + c, 3 * j + c) = it.value();
  out.makeCompressed();
  return out;
}

}  // namespace fielddeform::volume
