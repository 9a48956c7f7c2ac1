#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/cubic_form.h>
#include <fielddeform/volume/detail/lanes.h>
#include <fielddeform/volume/detail/wedge_plan.h>
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace fielddeform::volume {
namespace {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
constexpr std::size_t kMaxNodes = 400;   // 64 million numbers, 500 MB: far beyond where the form is worth while
constexpr std::size_t kBlock = 32;       // owners of one matrix product: their products stay in the nearest caches
constexpr std::size_t kChunk = 32 * kBlock;

void checkNodes(std::size_t nodes) {
  if (nodes < 3 || nodes > kMaxNodes) throw std::invalid_argument(fmt::format("nodes is {}, expected 3 to {}", nodes, kMaxNodes));
}

/// Place of the pair (i, j), i < j, among the pairs in lexicographic order.
std::size_t pairIndex(std::size_t n, std::size_t i, std::size_t j) { return i * (2 * n - i - 1) / 2 + (j - i - 1); }

/// Adds the owners begin .. end of a plan to sums(i, jk) = sum_v basis(v, i) (sum b ^ c)_jk, stride by width.
void addOwners(const detail::WedgeLayout& layout, const detail::WedgePlan& plan, const double* rows, std::size_t begin, std::size_t end, std::vector<double>& sums) {
  std::vector<double> products(kBlock * layout.width);
  for (std::size_t first = begin; first < end; first += kBlock) {
    const std::size_t last = std::min(end, first + kBlock);
    detail::wedgeRows(layout, plan, rows, first, last, products.data());
    detail::addOuter(layout, rows, plan.owner.data() + first, products.data(), last - first, sums.data());
  }
}

}  // namespace

CubicForm::CubicForm(std::size_t nodes, const std::vector<double>& unique) : nodes_(nodes), stride_(detail::padded(nodes)) {
  checkNodes(nodes);
  if (unique.size() != nodes * (nodes - 1) * (nodes - 2) / 6)
    throw std::invalid_argument(fmt::format("{} coefficients for {} nodes", unique.size(), nodes));
  rows_.assign(nodes * (nodes - 1) / 2 * stride_, 0.0);
  std::size_t next = 0;
  for (std::size_t i = 0; i < nodes; ++i)
    for (std::size_t j = i + 1; j < nodes; ++j)
      for (std::size_t k = j + 1; k < nodes; ++k) {
        const double c = unique[next++];
        rows_[pairIndex(nodes, i, j) * stride_ + k] = c;
        rows_[pairIndex(nodes, i, k) * stride_ + j] = -c;
        rows_[pairIndex(nodes, j, k) * stride_ + i] = c;
      }
}

CubicForm CubicForm::ofMesh(const Eigen::Ref<const RowMatrix>& basis, std::span<const Index> triangles) {
  const auto vertices = static_cast<std::size_t>(basis.rows());
  for (const Index v : triangles)
    if (v >= vertices) throw std::invalid_argument(fmt::format("triangles: vertex {} of {}", v, vertices));
  const auto nodes = static_cast<std::size_t>(basis.cols());
  checkNodes(nodes);
  RowMatrix rows = RowMatrix::Zero(basis.rows(), static_cast<Eigen::Index>(detail::padded(nodes)));
  rows.leftCols(basis.cols()) = basis;
  return ofPlan(detail::WedgePlan(vertices, triangles), rows.data(), nodes);
}

CubicForm CubicForm::ofPlan(const detail::WedgePlan& plan, const double* rows, std::size_t n) {
  checkNodes(n);
  const detail::WedgeLayout layout(n);
  std::vector<double> sum = deterministicReduce(
      plan.owner.size(), kChunk, std::vector<double>(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<double> part(layout.stride * layout.width, 0.0);
        addOwners(layout, plan, rows, begin, end, part);
        return part;
      },
      [](std::vector<double> a, const std::vector<double>& b) {
        if (a.empty()) return b;
        for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
        return a;
      });
  sum.resize(layout.stride * layout.width, 0.0);
  // C_ijk = 1/6 sum_v det of columns i, j, k of (v; b; c), along v's row.
  const auto m = [&](std::size_t i, std::size_t j, std::size_t k) { return sum[i * layout.width + layout.at(j, k)]; };
  std::vector<double> unique;
  unique.reserve(n * (n - 1) * (n - 2) / 6);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j)
      for (std::size_t k = j + 1; k < n; ++k) unique.push_back((m(i, j, k) - m(j, i, k) + m(k, i, j)) / 6);
  return CubicForm(n, unique);
}

