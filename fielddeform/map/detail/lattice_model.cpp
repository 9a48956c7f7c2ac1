#include <fielddeform/map/detail/lattice_model.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map::detail {
namespace {

constexpr double kLargest = 1e280;  // of weights: products with displacements must stay in range

const std::array<Cell, kBlock> kOneCell{};

}  // namespace

LatticeModel::LatticeModel(const Lattice& l) : lattice_(l), shape_(l.axis), table_(l.axis) {
  l.validate();
  lattice_.displacements.clear();
  rest_ = l.restNodes();
  for (const Vec3& p : rest_)
    if (!p.allFinite()) throw std::invalid_argument("box: a rest node is beyond double");
  // A power of two first, so that the determinant stays in range.
  scale_ = std::ldexp(1.0, -std::clamp(std::ilogb(l.box.axes.cwiseAbs().maxCoeff()), -1022, 1022));
  toBox_ = Mat3(l.box.axes * scale_).inverse();
  pieces_ = oneCell_ = true;
  for (const AxisBasis& axis : l.axis) {
    const auto& pieces = axis.pieces();
    pieces_ = pieces_ && !pieces.empty() && pieces.size() <= 0xFFFF;
    oneCell_ = oneCell_ && axis.nodes() == axis.support();
    for (const AxisBasis::Piece& piece : pieces) oneCell_ = oneCell_ && pieces.size() == 1 && piece.segments == 1;
  }
}

LatticeModel::Scratch::Scratch(const LatticeModel& model, std::size_t points)
    : weight(points * model.shape_.stride), slope(model.shape_.stride),
      rows(model.shape_.support[1] * model.shape_.support[2]), t(points), cell(points), kind(points) {}

// Where a point stands: in `t` its parameters, of clamped box coordinates.
PointKind LatticeModel::locate(const Vec3& x, Vec3& t, Cell& cell) const {
  t.setZero();
  cell = {};
  if (!x.allFinite()) return PointKind::Invalid;
  const Vec3 u = boxPoint(x);
  if (!u.allFinite()) return lattice_.outside == Outside::Keep ? PointKind::Kept : PointKind::Invalid;
  const Vec3 c = u.cwiseMax(0.0).cwiseMin(1.0);
  PointKind kind = PointKind::Inside;
  if (c != u) kind = lattice_.outside == Outside::Keep ? PointKind::Kept : PointKind::Extended;
  if (kind == PointKind::Kept) return kind;
  std::size_t step = 1, first = 0;
  for (int a = 0; a < 3; ++a) {
    t[a] = c[a];
    const AxisBasis& axis = lattice_.axis[a];
    if (!axis.pieces().empty() || axis.support() < axis.nodes()) {
      const AxisBasis::Place place = axis.locate(c[a]);
      if (pieces_) t[a] = place.t;
      cell.piece[a] = static_cast<std::uint16_t>(place.piece);  // of use only if they are few
      first += step * static_cast<std::size_t>(place.first);
    }
    step *= shape_.nodes[a];
  }
  cell.first = static_cast<Index>(first);
  if (kind == PointKind::Extended) {
    // Far away the weights' products leave the range of double.
    double product = 1;
    for (int a = 0; a < 3; ++a) product *= 1 + std::abs(u[a] - c[a]) * lattice_.axis[a].nodes() * lattice_.axis[a].nodes();
    if (!(product < kLargest)) return PointKind::Invalid;
  }
  return kind;
}

void LatticeModel::bind(LatticeBinding& binding, std::size_t begin, std::size_t end) const {
  Cell one;
  for (std::size_t p = begin; p < end; ++p)
    binding.kind[p] = locate(binding.rest[p], binding.t[p], binding.cell.empty() ? one : binding.cell[p]);
}

const Cell* LatticeModel::cells(const LatticeBinding& binding, std::size_t begin, const Scratch& scratch) const {
  if (oneCell_) return kOneCell.data();
  return binding.isView() ? scratch.cell.data() : &binding.cell[begin];
}

Index LatticeModel::firstNode(const LatticeBinding& b, std::size_t point) const {
  if (oneCell_) return 0;
  if (!b.isView()) return b.cell[point].first;
  Vec3 t;
  Cell cell;
  locate(b.points[point], t, cell);
  return cell.first;
}

// Axes without pieces: from the box coordinates.
void LatticeModel::weightsAt(const Vec3& t, double* weight) const {
  for (int a = 0; a < 3; ++a) lattice_.axis[a].evaluate(t[a], weight + shape_.at[a], nullptr);
}

