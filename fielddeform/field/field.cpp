#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/blend_grid.h>
#include <fielddeform/field/detail/distance_source.h>
#include <fielddeform/field/field.h>
#include <fielddeform/field/potential.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace fielddeform::field {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMaxWeight = 1e40;  // times e^600 and the number of primitives stays finite
// The inverse of a kernel whose slope vanishes on the primitive has no slope bound there: at least this share of the
// mean slope is divided by.
constexpr double kSlopeFloor = 0.05;
constexpr double kSlack = 1e-12;  // a bound in world units, rounded
constexpr std::size_t kTogether = 64;  // points whose sums are held at once
constexpr std::size_t kMany = std::size_t{1} << 19;  // the same where a source takes many points together

}  // namespace

void FieldOptions::validate() const {
  requireInRange("sharpness", sharpness, 1e-3, 500);
  if (referenceRadius) requirePositive("referenceRadius", *referenceRadius);
  distance.validate();
}

FieldOptions FieldOptions::after(const Field& other) const {
  FieldOptions options = *this;
  options.distance.grid.takenMegabytes += other.gridMegabytes();
  return options;
}

struct Field::Impl {
  struct Term {
    detail::PrimitiveDistance distance;
    Kernel kernel;
    double weight;
    bool plain;  // weight 1 and the field's own kernel: alone, its x is the blend's x
    std::unique_ptr<detail::DistanceSource> source = {};  // null: exact
    DistanceReport report = {};

    // Nothing farther counts.
    double reach() const { return distance.greatestRadius() * (1 + kSlack); }
    std::optional<detail::Relative> at(const Vec3& point, double maxDistance) const {
      if (source)
        if (const auto found = source->at(point)) return found;
      return exactAt(point, maxDistance);
    }
    std::optional<detail::Relative> exactAt(const Vec3& point, double maxDistance) const {
      const auto hit = distance.closest(point, maxDistance);
      if (!hit) return std::nullopt;
      return detail::exactRelative(distance, *hit);
    }
  };

  // The sum over the primitives that reach a point.
  struct Blend {
    double sum = 0;
    Vec3 slope = Vec3::Zero();         // sum of w E'(x) grad(d / r)
    Vec3 onlyGradient = Vec3::Zero();  // of the last
    double only = 0;
    int active = 0;
    bool plain = false;
  };

  FieldOptions options;
  Kernel own;
  std::vector<Term> terms;
  double reference = 1;  // R
  std::unique_ptr<const detail::BlendGrid> grid;  // of the whole field; null: none
  std::optional<DistanceReport> gridReport;

  Impl(const skeleton::Skeleton& skeleton, const FieldOptions& o, Points around);
  void makeSources(const skeleton::Skeleton& skeleton, Points around);
  void makeBlendGrid(Points around);
  FieldValue evaluate(const Vec3& point) const;
  FieldValue evaluateExactly(const Vec3& point) const;
  FieldValue blended(const detail::Relative& d) const;
  void evaluateTogether(Points points, std::span<FieldValue> out, SearchHints& hints, std::span<Foot> feet) const;
  void exactTogether(Points points, std::span<double> out, SearchHints& hints) const;
  bool manyAreQuicker(std::size_t points) const;
  void evaluateMany(Points points, std::span<FieldValue> out) const;
  void add(const Term& t, const detail::Relative& near, Blend& blend) const;
  bool finish(const Blend& blend, FieldValue& value) const;
  void beyond(const Vec3& point, FieldValue& value) const;
  void extend(const Vec3& point, FieldValue& value) const;
};

Field::Impl::Impl(const skeleton::Skeleton& skeleton, const FieldOptions& o, Points around)
    : options(o), own(o.potential, o.sharpness) {
  double greatest = 0, greatestWeighted = 0;
  for (const auto& p : skeleton.primitives) {
    if (p.weight > kMaxWeight)
      throw std::invalid_argument(fmt::format("primitive \"{}\": weight is {}, must be <= {}", p.name, p.weight, kMaxWeight));
    const auto potential = p.potential.value_or(o.potential);
    terms.push_back({detail::PrimitiveDistance(p), Kernel(potential, o.sharpness), p.weight,
                     p.weight == 1 && potential == o.potential});
    const double r = terms.back().distance.greatestRadius();
    greatest = std::max(greatest, r);
    if (p.weight > 0) greatestWeighted = std::max(greatestWeighted, r);
  }
  reference = o.referenceRadius.value_or(greatestWeighted > 0 ? greatestWeighted : greatest);
  if (o.distance.kind != Distance::Exact) makeSources(skeleton, around);
}

