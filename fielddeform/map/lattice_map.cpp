#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/map/lattice.h>
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

constexpr std::size_t kGrain = 1024;
constexpr std::size_t kGatherChunks = 32;          // of points, each with sums of its own
constexpr std::size_t kGatherMemory = 64u << 20;   // bytes that these may take; else the points are added one after another

// The functions that do not vanish at one point, axis by axis.
struct Local {
  std::array<int, 3> first{};
  std::array<std::vector<double>, 3> weight, slope;

  explicit Local(const std::array<AxisBasis, 3>& axes) {
    for (int a = 0; a < 3; ++a) {
      weight[a].resize(static_cast<std::size_t>(axes[a].support()));
      slope[a].resize(weight[a].size());
    }
  }
  std::size_t support(int a) const { return weight[a].size(); }
};

}  // namespace

struct LatticeMap::Model {
  Lattice lattice;  // without displacements
  std::vector<Vec3> rest;
  Mat3 toBox = Mat3::Identity();  // of world differences; times 2^-exponent
  int exponent = 0;

  explicit Model(const Lattice& l);
  // Box coordinates of a point, and whether it is moved at all.
  Vec3 boxPoint(const Vec3& x) const { return toBox * ((x - lattice.box.origin) * std::ldexp(1.0, -exponent)); }
  Mat3 boxDerivative() const { return toBox * std::ldexp(1.0, -exponent); }
  bool locate(const Vec3& x, Local& local) const;
  Vec3 combine(const Local& local, const Vec3* values) const;
  Mat3 derivative(const Local& local, const Vec3* values) const;  // by box coordinates
  void scatter(const Local& local, const Vec3& value, Vec3* sums) const;
  std::size_t row(const Local& local, std::size_t j, std::size_t k) const {
    const auto n = lattice.nodes();
    return static_cast<std::size_t>(local.first[0]) +
           static_cast<std::size_t>(n[0]) * (static_cast<std::size_t>(local.first[1]) + j +
                                             static_cast<std::size_t>(n[1]) * (static_cast<std::size_t>(local.first[2]) + k));
  }
};

LatticeMap::Model::Model(const Lattice& l) {
  l.validate();
  lattice = l;
  lattice.displacements.clear();
  rest = l.restNodes();
  for (const Vec3& p : rest)
    if (!p.allFinite()) throw std::invalid_argument("box: a rest node is beyond double");
  // A power of two first, so that the determinant stays in range.
  exponent = std::clamp(std::ilogb(l.box.axes.cwiseAbs().maxCoeff()), -1022, 1022);
  toBox = Mat3(l.box.axes * std::ldexp(1.0, -exponent)).inverse();
}

bool LatticeMap::Model::locate(const Vec3& x, Local& local) const {
  const Vec3 u = boxPoint(x);
  if (!u.allFinite()) return false;
  for (int a = 0; a < 3; ++a) {
    const double c = std::clamp(u[a], 0.0, 1.0);
    if (c != u[a] && lattice.outside == Outside::Keep) return false;
    local.first[a] = lattice.axis[a].evaluate(c, local.weight[a].data(), local.slope[a].data());
    if (c != u[a])
      for (std::size_t k = 0; k < local.support(a); ++k) local.weight[a][k] += local.slope[a][k] * (u[a] - c);
  }
  return true;
}

Vec3 LatticeMap::Model::combine(const Local& l, const Vec3* values) const {
  Vec3 sum = Vec3::Zero();
  for (std::size_t k = 0; k < l.support(2); ++k)
    for (std::size_t j = 0; j < l.support(1); ++j) {
      const Vec3* v = values + row(l, j, k);
      Vec3 line = Vec3::Zero();
      for (std::size_t i = 0; i < l.support(0); ++i) line += l.weight[0][i] * v[i];
      sum += (l.weight[1][j] * l.weight[2][k]) * line;
    }
  return sum;
}

