#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/solid/bezier.h>
#include <fielddeform/solid/solid_map.h>
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::solid {
namespace {

constexpr std::size_t kGrain = 256;
constexpr int kSplits = 2;           // halvings along each axis: 4 by 4 by 4 cells
constexpr double kOnSurface = 1e-9;  // of the cube
constexpr double kExact = 1e-13;     // of the size: a local coordinate's image

/// One half of a net, by de Casteljau's algorithm.
std::vector<Vec3> halfOf(const std::vector<Vec3>& net, const std::array<int, 3>& degree, std::size_t axis, bool upper) {
  std::vector<Vec3> out = net;
  const auto n = static_cast<std::size_t>(degree[axis]);
  const std::size_t stride = axis == 0 ? 1 : axis == 1 ? static_cast<std::size_t>(degree[0] + 1) : static_cast<std::size_t>((degree[0] + 1) * (degree[1] + 1));
  std::vector<Vec3> row(n + 1);
  for (std::size_t first = 0; first < net.size(); ++first) {
    if (first / stride % (n + 1) != 0) continue;
    for (std::size_t i = 0; i <= n; ++i) row[i] = net[first + i * stride];
    for (std::size_t k = 0; k <= n; ++k) {
      if (upper) out[first + (n - k) * stride] = row[n - k];
      else out[first + k * stride] = row[0];
      for (std::size_t i = 0; i + k < n; ++i) row[i] = 0.5 * (row[i] + row[i + 1]);
    }
  }
  return out;
}

}  // namespace

struct SolidMap::Model {
  struct Cell {
    Box box;
    Vec3 middle;  // u, v, w
  };
  struct Part {
    std::vector<Vec3> points;
    std::vector<Cell> cells;
    double size = 1;
  };
  Object rest;
  std::vector<Part> parts;
  double reach = 0.5;

  Model(Object object, double r) : rest(std::move(object)), reach(r) {
    rest.validate();
    requireInRange("reach", reach, 0, 1e3);
    for (std::size_t s = 0; s < rest.solids.size(); ++s) {
      Part part;
      part.points = rest.pointsOf(s);
      divide(rest.solids[s].degree, part.points, Vec3::Zero(), Vec3::Ones(), 0, part.cells);
      Box all;
      for (const Cell& c : part.cells) all.extend(c.box);
      part.size = std::max(all.sizes().norm(), 1e-300);
      parts.push_back(std::move(part));
    }
  }

  static void divide(const std::array<int, 3>& degree, const std::vector<Vec3>& net, const Vec3& low, const Vec3& high, int depth, std::vector<Cell>& out) {
    if (depth == 3 * kSplits) {
      Cell cell{{}, 0.5 * (low + high)};
      for (const Vec3& p : net) cell.box.extend(p);
      out.push_back(cell);
      return;
    }
    const auto axis = static_cast<std::size_t>(depth % 3);
    const auto a = static_cast<Eigen::Index>(axis);
    const double middle = 0.5 * (low[a] + high[a]);
    for (const bool upper : {false, true}) {
      Vec3 l = low, h = high;
      (upper ? l : h)[a] = middle;
      divide(degree, halfOf(net, degree, axis, upper), l, h, depth + 1, out);
    }
  }

  /// Newton's method on the solid gone on beyond its cube, with halved steps while the image does not come nearer.
  bool invert(std::size_t s, const Vec3& x, Vec3& u) const {
    const auto& degree = rest.solids[s].degree;
    const std::vector<Vec3>& points = parts[s].points;
    const double far = 1 + 2 * reach, enough = kExact * (parts[s].size + 1e-3 * x.cwiseAbs().maxCoeff());
    Vec3 off = x - evaluate(degree, points, u);
    double error = off.norm();
    for (int k = 0; k < 50 && error > 0; ++k) {
      const Vec3 step = derivative(degree, points, u).partialPivLu().solve(off);
      if (!step.allFinite()) break;
      bool nearer = false;
      for (double share = std::min(1.0, 0.5 / std::max(step.cwiseAbs().maxCoeff(), 1e-300)); share > 1e-5 && !nearer; share *= 0.5) {
        const Vec3 trial = (u + share * step).cwiseMax(-far).cwiseMin(1 + far);
        const Vec3 rest2 = x - evaluate(degree, points, trial);
        if (!(rest2.norm() < error)) continue;
        u = trial, off = rest2, error = rest2.norm(), nearer = true;
      }
      if (!nearer) break;
    }
    return error <= enough && derivative(degree, points, u).determinant() > 0;
  }

  Place locate(const Vec3& x) const {
    // Cells whose boxes hold the point, then those near it.
    struct Start {
      double distance;
      std::size_t solid;
      Vec3 middle;
    };
    std::vector<Start> starts;
    for (std::size_t s = 0; s < parts.size(); ++s)
      for (const Cell& c : parts[s].cells) starts.push_back({c.box.exteriorDistance(x) / parts[s].size, s, c.middle});
    std::stable_sort(starts.begin(), starts.end(), [](const Start& a, const Start& b) { return a.distance < b.distance; });
    Place best;
    double over = std::numeric_limits<double>::infinity();
    int outside = 0;
    for (const Start& start : starts) {
      // Boxes that hold it are all tried; a dozen of the others.
      if (start.distance > 1e-9 && ++outside > 12) break;
      Vec3 u = start.middle;
      if (!invert(start.solid, x, u)) continue;
      const double beyond = std::max({0.0, -u.minCoeff(), u.maxCoeff() - 1});
      if (beyond < over) best = {start.solid, u, beyond <= reach + kOnSurface, beyond <= kOnSurface}, over = beyond;
      if (best.inside) break;
    }
    return best;
  }
};

class SolidMap::Bound final : public map::Binding {
 public:
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const Model> model;
  std::vector<Vec3> rest;
  std::vector<Place> place;
  std::vector<bool> invalid;
};

SolidMap::SolidMap(Object rest, Points posed, double reach) : model_(std::make_shared<const Model>(std::move(rest), reach)) {
  const std::vector<Vec3>& points = model_->rest.points;
  if (posed.size() != points.size()) throw std::invalid_argument(fmt::format("posed: {} points, expected {}", posed.size(), points.size()));
  std::vector<Vec3> d(points.size());
  for (std::size_t i = 0; i < d.size(); ++i) {
    d[i] = posed[i] - points[i];
    if (!d[i].allFinite()) throw std::invalid_argument(fmt::format("posed: point {} is not finite", i));
  }
  displacements_ = std::make_shared<const std::vector<Vec3>>(std::move(d));
}

SolidMap::Place SolidMap::locate(const Vec3& x) const { return x.allFinite() ? model_->locate(x) : Place{}; }

const SolidMap::Bound& SolidMap::own(const map::Binding& binding) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->model != model_) throw std::invalid_argument("binding: not of this object");
  return *bound;
}

