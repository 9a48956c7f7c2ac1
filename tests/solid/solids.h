#pragma once

#include <fielddeform/core/random.h>
#include <fielddeform/numeric/legendre.h>
#include <fielddeform/solid/bezier.h>

#include <Eigen/LU>

/// Solids for tests, and slow evaluations that share nothing with the library's.
namespace fielddeform::test {

using namespace solid;

inline Vec3 randomPoint(std::uint64_t seed, std::uint64_t i) {
  return {2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1};
}
inline std::vector<Vec3> cloud(std::uint64_t seed, std::size_t n) {
  std::vector<Vec3> out;
  for (std::size_t i = 0; i < n; ++i) out.push_back(randomPoint(seed, i));
  return out;
}

/// A box of evenly spaced control points, shaken.
inline LooseSolid boxSolid(const std::string& name, std::array<int, 3> degree, const Vec3& low = Vec3::Zero(), const Vec3& size = Vec3::Ones(), double shake = 0,
                           std::uint64_t seed = 1) {
  LooseSolid out{name, degree, {}};
  for (int k = 0; k <= degree[2]; ++k)
    for (int j = 0; j <= degree[1]; ++j)
      for (int i = 0; i <= degree[0]; ++i)
        out.points.push_back(low + size.cwiseProduct(Vec3(static_cast<double>(i) / degree[0], static_cast<double>(j) / degree[1], static_cast<double>(k) / degree[2]) +
                                                     shake * randomPoint(seed, out.points.size())));
  return out;
}
inline Object boxObject(std::array<int, 3> degree, double shake = 0, std::uint64_t seed = 1) {
  return makeObject({boxSolid("box", degree, Vec3::Zero(), Vec3::Ones(), shake, seed)}, {});
}

/// Three tricubic solids in a row along x, C1.
inline Object row(int degree = 3, int continuity = 1) {
  std::vector<LooseSolid> solids;
  for (int s = 0; s < 3; ++s) solids.push_back(boxSolid(std::string(1, static_cast<char>('a' + s)), {degree, degree, degree}, Vec3(s, 0, 0)));
  return makeObject(solids, {{{0, Side::U1}, {1, Side::U0}, continuity, 1}, {{1, Side::U1}, {2, Side::U0}, continuity, 1}});
}

/// Bernstein functions by binomials.
inline double bernsteinOf(int n, int i, double u) {
  return std::exp(std::lgamma(n + 1) - std::lgamma(i + 1) - std::lgamma(n - i + 1)) * std::pow(u, i) * std::pow(1 - u, n - i);
}
inline Vec3 slowPoint(const LooseSolid& s, const Vec3& u) {
  Vec3 out = Vec3::Zero();
  std::size_t at = 0;
  for (int k = 0; k <= s.degree[2]; ++k)
    for (int j = 0; j <= s.degree[1]; ++j)
      for (int i = 0; i <= s.degree[0]; ++i) out += bernsteinOf(s.degree[0], i, u.x()) * bernsteinOf(s.degree[1], j, u.y()) * bernsteinOf(s.degree[2], k, u.z()) * s.points[at++];
  return out;
}

/// The integral of f over the cube by n^3 Gauss points.
template <class F>
double overCube(int n, F&& f) {
  const auto rule = numeric::gaussLegendre(n);
  double sum = 0;
  for (std::size_t a = 0; a < rule.point.size(); ++a)
    for (std::size_t b = 0; b < rule.point.size(); ++b)
      for (std::size_t c = 0; c < rule.point.size(); ++c)
        sum += rule.weight[a] * rule.weight[b] * rule.weight[c] * f(Vec3(rule.point[a], rule.point[b], rule.point[c]));
  return sum;
}

}  // namespace fielddeform::test