void Field::Impl::makeSources(const skeleton::Skeleton& skeleton, Points around) {
  const GridOptions& g = options.distance.grid;
  if (g.around == GridAround::Influence) around = {};
  if (options.distance.kind == Distance::Grid && g.of == GridOf::Blend) return makeBlendGrid(around);
  detail::GridBudget budget(g);
  for (std::size_t i = 0; i < terms.size(); ++i) {
    Term& t = terms[i];
    if (!(t.weight > 0)) continue;
    if (options.distance.kind == Distance::Grid)
      t.source = detail::makeGridDistance(t.distance, skeleton.primitives[i].name, g, around, budget, t.report);
    else
      t.source = detail::makeVariationalDistance(t.distance, skeleton.primitives[i], options.distance.variational, t.report);
  }
}

void Field::Impl::makeBlendGrid(Points around) {
  detail::BlendSource source{{}, reference, options.sharpness, true, [this](const Vec3& p) { return evaluateExactly(p).pseudoDistance; },
                             [this](Points points, std::span<double> out, SearchHints& hints) { exactTogether(points, out, hints); }};
  for (const Term& t : terms) {
    if (!(t.weight > 0)) continue;
    source.parts.push_back({&t.distance, t.weight});
    source.exponential = source.exponential && t.kernel.potential() == skeleton::Potential::Exponential;
  }
  source.exponential = source.exponential && own.potential() == skeleton::Potential::Exponential;
  if (source.parts.empty()) return;
  detail::GridBudget budget(options.distance.grid);
  gridReport.emplace();
  grid = std::make_unique<const detail::BlendGrid>(std::move(source), options.distance.grid, around, budget, *gridReport);
}

// One primitive more.
void Field::Impl::add(const Term& t, const detail::Relative& near, Blend& blend) const {
  const double f = near.value, x = options.sharpness * f;
  const double e = t.weight * t.kernel.value(x);
  if (!(e > 0)) return;
  blend.sum += e;
  const Vec3& g = near.gradient;
  blend.slope += t.weight * t.kernel.derivative(x) * g;
  blend.plain = t.plain;
  blend.only = f;
  blend.onlyGradient = g;
  ++blend.active;
}

// The value where primitives reach; false where none does.
bool Field::Impl::finish(const Blend& blend, FieldValue& value) const {
  if (blend.active == 0) return false;
  const double k = options.sharpness;
  value.sum = blend.sum;
  value.inside = true;
  if (blend.active == 1 && blend.plain) {
    value.pseudoDistance = reference * blend.only;
    value.gradient = reference * blend.onlyGradient;
    return true;
  }
  const double x = own.inverse(value.sum);
  value.pseudoDistance = reference * (x / k);
  double steepness = -own.slopeAt(value.sum);
  if (2 * x < k) steepness = std::max(steepness, kSlopeFloor * own.atZero() / k);
  // Where the slope vanishes at the radius (sum rounded to almost nothing) there is no direction to be had.
  if (steepness > 0) value.gradient = (-reference / steepness) * blend.slope;
  return true;
}

void Field::Impl::extend(const Vec3& point, FieldValue& value) const {
  double best = kInfinity;  // d / r
  for (const Term& t : terms) {
    if (!(t.weight > 0)) continue;
    const auto near = t.at(point, best * t.distance.greatestRadius() * (1 + kSlack));
    if (!near || !(near->value < best)) continue;
    best = near->value;
    value.gradient = reference * near->gradient;
  }
  value.pseudoDistance = reference * best;
}

// A field value of its pseudo-distance alone.
FieldValue Field::Impl::blended(const detail::Relative& d) const {
  FieldValue value{0, d.value, d.gradient, d.value < reference};
  if (value.inside) value.sum = own.value(options.sharpness * (d.value / reference));
  else if (options.extension == Extension::None) value.pseudoDistance = reference, value.gradient.setZero();
  return value;
}

FieldValue Field::Impl::evaluate(const Vec3& point) const {
  if (!grid || !point.allFinite()) return evaluateExactly(point);
  const auto sample = grid->at(point);
  if (!sample) return evaluateExactly(point);
  if (sample->share >= 1) return blended(sample->blend);
  const FieldValue exact = evaluateExactly(point);
  return blended(detail::mix({exact.pseudoDistance, exact.gradient}, sample->blend, sample->share, sample->shareGradient));
}

