// The lattice of the pass and its quadratic energy.
#include <fielddeform/volume/detail/local_lattice.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::volume::detail {
namespace {

constexpr double kPadding = 0.02, kCellOverLength = 1.25, kThinnest = 1e-3;
constexpr int kFewestCells = 3, kMostCells = 29;
constexpr int kStencil = 7, kStencilSize = kStencil * kStencil * kStencil;  // functions overlap three nodes away

// The four cubic B-splines of a cell at u in [0, 1].
std::array<double, 4> cubic(double u) {
  const double w = 1 - u;
  return {w * w * w / 6, (3 * u * u * u - 6 * u * u + 4) / 6, (3 * w * w * w - 6 * w * w + 4) / 6, u * u * u / 6};
}

int cellOf(double t, int cells) { return std::clamp(static_cast<int>(std::floor(t)), 0, cells - 1); }

template <class Call>
void eachMoved(const LocalParts& parts, Call&& call) {
  for (const LocalPart& part : parts.part)
    for (std::size_t i = 0; i < part.size(); ++i)
      if (part.mask[i] > 0) call(part, i);
}

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
  eachMoved(parts, [&](const LocalPart& part, std::size_t v) {
    int c[3];
    for (int k = 0; k < 3; ++k) c[k] = cellOf((part.base[v][k] - out.lattice.box.origin[k]) / out.cell[k], out.cells[k]);
    occupied[cellIndex(c[0], c[1], c[2])] = 1;
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

struct Lump {
  double weight = 0;
  Vec3 sum = Vec3::Zero();
};

void addLump(StencilMatrix& m, const LocalLattice& l, const Lump& lump, const std::array<int, 3>& first) {
  const Vec3 p = lump.sum / lump.weight;
  std::array<double, 4> w[3];
  for (int k = 0; k < 3; ++k)
    w[k] = cubic(std::clamp((p[k] - l.lattice.box.origin[k]) / l.cell[k] - first[k], 0.0, 1.0));
  double phi[64];
  Index own[64];
  for (int c = 0, a = 0; c < 4; ++c)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 4; ++i, ++a) {
        phi[a] = w[0][i] * w[1][j] * w[2][c];
        own[a] = m.own(first[0] + i, first[1] + j, first[2] + c);
      }
  for (int a = 0; a < 64; ++a)
    for (int b = 0; b < 64; ++b)
      m.at(own[a], b % 4 - a % 4, b / 4 % 4 - a / 4 % 4, b / 16 - a / 16) += lump.weight * phi[a] * phi[b];
}

}  // namespace

LocalLattice makeLattice(LocalParts& parts, double length, const std::optional<std::array<int, 3>>& nodes) {
  Box box;
  eachMoved(parts, [&](const LocalPart& part, std::size_t i) { box.extend(part.base[i]); });
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
  for (LocalPart& part : parts.part) part.binding = out.map->bind(part.base, part.mask);
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
  const std::array<std::size_t, 3> half{2 * static_cast<std::size_t>(l.cells[0]), 2 * static_cast<std::size_t>(l.cells[1]),
                                        2 * static_cast<std::size_t>(l.cells[2])};
  std::vector<Lump> lumps(half[0] * half[1] * half[2]);
  eachMoved(parts, [&](const LocalPart& part, std::size_t v) {
    std::size_t c[3];
    for (int k = 0; k < 3; ++k)
      c[k] = static_cast<std::size_t>(cellOf(2 * (part.base[v][k] - l.lattice.box.origin[k]) / l.cell[k], 2 * l.cells[k]));
    Lump& lump = lumps[c[0] + half[0] * (c[1] + half[1] * c[2])];
    const double w = part.area[v] * part.mask[v] * part.mask[v];
    lump.weight += w;
    lump.sum += w * part.base[v];
  });
  StencilMatrix m(l);
  for (std::size_t at = 0; at < lumps.size(); ++at) {
    const std::array<int, 3> cell{static_cast<int>(at % half[0] / 2), static_cast<int>(at / half[0] % half[1] / 2),
                                  static_cast<int>(at / half[0] / half[1] / 2)};
    if (lumps[at].weight > 0) addLump(m, l, lumps[at], cell);
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
