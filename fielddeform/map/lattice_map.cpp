#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/map/detail/lattice_model.h>
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using detail::Cell;
using detail::kBlock;
using detail::LatticeBinding;
using detail::LatticeModel;
using detail::PointKind;

constexpr std::size_t kGrain = 32 * kBlock;
constexpr std::size_t kGatherChunks = 32;         // of points, each with sums of its own
constexpr std::size_t kGatherMemory = 64u << 20;  // bytes that these may take; else the nodes are cut into slabs

const LatticeBinding& boundBy(const Binding& binding, const std::shared_ptr<const LatticeModel>& model) {
  const auto* bound = dynamic_cast<const LatticeBinding*>(&binding);
  if (!bound || bound->model != model) throw std::invalid_argument("binding: not of this lattice");
  return *bound;
}

void requireSize(const char* name, std::size_t size, std::size_t expected) {
  if (size != expected) throw std::invalid_argument(fmt::format("{}: {} elements, expected {}", name, size, expected));
}

void requireDisplacements(Points displacements, std::size_t nodes) {
  requireSize("displacements", displacements.size(), nodes);
  for (std::size_t i = 0; i < displacements.size(); ++i)
    if (!displacements[i].allFinite()) throw std::invalid_argument(fmt::format("displacements: that of node {} is not finite", i));
}

// Calls block(begin, count, scratch) for the blocks of [begin, end).
template <class Block>
void forBlocks(const LatticeModel& model, std::size_t begin, std::size_t end, Block&& block) {
  LatticeModel::Scratch scratch(model);
  for (std::size_t b = begin; b < end; b += kBlock) block(b, std::min(kBlock, end - b), scratch);
}

void sumOf(const LatticeModel& model, const LatticeBinding& bound, std::size_t begin, std::size_t count, const Vec3* values,
           LatticeModel::Scratch& scratch, Vec3* out) {
  model.weights(bound, begin, count, scratch);
  detail::combine(model.shape(), count, model.cells(bound, begin, scratch), scratch.weight.data(), values, scratch.rows.data(), out);
}

// Adds displacements to points; a point whose image is not finite stays.
void place(const LatticeBinding& bound, std::size_t begin, std::size_t count, const LatticeModel::Scratch& scratch, const Vec3* d,
           const MapOutput& out) {
  const Vec3* rest = &bound.points[begin];
  const PointKind* kind = bound.isView() ? scratch.kind.data() : &bound.kind[begin];
  std::array<Vec3, kBlock> spare;
  Vec3* x = out.position.empty() ? spare.data() : &out.position[begin];
  const bool finite = detail::addDisplacements(count, rest, d, x);
  std::array<bool, kBlock> invalid{};
  if (!finite || bound.isView() || bound.special[begin / kBlock])
    for (std::size_t p = 0; p < count; ++p) {
      invalid[p] = kind[p] == PointKind::Invalid || !x[p].allFinite();
      if (invalid[p]) x[p] = rest[p];
    }
  if (!out.safe.empty()) std::copy(x, x + count, &out.safe[begin]);
  if (!out.status.empty())
    for (std::size_t p = 0; p < count; ++p)
      out.status[begin + p] = invalid[p] ? Status::Invalid : d[p] == Vec3::Zero() ? Status::Fixed : Status::Converged;
  if (!out.residual.empty()) std::fill(&out.residual[begin], &out.residual[begin] + count, 0.0f);
}

}  // namespace

LatticeMap::LatticeMap(Lattice lattice) : model_(std::make_shared<const LatticeModel>(lattice)) {
  std::vector<Vec3> d = std::move(lattice.displacements);
  d.resize(model_->rest().size(), Vec3::Zero());
  displacements_ = std::make_shared<const std::vector<Vec3>>(std::move(d));
}

Lattice LatticeMap::lattice() const {
  Lattice l = model_->lattice();
  l.displacements = *displacements_;
  return l;
}

Vec3 LatticeMap::position(const Vec3& rest) const {
  LatticeModel::Scratch scratch(*model_, 1);
  Cell cell;
  if (!model_->place(rest, cell, scratch.weight.data(), scratch.slope.data())) return rest;
  Vec3 d;
  detail::combine(model_->shape(), 1, &cell, scratch.weight.data(), displacements_->data(), scratch.rows.data(), &d);
  Vec3 x;
  return detail::addDisplacements(1, &rest, &d, &x) ? x : rest;
}

Mat3 LatticeMap::jacobian(const Vec3& rest) const {
  Mat3 j;
  const auto binding = bind({&rest, 1});
  jacobians(*binding, {&j, 1});
  return j;
}

