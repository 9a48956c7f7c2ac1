#include <fielddeform/core/error.h>
#include <fielddeform/volume/energy.h>
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace fielddeform::volume {
namespace {

/// Half of the neighbours' steps: each spring is made once.
std::vector<std::array<int, 3>> steps(Springs kind) {
  std::vector<std::array<int, 3>> out;
  for (int k = 0; k <= 1; ++k)
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        if (std::array{k, j, i} <= std::array{0, 0, 0}) continue;
        const int length = std::abs(i) + std::abs(j) + std::abs(k);
        const bool sameSign = i >= 0 && j >= 0 && k >= 0;  // Kuhn: edges of the simplices along the main diagonal
        if (kind == Springs::All || (kind == Springs::AxesAndDiagonals && length != 2) || (kind == Springs::Kuhn && sameSign))
          out.push_back({i, j, k});
      }
  return out;
}

std::vector<SpringNetwork::Spring> gridSprings(const std::array<int, 3>& n, Points rest, Springs kind) {
  for (int a = 0; a < 3; ++a)
    if (n[a] < 1) throw std::invalid_argument(fmt::format("nodes is {} along axis {}, expected at least 1", n[a], a));
  const auto at = [&](int i, int j, int k) {
    return static_cast<std::size_t>(i) + static_cast<std::size_t>(n[0]) * (static_cast<std::size_t>(j) + static_cast<std::size_t>(n[1]) * static_cast<std::size_t>(k));
  };
  if (rest.size() != at(0, 0, n[2])) throw std::invalid_argument(fmt::format("rest: {} nodes, expected {}", rest.size(), at(0, 0, n[2])));
  if (rest.size() < 2) throw std::invalid_argument("a spring network needs at least two nodes");
  const auto around = steps(kind);
  std::vector<SpringNetwork::Spring> out;
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i)
        for (const auto& s : around) {
          const int a = i + s[0], b = j + s[1], c = k + s[2];
          if (a < 0 || b < 0 || c < 0 || a >= n[0] || b >= n[1] || c >= n[2]) continue;
          const std::size_t p = at(i, j, k), q = at(a, b, c);
          out.push_back({static_cast<Index>(p), static_cast<Index>(q), (rest[q] - rest[p]).norm(), 1});
        }
  return out;
}

void checkSize(std::size_t given, std::size_t expected) {
  if (given != expected) throw std::invalid_argument(fmt::format("{} node displacements, expected {}", given, expected));
}

}  // namespace

std::string_view toString(Springs springs) noexcept {
  switch (springs) {
    case Springs::AxesAndDiagonals: return "6+8";
    case Springs::Kuhn: return "14";
    case Springs::All: return "26";
  }
  return "";
}

SpringNetwork::SpringNetwork(const std::array<int, 3>& nodes, Points rest, Springs springs)
    : SpringNetwork({rest.begin(), rest.end()}, gridSprings(nodes, rest, springs)) {}

SpringNetwork::SpringNetwork(std::vector<Vec3> rest, std::vector<Spring> springs) : rest_(std::move(rest)), springs_(std::move(springs)) {
  for (const Vec3& p : rest_)
    if (!p.allFinite()) throw std::invalid_argument("rest: a node is not finite");
  for (const Spring& s : springs_) {
    if (s.start >= rest_.size() || s.end >= rest_.size() || s.start == s.end)
      throw std::invalid_argument(fmt::format("spring between nodes {} and {} of {}", s.start, s.end, rest_.size()));
    if (!(s.length >= 0) || !std::isfinite(s.length)) throw std::invalid_argument("a spring's length is negative or not finite");
    requirePositive("stiffness", s.stiffness);
  }
}

double SpringNetwork::value(Points d) const {
  checkSize(d.size(), rest_.size());
  double sum = 0;
  for (const Spring& s : springs_) {
    const Vec3 e = (rest_[s.end] - rest_[s.start]) + (d[s.end] - d[s.start]);
    const double stretch = e.norm() - s.length;
    sum += 0.5 * s.stiffness * stretch * stretch;
  }
  return sum;
}

double SpringNetwork::gradient(Points d, std::span<Vec3> out) const {
  checkSize(d.size(), rest_.size());
  checkSize(out.size(), rest_.size());
  for (Vec3& g : out) g.setZero();
  double sum = 0;
  for (const Spring& s : springs_) {
    const Vec3 e = (rest_[s.end] - rest_[s.start]) + (d[s.end] - d[s.start]);
    const double length = e.norm(), stretch = length - s.length;
    sum += 0.5 * s.stiffness * stretch * stretch;
    if (!(length > 0)) continue;  // the energy has a kink there: no direction
    const Vec3 f = (s.stiffness * stretch / length) * e;
    out[s.end] += f, out[s.start] -= f;
  }
  return sum;
}

template <class Add>
void SpringNetwork::eachBlock(Points d, Add&& add) const {
  checkSize(d.size(), rest_.size());
  for (const Spring& s : springs_) {
    const Vec3 e = (rest_[s.end] - rest_[s.start]) + (d[s.end] - d[s.start]);
    const double length = e.norm();
    if (!(length > 0)) continue;
    const Vec3 u = e / length;
    const double across = 1 - s.length / length;
    add(s, Mat3(s.stiffness * (across * Mat3::Identity() + (1 - across) * u * u.transpose())));
  }
}

SparseMatrix SpringNetwork::hessian(Points d) const {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(springs_.size() * 36);
  eachBlock(d, [&](const Spring& s, const Mat3& block) {
    const int a = static_cast<int>(3 * s.start), b = static_cast<int>(3 * s.end);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        const double h = block(r, c);
        entries.emplace_back(a + r, a + c, h), entries.emplace_back(b + r, b + c, h);
        entries.emplace_back(a + r, b + c, -h), entries.emplace_back(b + r, a + c, -h);
      }
  });
  const auto size = static_cast<Eigen::Index>(3 * rest_.size());
  SparseMatrix out(size, size);
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

void SpringNetwork::addHessian(Points d, double weight, std::span<const Index> rows, Eigen::MatrixXd& h) const {
  checkSize(rows.size(), rest_.size());
  eachBlock(d, [&](const Spring& s, const Mat3& block) {
    const Index a = rows[s.start], b = rows[s.end];
    const auto at = [](Index row) { return 3 * static_cast<Eigen::Index>(row); };
    if (a != kNoIndex) h.block<3, 3>(at(a), at(a)) += weight * block;
    if (b != kNoIndex) h.block<3, 3>(at(b), at(b)) += weight * block;
    if (a == kNoIndex || b == kNoIndex) return;
    h.block<3, 3>(at(a), at(b)) -= weight * block;
    h.block<3, 3>(at(b), at(a)) -= weight * block;
  });
}

}  // namespace fielddeform::volume
