// The lattice of the pass and its quadratic energy.
#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/detail/local_lattice.h>

#include <algorithm>
#include <atomic>
#include <cmath>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kGrain = 8192;
constexpr double kPadding = 0.02, kCellOverLength = 1.25, kThinnest = 1e-3;
constexpr int kFewestCells = 3, kMostCells = 29;
constexpr int kStencil = 7, kStencilSize = kStencil * kStencil * kStencil;  // functions overlap three nodes away

int cellOf(double t, int cells) { return std::clamp(static_cast<int>(std::floor(t)), 0, cells - 1); }

void chooseCells(LocalLattice& out, const Vec3& extent, double length, const std::optional<std::array<int, 3>>& nodes) {
  const double longest = extent.maxCoeff();
  const double wanted = length > 0 ? std::ceil(longest / (kCellOverLength * length)) : kMostCells;
  const double h = longest / std::clamp(wanted, double{kFewestCells}, double{kMostCells});
  for (int k = 0; k < 3; ++k) {
    if (nodes) {
      out.cells[k] = (*nodes)[k] - 3;
      out.cell[k] = std::max(extent[k], kThinnest * longest) / out.cells[k];
    } else {
      out.cells[k] = std::clamp(static_cast<int>(std::ceil(extent[k] / h * (1 - 1e-12))), 1, kMostCells);
      out.cell[k] = h;
    }
  }
}

void findActive(LocalLattice& out, const LocalParts& parts) {
  const auto n = out.lattice.nodes();
  std::vector<std::uint8_t> occupied(static_cast<std::size_t>(out.cells[0]) * static_cast<std::size_t>(out.cells[1]) *
                                     static_cast<std::size_t>(out.cells[2]));
  const auto cellIndex = [&](int i, int j, int k) {
    return static_cast<std::size_t>(i) + static_cast<std::size_t>(out.cells[0]) *
           (static_cast<std::size_t>(j) + static_cast<std::size_t>(out.cells[1]) * static_cast<std::size_t>(k));
  };
  for (const LocalPart& part : parts.part)
    parallelFor(part.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        if (!(part.mask[v] > 0)) continue;
        int c[3];
        for (int k = 0; k < 3; ++k) c[k] = cellOf((part.base[v][k] - out.lattice.box.origin[k]) / out.cell[k], out.cells[k]);
        std::atomic_ref(occupied[cellIndex(c[0], c[1], c[2])]).store(1, std::memory_order_relaxed);
      }
    });
  std::vector<std::uint8_t> active(out.lattice.nodeCount(), 0);
  for (int k = 0; k < out.cells[2]; ++k)
    for (int j = 0; j < out.cells[1]; ++j)
      for (int i = 0; i < out.cells[0]; ++i) {
        if (!occupied[cellIndex(i, j, k)]) continue;
        for (int c = 0; c < 4; ++c)
          for (int b = 0; b < 4; ++b)
            for (int a = 0; a < 4; ++a)
              active[static_cast<std::size_t>(i + a) + static_cast<std::size_t>(n[0]) *
                     (static_cast<std::size_t>(j + b) + static_cast<std::size_t>(n[1]) * static_cast<std::size_t>(k + c))] = 1;
      }
  for (Index v = 0; v < active.size(); ++v)
    if (active[v]) out.active.push_back(v);
}