double CubicForm::coefficient(std::size_t i, std::size_t j, std::size_t k) const {
  if (std::max({i, j, k}) >= nodes_) throw std::invalid_argument("coefficient: a node is out of range");
  if (i == j) return 0;
  return i < j ? rows_[pairIndex(nodes_, i, j) * stride_ + k] : -rows_[pairIndex(nodes_, j, i) * stride_ + k];
}

std::vector<double> CubicForm::unique() const {
  std::vector<double> out;
  for (std::size_t i = 0; i < nodes_; ++i)
    for (std::size_t j = i + 1; j < nodes_; ++j)
      for (std::size_t k = j + 1; k < nodes_; ++k) out.push_back(rows_[pairIndex(nodes_, i, j) * stride_ + k]);
  return out;
}

void CubicForm::contract(Points x, std::vector<Vec3>& s) const {
  if (x.size() != nodes_) throw std::invalid_argument(fmt::format("{} nodes, expected {}", x.size(), nodes_));
  std::vector<double> columns(3 * stride_, 0.0);
  for (std::size_t i = 0; i < nodes_; ++i)
    for (std::size_t c = 0; c < 3; ++c) columns[c * stride_ + i] = x[i][static_cast<Eigen::Index>(c)];
  const std::size_t pairs = nodes_ * (nodes_ - 1) / 2;
  s.resize(pairs);
  detail::dot3Rows(rows_.data(), stride_, pairs, columns.data(), nullptr, s.data());
}

double CubicForm::value(Points x) const {
  std::vector<Vec3> g(nodes_);
  return gradient(x, g);
}

double CubicForm::gradient(Points x, std::span<Vec3> out) const {
  if (out.size() != nodes_) throw std::invalid_argument(fmt::format("{} gradients, expected {}", out.size(), nodes_));
  std::vector<Vec3> s;
  contract(x, s);
  for (Vec3& g : out) g.setZero();
  const Vec3* next = s.data();
  for (std::size_t i = 0; i < nodes_; ++i) {
    Vec3 own = Vec3::Zero();
    const Vec3 xi = x[i];
    for (std::size_t j = i + 1; j < nodes_; ++j, ++next) {
      const Vec3& sij = *next;
      own += x[j].cross(sij);
      out[j] += sij.cross(xi);
    }
    out[i] += own;
  }
  double sum = 0;
  for (std::size_t i = 0; i < nodes_; ++i) {
    out[i] *= 0.5;
    sum += out[i].dot(x[i]);
  }
  return sum / 3;
}

void CubicForm::addHessian(Points x, double weight, std::span<const Index> rows, Eigen::MatrixXd& h) const {
  if (rows.size() != nodes_) throw std::invalid_argument(fmt::format("{} rows, expected {}", rows.size(), nodes_));
  std::vector<Vec3> s;
  contract(x, s);
  const Vec3* next = s.data();
  for (std::size_t i = 0; i < nodes_; ++i)
    for (std::size_t j = i + 1; j < nodes_; ++j, ++next) {
      if (rows[i] == kNoIndex || rows[j] == kNoIndex) continue;
      const Eigen::Index a = 3 * static_cast<Eigen::Index>(rows[i]), b = 3 * static_cast<Eigen::Index>(rows[j]);
      const double u = weight * next->x(), v = weight * next->y(), w = weight * next->z();
      // -[S]_x at (i, j), its transpose at (j, i)
      h(a, b + 1) += w, h(a, b + 2) -= v, h(a + 1, b) -= w, h(a + 1, b + 2) += u, h(a + 2, b) += v, h(a + 2, b + 1) -= u;
      h(b + 1, a) += w, h(b + 2, a) -= v, h(b, a + 1) -= w, h(b + 2, a + 1) += u, h(b, a + 2) += v, h(b + 1, a + 2) -= u;
    }
}

}  // namespace fielddeform::volume
