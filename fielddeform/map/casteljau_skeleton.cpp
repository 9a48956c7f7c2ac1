#include <fielddeform/core/parallel.h>
#include <fielddeform/map/casteljau_skeleton.h>
#include <fielddeform/map/detail/feet.h>
#include <fielddeform/map/detail/jet_curve.h>
#include <fielddeform/map/detail/line_curves.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using detail::Jet;
using detail::JetVec;

constexpr std::size_t kGrain = 256;

CasteljauMap mapOf(const SkeletonMotion& motion, Index i, const detail::LineCurves& curves) {
  const skeleton::Primitive& line = motion.rest.primitives[i];
  std::vector<Vec3> rest, posed;
  std::vector<Quat> rotation;
  std::vector<double> scale;
  for (const Index v : curves.points) {
    const Index sample = motion.samples.set.vertexSample[i][v];
    rest.push_back(line.points[v]);
    posed.push_back(motion.posed.primitives[i].points[v]);
    rotation.push_back(motion.samples.rotation[sample]);
    scale.push_back(motion.samples.scale[sample]);
  }
  CasteljauPair pair = curvesAlong(rest, posed, rotation, scale, line.closed);
  if (motion.unedited) pair.posed = pair.rest;
  return CasteljauMap(std::move(pair.rest), std::move(pair.posed), Outside::Extend, line.closed);
}

// Distance to a line's spline at rest in influence radii.
Jet nearness(const detail::LineCurves& curves, const Vec3& rest) {
  const JetVec x{rest, Mat3::Identity()};
  const Jet t = detail::closestAt(curves.rest, x);
  const SplineCurve::Place number = curves.numbers.at(t.v);
  const Jet radius{number.point[2], number.first[2] * t.g};
  return norm(x - detail::pointAt(curves.rest.at(t.v), t)) / radius;
}

}  // namespace

CasteljauMap casteljauAlong(const SkeletonMotion& motion, Index primitive) {
  return mapOf(motion, primitive, detail::lineCurves(motion, primitive, "casteljau"));
}

std::shared_ptr<const SpaceMap> casteljauBy(const SkeletonMotion& motion) {
  if (motion.rest.primitives.size() == 1) return std::make_shared<CasteljauMap>(casteljauAlong(motion));
  return std::make_shared<CasteljauLines>(motion);
}

struct CasteljauLines::Line {
  detail::LineCurves curves;
  CasteljauMap map;
};

class CasteljauLines::Bound final : public Binding {
 public:
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const std::vector<Line>> lines;  ///< whose it is
  std::vector<Vec3> rest;
  std::vector<std::shared_ptr<const Binding>> inner;  ///< #L
  std::vector<double> nearness;                       ///< #P by #L
  std::vector<double> restNumbers;
};

// What every line does to every point.
struct CasteljauLines::Images {
  std::vector<std::vector<Vec3>> position;  // #L by #P
  std::vector<std::vector<Status>> status;
  std::vector<std::vector<float>> residual;

  bool reaches(std::size_t line, std::size_t point) const { return status[line][point] != Status::Stalled && status[line][point] != Status::Invalid; }
};

CasteljauLines::CasteljauLines(const SkeletonMotion& motion, double sharpness) : sharpness_(sharpness) {
  if (!(sharpness > 0 && std::isfinite(sharpness))) throw std::invalid_argument("sharpness must be finite and > 0");
  auto lines = std::make_shared<std::vector<Line>>();
  for (Index i = 0; i < motion.rest.primitives.size(); ++i) {
    detail::LineCurves curves = detail::lineCurves(motion, i, "casteljau");
    CasteljauMap map = mapOf(motion, i, curves);
    lines->push_back({std::move(curves), std::move(map)});
  }
  lines_ = std::move(lines);
  restNumbers_ = detail::restNumbers(motion);
  for (const Line& line : *lines_)
    for (const Index v : line.curves.points) restNumbers_.push_back(skeleton::radiusOf(motion.rest.primitives[static_cast<std::size_t>(&line - lines_->data())], v));
}

CasteljauLines::~CasteljauLines() = default;

std::shared_ptr<const Binding> CasteljauLines::bind(Points rest) const {
  auto bound = std::make_shared<Bound>();
  bound->lines = lines_;
  bound->restNumbers = restNumbers_;
  bound->rest.assign(rest.begin(), rest.end());
  const std::size_t n = lines_->size();
  for (const Line& line : *lines_) bound->inner.push_back(line.map.bind(rest));
  bound->nearness.resize(rest.size() * n);
  parallelFor(rest.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p)
      for (std::size_t i = 0; i < n && rest[p].allFinite(); ++i) bound->nearness[p * n + i] = nearness((*lines_)[i].curves, rest[p]).v;
  });
  return bound;
}