LatticeMap::Inverse LatticeMap::inverse(const Vec3& target, const Vec3& start, double tolerance) const {
  constexpr int kSteps = 64;
  Inverse best{start, (position(start) - target).stableNorm(), false};
  if (!start.allFinite() || !target.allFinite()) return best;
  for (int step = 0; step < kSteps && best.error > 0; ++step) {
    const Vec3 move = jacobian(best.rest).partialPivLu().solve(target - position(best.rest));
    if (!move.allFinite()) break;
    // Shorter steps until the image comes nearer; none does at a fold, and at the last bit.
    bool nearer = false;
    for (double share = 1; share > 1e-4 && !nearer; share *= 0.5) {
      const Vec3 trial = best.rest + share * move;
      const double error = (position(trial) - target).stableNorm();
      if ((nearer = error < best.error)) best = {trial, error, false};
    }
    if (!nearer) break;
  }
  best.found = best.error <= tolerance && jacobian(best.rest).determinant() > 0;
  return best;
}

std::shared_ptr<const Binding> LatticeMap::bind(Points rest) const {
  auto bound = std::make_shared<LatticeBinding>();
  bound->model = model_;
  bound->rest.assign(rest.begin(), rest.end());
  bound->points = bound->rest;
  bound->t.resize(rest.size());
  if (!model_->oneCell()) bound->cell.resize(rest.size());
  bound->kind.resize(rest.size());
  parallelFor(rest.size(), kGrain, [&](std::size_t begin, std::size_t end) { model_->bind(*bound, begin, end); });
  bound->special.resize((rest.size() + kBlock - 1) / kBlock);
  for (std::size_t p = 0; p < rest.size(); ++p)
    if (bound->kind[p] != PointKind::Inside) bound->special[p / kBlock] = true;
  return bound;
}

std::shared_ptr<const Binding> LatticeMap::bindView(Points rest) const {
  auto bound = std::make_shared<LatticeBinding>();
  bound->model = model_;
  bound->points = rest;
  return bound;
}

void LatticeMap::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const LatticeBinding& bound = boundBy(binding, model_);
  const std::size_t n = bound.size();
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0) requireSize("out", size, n);
  parallelFor(n, kGrain, progress, [&](std::size_t begin, std::size_t end) {
    std::array<Vec3, kBlock> d;
    forBlocks(*model_, begin, end, [&](std::size_t b, std::size_t count, LatticeModel::Scratch& scratch) {
      sumOf(*model_, bound, b, count, displacements_->data(), scratch, d.data());
      place(bound, b, count, scratch, d.data(), out);
    });
  });
}

void LatticeMap::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const LatticeBinding& bound = boundBy(binding, model_);
  requireSize("out", out.size(), bound.size());
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    LatticeModel::Scratch scratch(*model_, 1);
    const Mat3 toBox = model_->boxDerivative();
    Cell cell;
    for (std::size_t p = begin; p < end; ++p) {
      out[p].setIdentity();
      if (!model_->place(bound.points[p], cell, scratch.weight.data(), scratch.slope.data())) continue;
      const Mat3 d = model_->derivative(cell, scratch.weight.data(), scratch.slope.data(), displacements_->data()) * toBox;
      if (d.allFinite()) out[p] += d;
    }
  });
}

std::size_t LatticeMap::nodeCount() const { return model_->rest().size(); }
Points LatticeMap::restNodes() const { return model_->rest(); }
Points LatticeMap::displacements() const { return *displacements_; }

namespace {

/// Appends the rows of the bound points begin .. begin + count.
void addRows(const LatticeModel& model, const LatticeBinding& bound, std::size_t begin, std::size_t count, LatticeModel::Scratch& scratch, SparseRows& rows) {
  const detail::Shape& shape = model.shape();
  model.weights(bound, begin, count, scratch);
  const Cell* cell = model.cells(bound, begin, scratch);
  for (std::size_t p = 0; p < count; ++p) {
    const double* w = &scratch.weight[p * shape.stride];
    for (std::size_t k = 0; k < shape.support[2]; ++k)
      for (std::size_t j = 0; j < shape.support[1]; ++j)
        for (std::size_t i = 0; i < shape.support[0]; ++i) {
          const double value = w[i] * (w[shape.at[1] + j] * w[shape.at[2] + k]);
          if (value == 0) continue;
          rows.column.push_back(static_cast<Index>(model.row(cell[p], j, k) + i));
          rows.value.push_back(value);
        }
    rows.start.push_back(rows.column.size());
  }
}

}  // namespace

SparseRows LatticeMap::basis(const Binding& binding) const {
  const LatticeBinding& bound = boundBy(binding, model_);
  SparseRows rows;
  rows.columns = nodeCount();
  rows.start.reserve(bound.size() + 1);
  forBlocks(*model_, 0, bound.size(), [&](std::size_t b, std::size_t count, LatticeModel::Scratch& scratch) { addRows(*model_, bound, b, count, scratch, rows); });
  return rows;
}

