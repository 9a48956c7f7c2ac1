#include <fielddeform/core/parallel.h>
#include <fielddeform/map/detail/tricubic.h>
#include <fielddeform/map/extended_lattice.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/numeric/min_norm.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using detail::localJacobian;
using detail::Weights;
using detail::weightsAt;

constexpr std::size_t kGrain = 256;
constexpr double kEdge = 1e-10;     // of [0, 1]: how far outside a point on a common face may be found
constexpr int kMostCells = 64;

void checkSize(const char* name, std::size_t found, std::size_t expected) {
  if (found != expected) throw std::invalid_argument(fmt::format("{} has {} elements, expected {}", name, found, expected));
}

void requireCells(const std::array<int, 3>& cells, int leastAround) {
  for (int k = 0; k < 3; ++k)
    if (cells[k] < (k == 1 ? leastAround : 1) || cells[k] > kMostCells)
      throw std::invalid_argument(fmt::format("cells: {} along axis {}, must be {} to {}", cells[k], k, k == 1 ? leastAround : 1, kMostCells));
}

// Cells of a grid of nodes, 3 n + 1 along each axis; the second axis comes back to its start if it is a ring.
void addCells(ExtendedLattice& lattice, const std::array<int, 3>& cells, bool ring) {
  const int n0 = 3 * cells[0] + 1, n1 = 3 * cells[1] + (ring ? 0 : 1);
  for (int c = 0; c < cells[2]; ++c)
    for (int b = 0; b < cells[1]; ++b)
      for (int a = 0; a < cells[0]; ++a) {
        std::array<Index, 64> cell{};
        for (int n = 0; n < 64; ++n) {
          const int i = 3 * a + n % 4, j = (3 * b + n / 4 % 4) % n1, k = 3 * c + n / 16;
          cell[static_cast<std::size_t>(n)] = static_cast<Index>(i + n0 * (j + n1 * k));
        }
        lattice.cells.push_back(cell);
      }
}

}  // namespace

void ExtendedLattice::validate() const {
  if (cells.empty()) throw std::invalid_argument("cells: none, needs at least 1");
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (!nodes[i].allFinite()) throw std::invalid_argument(fmt::format("node {} is not finite", i));
  for (std::size_t c = 0; c < cells.size(); ++c)
    for (const Index n : cells[c])
      if (n >= nodes.size()) throw std::invalid_argument(fmt::format("cell {} names node {}, there are {}", c, n, nodes.size()));
  if (!displacements.empty()) checkSize("displacements", displacements.size(), nodes.size());
  for (const Vec3& d : displacements)
    if (!d.allFinite()) throw std::invalid_argument("a displacement is not finite");
}

ExtendedLattice boxLattice(const LatticeBox& box, const std::array<int, 3>& cells) {
  box.validate();
  requireCells(cells, 1);
  ExtendedLattice out;
  const int n[3] = {3 * cells[0] + 1, 3 * cells[1] + 1, 3 * cells[2] + 1};
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i)
        out.nodes.push_back(box.origin + box.axes * Vec3(i / (n[0] - 1.0), j / (n[1] - 1.0), k / (n[2] - 1.0)));
  addCells(out, cells, false);
  return out;
}

ExtendedLattice cylinderLattice(const CylinderLattice& tube) {
  requireCells(tube.cells, 3);
  if (!(tube.inner > 0 && tube.inner < tube.outer && std::isfinite(tube.outer)))
    throw std::invalid_argument(fmt::format("radii are {} and {}, must be 0 < inner < outer", tube.inner, tube.outer));
  const double length = tube.axis.norm();
  if (!(length > 0 && std::isfinite(length)) || !tube.origin.allFinite()) throw std::invalid_argument("axis has no length, or origin is not finite");
  const Vec3 z = tube.axis / length, seed = std::abs(z.x()) < 0.9 ? Vec3(Vec3::UnitX()) : Vec3(Vec3::UnitY());
  const Vec3 x = (seed - z.dot(seed) * z).normalized(), y = z.cross(x);
  ExtendedLattice out;
  const int around = tube.cells[1], n0 = 3 * tube.cells[0] + 1, n1 = 3 * around, n2 = 3 * tube.cells[2] + 1;
  const double step = 2 * 3.14159265358979323846 / around;
  const auto quarter = numeric::sincos(step / 4);
  const double handle = 4.0 / 3 * quarter.sin / quarter.cos;  // of an arc's Bezier form
  for (int k = 0; k < n2; ++k)
    for (int j = 0; j < n1; ++j)
      for (int i = 0; i < n0; ++i) {
        // Ends of arcs on the circle, handles on its tangents there.
        const int end = j % 3 == 2 ? j / 3 + 1 : j / 3;
        const auto at = numeric::sincos(step * (end % around));
        const double side = j % 3 == 1 ? handle : j % 3 == 2 ? -handle : 0;
        const Vec3 across = (at.cos - side * at.sin) * x + (at.sin + side * at.cos) * y;
        const double radius = tube.inner + (tube.outer - tube.inner) * i / (n0 - 1.0);
        out.nodes.push_back(tube.origin + radius * across + tube.axis * (k / (n2 - 1.0)));
      }
  addCells(out, tube.cells, true);
  return out;
}