FieldValue Field::Impl::evaluateExactly(const Vec3& point) const {
  FieldValue value;
  value.pseudoDistance = kInfinity;
  if (!point.allFinite()) return value;
  Blend blend;
  for (const Term& t : terms) {
    if (!(t.weight > 0)) continue;
    if (const auto near = t.at(point, t.reach())) add(t, *near, blend);
  }
  if (!finish(blend, value)) beyond(point, value);
  return value;
}

void Field::Impl::beyond(const Vec3& point, FieldValue& value) const {
  if (options.extension == Extension::Linear)
    extend(point, value);
  else
    value.pseudoDistance = reference;
}

void Field::Impl::evaluateTogether(Points points, std::span<FieldValue> out, SearchHints& hints, std::span<Foot> feet) const {
  const std::size_t n = points.size();
  std::fill(feet.begin(), feet.end(), Foot{});
  if (grid) {
    for (std::size_t i = 0; i < n; ++i) out[i] = evaluate(points[i]);
    return;
  }
  std::array<Blend, kTogether> blends;
  std::array<PrimitiveHit, kTogether> hits;
  for (std::size_t k = 0; k < terms.size(); ++k) {
    const Term& t = terms[k];
    if (!(t.weight > 0)) continue;
    if (t.source) {
      for (std::size_t i = 0; i < n; ++i)
        if (const auto near = t.at(points[i], t.reach())) add(t, *near, blends[i]);
      continue;
    }
    t.distance.closestTogether(points, t.reach(), std::span(hits).first(n), hints[k]);
    for (std::size_t i = 0; i < n; ++i)
      if (hits[i].element != kNoIndex) add(t, detail::exactRelative(t.distance, hits[i]), blends[i]);
    if (!feet.empty())
      for (std::size_t i = 0; i < n; ++i) feet[i * terms.size() + k] = Foot(hits[i]);
  }
  for (std::size_t i = 0; i < n; ++i) {
    out[i] = {};
    out[i].pseudoDistance = kInfinity;
    if (!finish(blends[i], out[i])) beyond(points[i], out[i]);
  }
}

// D while the grid is being made.
void Field::Impl::exactTogether(Points points, std::span<double> out, SearchHints& hints) const {
  std::array<FieldValue, kTogether> values;
  const bool finite = std::all_of(points.begin(), points.end(), [](const Vec3& p) { return p.allFinite(); });
  hints.resize(terms.size());
  if (finite) evaluateTogether(points, std::span(values).first(points.size()), hints, {});
  for (std::size_t i = 0; i < points.size(); ++i) out[i] = finite ? values[i].pseudoDistance : evaluateExactly(points[i]).pseudoDistance;
}

bool Field::Impl::manyAreQuicker(std::size_t points) const {
  return !grid && std::any_of(terms.begin(), terms.end(), [&](const Term& t) { return t.source && t.source->togetherIsQuicker(points); });
}

// One primitive after the other.
void Field::Impl::evaluateMany(Points points, std::span<FieldValue> out) const {
  std::vector<std::size_t> which;
  std::vector<Vec3> finite;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].allFinite()) which.push_back(i), finite.push_back(points[i]);
    else out[i] = evaluate(points[i]);
  }
  std::vector<Blend> blends(finite.size());
  std::vector<std::optional<detail::Relative>> found(finite.size());
  for (const Term& t : terms) {
    if (!(t.weight > 0)) continue;
    const bool together = t.source && t.source->togetherIsQuicker(finite.size());
    if (together) t.source->atMany(finite, found);
    parallelFor(finite.size(), 512, [&](std::size_t begin, std::size_t end) {
      for (std::size_t j = begin; j < end; ++j) {
        const auto near = !together ? t.at(finite[j], t.reach()) : found[j] ? found[j] : t.exactAt(finite[j], t.reach());
        if (near) add(t, *near, blends[j]);
      }
    });
  }
  parallelFor(finite.size(), 512, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      FieldValue value;
      value.pseudoDistance = kInfinity;
      if (!finish(blends[j], value)) beyond(finite[j], value);
      out[which[j]] = value;
    }
  });
}