Mat3 LatticeMap::Model::derivative(const Local& l, const Vec3* values) const {
  Mat3 d = Mat3::Zero();
  for (std::size_t k = 0; k < l.support(2); ++k)
    for (std::size_t j = 0; j < l.support(1); ++j) {
      const Vec3* v = values + row(l, j, k);
      Vec3 line = Vec3::Zero(), rise = Vec3::Zero();
      for (std::size_t i = 0; i < l.support(0); ++i) {
        line += l.weight[0][i] * v[i];
        rise += l.slope[0][i] * v[i];
      }
      d.col(0) += (l.weight[1][j] * l.weight[2][k]) * rise;
      d.col(1) += (l.slope[1][j] * l.weight[2][k]) * line;
      d.col(2) += (l.weight[1][j] * l.slope[2][k]) * line;
    }
  return d;
}

void LatticeMap::Model::scatter(const Local& l, const Vec3& value, Vec3* sums) const {
  for (std::size_t k = 0; k < l.support(2); ++k)
    for (std::size_t j = 0; j < l.support(1); ++j) {
      Vec3* s = sums + row(l, j, k);
      const Vec3 v = (l.weight[1][j] * l.weight[2][k]) * value;
      for (std::size_t i = 0; i < l.support(0); ++i) s[i] += l.weight[0][i] * v;
    }
}

class LatticeMap::Bound final : public Binding {
 public:
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const Model> model;
  std::vector<Vec3> rest;

  static const Bound& of(const Binding& binding, const std::shared_ptr<const Model>& model) {
    const auto* bound = dynamic_cast<const Bound*>(&binding);
    if (!bound || bound->model != model) throw std::invalid_argument("binding: not of this lattice");
    return *bound;
  }
};

namespace {

void requireSize(const char* name, std::size_t size, std::size_t expected) {
  if (size != expected) throw std::invalid_argument(fmt::format("{}: {} elements, expected {}", name, size, expected));
}

// Where nothing is added, not even the sign of a zero changes.
Vec3 moved(const Vec3& x, const Vec3& d) {
  return {d[0] == 0 ? x[0] : x[0] + d[0], d[1] == 0 ? x[1] : x[1] + d[1], d[2] == 0 ? x[2] : x[2] + d[2]};
}

}  // namespace

LatticeMap::LatticeMap(Lattice lattice) {
  model_ = std::make_shared<const Model>(lattice);
  std::vector<Vec3> d = std::move(lattice.displacements);
  d.resize(model_->rest.size(), Vec3::Zero());
  displacements_ = std::make_shared<const std::vector<Vec3>>(std::move(d));
}

Lattice LatticeMap::lattice() const {
  Lattice l = model_->lattice;
  l.displacements = *displacements_;
  return l;
}

Vec3 LatticeMap::position(const Vec3& rest) const {
  Local local(model_->lattice.axis);
  if (!rest.allFinite() || !model_->locate(rest, local)) return rest;
  const Vec3 x = moved(rest, model_->combine(local, displacements_->data()));
  return x.allFinite() ? x : rest;
}

Mat3 LatticeMap::jacobian(const Vec3& rest) const {
  Local local(model_->lattice.axis);
  if (!rest.allFinite() || !model_->locate(rest, local)) return Mat3::Identity();
  const Mat3 j = model_->derivative(local, displacements_->data()) * model_->boxDerivative();
  return j.allFinite() ? Mat3(Mat3::Identity() + j) : Mat3::Identity();
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
  auto bound = std::make_shared<Bound>();
  bound->model = model_;
  bound->rest.assign(rest.begin(), rest.end());
  return bound;
}

void LatticeMap::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const Bound& bound = Bound::of(binding, model_);
  const std::size_t n = bound.size();
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0) requireSize("out", size, n);
  parallelFor(n, kGrain, progress, [&](std::size_t begin, std::size_t end) {
    Local local(model_->lattice.axis);
    for (std::size_t p = begin; p < end; ++p) {
      const Vec3& rest = bound.rest[p];
      Vec3 x = rest;
      Status status = rest.allFinite() ? Status::Fixed : Status::Invalid;
      if (status == Status::Fixed && model_->locate(rest, local)) {
        const Vec3 d = model_->combine(local, displacements_->data());
        x = moved(rest, d);
        if (!x.allFinite()) x = rest, status = Status::Invalid;
        else if (d != Vec3::Zero()) status = Status::Converged;
      }
      if (!out.position.empty()) out.position[p] = x;
      if (!out.safe.empty()) out.safe[p] = x;
      if (!out.status.empty()) out.status[p] = status;
      if (!out.residual.empty()) out.residual[p] = 0;
    }
  });
}