SolidMap::Place SolidMap::place(const map::Binding& binding, std::size_t point) {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound) throw std::invalid_argument("binding: not of a solid map");
  return bound->place.at(point);
}

std::shared_ptr<const map::Binding> SolidMap::bind(Points rest) const {
  auto bound = std::make_shared<Bound>();
  bound->model = model_;
  bound->rest.assign(rest.begin(), rest.end());
  bound->place.resize(rest.size());
  bound->invalid.resize(rest.size());
  for (std::size_t p = 0; p < rest.size(); ++p) bound->invalid[p] = !rest[p].allFinite();
  parallelFor(rest.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) bound->place[p] = locate(rest[p]);
  });
  return bound;
}

void SolidMap::combine(const map::Binding& binding, Points nodeValues, std::span<Vec3> out) const {
  const Bound& bound = own(binding);
  if (nodeValues.size() != nodeCount() || out.size() != bound.size()) throw std::invalid_argument("combine: a size does not fit");
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<double> w;
    for (std::size_t p = begin; p < end; ++p) {
      out[p].setZero();
      if (!bound.place[p].found) continue;
      const Solid& solid = model_->rest.solids[bound.place[p].solid];
      w.resize(solid.slots());
      weights(solid.degree, bound.place[p].uvw, w);
      for (std::size_t s = 0; s < w.size(); ++s) out[p] += w[s] * nodeValues[solid.points[s]];
    }
  });
}