// A symmetric matrix over lattice nodes whose entries lie within three nodes along each axis.
class StencilMatrix {
 public:
  explicit StencilMatrix(const LocalLattice& lattice)
      : nodes_(lattice.lattice.nodes()), active_(lattice.active), own_(lattice.lattice.nodeCount(), kNoIndex),
        value_(lattice.active.size() * kStencilSize, 0.0) {
    for (Index i = 0; i < active_.size(); ++i) own_[active_[i]] = i;
  }
  Index own(int i, int j, int k) const {
    if (i < 0 || j < 0 || k < 0 || i >= nodes_[0] || j >= nodes_[1] || k >= nodes_[2]) return kNoIndex;
    return own_[index(i, j, k)];
  }
  // Row of active node `row`, column at the offset (di, dj, dk) from it.
  double& at(Index row, int di, int dj, int dk) {
    return value_[row * kStencilSize + static_cast<std::size_t>((di + 3) + kStencil * ((dj + 3) + kStencil * (dk + 3)))];
  }
  std::array<int, 3> place(Index row) const {
    const auto a = static_cast<int>(active_[row]);
    return {a % nodes_[0], a / nodes_[0] % nodes_[1], a / nodes_[0] / nodes_[1]};
  }
  // Adds weight v v^T for the row vector of given coefficients at nodes; nothing if one of them is not active.
  void addSquare(std::span<const std::array<int, 3>> node, std::span<const double> coefficient, double weight) {
    for (const auto& p : node)
      if (own(p[0], p[1], p[2]) == kNoIndex) return;
    for (std::size_t a = 0; a < node.size(); ++a)
      for (std::size_t b = 0; b < node.size(); ++b)
        at(own(node[a][0], node[a][1], node[a][2]), node[b][0] - node[a][0], node[b][1] - node[a][1], node[b][2] - node[a][2]) +=
            weight * coefficient[a] * coefficient[b];
  }
  SparseMatrix matrix() const {
    SparseMatrix out(static_cast<Eigen::Index>(active_.size()), static_cast<Eigen::Index>(active_.size()));
    std::vector<std::pair<Index, double>> column;
    for (Index c = 0; c < active_.size(); ++c) {
      out.startVec(c);
      const auto p = place(c);
      column.clear();
      std::size_t at = c * kStencilSize;
      for (int dk = -3; dk <= 3; ++dk)
        for (int dj = -3; dj <= 3; ++dj)
          for (int di = -3; di <= 3; ++di, ++at)
            if (value_[at] != 0) column.emplace_back(own(p[0] + di, p[1] + dj, p[2] + dk), value_[at]);
      for (const auto& [row, value] : column) out.insertBack(row, c) = value;  // the stencil's order is the nodes'
    }
    out.finalize();
    return out;
  }

 private:
  std::size_t index(int i, int j, int k) const {
    return static_cast<std::size_t>(i) + static_cast<std::size_t>(nodes_[0]) *
           (static_cast<std::size_t>(j) + static_cast<std::size_t>(nodes_[1]) * static_cast<std::size_t>(k));
  }
  std::array<int, 3> nodes_;
  const std::vector<Index>& active_;
  std::vector<Index> own_;
  std::vector<double> value_;
};

// Over one cell a product of two of its 64 functions is a polynomial of degree 6 along each axis, so that the moments
// sum w x^a y^b z^c of the cell's vertices, a, b, c <= 6, give all 64 x 64 sums exactly: 343 numbers a vertex instead of 4096.
constexpr int kMoments = 7, kMomentStride = 8, kPairs = 10;
using CellMoments = std::array<double, kMoments * kMoments * kMomentStride>;  // z, y, x; x padded to whole vectors
using CellProducts = std::array<double, kPairs * kPairs * kPairs>;

// Coefficients in t = 2 u - 1 of the products of two of a cell's four cubic B-splines, pairs i <= j row by row.
std::array<std::array<double, kMoments>, kPairs> pairPolynomials() {
  // 48 times the splines: (1 - t)^3, 3 t^3 - 3 t^2 - 15 t + 23, ..., (1 + t)^3.
  constexpr double kSpline[4][4] = {{1, -3, 3, -1}, {23, -15, -3, 3}, {23, 15, -3, -3}, {1, 3, 3, 1}};
  std::array<std::array<double, kMoments>, kPairs> out{};
  for (int i = 0, pair = 0; i < 4; ++i)
    for (int j = i; j < 4; ++j, ++pair)
      for (int a = 0; a < 4; ++a)
        for (int b = 0; b < 4; ++b) out[pair][a + b] += kSpline[i][a] * kSpline[j][b] / (48.0 * 48.0);
  return out;
}

int pairIndex(int i, int j) {
  const int low = std::min(i, j), high = std::max(i, j);
  return low * 4 - low * (low - 1) / 2 + high - low;
}

void addMoments(CellMoments& m, const Vec3& t, double weight) {
  double x[kMomentStride] = {}, y[kMoments], z[kMoments];
  x[0] = y[0] = 1, z[0] = weight;
  for (int a = 1; a < kMoments; ++a) x[a] = x[a - 1] * t.x(), y[a] = y[a - 1] * t.y(), z[a] = z[a - 1] * t.z();
  double* at = m.data();
  for (int c = 0; c < kMoments; ++c)
    for (int b = 0; b < kMoments; ++b, at += kMomentStride) {
      const double s = z[c] * y[b];
      for (int a = 0; a < kMomentStride; ++a) at[a] += s * x[a];
    }
}