void LatticeMap::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const Bound& bound = Bound::of(binding, model_);
  requireSize("out", out.size(), bound.size());
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) out[p] = jacobian(bound.rest[p]);
  });
}

std::size_t LatticeMap::nodeCount() const { return model_->rest.size(); }
Points LatticeMap::restNodes() const { return model_->rest; }
Points LatticeMap::displacements() const { return *displacements_; }

SparseRows LatticeMap::basis(const Binding& binding) const {
  const Bound& bound = Bound::of(binding, model_);
  SparseRows rows;
  rows.columns = nodeCount();
  rows.start.reserve(bound.size() + 1);
  Local l(model_->lattice.axis);
  for (const Vec3& x : bound.rest) {
    if (x.allFinite() && model_->locate(x, l))
      for (std::size_t k = 0; k < l.support(2); ++k)
        for (std::size_t j = 0; j < l.support(1); ++j)
          for (std::size_t i = 0; i < l.support(0); ++i) {
            const double w = l.weight[0][i] * (l.weight[1][j] * l.weight[2][k]);
            if (w == 0) continue;
            rows.column.push_back(static_cast<Index>(model_->row(l, j, k) + i));
            rows.value.push_back(w);
          }
    rows.start.push_back(rows.column.size());
  }
  return rows;
}

void LatticeMap::combine(const Binding& binding, Points nodeValues, std::span<Vec3> out) const {
  const Bound& bound = Bound::of(binding, model_);
  requireSize("nodeValues", nodeValues.size(), nodeCount());
  requireSize("out", out.size(), bound.size());
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    Local local(model_->lattice.axis);
    for (std::size_t p = begin; p < end; ++p)
      out[p] = bound.rest[p].allFinite() && model_->locate(bound.rest[p], local) ? model_->combine(local, nodeValues.data())
                                                                                : Vec3(Vec3::Zero());
  });
}

void LatticeMap::gather(const Binding& binding, Points pointValues, std::span<Vec3> out) const {
  const Bound& bound = Bound::of(binding, model_);
  requireSize("pointValues", pointValues.size(), bound.size());
  requireSize("out", out.size(), nodeCount());
  const auto add = [&](std::size_t begin, std::size_t end, Vec3* sums) {
    Local local(model_->lattice.axis);
    for (std::size_t p = begin; p < end; ++p)
      if (bound.rest[p].allFinite() && model_->locate(bound.rest[p], local)) model_->scatter(local, pointValues[p], sums);
  };
  std::fill(out.begin(), out.end(), Vec3(Vec3::Zero()));
  const std::size_t n = bound.size(), chunks = std::min(kGatherChunks, (n + kGrain - 1) / kGrain);
  if (chunks < 2 || chunks * nodeCount() * sizeof(Vec3) > kGatherMemory) return add(0, n, out.data());
  std::vector<Vec3> sums(chunks * nodeCount(), Vec3::Zero());
  parallelFor(chunks, 1, [&](std::size_t c, std::size_t) { add(n * c / chunks, n * (c + 1) / chunks, &sums[c * nodeCount()]); });
  for (std::size_t c = 0; c < chunks; ++c)
    for (std::size_t i = 0; i < nodeCount(); ++i) out[i] += sums[c * nodeCount() + i];
}

std::unique_ptr<LinearMap> LatticeMap::withDisplacements(Points displacements) const {
  requireSize("displacements", displacements.size(), nodeCount());
  for (std::size_t i = 0; i < displacements.size(); ++i)
    if (!displacements[i].allFinite()) throw std::invalid_argument(fmt::format("displacements: that of node {} is not finite", i));
  auto other = std::make_unique<LatticeMap>(*this);
  other->displacements_ = std::make_shared<const std::vector<Vec3>>(displacements.begin(), displacements.end());
  return other;
}

}  // namespace fielddeform::map
