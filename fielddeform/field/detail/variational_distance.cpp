// A primitive's distance as a variational interpolant of samples: 0 on the primitive, and true distances on offset surfaces
// around it.  [Turk & O'Brien 1999; Qin et al. 2003, Fig. 1]
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/distance_source.h>
#include <fielddeform/field/detail/stencil.h>
#include <fielddeform/numeric/compact_rbf.h>
#include <fielddeform/numeric/rbf.h>

#include <cmath>

namespace fielddeform::field::detail {
namespace {

constexpr std::size_t kMostDense = 2000;  // centres: above, the dense solve takes too long
constexpr double kReach = 1.25;           // radii: nothing is fitted beyond
constexpr double kFadeFrom = 0.85;        // between these the fit gives way to the exact distance, so that the field
constexpr double kFadeTo = 1.15;          // ends where it should

class VariationalDistance final : public DistanceSource {
 public:
  VariationalDistance(const PrimitiveDistance& distance, const skeleton::Primitive& primitive, const VariationalOptions& options,
                      DistanceReport& report)
      : distance_(distance), box_(distance.bounds()), radius_(distance.greatestRadius()) {
    box_.min().array() -= kReach * radius_;
    box_.max().array() += kReach * radius_;
    const Stencil s = sampleDistance(distance, primitive, options.centres);
    report.kind = Distance::Variational;
    report.centres = s.points.size();
    if (options.centres <= kMostDense) fitDense(s, options, report);
    else fitCompact(s, options, report);
  }

  std::optional<Relative> at(const Vec3& point) const override {
    const auto exact = exactAt(point);
    if (!exact || !(std::abs(exact->value) < kFadeTo)) return exact;
    Vec3 gradient;
    const double value = dense_ ? dense_->first(point, gradient) : compact_->evaluate(point, gradient);
    return faded(value, gradient, *exact);
  }

  bool togetherIsQuicker(std::size_t points) const override { return dense_ && dense_->togetherIsQuicker(points); }

  void atMany(Points points, std::span<std::optional<Relative>> out) const override {
    parallelFor(points.size(), 512, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) out[i] = exactAt(points[i]);
    });
    std::vector<std::size_t> which;
    std::vector<Vec3> some;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (out[i] && std::abs(out[i]->value) < kFadeTo) {
        which.push_back(i);
        some.push_back(points[i]);
      }
    std::vector<double> values(some.size());
    std::vector<Vec3> gradients(some.size());
    dense_->first(some, values, gradients);
    parallelFor(some.size(), 4096, [&](std::size_t begin, std::size_t end) {
      for (std::size_t j = begin; j < end; ++j) out[which[j]] = faded(values[j], gradients[j], *out[which[j]]);
    });
  }

 private:
  // Beyond its constraints the fit means nothing: the exact distance says where that is.
  std::optional<Relative> exactAt(const Vec3& point) const {
    if (!box_.contains(point)) return std::nullopt;
    const auto hit = distance_.closest(point, kFadeTo * radius_);
    if (!hit) return std::nullopt;
    return exactRelative(distance_, *hit);
  }
  // What was fitted, going over to the exact distance.
  Relative faded(double value, const Vec3& gradient, const Relative& exact) const {
    const Relative fitted{value / radius_, gradient / radius_};
    const double depth = std::abs(exact.value);  // also deep inside a solid
    if (depth <= kFadeFrom) return fitted;
    const double unit = 1 / (kFadeTo - kFadeFrom);
    return mix(fitted, exact, unit * (depth - kFadeFrom), std::copysign(unit, exact.value) * exact.gradient);
  }
  void fitDense(const Stencil& s, const VariationalOptions& options, DistanceReport& report) {
    std::vector<Vec3> values(s.points.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = Vec3(s.values[i], 0, 0);
    dense_.emplace(s.points, values, numeric::RbfOptions{.smoothing = options.smoothing, .maxCentres = kMostDense});
    report.residual = dense_->report().residual;
  }
  void fitCompact(const Stencil& s, const VariationalOptions& options, DistanceReport& report) {
    numeric::CompactRbfOptions o;
    o.smoothing = options.smoothing;
    o.tolerance = options.tolerance * radius_;
    compact_.emplace(s.points, s.values, o);
    report.levels = compact_->report().levels;
    report.residual = compact_->report().residual;
  }

  const PrimitiveDistance& distance_;
  Box box_;
  double radius_;  // what is fitted is d / r times this
  std::optional<numeric::Rbf> dense_;
  std::optional<numeric::CompactRbf> compact_;
};

}  // namespace

std::unique_ptr<DistanceSource> makeVariationalDistance(const PrimitiveDistance& distance, const skeleton::Primitive& primitive,
                                                        const VariationalOptions& options, DistanceReport& report) {
  return std::make_unique<VariationalDistance>(distance, primitive, options, report);
}

}  // namespace fielddeform::field::detail