std::vector<Joint> jointsOf(const ExtendedLattice& lattice) {
  lattice.validate();
  // The four nodes deep behind each face node, by the face's sorted nodes.
  struct Side {
    std::size_t cell;
    int axis;
    bool upper;
  };
  std::map<std::array<Index, 16>, std::vector<Side>> faces;
  const auto nodeOf = [&](const Side& s, int u, int v, int depth) {
    std::array<int, 3> at{};
    at[static_cast<std::size_t>(s.axis)] = s.upper ? 3 - depth : depth;
    at[static_cast<std::size_t>((s.axis + 1) % 3)] = u;
    at[static_cast<std::size_t>((s.axis + 2) % 3)] = v;
    return lattice.cells[s.cell][static_cast<std::size_t>(at[0] + 4 * (at[1] + 4 * at[2]))];
  };
  for (std::size_t c = 0; c < lattice.cells.size(); ++c)
    for (int axis = 0; axis < 3; ++axis)
      for (const bool upper : {false, true}) {
        const Side side{c, axis, upper};
        std::array<Index, 16> key{};
        for (int n = 0; n < 16; ++n) key[static_cast<std::size_t>(n)] = nodeOf(side, n % 4, n / 4, 0);
        std::sort(key.begin(), key.end());
        faces[key].push_back(side);
      }
  std::map<std::array<Index, 3>, double> found;  // several pairs of cells name the joints over an edge of a face twice
  for (const auto& [key, sides] : faces) {
    if (sides.size() != 2) continue;
    std::map<Index, Index> behind;  // of the second side
    for (int n = 0; n < 16; ++n) behind[nodeOf(sides[1], n % 4, n / 4, 0)] = nodeOf(sides[1], n % 4, n / 4, 1);
    for (int n = 0; n < 16; ++n) {
      Joint joint{nodeOf(sides[0], n % 4, n / 4, 1), nodeOf(sides[0], n % 4, n / 4, 0), 0, 1};
      joint.out = behind[joint.face];
      const Vec3 in = lattice.nodes[joint.face] - lattice.nodes[joint.in], out = lattice.nodes[joint.out] - lattice.nodes[joint.face];
      const double length = in.squaredNorm();
      if (!(length > 0)) continue;
      joint.ratio = in.dot(out) / length;
      if (!(joint.ratio > 0) || (out - joint.ratio * in).norm() > 1e-9 * out.norm()) continue;
      if (joint.out < joint.in) {
        std::swap(joint.in, joint.out);
        joint.ratio = 1 / joint.ratio;
      }
      found[{joint.in, joint.face, joint.out}] = joint.ratio;
    }
  }
  std::vector<Joint> joints;
  for (const auto& [nodes, ratio] : found) joints.push_back({nodes[0], nodes[1], nodes[2], ratio});
  return joints;
}

std::vector<Vec3> joinSmoothly(const ExtendedLattice& lattice, std::span<const Index> pinned, double* residual) {
  const std::vector<Joint> joints = jointsOf(lattice);
  std::vector<Vec3> d = lattice.displacements;
  d.resize(lattice.nodes.size(), Vec3::Zero());
  std::vector<char> pin(d.size(), 0);
  for (const Index n : pinned) {
    if (n >= d.size()) throw std::invalid_argument(fmt::format("pinned node {}, there are {}", n, d.size()));
    pin[n] = 1;
  }
  const auto missOf = [&](const Joint& j) -> Vec3 { return (d[j.out] - d[j.face]) - j.ratio * (d[j.face] - d[j.in]); };
  std::vector<std::size_t> start{0};
  std::vector<Index> column;
  std::vector<double> value;
  std::vector<Vec3> right;
  for (const Joint& j : joints) {
    for (const auto& [node, factor] : {std::pair{j.in, j.ratio}, {j.face, -1 - j.ratio}, {j.out, 1.0}})
      if (!pin[node]) column.push_back(node), value.push_back(factor);
    start.push_back(column.size());
    right.push_back(-missOf(j));
  }
  const std::vector<Vec3> change = numeric::minNormLeastSquares({d.size(), start, column, value}, right, {});
  for (std::size_t n = 0; n < d.size(); ++n) d[n] += change[n];
  if (residual) {
    *residual = 0;
    for (const Joint& j : joints) *residual = std::max(*residual, missOf(j).norm());
  }
  return d;
}

