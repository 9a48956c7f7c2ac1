#include <fielddeform/map/detail/feet.h>
#include <fielddeform/map/detail/jet_curve.h>
#include <fielddeform/map/detail/line_curves.h>
#include <fielddeform/map/wires.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using namespace detail;

constexpr std::string_view kDomain = ".domain";

// A smooth function of a jet by value and slope.
Jet compose(double value, double slope, const Jet& z) { return {value, slope * z.g}; }

// sin(x)/x and (1 - cos x)/x^2 as functions of z = x^2.
Jet sincOf(const Jet& z) {
  if (z.v < 1e-4) return compose(1 - z.v / 6 + z.v * z.v / 120, -1.0 / 6 + z.v / 60, z);
  const double x = std::sqrt(z.v);
  const auto sc = numeric::sincos(x);
  return compose(sc.sin / x, (x * sc.cos - sc.sin) / (2 * x * z.v), z);
}
Jet verseOf(const Jet& z) {
  if (z.v < 1e-3) return compose(0.5 - z.v / 24 + z.v * z.v / 720, -1.0 / 24 + z.v / 360 - z.v * z.v / 13440, z);
  const double x = std::sqrt(z.v);
  const auto half = numeric::sincos(0.5 * x), sc = numeric::sincos(x);
  const double less = 2 * half.sin * half.sin;
  return compose(less / z.v, (0.5 * x * sc.sin - less) / (z.v * z.v), z);
}

// What turning y by the vector w adds to it.
JetVec turnedBy(const JetVec& y, const JetVec& w) {
  const Jet z = dot(w, w);
  const JetVec wy = cross(w, y);
  return sincOf(z) * wy + verseOf(z) * cross(w, wy);
}

// The rotation from one unit vector to another, as a vector; zero for opposite ones.
JetVec rotationBetween(const JetVec& a, const JetVec& b) {
  const JetVec v = cross(a, b);
  const Jet c = dot(a, b), s2 = dot(v, v);
  if (c.v > 0 && s2.v < 1e-4)  // asin(s)/s
    return compose(1 + s2.v / 6 + 3 * s2.v * s2.v / 40, 1.0 / 6 + 3 * s2.v / 20, s2) * v;
  if (s2.v < 1e-24) return {};
  const double s = std::sqrt(s2.v), angle = numeric::atan2(s, c.v);
  // By s alone, c = +-sqrt(1 - s^2): d angle / d(s^2) = 1 / (2 s c); near a quarter turn by both.
  const Jet sine{s, s2.g / (2 * s)};
  const Jet theta{angle, c.v * sine.g - s * c.g};
  return theta / sine * v;
}

}  // namespace

struct WireMap::Wire {
  LineCurves curves;
  std::optional<SplineCurve> domain;

  struct Pull {
    JetVec move;
    Jet density;  // F
  };

  Pull at(const Vec3& rest, const SplineCurve::Foot* foot) const {
    const JetVec x{rest, Mat3::Identity()};
    const Jet t = foot ? closestAt(curves.rest, x, *foot) : closestAt(curves.rest, x);
    const SplineCurve::Place r = curves.rest.at(t.v), w = curves.posed.at(t.v), number = curves.numbers.at(t.v);
    const JetVec p = pointAt(r, t), offset = x - p;
    const Jet d2 = dot(offset, offset);
    const Jet reach = reachOf(offset, d2, p, {number.point[2], number.first[2] * t.g});
    if (!(d2.v < reach.v * reach.v)) return {};
    const Jet u2 = d2 / (reach * reach), rest1 = Jet{1, Vec3::Zero()} - u2, f = rest1 * rest1;
    const Jet scale{number.point[1], number.first[1] * t.g}, twist{number.point[0], number.first[0] * t.g};
    JetVec move = (scale - 1) * f * offset;  // what has been added to x so far
    if (r.first.norm() > 0 && w.first.norm() > 0) {
      const JetVec from = unit(tangentAt(r, t)), to = unit(tangentAt(w, t));
      move = move + turnedBy(offset + move, f * rotationBetween(from, to));
      move = move + turnBy(offset + move, to, f * twist);
    }
    return {move + f * (pointAt(w, t) - p), f};
  }

  Jet reachOf(const JetVec& offset, const Jet& d2, const JetVec& p, const Jet& radius) const {
    if (!domain || d2.v == 0) return radius;
    const Jet t = closestAt(*domain, p);
    const JetVec across = pointAt(domain->at(t.v), t) - p;
    const Jet along = dot(offset, across), distance = norm(across);
    if (!(along.v > 0)) return radius;
    return radius + (distance - radius) * (along * along / (d2 * dot(across, across)));
  }
};