void SolidMap::apply(const map::Binding& binding, map::MapOutput out, Progress& progress) const {
  const Bound& bound = own(binding);
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0 && size != bound.size()) throw std::invalid_argument(fmt::format("out: {} elements, expected {}", size, bound.size()));
  progress.throwIfCancelled();
  std::vector<Vec3> d(bound.size());
  combine(binding, *displacements_, d);
  for (std::size_t p = 0; p < d.size(); ++p) {
    Vec3 x = d[p] == Vec3::Zero() ? bound.rest[p] : Vec3(bound.rest[p] + d[p]);
    const bool invalid = bound.invalid[p] || !x.allFinite();
    if (invalid) x = bound.rest[p];
    if (!out.position.empty()) out.position[p] = x;
    if (!out.safe.empty()) out.safe[p] = x;
    if (!out.status.empty()) out.status[p] = invalid ? Status::Invalid : d[p] == Vec3::Zero() ? Status::Fixed : Status::Converged;
    if (!out.residual.empty()) out.residual[p] = 0;
  }
}

void SolidMap::jacobians(const map::Binding& binding, std::span<Mat3> out) const {
  const Bound& bound = own(binding);
  if (out.size() != bound.size()) throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), bound.size()));
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<Vec3> g;
    for (std::size_t p = begin; p < end; ++p) {
      out[p].setIdentity();
      if (!bound.place[p].found) continue;
      const Solid& solid = model_->rest.solids[bound.place[p].solid];
      g.resize(solid.slots());
      weights(solid.degree, bound.place[p].uvw, {}, g);
      Mat3 rest = Mat3::Zero(), change = Mat3::Zero();
      for (std::size_t s = 0; s < g.size(); ++s) {
        rest += model_->rest.points[solid.points[s]] * g[s].transpose();
        change += (*displacements_)[solid.points[s]] * g[s].transpose();
      }
      const Mat3 d = change * rest.inverse();
      if (d.allFinite()) out[p] += d;
    }
  });
}

std::size_t SolidMap::nodeCount() const { return model_->rest.points.size(); }
Points SolidMap::restNodes() const { return model_->rest.points; }
Points SolidMap::displacements() const { return *displacements_; }

map::SparseRows SolidMap::basis(const map::Binding& binding) const {
  const Bound& bound = own(binding);
  map::SparseRows rows;
  rows.columns = nodeCount();
  std::vector<double> w, sum(nodeCount(), 0.0);
  for (std::size_t p = 0; p < bound.size(); ++p) {
    if (bound.place[p].found) {
      const Solid& solid = model_->rest.solids[bound.place[p].solid];
      w.resize(solid.slots());
      weights(solid.degree, bound.place[p].uvw, w);
      std::vector<Index> columns(solid.points);
      std::sort(columns.begin(), columns.end());
      columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
      for (std::size_t s = 0; s < w.size(); ++s) sum[solid.points[s]] += w[s];
      for (const Index c : columns) {
        if (sum[c] != 0) rows.column.push_back(c), rows.value.push_back(sum[c]);
        sum[c] = 0;
      }
    }
    rows.start.push_back(rows.column.size());
  }
  return rows;
}

void SolidMap::gather(const map::Binding& binding, Points pointValues, std::span<Vec3> out) const {
  const Bound& bound = own(binding);
  if (pointValues.size() != bound.size() || out.size() != nodeCount()) throw std::invalid_argument("gather: a size does not fit");
  const std::vector<Vec3> total = deterministicReduce(
      bound.size(), 4096, std::vector<Vec3>(nodeCount(), Vec3::Zero()),
      [&](std::size_t begin, std::size_t end) {
        std::vector<Vec3> part(nodeCount(), Vec3::Zero());
        std::vector<double> w;
        for (std::size_t p = begin; p < end; ++p) {
          if (!bound.place[p].found) continue;
          const Solid& solid = model_->rest.solids[bound.place[p].solid];
          w.resize(solid.slots());
          weights(solid.degree, bound.place[p].uvw, w);
          for (std::size_t s = 0; s < w.size(); ++s) part[solid.points[s]] += w[s] * pointValues[p];
        }
        return part;
      },
      [](std::vector<Vec3> a, const std::vector<Vec3>& b) {
        for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
        return a;
      });
  std::copy(total.begin(), total.end(), out.begin());
}

std::unique_ptr<map::LinearMap> SolidMap::withDisplacements(Points displacements) const {
  if (displacements.size() != nodeCount()) throw std::invalid_argument(fmt::format("displacements: {}, expected {}", displacements.size(), nodeCount()));
  for (const Vec3& d : displacements)
    if (!d.allFinite()) throw std::invalid_argument("displacements: one is not finite");
  auto other = std::make_unique<SolidMap>(*this);
  other->displacements_ = std::make_shared<const std::vector<Vec3>>(displacements.begin(), displacements.end());
  return other;
}

}  // namespace fielddeform::solid