struct ExtendedLatticeMap::Bound final : Binding {
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const ExtendedLattice> model;
  std::vector<Vec3> rest;
  std::vector<Place> place;
};

ExtendedLatticeMap::ExtendedLatticeMap(ExtendedLattice lattice) {
  lattice.validate();
  displacements_ = std::move(lattice.displacements);
  displacements_.resize(lattice.nodes.size(), Vec3::Zero());
  lattice.displacements.clear();
  auto boxes = std::make_shared<std::vector<Box>>();
  for (const auto& cell : lattice.cells) {
    Box box;
    for (const Index n : cell) box.extend(lattice.nodes[n]);
    const double margin = 1e-9 * box.sizes().norm();
    boxes->push_back(Box(box.min().array() - margin, box.max().array() + margin));
  }
  boxes_ = std::move(boxes);
  model_ = std::make_shared<const ExtendedLattice>(std::move(lattice));
}

namespace {

// Local coordinates of a point in one cell by Newton steps, from the nearest of 4 x 4 x 4 places; false if it is outside.
bool invert(const ExtendedLattice& lattice, const std::array<Index, 64>& cell, double size, const Vec3& x, Vec3& u) {
  const auto node = [&](std::size_t n) -> const Vec3& { return lattice.nodes[cell[n]]; };
  const auto image = [&](const Vec3& at) {
    const Weights w = weightsAt(at);
    Vec3 p = Vec3::Zero();
    for (std::size_t n = 0; n < 64; ++n) p += w[n] * (node(n) - x);  // relative: no cancellation far from the origin
    return p;
  };
  double best = 1e300;
  for (int n = 0; n < 64; ++n) {
    const Vec3 at((n % 4 + 0.5) / 4, (n / 4 % 4 + 0.5) / 4, (n / 16 + 0.5) / 4);
    if (const double d = image(at).squaredNorm(); d < best) best = d, u = at;
  }
  Vec3 miss = image(u);
  for (int step = 0; step < 40; ++step) {
    const Vec3 by = localJacobian(u, [&](std::size_t n) { return Vec3(node(n) - x); }).fullPivLu().solve(miss);
    if (!by.allFinite()) return false;
    double share = 1;
    Vec3 next = u - by, nextMiss = image(next);
    for (int halving = 0; halving < 6 && !(nextMiss.norm() < miss.norm()); ++halving) {
      share *= 0.5;
      next = u - share * by;
      nextMiss = image(next);
    }
    if (!(nextMiss.norm() < miss.norm())) break;
    u = next;
    miss = nextMiss;
    if ((u.array() < -2).any() || (u.array() > 3).any()) return false;
  }
  if (!(miss.norm() <= 1e-12 * size) || (u.array() < -kEdge).any() || (u.array() > 1 + kEdge).any()) return false;
  u = u.cwiseMax(0.0).cwiseMin(1.0);
  return true;
}

}  // namespace

ExtendedLatticeMap::Place ExtendedLatticeMap::locate(const Vec3& rest) const {
  Place place;
  for (std::size_t c = 0; c < model_->cells.size(); ++c) {
    if (!(*boxes_)[c].contains(rest)) continue;
    if (!invert(*model_, model_->cells[c], (*boxes_)[c].sizes().norm(), rest, place.uvw)) continue;
    place.cell = static_cast<Index>(c);
    return place;
  }
  place.uvw.setZero();
  return place;
}

std::size_t ExtendedLatticeMap::outsideCount(const Binding& binding) const {
  const Bound& b = own(binding);
  std::size_t count = 0;
  for (std::size_t i = 0; i < b.size(); ++i) count += b.place[i].cell == kNoIndex && b.rest[i].allFinite();
  return count;
}

ExtendedLattice ExtendedLatticeMap::lattice() const {
  ExtendedLattice out = *model_;
  out.displacements = displacements_;
  return out;
}

