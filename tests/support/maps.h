#pragma once

#include <fielddeform/core/random.h>
#include <fielddeform/map/space_map.h>

#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

/// Maps of space in closed form, for tests of whatever works with any map.
namespace fielddeform::test {

/// A map given by a function of one point. Points that it leaves alone are Fixed.
class FunctionMap : public map::SpaceMap {
 public:
  explicit FunctionMap(std::function<Vec3(const Vec3&)> f) : f_(std::move(f)) {}

  struct Bound final : map::Binding {
    explicit Bound(Points p) : rest(p.begin(), p.end()) {}
    std::size_t size() const override { return rest.size(); }
    std::vector<Vec3> rest;
  };
  std::shared_ptr<const map::Binding> bind(Points rest) const override {
    largestBatch = std::max(largestBatch, rest.size());
    bound += rest.size();
    return std::make_shared<Bound>(rest);
  }
  void apply(const map::Binding& binding, map::MapOutput out, Progress&) const override {
    const auto& rest = dynamic_cast<const Bound&>(binding).rest;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const Vec3 image = f_(rest[i]);
      if (!out.position.empty()) out.position[i] = image;
      if (!out.safe.empty()) out.safe[i] = image;
      if (!out.status.empty()) out.status[i] = image == rest[i] ? Status::Fixed : Status::Converged;
      if (!out.residual.empty()) out.residual[i] = 0;
    }
  }
  void jacobians(const map::Binding& binding, std::span<Mat3> out) const override {
    const auto& rest = dynamic_cast<const Bound&>(binding).rest;
    const double h = 1e-6;
    for (std::size_t i = 0; i < rest.size(); ++i)
      for (int k = 0; k < 3; ++k)
        out[i].col(k) = (f_(rest[i] + h * Vec3::Unit(k)) - f_(rest[i] - h * Vec3::Unit(k))) / (2 * h);
  }

  mutable std::size_t largestBatch = 0, bound = 0;

 private:
  std::function<Vec3(const Vec3&)> f_;
};

inline FunctionMap stretchMap(double x, double y = 1, double z = 1) {
  return FunctionMap([=](const Vec3& p) { return Vec3(x * p.x(), y * p.y(), z * p.z()); });
}

/// The ideal bend of the z axis between 0 and `length` by an angle about y; rigid beyond.
inline FunctionMap bendMap(double angle, double length) {
  return FunctionMap([=](const Vec3& p) {
    const double radius = length / angle, t = std::min(1.0, std::max(0.0, p.z() / length)), beyond = p.z() - t * length;
    const double c = std::cos(angle * t), s = std::sin(angle * t);
    if (p.z() <= 0) return p;
    return Vec3(radius - (radius - p.x()) * c + beyond * s, p.y(), (radius - p.x()) * s + beyond * c);
  });
}

/// Every point jumps anywhere within a box: no continuity at all.
inline FunctionMap noiseMap(double size) {
  return FunctionMap([=](const Vec3& p) {
    std::uint64_t h = 0;
    for (int k = 0; k < 3; ++k) h = splitmix64(h, std::bit_cast<std::uint64_t>(p[k]));
    return Vec3(size * Vec3(uniform01(h, 0), uniform01(h, 1), uniform01(h, 2)));
  });
}

}  // namespace fielddeform::test