CellProducts productsOf(const CellMoments& m) {
  static const auto kPair = pairPolynomials();
  std::array<double, kPairs * kMoments * kMoments> one{};  // pair x, b, c
  std::array<double, kPairs * kPairs * kMoments> two{};    // pair x, pair y, c
  CellProducts three{};
  for (int p = 0; p < kPairs; ++p)
    for (int c = 0; c < kMoments; ++c)
      for (int b = 0; b < kMoments; ++b)
        for (int a = 0; a < kMoments; ++a)
          one[(p * kMoments + b) * kMoments + c] += kPair[p][a] * m[(c * kMoments + b) * kMomentStride + a];
  for (int p = 0; p < kPairs; ++p)
    for (int q = 0; q < kPairs; ++q)
      for (int b = 0; b < kMoments; ++b)
        for (int c = 0; c < kMoments; ++c) two[(p * kPairs + q) * kMoments + c] += kPair[q][b] * one[(p * kMoments + b) * kMoments + c];
  for (int pq = 0; pq < kPairs * kPairs; ++pq)
    for (int r = 0; r < kPairs; ++r)
      for (int c = 0; c < kMoments; ++c) three[pq * kPairs + r] += kPair[r][c] * two[pq * kMoments + c];
  return three;
}

void addCell(StencilMatrix& m, const std::array<int, 3>& cell, const CellProducts& products) {
  Index own[64];
  for (int a = 0; a < 64; ++a) own[a] = m.own(cell[0] + a % 4, cell[1] + a / 4 % 4, cell[2] + a / 16);
  for (int a = 0; a < 64; ++a)
    for (int b = 0; b < 64; ++b)
      m.at(own[a], b % 4 - a % 4, b / 4 % 4 - a / 4 % 4, b / 16 - a / 16) +=
          products[(pairIndex(a % 4, b % 4) * kPairs + pairIndex(a / 4 % 4, b / 4 % 4)) * kPairs + pairIndex(a / 16, b / 16)];
}

// The moved vertices cell by cell, in their order.
class CellPoints {
 public:
  CellPoints(const LocalLattice& l, const LocalParts& parts) : lattice_(l), parts_(parts) {
    std::size_t count = 0;
    for (const LocalPart& part : parts.part) first_.push_back(count), count += part.size();
    const auto cellsX = static_cast<std::size_t>(l.cells[0]), cellsY = static_cast<std::size_t>(l.cells[1]);
    lists_ = makeIndexLists(cellsX * cellsY * static_cast<std::size_t>(l.cells[2]), count, [&](std::size_t begin, std::size_t end, auto&& put) {
      for (std::size_t p = partAt(begin); p < parts.part.size() && first_[p] < end; ++p) {
        const LocalPart& part = parts.part[p];
        for (std::size_t i = std::max(begin, first_[p]) - first_[p]; i < std::min(end - first_[p], part.size()); ++i) {
          if (!(part.mask[i] > 0)) continue;
          std::array<int, 3> c{};
          for (int k = 0; k < 3; ++k) c[k] = cellOf((part.base[i][k] - l.lattice.box.origin[k]) / l.cell[k], l.cells[k]);
          put(static_cast<Index>(static_cast<std::size_t>(c[0]) + cellsX * (static_cast<std::size_t>(c[1]) + cellsY * static_cast<std::size_t>(c[2]))),
              static_cast<Index>(first_[p] + i));
        }
      }
    });
    for (std::size_t i = 0; i + 1 < lists_.start.size(); ++i)
      if (!lists_[i].empty())
        cell_.push_back({static_cast<int>(i % cellsX), static_cast<int>(i / cellsX % cellsY), static_cast<int>(i / cellsX / cellsY)}), list_.push_back(i);
  }

  const std::vector<std::array<int, 3>>& cells() const noexcept { return cell_; }
  CellMoments moments(std::size_t cell) const {
    CellMoments out{};
    for (const Index point : lists_[list_[cell]]) {
      const std::size_t p = partAt(point), i = point - first_[p];
      const LocalPart& part = parts_.part[p];
      Vec3 t;
      for (int k = 0; k < 3; ++k) t[k] = 2 * ((part.base[i][k] - lattice_.lattice.box.origin[k]) / lattice_.cell[k] - cell_[cell][k]) - 1;
      addMoments(out, t, part.area[i] * part.mask[i] * part.mask[i]);
    }
    return out;
  }