std::shared_ptr<const Binding> ExtendedLatticeMap::bind(Points rest) const {
  auto bound = std::make_shared<Bound>();
  bound->model = model_;
  bound->rest.assign(rest.begin(), rest.end());
  bound->place.resize(rest.size());
  parallelFor(rest.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (rest[i].allFinite()) bound->place[i] = locate(rest[i]);
  });
  return bound;
}

const ExtendedLatticeMap::Bound& ExtendedLatticeMap::own(const Binding& binding) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->model != model_) throw std::invalid_argument("the binding was made by another map");
  return *bound;
}

void ExtendedLatticeMap::combine(const Binding& binding, Points nodeValues, std::span<Vec3> out) const {
  const Bound& b = own(binding);
  checkSize("nodeValues", nodeValues.size(), nodeCount());
  checkSize("out", out.size(), b.size());
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      out[i].setZero();
      if (b.place[i].cell == kNoIndex) continue;
      const Weights w = weightsAt(b.place[i].uvw);
      const auto& cell = model_->cells[b.place[i].cell];
      for (std::size_t n = 0; n < 64; ++n) out[i] += w[n] * nodeValues[cell[n]];
    }
  });
}

void ExtendedLatticeMap::gather(const Binding& binding, Points pointValues, std::span<Vec3> out) const {
  const Bound& b = own(binding);
  checkSize("pointValues", pointValues.size(), b.size());
  checkSize("out", out.size(), nodeCount());
  std::fill(out.begin(), out.end(), Vec3::Zero());
  for (std::size_t i = 0; i < b.size(); ++i) {
    if (b.place[i].cell == kNoIndex) continue;
    const Weights w = weightsAt(b.place[i].uvw);
    const auto& cell = model_->cells[b.place[i].cell];
    for (std::size_t n = 0; n < 64; ++n) out[cell[n]] += w[n] * pointValues[i];
  }
}

SparseRows ExtendedLatticeMap::basis(const Binding& binding) const {
  const Bound& b = own(binding);
  SparseRows rows;
  rows.columns = nodeCount();
  for (std::size_t i = 0; i < b.size(); ++i) {
    std::map<Index, double> row;  // a cell may name a node twice
    if (b.place[i].cell != kNoIndex) {
      const Weights w = weightsAt(b.place[i].uvw);
      for (std::size_t n = 0; n < 64; ++n) row[model_->cells[b.place[i].cell][n]] += w[n];
    }
    for (const auto& [node, value] : row)
      if (value != 0) rows.column.push_back(node), rows.value.push_back(value);
    rows.start.push_back(rows.column.size());
  }
  return rows;
}

void ExtendedLatticeMap::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const Bound& b = own(binding);
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0) checkSize("out", size, b.size());
  std::vector<Vec3> moved(b.size());
  combine(binding, displacements_, moved);
  parallelFor(b.size(), 8192, progress, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const bool fixed = moved[i].isZero(0), valid = b.rest[i].allFinite() && (b.rest[i] + moved[i]).allFinite();
      const Vec3 x = fixed || !valid ? b.rest[i] : Vec3(b.rest[i] + moved[i]);
      if (!out.position.empty()) out.position[i] = x;
      if (!out.safe.empty()) out.safe[i] = x;
      if (!out.status.empty()) out.status[i] = !valid ? Status::Invalid : fixed ? Status::Fixed : Status::Converged;
      if (!out.residual.empty()) out.residual[i] = 0;
    }
  });
}

void ExtendedLatticeMap::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const Bound& b = own(binding);
  checkSize("out", out.size(), b.size());
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      out[i].setIdentity();
      if (b.place[i].cell == kNoIndex) continue;
      const auto& cell = model_->cells[b.place[i].cell];
      const Vec3& u = b.place[i].uvw;
      const Mat3 rest = localJacobian(u, [&](std::size_t n) { return Vec3(model_->nodes[cell[n]] - b.rest[i]); });
      const Mat3 moved = localJacobian(u, [&](std::size_t n) { return displacements_[cell[n]]; });
      const Mat3 change = moved * rest.inverse();
      if (change.allFinite()) out[i] += change;  // not at a collapsed edge
    }
  });
}

std::unique_ptr<LinearMap> ExtendedLatticeMap::withDisplacements(Points displacements) const {
  checkSize("displacements", displacements.size(), nodeCount());
  for (const Vec3& d : displacements)
    if (!d.allFinite()) throw std::invalid_argument("a displacement is not finite");
  auto other = std::make_unique<ExtendedLatticeMap>(*this);
  other->displacements_.assign(displacements.begin(), displacements.end());
  return other;
}

}  // namespace fielddeform::map