SparseRows LatticeMap::basisAt(const Binding& binding, std::span<const Index> points) const {
  const LatticeBinding& bound = boundBy(binding, model_);
  SparseRows rows;
  rows.columns = nodeCount();
  LatticeModel::Scratch scratch(*model_);
  for (const Index p : points) addRows(*model_, bound, p, 1, scratch, rows);
  return rows;
}

void LatticeMap::combine(const Binding& binding, Points nodeValues, std::span<Vec3> out) const {
  const LatticeBinding& bound = boundBy(binding, model_);
  requireSize("nodeValues", nodeValues.size(), nodeCount());
  requireSize("out", out.size(), bound.size());
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    forBlocks(*model_, begin, end, [&](std::size_t b, std::size_t count, LatticeModel::Scratch& scratch) {
      sumOf(*model_, bound, b, count, nodeValues.data(), scratch, &out[b]);
    });
  });
}

namespace {

// Many nodes: the lattice is cut along its longest axis into slabs so wide that a point of one reaches into the next at
// most. First the even slabs, side by side, then the odd ones: no two at work meet, and each node's order is fixed.
void gatherBySlabs(const LatticeModel& model, const LatticeBinding& bound, Points values, std::span<Vec3> out) {
  const detail::Shape& shape = model.shape();
  const std::size_t axis = static_cast<std::size_t>(std::max_element(shape.nodes.begin(), shape.nodes.end()) - shape.nodes.begin());
  const std::size_t width = std::max<std::size_t>(shape.support[axis], 8), slabs = (shape.nodes[axis] + width - 1) / width;
  std::size_t step = 1;
  for (std::size_t a = 0; a < axis; ++a) step *= shape.nodes[a];
  const auto slabOf = [&](std::size_t p) {
    return model.firstNode(bound, p) / step % shape.nodes[axis] / width;
  };
  std::vector<std::size_t> start(slabs + 1, 0);
  for (std::size_t p = 0; p < bound.size(); ++p) ++start[slabOf(p) + 1];
  for (std::size_t s = 0; s < slabs; ++s) start[s + 1] += start[s];
  std::vector<Index> order(bound.size());
  std::vector<std::size_t> next(start.begin(), start.end() - 1);
  for (std::size_t p = 0; p < bound.size(); ++p) order[next[slabOf(p)]++] = static_cast<Index>(p);
  for (const std::size_t parity : {std::size_t{0}, std::size_t{1}})
    parallelFor((slabs + 1 - parity) / 2, 1, [&](std::size_t pair, std::size_t) {
      const std::size_t slab = 2 * pair + parity;
      std::array<Vec3, kBlock> in;
      forBlocks(model, start[slab], start[slab + 1], [&](std::size_t b, std::size_t count, LatticeModel::Scratch& scratch) {
        const std::span<const Index> points(&order[b], count);
        model.weightsOf(bound, points, scratch);
        for (std::size_t p = 0; p < count; ++p) in[p] = values[points[p]];
        detail::scatter(shape, count, scratch.cell.data(), scratch.weight.data(), in.data(), scratch.rows.data(), out.data());
      });
    });
}

}  // namespace

void LatticeMap::gather(const Binding& binding, Points pointValues, std::span<Vec3> out) const {
  const LatticeBinding& bound = boundBy(binding, model_);
  requireSize("pointValues", pointValues.size(), bound.size());
  requireSize("out", out.size(), nodeCount());
  std::fill(out.begin(), out.end(), Vec3(Vec3::Zero()));
  const std::size_t blocks = (bound.size() + kBlock - 1) / kBlock;
  const std::size_t chunks = std::min(kGatherChunks, (blocks + 15) / 16), nodes = nodeCount();
  if (chunks == 0) return;
  if (chunks * nodes * sizeof(Vec3) > kGatherMemory) return gatherBySlabs(*model_, bound, pointValues, out);
  std::vector<Vec3> sums(chunks * nodes, Vec3::Zero());
  parallelFor(chunks, 1, [&](std::size_t c, std::size_t) {
    const std::size_t end = std::min(bound.size(), blocks * (c + 1) / chunks * kBlock);
    forBlocks(*model_, blocks * c / chunks * kBlock, end, [&](std::size_t b, std::size_t count, LatticeModel::Scratch& scratch) {
      model_->weights(bound, b, count, scratch);
      detail::scatter(model_->shape(), count, model_->cells(bound, b, scratch), scratch.weight.data(), &pointValues[b],
                      scratch.rows.data(), &sums[c * nodes]);
    });
  });
  for (std::size_t c = 0; c < chunks; ++c)
    for (std::size_t i = 0; i < nodes; ++i) out[i] += sums[c * nodes + i];
}

std::unique_ptr<LinearMap> LatticeMap::withDisplacements(Points displacements) const {
  requireDisplacements(displacements, nodeCount());
  auto other = std::make_unique<LatticeMap>(*this);
  other->displacements_ = std::make_shared<const std::vector<Vec3>>(displacements.begin(), displacements.end());
  return other;
}

}  // namespace fielddeform::map
