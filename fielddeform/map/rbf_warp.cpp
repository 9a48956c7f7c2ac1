#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/map/rbf_warp.h>
#include <fielddeform/numeric/compact_rbf.h>
#include <fielddeform/numeric/rotation.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

namespace fielddeform::map {
namespace {

constexpr double kRigid = 1e-12;  // of the centres' size: what is nearer to a rigid motion is one
constexpr std::size_t kMostDense = 2000;  // centres: above, the dense solve takes too long
constexpr std::size_t kGrain = 64;

void requireCentres(Points rest, Points posed, const RbfWarpOptions& o) {
  if (rest.size() != posed.size())
    throw std::invalid_argument(fmt::format("posed: {} centres, expected {}, one a rest centre", posed.size(), rest.size()));
  if (rest.empty()) throw std::invalid_argument("rest: no centres, needs at least 1");
  if (rest.size() > o.maxCentres)
    throw std::invalid_argument(fmt::format("rest: {} centres, must be <= {}", rest.size(), o.maxCentres));
  requireFinite("time", o.time);
  requireInRange("smoothing", o.smoothing, 0, std::numeric_limits<double>::max());
  requirePositive("tolerance", o.tolerance);
  for (std::size_t i = 0; i < rest.size(); ++i)
    for (const Points& side : {rest, posed})
      if (!side[i].allFinite())
        throw std::invalid_argument(fmt::format("{}: centre {} is not finite", &side == &rest ? "rest" : "posed", i));
}

// The rigid motion p -> q.centre + R (p - p.centre).
struct Motion {
  Vec3 from = Vec3::Zero(), to = Vec3::Zero();
  Mat3 rotation = Mat3::Identity();

  Vec3 displacement(const Vec3& p) const {
    const Vec3 x = p - from;
    return (to - from) + (rotation * x - x);
  }
};

Vec3 mean(Points p) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& x : p) sum += x - p[0];
  return p[0] + sum / static_cast<double>(p.size());
}

double largestMiss(const Motion& m, Points rest, Points posed) {
  double worst = 0;
  for (std::size_t i = 0; i < rest.size(); ++i)
    worst = std::max(worst, (posed[i] - (rest[i] + m.displacement(rest[i]))).stableNorm());
  return worst;
}

Mat3 bestRotation(const Motion& m, Points rest, Points posed, double size) {
  const double unit = size > 0 ? std::ldexp(1.0, -std::clamp(std::ilogb(size), -1022, 1022)) : 1;  // squares stay in range
  Mat3 c = Mat3::Zero();
  for (std::size_t i = 0; i < rest.size(); ++i)
    c += ((rest[i] - m.from) * unit) * ((posed[i] - m.to) * unit).transpose();
  return numeric::kabsch(c);
}

}  // namespace

struct RbfWarp::Model {
  Motion motion;
  std::optional<numeric::Rbf> rest;  // what the motion leaves; absent if nothing
  std::vector<numeric::CompactRbf> many;  // the same for many centres, one a coordinate
  bool identity = false;
  numeric::RbfReport report;

  Model(Points restCentres, Points posed, const RbfWarpOptions& options);
  void fitMany(Points centres, Points left, const RbfWarpOptions& options, double size);
  Vec3 displacement(const Vec3& p) const {
    if (identity) return Vec3::Zero();
    Vec3 d = motion.displacement(p);
    if (rest) d += rest->evaluate(p);
    Vec3 unused;
    for (std::size_t k = 0; k < many.size(); ++k) d[static_cast<int>(k)] += many[k].evaluate(p, unused);
    return d;
  }
  Mat3 gradient(const Vec3& p) const {
    if (identity) return Mat3::Zero();
    Mat3 g = motion.rotation - Mat3::Identity();
    if (rest) g += rest->jacobian(p);
    Vec3 row;
    for (std::size_t k = 0; k < many.size(); ++k) {
      many[k].evaluate(p, row);
      g.row(static_cast<int>(k)) += row.transpose();
    }
    return g;
  }
};

