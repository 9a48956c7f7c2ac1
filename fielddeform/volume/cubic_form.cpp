#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/cubic_form.h>
#include <fielddeform/volume/detail/lanes.h>
#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace fielddeform::volume {
namespace {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
constexpr std::size_t kMaxNodes = 400;   // 64 million numbers, 500 MB: far beyond where the form is worth while
constexpr std::size_t kBlock = 64;       // vertices of one matrix product
constexpr std::size_t kChunk = 16 * kBlock;

/// Place of the pair (i, j), i < j, among the pairs in lexicographic order.
std::size_t pairIndex(std::size_t n, std::size_t i, std::size_t j) { return i * (2 * n - i - 1) / 2 + (j - i - 1); }

struct Rings {
  std::vector<std::size_t> start;
  std::vector<std::array<Index, 2>> ends;

  Rings(std::size_t vertices, std::span<const Index> triangles) : start(vertices + 1, 0), ends(triangles.size()) {
    for (const Index v : triangles) ++start[v + 1];
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<std::size_t> place(start.begin(), start.end() - 1);
    for (std::size_t c = 0; c < triangles.size(); ++c) {
      const std::size_t t = c / 3 * 3, k = c - t;
      ends[place[triangles[c]]++] = {triangles[t + (k + 1) % 3], triangles[t + (k + 2) % 3]};
    }
  }
};

}  // namespace

CubicForm::CubicForm(std::size_t nodes, const std::vector<double>& unique) : nodes_(nodes), stride_(detail::padded(nodes)) {
  if (nodes < 3 || nodes > kMaxNodes) throw std::invalid_argument(fmt::format("nodes is {}, expected 3 to {}", nodes, kMaxNodes));
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
  const auto n = static_cast<std::size_t>(basis.cols()), vertices = static_cast<std::size_t>(basis.rows());
  if (n < 3 || n > kMaxNodes) throw std::invalid_argument(fmt::format("nodes is {}, expected 3 to {}", n, kMaxNodes));
  for (const Index v : triangles)
    if (v >= vertices) throw std::invalid_argument(fmt::format("triangles: vertex {} of {}", v, vertices));
  const std::size_t pairs = n * (n - 1) / 2;
  const Rings rings(vertices, triangles);
  // C_i,jk = 1/6 sum_v basis(v, i) (sum over v's corners of basis(b) ^ basis(c))_jk; only i < j < k is needed, so rows i .. i+3
  // take the pairs from (i + 1, i + 2) on.
  const Eigen::Index rows = static_cast<Eigen::Index>(n), columns = static_cast<Eigen::Index>(pairs);
  const RowMatrix zero = RowMatrix::Zero(rows, columns);
  const RowMatrix sum = deterministicReduce(
      vertices, kChunk, RowMatrix(),
      [&](std::size_t begin, std::size_t end) {
        RowMatrix part = zero, wedge(static_cast<Eigen::Index>(kBlock), columns);
        for (std::size_t first = begin; first < end; first += kBlock) {
          const std::size_t count = std::min(kBlock, end - first);
          wedge.setZero();
          for (std::size_t v = 0; v < count; ++v)
            for (std::size_t c = rings.start[first + v]; c < rings.start[first + v + 1]; ++c)
              detail::addWedge(basis.row(static_cast<Eigen::Index>(rings.ends[c][0])).data(), basis.row(static_cast<Eigen::Index>(rings.ends[c][1])).data(),
                       n, wedge.row(static_cast<Eigen::Index>(v)).data());
          const auto phi = basis.middleRows(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(count));
          for (std::size_t i = 0; i + 2 < n; i += 4) {
            const auto height = static_cast<Eigen::Index>(std::min<std::size_t>(4, n - i));
            const auto from = static_cast<Eigen::Index>(pairIndex(n, i + 1, i + 2));
            part.block(static_cast<Eigen::Index>(i), from, height, columns - from).noalias() +=
                phi.middleCols(static_cast<Eigen::Index>(i), height).transpose() *
                wedge.topRows(static_cast<Eigen::Index>(count)).rightCols(columns - from);
          }
        }
        return part;
      },
      [](const RowMatrix& a, const RowMatrix& b) { return a.size() == 0 ? b : RowMatrix(a + b); });
  std::vector<double> unique;
  unique.reserve(n * (n - 1) * (n - 2) / 6);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t p = pairIndex(n, i + 1, i + 2); i + 2 < n && p < pairs; ++p)
      unique.push_back(sum.size() ? sum(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(p)) / 6 : 0);
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
  detail::dot3Rows(rows_.data(), stride_, pairs, columns.data(), s.data());
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
