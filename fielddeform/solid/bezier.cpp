#include <fielddeform/solid/bezier.h>
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace fielddeform::solid {
namespace {

using Row = std::array<double, kMaxDegree + 1>;

}  // namespace

void bernstein(int degree, double u, double* value, double* slope) {
  const double t = std::clamp(u, 0.0, 1.0), s = 1 - t;
  value[0] = 1;
  for (int k = 1; k < degree; ++k) {  // degree - 1
    value[k] = t * value[k - 1];
    for (int i = k - 1; i > 0; --i) value[i] = s * value[i] + t * value[i - 1];
    value[0] *= s;
  }
  for (int i = 0; i <= degree; ++i) slope[i] = degree * ((i > 0 ? value[i - 1] : 0) - (i < degree ? value[i] : 0));
  value[degree] = t * value[degree - 1];
  for (int i = degree - 1; i > 0; --i) value[i] = s * value[i] + t * value[i - 1];
  value[0] *= s;
  if (u != t)
    for (int i = 0; i <= degree; ++i) value[i] += (u - t) * slope[i];
}

void weights(const std::array<int, 3>& degree, const Vec3& uvw, std::span<double> weight, std::span<Vec3> gradient) {
  std::array<Row, 3> b, d;
  for (std::size_t a = 0; a < 3; ++a) bernstein(degree[a], uvw[static_cast<Eigen::Index>(a)], b[a].data(), d[a].data());
  std::size_t at = 0;
  for (std::size_t k = 0; k <= static_cast<std::size_t>(degree[2]); ++k)
    for (std::size_t j = 0; j <= static_cast<std::size_t>(degree[1]); ++j)
      for (std::size_t i = 0; i <= static_cast<std::size_t>(degree[0]); ++i, ++at) {
        if (!weight.empty()) weight[at] = b[0][i] * (b[1][j] * b[2][k]);
        if (!gradient.empty()) gradient[at] = Vec3(d[0][i] * (b[1][j] * b[2][k]), b[0][i] * (d[1][j] * b[2][k]), b[0][i] * (b[1][j] * d[2][k]));
      }
}

Vec3 evaluate(const std::array<int, 3>& degree, Points points, const Vec3& uvw) {
  std::vector<double> w(points.size());
  weights(degree, uvw, w);
  Vec3 sum = Vec3::Zero();
  for (std::size_t s = 0; s < w.size(); ++s) sum += w[s] * points[s];
  return sum;
}

Mat3 derivative(const std::array<int, 3>& degree, Points points, const Vec3& uvw) {
  std::vector<Vec3> g(points.size());
  weights(degree, uvw, {}, g);
  Mat3 sum = Mat3::Zero();
  for (std::size_t s = 0; s < g.size(); ++s) sum += points[s] * g[s].transpose();
  return sum;
}

Vec3 evaluate(const Object& object, std::size_t solid, const Vec3& uvw) { return evaluate(object.solids[solid].degree, object.pointsOf(solid), uvw); }
Mat3 derivative(const Object& object, std::size_t solid, const Vec3& uvw) { return derivative(object.solids[solid].degree, object.pointsOf(solid), uvw); }

LooseSolid elevated(const LooseSolid& solid, std::size_t axis) {
  if (axis > 2) throw std::invalid_argument("axis: expected 0 to 2");
  LooseSolid out = solid;
  if (++out.degree[axis] > kMaxDegree) throw std::invalid_argument(fmt::format("degree: {}, at most {}", out.degree[axis], kMaxDegree));
  out.points.clear();
  const Solid from{{}, solid.degree, {}};
  if (solid.points.size() != from.slots()) throw std::invalid_argument("points: their number does not fit the degrees");
  const int n = out.degree[axis];
  for (int k = 0; k <= out.degree[2]; ++k)
    for (int j = 0; j <= out.degree[1]; ++j)
      for (int i = 0; i <= out.degree[0]; ++i) {
        std::array<int, 3> at{i, j, k};
        const int r = at[axis];
        const double a = static_cast<double>(r) / n;
        Vec3 p = Vec3::Zero();
        if (r < n) p += (1 - a) * solid.points[from.slot(at[0], at[1], at[2])];
        if (r > 0) {
          --at[axis];
          p += a * solid.points[from.slot(at[0], at[1], at[2])];
        }
        out.points.push_back(p);
      }
  return out;
}

std::vector<std::pair<std::size_t, double>> coonsWeights(const std::array<int, 3>& degree, const std::array<int, 3>& ijk) {
  const Solid solid{{}, degree, {}};
  for (std::size_t a = 0; a < 3; ++a)
    if (ijk[a] <= 0 || ijk[a] >= degree[a]) throw std::invalid_argument("coons: the point is not inside");
  // P = 1 - (1 - L_u)(1 - L_v)(1 - L_w), L_a the linear interpolation between the two ends along axis a.
  std::vector<std::pair<std::size_t, double>> out;
  for (int mask = 1; mask < 8; ++mask) {
    const int axes = (mask & 1) + (mask >> 1 & 1) + (mask >> 2 & 1);
    for (int ends = 0; ends < 8; ++ends) {
      if ((ends & ~mask) != 0) continue;
      std::array<int, 3> at = ijk;
      double w = axes % 2 ? 1 : -1;
      for (std::size_t a = 0; a < 3; ++a) {
        if (!(mask >> a & 1)) continue;
        const double share = static_cast<double>(ijk[a]) / degree[a];
        at[a] = ends >> a & 1 ? degree[a] : 0;
        w *= ends >> a & 1 ? share : 1 - share;
      }
      out.emplace_back(solid.slot(at[0], at[1], at[2]), w);
    }
  }
  return out;
}

std::vector<std::array<int, 3>> innerPoints(const std::array<int, 3>& degree) {
  std::vector<std::array<int, 3>> out;
  for (int k = 1; k < degree[2]; ++k)
    for (int j = 1; j < degree[1]; ++j)
      for (int i = 1; i < degree[0]; ++i) out.push_back({i, j, k});
  return out;
}

void fillInner(Object& object) {
  for (const Solid& solid : object.solids)
    for (const auto& at : innerPoints(solid.degree)) {
      Vec3 p = Vec3::Zero();
      for (const auto& [slot, w] : coonsWeights(solid.degree, at)) p += w * object.points[solid.points[slot]];
      object.points[solid.points[solid.slot(at[0], at[1], at[2])]] = p;
    }
}

}  // namespace fielddeform::solid