// Beyond its ends an axis goes on along its tangents.
void LatticeModel::extend(const Vec3& rest, double* weight) const {
  const Vec3 u = boxPoint(rest), c = u.cwiseMax(0.0).cwiseMin(1.0);
  std::vector<double> slope;
  for (int a = 0; a < 3; ++a) {
    if (c[a] == u[a]) continue;
    double few[8];
    double* w = few;
    if (shape_.support[a] > 4) {
      slope.resize(2 * shape_.support[a]);
      w = slope.data();
    }
    lattice_.axis[a].evaluate(c[a], w, w + shape_.support[a]);
    for (std::size_t k = 0; k < shape_.support[a]; ++k)
      weight[shape_.at[a] + k] = w[k] + w[shape_.support[a] + k] * (u[a] - c[a]);
  }
}

void LatticeModel::finish(PointKind kind, const Vec3& rest, double* weight) const {
  if (kind == PointKind::Extended) extend(rest, weight);
  else if (kind != PointKind::Inside) std::fill(weight, weight + shape_.stride, 0.0);
}

void LatticeModel::weights(const LatticeBinding& b, std::size_t begin, std::size_t count, Scratch& scratch) const {
  if (b.isView()) return weightsOfView(b, begin, count, scratch);
  double* weight = scratch.weight.data();
  if (pieces_) pieceWeights(table_, count, &b.t[begin], cells(b, begin, scratch), weight);
  else
    for (std::size_t p = 0; p < count; ++p) weightsAt(b.t[begin + p], weight + p * shape_.stride);
  if (b.special[begin / kBlock])
    for (std::size_t p = 0; p < count; ++p) finish(b.kind[begin + p], b.points[begin + p], weight + p * shape_.stride);
}

void LatticeModel::weightsOfView(const LatticeBinding& b, std::size_t begin, std::size_t count, Scratch& scratch) const {
  double* weight = scratch.weight.data();
  for (std::size_t p = 0; p < count; ++p) scratch.kind[p] = locate(b.points[begin + p], scratch.t[p], scratch.cell[p]);
  if (pieces_) pieceWeights(table_, count, scratch.t.data(), cells(b, begin, scratch), weight);
  else
    for (std::size_t p = 0; p < count; ++p) weightsAt(scratch.t[p], weight + p * shape_.stride);
  for (std::size_t p = 0; p < count; ++p) finish(scratch.kind[p], b.points[begin + p], weight + p * shape_.stride);
}

void LatticeModel::weightsOf(const LatticeBinding& b, std::span<const Index> points, Scratch& scratch) const {
  double* weight = scratch.weight.data();
  for (std::size_t p = 0; p < points.size(); ++p) {
    const Vec3& x = b.points[points[p]];
    if (b.isView()) {
      scratch.kind[p] = locate(x, scratch.t[p], scratch.cell[p]);
    } else {
      scratch.t[p] = b.t[points[p]];
      scratch.cell[p] = *cells(b, points[p], scratch);
      scratch.kind[p] = b.kind[points[p]];
    }
  }
  if (pieces_) pieceWeights(table_, points.size(), scratch.t.data(), scratch.cell.data(), weight);
  else
    for (std::size_t p = 0; p < points.size(); ++p) weightsAt(scratch.t[p], weight + p * shape_.stride);
  for (std::size_t p = 0; p < points.size(); ++p) finish(scratch.kind[p], b.points[points[p]], weight + p * shape_.stride);
}

bool LatticeModel::place(const Vec3& x, Cell& cell, double* weight, double* slope) const {
  Vec3 t;
  const PointKind kind = locate(x, t, cell);
  if (kind == PointKind::Kept || kind == PointKind::Invalid) return false;
  const Vec3 u = boxPoint(x), c = u.cwiseMax(0.0).cwiseMin(1.0);
  for (int a = 0; a < 3; ++a) {
    double *w = weight + shape_.at[a], *s = slope + shape_.at[a];
    lattice_.axis[a].evaluate(c[a], w, s);
    if (c[a] != u[a])
      for (std::size_t k = 0; k < shape_.support[a]; ++k) w[k] += s[k] * (u[a] - c[a]);
  }
  return true;
}

Mat3 LatticeModel::derivative(const Cell& cell, const double* weight, const double* slope, const Vec3* values) const {
  const double *wi = weight, *wj = weight + shape_.at[1], *wk = weight + shape_.at[2];
  const double *si = slope, *sj = slope + shape_.at[1], *sk = slope + shape_.at[2];
  Mat3 d = Mat3::Zero();
  for (std::size_t k = 0; k < shape_.support[2]; ++k)
    for (std::size_t j = 0; j < shape_.support[1]; ++j) {
      const Vec3* v = values + row(cell, j, k);
      Vec3 line = Vec3::Zero(), rise = Vec3::Zero();
      for (std::size_t i = 0; i < shape_.support[0]; ++i) {
        line += wi[i] * v[i];
        rise += si[i] * v[i];
      }
      d.col(0) += (wj[j] * wk[k]) * rise;
      d.col(1) += (sj[j] * wk[k]) * line;
      d.col(2) += (wj[j] * sk[k]) * line;
    }
  return d;
}

}  // namespace fielddeform::map::detail
