#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/line_finder.h>
#include <fielddeform/gffd/detail/mls.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/numeric/rotation.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kSharpness = 8;
constexpr double kCutoff = 36;  // exp(-36) is below rounding
constexpr double kLog2E = 1.4426950408889634;
constexpr double kRounding = 1 + 1e-9;
constexpr Index kBlock = 16;

std::uint64_t spread(std::uint64_t x) {
  x &= 0x1FFFFF;
  x = (x | x << 32) & 0x1F00000000FFFFull;
  x = (x | x << 16) & 0x1F0000FF0000FFull;
  x = (x | x << 8) & 0x100F00F00F00F00Full;
  x = (x | x << 4) & 0x10C30C30C30C30C3ull;
  x = (x | x << 2) & 0x1249249249249249ull;
  return x;
}

std::vector<std::uint32_t> mortonOrder(const std::vector<Vec3>& points) {
  Box box;
  for (const Vec3& p : points) box.extend(p);
  const double side = std::max(box.sizes().maxCoeff(), 0.0);
  std::vector<std::uint64_t> keys(points.size(), 0);
  if (side > 0)
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3 u = (points[i] - box.min()) * (2097151.0 / side);
      for (int k = 0; k < 3; ++k) keys[i] |= spread(static_cast<std::uint64_t>(u[k])) << k;
    }
  return sortedOrder(keys);
}

}  // namespace

MlsPredictor::MlsPredictor(const skeleton::SampledPair& pair) {
  for (const std::uint32_t j : mortonOrder(pair.rest)) {
    const skeleton::Sample& s = pair.set.samples[j];
    if (!(s.mass > 0)) continue;
    samples_.push_back({pair.rest[j], pair.posed[j] - pair.rest[j], s.mass, 1 / s.radius, pair.scale[j], pair.rotation[j].toRotationMatrix()});
  }
  // A skeleton without extent (coincident points) has no mass: every sample then counts alike.
  if (samples_.empty())
    for (std::size_t j = 0; j < pair.rest.size(); ++j)
      samples_.push_back({pair.rest[j], pair.posed[j] - pair.rest[j], 1, 1 / pair.set.samples[j].radius,
                          pair.scale[j], pair.rotation[j].toRotationMatrix()});
  for (Index b = 0; b < samples_.size(); b += kBlock) {
    Ball ball{Vec3::Zero(), 0, 0, 0, b, std::min<Index>(b + kBlock, static_cast<Index>(samples_.size()))};
    Box box;
    ball.inverseRadiusMin = samples_[b].inverseRadius;
    for (Index j = ball.begin; j < ball.end; ++j) {
      box.extend(samples_[j].rest);
      ball.inverseRadiusMax = std::max(ball.inverseRadiusMax, samples_[j].inverseRadius);
      ball.inverseRadiusMin = std::min(ball.inverseRadiusMin, samples_[j].inverseRadius);
    }
    ball.centre = box.center();
    for (Index j = ball.begin; j < ball.end; ++j)
      ball.radius = std::max(ball.radius, (samples_[j].rest - ball.centre).norm());
    balls_.push_back(ball);
  }
  for (const Sample& s : samples_) {
    const Vec3 posed = s.rest + s.move;
    const double steepness = kSharpness * kLog2E * s.inverseRadius;
    MlsTerm term{{s.rest[0], s.rest[1], s.rest[2]}, {posed[0], posed[1], posed[2]}, {}, s.mass, s.scale, steepness * steepness};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) term.rotation[3 * i + j] = s.rotation(i, j);
    terms_.push_back(term);
  }
}

void MlsPredictor::at(const Block& points, std::size_t count, MlsBlock& out) const {
  Vec3 centre;
  double radius = 0;
  ballOf(points, count, centre, radius);
  // No point's nearest sample is farther, in units of that sample's radius.
  double nearest = std::numeric_limits<double>::infinity();
  for (const Ball& b : balls_) nearest = std::min(nearest, ((centre - b.centre).norm() + b.radius + radius) * b.inverseRadiusMax);
  const double reach = (nearest + kCutoff / kSharpness) * kRounding;
  // More samples do no harm: when there is no place for another run the last one takes in what lies between.
  std::array<MlsRun, 32> runs;
  std::size_t held = 0;
  for (const Ball& b : balls_) {
    if (((centre - b.centre).norm() - b.radius - radius) * b.inverseRadiusMin > reach) continue;
    if (held > 0 && (runs[held - 1].end == b.begin || held == runs.size())) runs[held - 1].end = b.end;
    else runs[held++] = {b.begin, b.end};
  }
  mlsMotions(terms_, std::span(runs).first(held), points, count, out);
}