Field::Field(const skeleton::Skeleton& skeleton, const FieldOptions& options, Points around) {
  options.validate();
  skeleton::validate(skeleton);
  impl_ = std::make_unique<Impl>(skeleton, options, around);
}
Field::~Field() = default;
Field::Field(Field&&) noexcept = default;
Field& Field::operator=(Field&&) noexcept = default;

const FieldOptions& Field::options() const noexcept { return impl_->options; }
std::size_t Field::primitiveCount() const noexcept { return impl_->terms.size(); }
double Field::referenceRadius() const noexcept { return impl_->reference; }
double Field::radius(std::size_t primitive) const { return impl_->terms.at(primitive).distance.greatestRadius(); }
double Field::weight(std::size_t primitive) const { return impl_->terms.at(primitive).weight; }
Box Field::bounds() const {
  Box box;
  for (const auto& t : impl_->terms) box.extend(t.distance.bounds());
  return box;
}

FieldValue Field::evaluate(const Vec3& point) const { return impl_->evaluate(point); }

void Field::evaluate(Points points, std::span<FieldValue> out) const {
  if (points.size() != out.size())
    throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), points.size()));
  for (std::size_t first = 0; first < points.size(); first += kMany) {
    const std::size_t n = std::min(kMany, points.size() - first);
    const Points some = points.subspan(first, n);
    const std::span<FieldValue> values = out.subspan(first, n);
    if (impl_->manyAreQuicker(n)) {
      impl_->evaluateMany(some, values);
      continue;
    }
    parallelFor(n, 512, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) values[i] = impl_->evaluate(some[i]);
    });
  }
}

void Field::evaluateTogether(Points points, std::span<FieldValue> out, SearchHints& hints, std::span<Foot> feet) const {
  if (points.size() != out.size())
    throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), points.size()));
  const std::size_t stride = feet.empty() ? 0 : impl_->terms.size();
  if (!feet.empty() && feet.size() != stride * points.size())
    throw std::invalid_argument(fmt::format("feet: {} elements, expected {}", feet.size(), stride * points.size()));
  hints.resize(impl_->terms.size());
  for (std::size_t begin = 0; begin < points.size(); begin += kTogether) {
    const std::size_t n = std::min(kTogether, points.size() - begin);
    const Points some = points.subspan(begin, n);
    if (std::all_of(some.begin(), some.end(), [](const Vec3& p) { return p.allFinite(); })) {
      impl_->evaluateTogether(some, out.subspan(begin, n), hints, feet.subspan(begin * stride, n * stride));
    } else {
      for (Foot& f : feet.subspan(begin * stride, n * stride)) f = {};
      for (std::size_t i = begin; i < begin + n; ++i) out[i] = impl_->evaluate(points[i]);
    }
  }
}

void Field::closestTogether(std::size_t primitive, Points points, std::span<PrimitiveHit> out, SearchHints& hints) const {
  if (points.size() != out.size())
    throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), points.size()));
  hints.resize(impl_->terms.size());
  impl_->terms.at(primitive).distance.closestTogether(points, kInfinity, out, hints[primitive]);
}

double Field::pseudoDistanceOf(double sum) const {
  return impl_->reference * (impl_->own.inverse(sum) / impl_->options.sharpness);
}

const DistanceReport& Field::distanceReport(std::size_t primitive) const { return impl_->terms.at(primitive).report; }

const std::optional<DistanceReport>& Field::blendReport() const noexcept { return impl_->gridReport; }

double Field::gridMegabytes() const noexcept {
  double sum = impl_->gridReport ? impl_->gridReport->megabytes : 0;
  for (const auto& t : impl_->terms) sum += t.report.megabytes;
  return sum;
}

PrimitiveHit Field::closest(std::size_t primitive, const Vec3& point) const {
  if (const auto hit = impl_->terms.at(primitive).distance.closest(point)) return *hit;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  return {point, nan, Vec3::Zero(), kNoIndex, {kNoIndex, kNoIndex, kNoIndex}, Vec3::Zero()};
}

PrimitiveHit Field::closestAt(std::size_t primitive, const Vec3& point, Foot foot) const {
  return foot.known() ? impl_->terms.at(primitive).distance.closestOn(foot.element(), foot.inside(), point) : closest(primitive, point);
}

double Field::radiusAt(std::size_t primitive, const PrimitiveHit& hit) const {
  return impl_->terms.at(primitive).distance.radiusAt(hit);
}

}  // namespace fielddeform::field
