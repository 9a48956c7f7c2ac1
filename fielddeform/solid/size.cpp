#include <fielddeform/numeric/legendre.h>
#include <fielddeform/solid/bezier.h>
#include <fielddeform/solid/size.h>

#include <map>

namespace fielddeform::solid {
namespace {

/// Integrals of b'_a b_b b_c over [0, 1].
class TripleIntegrals {
 public:
  explicit TripleIntegrals(int degree) : n_(static_cast<std::size_t>(degree) + 1), value_(n_ * n_ * n_, 0.0) {
    const numeric::Quadrature rule = numeric::gaussLegendre((3 * degree + 1) / 2);  // the integrand has degree 3 n - 1
    std::array<double, kMaxDegree + 1> b, d;
    for (std::size_t q = 0; q < rule.point.size(); ++q) {
      bernstein(degree, rule.point[q], b.data(), d.data());
      for (std::size_t i = 0; i < n_; ++i)
        for (std::size_t j = 0; j < n_; ++j)
          for (std::size_t k = 0; k < n_; ++k) value_[(i * n_ + j) * n_ + k] += rule.weight[q] * d[i] * b[j] * b[k];
    }
  }
  double operator()(std::size_t derived, std::size_t b, std::size_t c) const { return value_[(derived * n_ + b) * n_ + c]; }

 private:
  std::size_t n_;
  std::vector<double> value_;
};

/// The solid's points about their mean: less rounding far from the origin. (Only the sum over the sides is free of translation.)
Vec3 centreOf(Points points, const std::vector<Index>& of) {
  Vec3 sum = Vec3::Zero();
  for (const Index i : of) sum += points[i];
  return sum / static_cast<double>(of.size());
}

void pick(Points points, const std::vector<Index>& of, const Vec3& centre, std::vector<Vec3>& out) {
  out.resize(of.size());
  for (std::size_t i = 0; i < of.size(); ++i) out[i] = points[of[i]] - centre;
}

}  // namespace

volume::CubicForm patchForm(int first, int second) {
  const TripleIntegrals s(first), t(second);
  const std::size_t m = static_cast<std::size_t>(first) + 1, nodes = m * (static_cast<std::size_t>(second) + 1);
  // F of node a, F_s of b, F_t of c.
  const auto integral = [&](std::size_t a, std::size_t b, std::size_t c) { return s(b % m, a % m, c % m) * t(c / m, a / m, b / m); };
  std::vector<double> unique;
  for (std::size_t i = 0; i < nodes; ++i)
    for (std::size_t j = i + 1; j < nodes; ++j)
      for (std::size_t k = j + 1; k < nodes; ++k)
        unique.push_back((integral(i, j, k) + integral(j, k, i) + integral(k, i, j) - integral(i, k, j) - integral(j, i, k) - integral(k, j, i)) / 3);
  return volume::CubicForm(nodes, unique);
}

Sizes::Sizes(const Object& object) {
  std::map<std::pair<int, int>, std::shared_ptr<const volume::CubicForm>> made;
  for (const Solid& solid : object.solids) {
    std::vector<Face> faces;
    for (int k = 0; k < 6; ++k) {
      const Layer layer = layerOf(solid, static_cast<Side>(k));
      auto& form = made[{layer.first, layer.second}];
      if (!form) form = std::make_shared<const volume::CubicForm>(patchForm(layer.first - 1, layer.second - 1));
      Face face;
      face.form = form;
      for (const std::size_t slot : layer.slots) face.points.push_back(solid.points[slot]);
      // (v, w), (u, w), (u, v) turn out of the sides u = 1, v = 0, w = 1.
      face.sign = (k % 2 == 1) == (k / 2 != 1) ? 1 : -1;
      faces.push_back(std::move(face));
    }
    solids_.push_back(std::move(faces));
  }
}

double Sizes::value(std::size_t solid, Points points) const {
  std::vector<Vec3> x;
  const Vec3 centre = centreOf(points, solids_[solid][0].points);
  double sum = 0;
  for (const Face& f : solids_[solid]) {
    pick(points, f.points, centre, x);
    sum += f.sign * f.form->value(x);
  }
  return sum;
}

double Sizes::addGradient(std::size_t solid, Points points, double weight, std::span<Vec3> gradient) const {
  std::vector<Vec3> x, g;
  const Vec3 centre = centreOf(points, solids_[solid][0].points);
  double sum = 0;
  for (const Face& f : solids_[solid]) {
    pick(points, f.points, centre, x);
    g.resize(x.size());
    sum += f.sign * f.form->gradient(x, g);
    for (std::size_t i = 0; i < g.size(); ++i) gradient[f.points[i]] += weight * f.sign * g[i];
  }
  return sum;
}

void Sizes::addHessianTimes(std::size_t solid, Points points, double weight, Points direction, std::span<Vec3> out) const {
  // The gradient is a quadratic form without lower terms: H(x) p = g(x + p / 2) - g(x - p / 2), exactly.
  std::vector<Vec3> x, p, plus, minus;
  const Vec3 centre = centreOf(points, solids_[solid][0].points);
  for (const Face& f : solids_[solid]) {
    pick(points, f.points, centre, x);
    pick(direction, f.points, Vec3::Zero(), p);
    plus.resize(x.size()), minus.resize(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += 0.5 * p[i];
    f.form->gradient(x, plus);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] -= p[i];
    f.form->gradient(x, minus);
    for (std::size_t i = 0; i < x.size(); ++i) out[f.points[i]] += weight * f.sign * (plus[i] - minus[i]);
  }
}

void Sizes::addHessian(std::size_t solid, Points points, double weight, Eigen::MatrixXd& h) const {
  std::vector<Vec3> x;
  const Vec3 centre = centreOf(points, solids_[solid][0].points);
  for (const Face& f : solids_[solid]) {
    pick(points, f.points, centre, x);
    f.form->addHessian(x, weight * f.sign, f.points, h);
  }
}

}  // namespace fielddeform::solid
