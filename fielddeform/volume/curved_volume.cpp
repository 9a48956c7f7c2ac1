#include <Eigen/LU>
#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/legendre.h>
#include <fielddeform/volume/curved_volume.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::volume {
namespace {

using Degrees = std::array<std::size_t, 3>;  // moments per axis: 3l, 3m, 3n

std::size_t product(const Degrees& n) { return n[0] * n[1] * n[2]; }

std::vector<Vec3> boxPoints(const map::LatticeBox& box, Points positions, std::span<const Index> triangles) {
  const Mat3 toBox = box.axes.inverse();
  std::vector<Vec3> u(positions.size());
  for (std::size_t v = 0; v < u.size(); ++v) u[v] = toBox * (positions[v] - box.origin);
  for (const Index v : triangles)
    if (!((u[v].array() >= -1e-9).all() && (u[v].array() <= 1 + 1e-9).all()))
      throw std::invalid_argument(fmt::format("positions: vertex {} lies outside the lattice's box", v));
  return u;
}

/// Gauss points along each direction of a triangle: all that the degree asks for where triangles are few and large.
int pointsPerTriangle(std::size_t triangles, const Degrees& n) {
  const int all = static_cast<int>((n[0] + n[1] + n[2]) / 2 + 1);
  return std::min(all, triangles < 100 ? all : triangles < 2000 ? 7 : triangles < 16000 ? 4 : 3);
}

/// Moments integral of P_a(u) P_b(v) P_c(w), c running fastest: by the divergence theorem along u, of the antiderivative of P_a
/// over the triangles, with Gauss points collapsed into one corner.
std::vector<double> moments(const std::vector<Vec3>& u, std::span<const Index> triangles, const Degrees& n) {
  const std::size_t count = triangles.size() / 3;
  const auto rule = numeric::gaussLegendre(pointsPerTriangle(count, n));
  return deterministicReduce(
      count, 256, std::vector<double>(product(n), 0.0),
      [&](std::size_t begin, std::size_t end) {
        std::vector<double> sum(product(n), 0.0), pa(n[0]), pb(n[1]), pc(n[2]);
        for (std::size_t t = begin; t < end; ++t) {
          const Vec3 &a = u[triangles[3 * t]], ab = u[triangles[3 * t + 1]] - a, ac = u[triangles[3 * t + 2]] - a;
          const double area = ab.y() * ac.z() - ab.z() * ac.y();  // twice the projection along u
          for (std::size_t i = 0; i < rule.point.size(); ++i)
            for (std::size_t j = 0; j < rule.point.size(); ++j) {
              const double s = rule.point[i], r = rule.point[j] * (1 - s);
              const Vec3 p = a + s * ab + r * ac;
              numeric::shiftedLegendreIntegrals(p.x(), pa);
              numeric::shiftedLegendre(p.y(), pb);
              numeric::shiftedLegendre(p.z(), pc);
              const double weight = area * (1 - s) * rule.weight[i] * rule.weight[j];
              double* out = sum.data();
              for (std::size_t x = 0; x < n[0]; ++x)
                for (std::size_t y = 0; y < n[1]; ++y, out += n[2]) {
                  const double f = weight * pa[x] * pb[y];
                  for (std::size_t z = 0; z < n[2]; ++z) out[z] += f * pc[z];
                }
            }
        }
        return sum;
      },
      [](std::vector<double> a, const std::vector<double>& b) {
        for (std::size_t k = 0; k < a.size(); ++k) a[k] += b[k];
        return a;
      });
}

/// Weights of the tensor Gauss points such that they integrate over Omega what the moments determine: w_q times the indicator's
/// projection onto the polynomials.
std::vector<double> fittedWeights(const std::vector<double>& moment, const Degrees& n, const std::array<numeric::Quadrature, 3>& rule) {
  // One axis after the other: values at the points instead of coefficients.
  std::vector<double> now = moment;
  Degrees size = n;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> basis(n[axis]), next(now.size(), 0.0);
    const std::size_t inner = axis == 2 ? 1 : axis == 1 ? size[2] : size[1] * size[2], outer = now.size() / (inner * size[axis]);
    for (std::size_t q = 0; q < n[axis]; ++q) {
      numeric::shiftedLegendre(rule[axis].point[q], basis);
      for (std::size_t k = 0; k < n[axis]; ++k) {
        const double f = rule[axis].weight[q] * (2 * static_cast<double>(k) + 1) * basis[k];
        for (std::size_t o = 0; o < outer; ++o)
          for (std::size_t i = 0; i < inner; ++i) next[(o * size[axis] + q) * inner + i] += f * now[(o * size[axis] + k) * inner + i];
      }
    }
    now = std::move(next);
  }
  return now;
}

/// Gradients of all nodes' functions at a point, by lattice coordinates.
void gradients(const map::Lattice& lattice, const Vec3& u, std::vector<Vec3>& out) {
  map::AxisBasis::Values v[3];
  for (std::size_t a = 0; a < 3; ++a) v[a] = lattice.axis[a].evaluate(u[static_cast<Eigen::Index>(a)]);
  std::size_t at = 0;
  for (std::size_t k = 0; k < v[2].weight.size(); ++k)
    for (std::size_t j = 0; j < v[1].weight.size(); ++j)
      for (std::size_t i = 0; i < v[0].weight.size(); ++i)
        out[at++] = Vec3(v[0].slope[i] * v[1].weight[j] * v[2].weight[k], v[0].weight[i] * v[1].slope[j] * v[2].weight[k],
                         v[0].weight[i] * v[1].weight[j] * v[2].slope[k]);
}

}  // namespace

CubicForm curvedForm(const map::Lattice& lattice, Points positions, std::span<const Index> triangles) {
  lattice.validate();
  Degrees n{};
  std::array<numeric::Quadrature, 3> rule;
  for (std::size_t a = 0; a < 3; ++a) {
    if (lattice.axis[a].kind() != map::BasisKind::Bernstein) throw std::invalid_argument("lattice: only Bernstein axes have a smooth form");
    n[a] = 3 * static_cast<std::size_t>(lattice.axis[a].degree());
    rule[a] = numeric::gaussLegendre(static_cast<int>(n[a]));
  }
  const std::vector<double> weight = fittedWeights(moments(boxPoints(lattice.box, positions, triangles), triangles, n), n, rule);
  const std::size_t nodes = lattice.nodeCount(), unique = nodes * (nodes - 1) * (nodes - 2) / 6;
  const std::vector<double> c = deterministicReduce(
      product(n), 32, std::vector<double>(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<double> sum(unique, 0.0);
        std::vector<Vec3> g(nodes);
        for (std::size_t q = begin; q < end; ++q) {
          const Vec3 u(rule[0].point[q / (n[1] * n[2])], rule[1].point[q / n[2] % n[1]], rule[2].point[q % n[2]]);
          gradients(lattice, u, g);
          double* out = sum.data();
          for (std::size_t i = 0; i < nodes; ++i)
            for (std::size_t j = i + 1; j < nodes; ++j) {
              const Vec3 pair = weight[q] * g[i].cross(g[j]);
              for (std::size_t k = j + 1; k < nodes; ++k) *out++ += pair.dot(g[k]);
            }
        }
        return sum;
      },
      [](std::vector<double> a, const std::vector<double>& b) {
        if (a.empty()) return b;
        for (std::size_t k = 0; k < a.size(); ++k) a[k] += b[k];
        return a;
      });
  return CubicForm(nodes, c);
}

}  // namespace fielddeform::volume
