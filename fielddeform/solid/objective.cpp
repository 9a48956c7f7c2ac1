#include <fielddeform/core/error.h>
#include <fielddeform/numeric/legendre.h>
#include <fielddeform/solid/bezier.h>
#include <fielddeform/solid/objective.h>

#include <stdexcept>

namespace fielddeform::solid {
namespace {

using Matrix = Eigen::MatrixXd;

/// Integrals of products of Bernstein functions, of their first and of their second derivatives.
struct Gram {
  Matrix value, first, second;

  explicit Gram(int n) : value(Matrix::Zero(n + 1, n + 1)), first(value), second(value) {
    const numeric::Quadrature rule = numeric::gaussLegendre(n + 1);
    std::array<double, kMaxDegree + 1> b{}, d{}, lower{}, lowerSlope{};
    for (std::size_t q = 0; q < rule.point.size(); ++q) {
      bernstein(n, rule.point[q], b.data(), d.data());
      if (n > 1) bernstein(n - 1, rule.point[q], lower.data(), lowerSlope.data());
      const auto curved = [&](int i) { return n > 1 ? n * ((i > 0 ? lowerSlope[static_cast<std::size_t>(i - 1)] : 0) - (i < n ? lowerSlope[static_cast<std::size_t>(i)] : 0)) : 0.0; };
      for (int i = 0; i <= n; ++i)
        for (int j = 0; j <= n; ++j) {
          value(i, j) += rule.weight[q] * b[static_cast<std::size_t>(i)] * b[static_cast<std::size_t>(j)];
          first(i, j) += rule.weight[q] * d[static_cast<std::size_t>(i)] * d[static_cast<std::size_t>(j)];
          second(i, j) += rule.weight[q] * curved(i) * curved(j);
        }
    }
  }
};

/// weight times the Kronecker product: slot (i, j, k) with u running fastest.
void addProduct(const Matrix& u, const Matrix& v, const Matrix& w, double weight, Matrix& out) {
  if (weight == 0) return;
  const Eigen::Index l = u.rows(), m = v.rows();
  for (Eigen::Index r = 0; r < out.rows(); ++r)
    for (Eigen::Index c = 0; c < out.cols(); ++c)
      out(r, c) += weight * u(r % l, c % l) * (v(r / l % m, c / l % m) * w(r / l / m, c / l / m));
}

}  // namespace

void Objective::validate() const {
  requireInRange("least_squares", leastSquares, 0, 1e12);
  requireInRange("stretch", stretch, 0, 1e12);
  requireInRange("twist", twist, 0, 1e12);
  requireInRange("bend", bend, 0, 1e12);
  if (leastSquares + stretch + twist + bend == 0) throw std::invalid_argument("objective: all weights are 0");
}

Matrix energyMatrix(const std::array<int, 3>& degree, const Objective& o) {
  const Gram u(degree[0]), v(degree[1]), w(degree[2]);
  const Eigen::Index n = u.value.rows() * v.value.rows() * w.value.rows();
  Matrix out = Matrix::Zero(n, n);
  addProduct(u.first, v.value, w.value, o.stretch, out);
  addProduct(u.value, v.first, w.value, o.stretch, out);
  addProduct(u.value, v.value, w.first, o.stretch, out);
  addProduct(u.first, v.first, w.value, o.twist, out);
  addProduct(u.first, v.value, w.first, o.twist, out);
  addProduct(u.value, v.first, w.first, o.twist, out);
  addProduct(u.second, v.value, w.value, o.bend, out);
  addProduct(u.value, v.second, w.value, o.bend, out);
  addProduct(u.value, v.value, w.second, o.bend, out);
  return out;
}

Matrix objectiveMatrix(const Object& object, const Objective& objective) {
  objective.validate();
  const auto n = static_cast<Eigen::Index>(object.points.size());
  Matrix h = objective.leastSquares * Matrix::Identity(n, n);
  for (const Solid& solid : object.solids) {
    const Matrix e = energyMatrix(solid.degree, objective);
    for (Eigen::Index r = 0; r < e.rows(); ++r)
      for (Eigen::Index c = 0; c < e.cols(); ++c)
        h(solid.points[static_cast<std::size_t>(r)], solid.points[static_cast<std::size_t>(c)]) += e(r, c);
  }
  return h;
}

}  // namespace fielddeform::solid