void WireOptions::validate() const {
  if (blend && !(*blend >= 0 && *blend <= 100)) throw std::invalid_argument(fmt::format("blend is {}, must be 0 to 100", *blend));
  if (!(local >= 0 && local <= 100)) throw std::invalid_argument(fmt::format("local is {}, must be 0 to 100", local));
}

WireMap::~WireMap() = default;

WireMap::WireMap(const SkeletonMotion& motion, const WireOptions& options) : options_(options), identity_(motion.unedited) {
  options.validate();
  auto wires = std::make_shared<std::vector<Wire>>();
  std::vector<std::string> names;
  const auto isDomain = [](const std::string& name) { return name.ends_with(kDomain); };
  for (Index i = 0; i < motion.rest.primitives.size(); ++i) {
    if (isDomain(motion.rest.primitives[i].name)) continue;
    wires->push_back({lineCurves(motion, i, "wires"), std::nullopt});
    names.push_back(motion.rest.primitives[i].name);
  }
  for (Index i = 0; i < motion.rest.primitives.size(); ++i) {
    const std::string& name = motion.rest.primitives[i].name;
    if (!isDomain(name)) continue;
    const auto at = std::find(names.begin(), names.end(), name.substr(0, name.size() - kDomain.size()));
    if (at == names.end()) throw std::invalid_argument(fmt::format("method 'wires': '{}' is the domain of no wire", name));
    (*wires)[static_cast<std::size_t>(at - names.begin())].domain.emplace(lineCurves(motion, i, "wires").rest);
  }
  wires_ = std::move(wires);
  restNumbers_ = restNumbers(motion);
}

std::shared_ptr<RestSide> WireMap::keepRest(Points rest) const {
  return feetOf(rest, wires_->size(), [&](std::size_t i) -> const SplineCurve& { return (*wires_)[i].curves.rest; });
}

Vec3 WireMap::displacementOf(const RestSide& side, std::size_t i, const Vec3& rest) const {
  return identity_ ? Vec3(Vec3::Zero()) : moveOf(rest, static_cast<const Feet&>(side).of(i)).v;
}

std::size_t WireMap::wireCount() const noexcept { return wires_->size(); }

Vec3 WireMap::displacementBy(std::size_t wire, const Vec3& rest) const { return wires_->at(wire).at(rest, nullptr).move.v; }

namespace {

// (x / greatest)^m of a jet x > 0.
Jet share(const Jet& x, double greatest, double m) {
  if (m == 0) return {1, Vec3::Zero()};
  const double ratio = x.v / greatest, power = numeric::exp(m * numeric::log(ratio));
  return compose(power, m * power / ratio / greatest, x);
}

// sum D |D|^m F^k / sum |D|^m F^k, the greatest length and density taken out.
template <class Pull>
JetVec shared(const std::vector<Pull>& all, double m, double k) {
  double longest = 0, densest = 0;
  for (const Pull& p : all) longest = std::max(longest, p.move.v.norm()), densest = std::max(densest, p.density.v);
  JetVec sum;
  Jet weights;
  for (const Pull& p : all) {
    const Jet w = share(norm(p.move), longest, m) * share(p.density, densest, k);
    sum = sum + w * p.move;
    weights = weights + w;
  }
  return Jet{1, Vec3::Zero()} / weights * sum;
}

}  // namespace

detail::JetVec WireMap::moveOf(const Vec3& rest, const SplineCurve::Foot* feet) const {
  std::vector<Wire::Pull> all;
  for (std::size_t i = 0; i < wires_->size(); ++i)
    if (const Wire::Pull p = (*wires_)[i].at(rest, feet ? feet + i : nullptr); !p.move.v.isZero(0)) all.push_back(p);
  if (all.empty()) return {};
  if (all.size() == 1) return all[0].move;
  if (options_.blend) return shared(all, *options_.blend, options_.local);
  JetVec sum;
  for (const Wire::Pull& p : all) sum = sum + p.move;
  return sum;
}

Vec3 WireMap::displacement(const Vec3& rest) const { return identity_ ? Vec3(Vec3::Zero()) : moveOf(rest).v; }
Mat3 WireMap::jacobian(const Vec3& rest) const { return identity_ ? Mat3(Mat3::Identity()) : Mat3(Mat3::Identity() + moveOf(rest).j); }

}  // namespace fielddeform::map