std::shared_ptr<const Binding> CasteljauLines::bindAgain(const Binding* earlier, Points rest) const {
  const auto* last = dynamic_cast<const Bound*>(earlier);
  if (!last || last->size() != rest.size() || last->restNumbers != restNumbers_) return bind(rest);
  auto again = std::make_shared<Bound>(*last);
  again->lines = lines_;
  for (std::size_t i = 0; i < lines_->size(); ++i) again->inner[i] = (*lines_)[i].map.bindAgain(last->inner[i].get(), rest);
  return again;
}

const CasteljauLines::Bound& CasteljauLines::own(const Binding& binding) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->lines != lines_) throw std::invalid_argument("binding: made by another map");
  return *bound;
}

CasteljauLines::Images CasteljauLines::imagesOf(const Bound& bound, Progress& progress) const {
  Images out;
  for (std::size_t i = 0; i < lines_->size(); ++i) {
    out.position.emplace_back(bound.size());
    out.status.emplace_back(bound.size());
    out.residual.emplace_back(bound.size());
    (*lines_)[i].map.apply(*bound.inner[i], {.position = out.position[i], .safe = {}, .status = out.status[i], .residual = out.residual[i]}, progress);
  }
  return out;
}

void CasteljauLines::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const Bound& b = own(binding);
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0 && size != b.size()) throw std::invalid_argument(fmt::format("out: {} elements, expected {}", size, b.size()));
  const std::size_t n = lines_->size();
  const Images images = imagesOf(b, progress);
  parallelFor(b.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      const double* u = &b.nearness[p * n];
      double least = std::numeric_limits<double>::infinity(), sum = 0;
      float miss = std::numeric_limits<float>::infinity();
      for (std::size_t i = 0; i < n; ++i) {
        if (images.reaches(i, p)) least = std::min(least, u[i]);
        miss = std::min(miss, images.residual[i][p]);
      }
      const bool valid = b.rest[p].allFinite(), reached = std::isfinite(least);
      Vec3 d = Vec3::Zero();
      for (std::size_t i = 0; i < n && reached; ++i) {
        if (!images.reaches(i, p)) continue;
        const double w = numeric::exp(-sharpness_ * (u[i] - least));
        sum += w;
        d += w * (images.position[i][p] - b.rest[p]);
      }
      if (reached) d /= sum;
      const bool fixed = d.isZero(0), done = (b.rest[p] + d).allFinite();
      const Vec3 x = fixed || !done ? b.rest[p] : Vec3(b.rest[p] + d);
      if (!out.position.empty()) out.position[p] = x;
      if (!out.safe.empty()) out.safe[p] = x;
      if (!out.status.empty())
        out.status[p] = !valid || !done ? Status::Invalid : !reached ? Status::Stalled : fixed ? Status::Fixed : Status::Converged;
      if (!out.residual.empty()) out.residual[p] = valid && !reached ? miss : 0.0f;
    }
  });
}

void CasteljauLines::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const Bound& b = own(binding);
  if (out.size() != b.size()) throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), b.size()));
  const std::size_t n = lines_->size();
  Progress silent;
  const Images images = imagesOf(b, silent);
  std::vector<std::vector<Mat3>> inner(n, std::vector<Mat3>(b.size()));
  for (std::size_t i = 0; i < n; ++i) (*lines_)[i].map.jacobians(*b.inner[i], inner[i]);
  parallelFor(b.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      out[p].setIdentity();
      if (!b.rest[p].allFinite()) continue;
      std::vector<std::pair<std::size_t, Jet>> near;
      for (std::size_t i = 0; i < n; ++i)
        if (images.reaches(i, p)) near.emplace_back(i, nearness((*lines_)[i].curves, b.rest[p]));
      if (near.empty()) continue;
      const double least = std::min_element(near.begin(), near.end(), [](const auto& x, const auto& y) { return x.second.v < y.second.v; })->second.v;
      Jet sum;
      JetVec d;
      for (const auto& [i, u] : near) {
        const Jet w = exp(-sharpness_ * (u - least));
        sum = sum + w;
        d = d + w * JetVec{images.position[i][p] - b.rest[p], inner[i][p] - Mat3::Identity()};
      }
      d = Jet{1, Vec3::Zero()} / sum * d;
      if (d.j.allFinite()) out[p] += d.j;
    }
  });
}

}  // namespace fielddeform::map