RbfWarp::Model::Model(Points restCentres, Points posed, const RbfWarpOptions& options) {
  identity = std::equal(restCentres.begin(), restCentres.end(), posed.begin());
  if (identity) return;
  Box box;
  for (const Vec3& p : restCentres) box.extend(p);
  const double size = box.sizes().stableNorm();
  motion.from = mean(restCentres);
  motion.to = mean(posed);
  // A pure shift first: its rotation is exactly none.
  if (largestMiss(motion, restCentres, posed) <= kRigid * size) return;
  if (options.rigidPart == RigidPart::BestRotation) {
    motion.rotation = bestRotation(motion, restCentres, posed, size);
    if (largestMiss(motion, restCentres, posed) <= kRigid * size) return;
  }
  std::vector<Vec3> left(restCentres.size());
  for (std::size_t i = 0; i < left.size(); ++i)
    left[i] = posed[i] - restCentres[i] - motion.displacement(restCentres[i]);
  if (left.size() > kMostDense) {
    fitMany(restCentres, left, options, size);
    return;
  }
  numeric::RbfOptions rbf;
  rbf.smoothing = options.smoothing;
  rbf.maxCentres = options.maxCentres;
  rest.emplace(restCentres, left, rbf);
  report = rest->report();
}

void RbfWarp::Model::fitMany(Points centres, Points left, const RbfWarpOptions& options, double size) {
  numeric::CompactRbfOptions o;
  o.smoothing = options.smoothing;
  o.tolerance = options.tolerance * size / std::sqrt(3.0);
  std::vector<double> component(left.size());
  for (int k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < left.size(); ++i) component[i] = left[i][k];
    many.emplace_back(centres, component, o);
    const numeric::CompactRbfReport& r = many.back().report();
    report.centres = r.centres;
    report.distinct = r.distinct;
    report.residual = std::hypot(report.residual, r.residual);
  }
}

class RbfWarp::Bound final : public Binding {
 public:
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const Model> model;
  std::vector<Vec3> rest;
  std::vector<Vec3> displacement;  // at t = 1
};

RbfWarp::RbfWarp(Points rest, Points posed, const RbfWarpOptions& options) : time_(options.time) {
  requireCentres(rest, posed, options);
  model_ = std::make_shared<const Model>(rest, posed, options);
}

RbfWarp RbfWarp::atTime(double time) const {
  requireFinite("time", time);
  RbfWarp other = *this;
  other.time_ = time;
  return other;
}

const numeric::RbfReport& RbfWarp::report() const noexcept { return model_->report; }

Vec3 RbfWarp::position(const Vec3& rest) const { return rest + time_ * model_->displacement(rest); }

Mat3 RbfWarp::jacobian(const Vec3& rest) const { return Mat3::Identity() + time_ * model_->gradient(rest); }

std::shared_ptr<const Binding> RbfWarp::bind(Points rest) const {
  auto bound = std::make_shared<Bound>();
  bound->model = model_;
  bound->rest.assign(rest.begin(), rest.end());
  bound->displacement.resize(rest.size());
  parallelFor(rest.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      bound->displacement[i] = rest[i].allFinite() ? model_->displacement(rest[i]) : Vec3::Zero();
  });
  return bound;
}

void RbfWarp::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->model != model_) throw std::invalid_argument("binding: not of this warp");
  const std::size_t n = bound->size();
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0 && size != n) throw std::invalid_argument(fmt::format("out: a span has {} elements, expected {} or 0", size, n));
  parallelFor(n, 4096, progress, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const bool valid = bound->rest[i].allFinite(), fixed = model_->identity || time_ == 0;
      const Vec3 x = valid ? Vec3(bound->rest[i] + time_ * bound->displacement[i]) : bound->rest[i];
      if (!out.position.empty()) out.position[i] = x;
      if (!out.safe.empty()) out.safe[i] = x;
      if (!out.status.empty()) out.status[i] = !valid ? Status::Invalid : fixed ? Status::Fixed : Status::Converged;
      if (!out.residual.empty()) out.residual[i] = 0;
    }
  });
}

void RbfWarp::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->model != model_) throw std::invalid_argument("binding: not of this warp");
  if (out.size() != bound->size())
    throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), bound->size()));
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      out[i] = bound->rest[i].allFinite() ? jacobian(bound->rest[i]) : Mat3::Identity();
  });
}

}  // namespace fielddeform::map