 private:
  std::size_t partAt(std::size_t point) const {
    return first_.size() == 1 ? 0 : static_cast<std::size_t>(std::upper_bound(first_.begin(), first_.end(), point) - first_.begin()) - 1;
  }

  const LocalLattice& lattice_;
  const LocalParts& parts_;
  std::vector<std::size_t> first_;  // point of every part
  IndexLists lists_;                // points of every cell
  std::vector<std::array<int, 3>> cell_;  // those with points
  std::vector<std::size_t> list_;         // and their lists
};

Box boxOf(const LocalPart& part) {
  return deterministicReduce(
      part.size(), kGrain, Box(),
      [&](std::size_t begin, std::size_t end) {
        Box box;
        for (std::size_t i = begin; i < end; ++i)
          if (part.mask[i] > 0) box.extend(part.base[i]);
        return box;
      },
      [](const Box& a, const Box& b) { return Box(a).extend(b); });
}

}  // namespace

LocalLattice makeLattice(LocalParts& parts, double length, const std::optional<std::array<int, 3>>& nodes) {
  Box box;
  for (const LocalPart& part : parts.part) box.extend(boxOf(part));
  const Vec3 centre = box.center();
  const double longest = box.sizes().maxCoeff();
  LocalLattice out;
  chooseCells(out, box.sizes().array() + 2 * kPadding * longest, length, nodes);
  Vec3 edges;
  for (int k = 0; k < 3; ++k) {
    edges[k] = out.cells[k] * out.cell[k];
    out.lattice.axis[k] = map::AxisBasis::bspline(out.cells[k] + 3, 3, map::Border::Free);
  }
  out.lattice.box.origin = centre - 0.5 * edges;
  out.lattice.box.axes = edges.asDiagonal();
  findActive(out, parts);
  out.map = std::make_shared<const map::MaskedMap>(std::make_shared<const map::LatticeMap>(out.lattice), out.active);
  for (LocalPart& part : parts.part) part.binding = out.map->bindView(part.base, part.mask);
  return out;
}

SparseMatrix bendingMatrix(const LocalLattice& lattice) {
  StencilMatrix m(lattice);
  using Place = std::array<int, 3>;
  const auto shifted = [](Place p, int axis, int by) {
    p[static_cast<std::size_t>(axis)] += by;
    return p;
  };
  constexpr std::array<double, 3> kSecond{1, -2, 1};
  constexpr std::array<double, 4> kMixed{1, -1, -1, 1};
  for (Index r = 0; r < lattice.active.size(); ++r) {
    const Place p = m.place(r);
    for (int a = 0; a < 3; ++a) {
      m.addSquare(std::array<Place, 3>{shifted(p, a, -1), p, shifted(p, a, 1)}, kSecond, 1);
      for (int b = a + 1; b < 3; ++b)
        m.addSquare(std::array<Place, 4>{p, shifted(p, a, 1), shifted(p, b, 1), shifted(shifted(p, a, 1), b, 1)}, kMixed, 2);
    }
  }
  return m.matrix();
}

SparseMatrix surfaceMatrix(const LocalLattice& l, const LocalParts& parts) {
  constexpr std::size_t kBatch = 512;  // cells whose products are held at a time
  const CellPoints points(l, parts);
  StencilMatrix m(l);
  std::vector<CellProducts> products(std::min(kBatch, points.cells().size()));
  for (std::size_t first = 0; first < points.cells().size(); first += kBatch) {
    const std::size_t count = std::min(kBatch, points.cells().size() - first);
    parallelFor(count, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) products[i] = productsOf(points.moments(first + i));
    });
    for (std::size_t i = 0; i < count; ++i) addCell(m, points.cells()[first + i], products[i]);
  }
  return m.matrix();
}

double stiffness(const LocalLattice& lattice, double length, int power) {
  const double ratio = length / lattice.cell.maxCoeff();
  double x = 1 / static_cast<double>(lattice.active.size());
  for (int i = 0; i < power; ++i) x *= ratio;
  return x;
}

}  // namespace fielddeform::volume::detail