LocalMotion MlsPredictor::at(const Vec3& point) const {
  // The nearest sample in units of its radius; its weight is one.
  double nearest = std::numeric_limits<double>::infinity();
  for (const Ball& b : balls_) {
    const double low = ((point - b.centre).norm() - b.radius) * b.inverseRadiusMin;
    if (low > nearest) continue;
    for (Index j = b.begin; j < b.end; ++j)
      nearest = std::min(nearest, (samples_[j].rest - point).norm() * samples_[j].inverseRadius);
  }
  // Rows: weight, w p, w u, w p u^T, w p p^T (upper), w R^T, w s; p relative to the point, u = q - p.
  constexpr int kRows = 1 + 3 + 3 + 9 + 6 + 9 + 1;
  std::array<double, kRows> sum{};
  const double reach = nearest + kCutoff / kSharpness;
  for (const Ball& b : balls_) {
    if (((point - b.centre).norm() - b.radius) * b.inverseRadiusMin > reach) continue;
    const Index n = b.end - b.begin;
    std::array<double, kBlock> x;
    for (Index i = 0; i < n; ++i) {
      const Sample& s = samples_[b.begin + i];
      x[i] = kSharpness * (nearest - (s.rest - point).norm() * s.inverseRadius);
    }
    for (Index i = n; i < kBlock; ++i) x[i] = -1e3;
    for (Index i = 0; i < kBlock; ++i) x[i] = numeric::exp(x[i]);
    for (Index i = 0; i < n; ++i) {
      const Sample& s = samples_[b.begin + i];
      if (x[i] < 2e-16) continue;
      const double w = x[i] * s.mass;
      const Vec3 p = s.rest - point;
      const std::array<double, kRows> row{1, p[0], p[1], p[2], s.move[0], s.move[1], s.move[2],
          p[0] * s.move[0], p[1] * s.move[0], p[2] * s.move[0], p[0] * s.move[1], p[1] * s.move[1], p[2] * s.move[1],
          p[0] * s.move[2], p[1] * s.move[2], p[2] * s.move[2],
          p[0] * p[0], p[0] * p[1], p[0] * p[2], p[1] * p[1], p[1] * p[2], p[2] * p[2],
          s.rotation(0, 0), s.rotation(0, 1), s.rotation(0, 2), s.rotation(1, 0), s.rotation(1, 1), s.rotation(1, 2),
          s.rotation(2, 0), s.rotation(2, 1), s.rotation(2, 2), s.scale};
      for (int k = 0; k < kRows; ++k) sum[k] += w * row[k];
    }
  }
  const double scale = 1 / sum[0];
  for (double& v : sum) v *= scale;
  const Vec3 p(sum[1], sum[2], sum[3]), u(sum[4], sum[5], sum[6]);
  // C = sum w (p - p*)(q - q*)^T with q = p + u.
  Mat3 c = Eigen::Map<const Mat3>(sum.data() + 7) - p * u.transpose();
  const double* pp = sum.data() + 16;
  Mat3 spread;
  spread << pp[0], pp[1], pp[2], pp[1], pp[3], pp[4], pp[2], pp[4], pp[5];
  c += spread - p * p.transpose();
  const Mat3 frames = Eigen::Map<const Mat3>(sum.data() + 22);  // column-major read of row-major R: sum w R^T
  const double size = c.norm();
  // A single sample in reach has no spread: its frame alone decides.
  const Mat3 r = numeric::kabsch(size > 0 ? Mat3(c / size + 0.3 * frames) : frames);
  return {Quat(r), u - (sum[31] * (r * p) - p)};
}

}  // namespace fielddeform::gffd::detail
