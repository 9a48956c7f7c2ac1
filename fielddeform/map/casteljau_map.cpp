#include <fielddeform/core/parallel.h>
#include <fielddeform/map/casteljau.h>
#include <fielddeform/map/detail/casteljau_sweep.h>
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using detail::Sweep;
using detail::SweepFrame;
using detail::SweepPlace;
using detail::Triple;

constexpr std::size_t kGrain = 1024;
using Weights = std::array<double, kMaxCasteljauDegree + 1>;

enum class PointKind : std::uint8_t { Inside, Beyond, Kept, Stalled, Invalid };

std::vector<Sweep> sweepsOf(const CasteljauCurve& curve) {
  std::vector<Sweep> out;
  for (const CasteljauPiece& p : curve.pieces) out.emplace_back(p);
  return out;
}

std::vector<double> knotsOf(const CasteljauCurve& curve) {
  std::vector<double> knots{0};
  for (const CasteljauPiece& p : curve.pieces) knots.push_back(knots.back() + p.length);
  const double total = knots.back();
  for (double& k : knots) k /= total;
  knots.back() = 1;
  return knots;
}

}  // namespace

struct CasteljauMap::Model {
  CasteljauCurve posed;
  Outside outside = Outside::Extend;
  bool closed = false;                    ///< nothing lies beyond the ends
  std::optional<LatticeBox> frame;        ///< else the rest curve
  Mat3 toFrame = Mat3::Identity();
  std::vector<double> knots;
  std::vector<Sweep> rest, change;        ///< change: posed less rest
  std::vector<bool> unchanged;            ///< a piece

  Model(CasteljauCurve posedCurve, const CasteljauCurve& restCurve, Outside out) : posed(std::move(posedCurve)), outside(out) {
    posed.validate();
    restCurve.validate();
    if (restCurve.pieces.size() != posed.pieces.size())
      throw std::invalid_argument(fmt::format("posed: {} pieces, rest has {}", posed.pieces.size(), restCurve.pieces.size()));
    knots = knotsOf(posed);
    rest = sweepsOf(restCurve);
    const std::vector<Sweep> after = sweepsOf(posed);
    for (std::size_t k = 0; k < rest.size(); ++k) {
      if (rest[k].degree != after[k].degree || restCurve.pieces[k].length != posed.pieces[k].length)
        throw std::invalid_argument(fmt::format("posed: piece {} has another degree or length than at rest", k));
      change.push_back(after[k] - rest[k]);
      unchanged.push_back(change[k].isZero());
    }
  }

  SweepPlace place(const Vec3& x) const {
    if (!frame) return detail::locate(rest, x, outside == Outside::Extend && !closed);
    SweepPlace p;
    const Vec3 uvw = toFrame * (x - frame->origin);
    p.found = uvw.allFinite();
    p.piece = static_cast<std::size_t>(std::upper_bound(knots.begin() + 1, knots.end() - 1, uvw.x()) - knots.begin()) - 1;
    p.uvw = uvw;
    if (knots.size() > 2) p.uvw.x() = (uvw.x() - knots[p.piece]) / (knots[p.piece + 1] - knots[p.piece]);
    return p;
  }

  /// Whether points have the same places in both.
  bool placesAs(const Model& other) const {
    if (outside != other.outside || closed != other.closed || frame != other.frame || knots != other.knots || rest.size() != other.rest.size())
      return false;
    for (std::size_t k = 0; k < rest.size(); ++k)
      if (rest[k].c != other.rest[k].c || rest[k].s != other.rest[k].s || rest[k].t != other.rest[k].t) return false;
    return true;
  }

  PointKind kindOf(const Vec3& x, const SweepPlace& p) const {
    if (!x.allFinite()) return PointKind::Invalid;
    if (!p.found) return outside == Outside::Keep && !frame && !closed ? PointKind::Kept : PointKind::Stalled;
    if (p.uvw.x() >= 0 && p.uvw.x() <= 1) return PointKind::Inside;
    return outside == Outside::Keep ? PointKind::Kept : PointKind::Beyond;
  }

  Vec3 displacement(std::size_t piece, const Vec3& uvw, double* b) const {
    const Sweep& s = change[piece];
    if (uvw.x() >= 0 && uvw.x() <= 1) {
      Triple<double> d;
      detail::sweep(s.degree, s.c.data(), s.s.data(), s.t.data(), Triple<double>{uvw.x(), uvw.y(), uvw.z()}, b, d);
      return {d[0], d[1], d[2]};
    }
    return SweepFrame(s, uvw.x()).image(uvw.y(), uvw.z());
  }
};

class CasteljauMap::Bound final : public Binding {
 public:
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const Model> model;  ///< whose it is
  std::vector<Vec3> rest, uvw;
  std::vector<Index> piece;
  std::vector<PointKind> kind;
  std::vector<float> distance;         ///< of stalled points from the curve; empty for frames
};

CasteljauMap::CasteljauMap(CasteljauCurve posed, const LatticeBox& frame, Outside outside) {
  posed.validate();
  CasteljauCurve straight;
  std::vector<double> lengths;
  for (const CasteljauPiece& p : posed.pieces) lengths.push_back(p.length);
  // Pieces may differ in degree: each is the same straight line.
  for (std::size_t k = 0; k < lengths.size(); ++k) straight.pieces.push_back(straightCurve(frame, posed.pieces[k].degree(), lengths).pieces[k]);
  auto model = std::make_shared<Model>(std::move(posed), straight, outside);
  model->frame = frame;
  model->toFrame = frame.axes.inverse();
  model_ = std::move(model);
}

CasteljauMap::CasteljauMap(CasteljauCurve rest, CasteljauCurve posed, Outside outside, bool closed) {
  auto model = std::make_shared<Model>(std::move(posed), rest, outside);
  model->closed = closed;
  model_ = std::move(model);
}

const CasteljauCurve& CasteljauMap::posed() const noexcept { return model_->posed; }

Vec3 CasteljauMap::position(const Vec3& rest) const {
  const SweepPlace p = model_->place(rest);
  const PointKind kind = model_->kindOf(rest, p);
  if ((kind != PointKind::Inside && kind != PointKind::Beyond) || model_->unchanged[p.piece]) return rest;
  Weights b;
  const Vec3 x = rest + model_->displacement(p.piece, p.uvw, b.data());
  return x.allFinite() ? x : rest;
}

std::shared_ptr<const Binding> CasteljauMap::bind(Points rest) const {
  auto bound = std::make_shared<Bound>();
  bound->model = model_;
  bound->rest.assign(rest.begin(), rest.end());
  bound->uvw.resize(rest.size());
  bound->piece.resize(rest.size());
  bound->kind.resize(rest.size());
  if (!model_->frame) bound->distance.resize(rest.size());
  parallelFor(rest.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      const SweepPlace place = rest[p].allFinite() ? model_->place(rest[p]) : SweepPlace{};
      bound->kind[p] = model_->kindOf(rest[p], place);
      bound->uvw[p] = place.uvw;
      bound->piece[p] = static_cast<Index>(place.piece);
      if (bound->kind[p] != PointKind::Stalled || model_->frame) continue;
      double least = std::numeric_limits<double>::infinity();
      for (const Sweep& s : model_->rest)
        for (int k = 0; k <= 8; ++k) least = std::min(least, (SweepFrame(s, k / 8.0).c - rest[p]).norm());
      bound->distance[p] = static_cast<float>(least);
    }
  });
  return bound;
}

std::shared_ptr<const Binding> CasteljauMap::bindAgain(const Binding* earlier, Points rest) const {
  const auto* last = dynamic_cast<const Bound*>(earlier);
  if (!last || last->size() != rest.size() || !model_->placesAs(*last->model)) return bind(rest);
  auto again = std::make_shared<Bound>(*last);
  again->model = model_;
  return again;
}

/// Displacements of some neighbouring points: side by side where all are inside one piece.
void CasteljauMap::displacements(const Model& model, const Bound& bound, std::size_t first, std::size_t count, Vec3* out) {
  const auto moves = [&](std::size_t p) {
    return (bound.kind[p] == PointKind::Inside || bound.kind[p] == PointKind::Beyond) && !model.unchanged[bound.piece[p]];
  };
  const auto last = first + count;
  bool together = count == detail::kSweepBlock;
  for (std::size_t p = first; p < last && together; ++p)
    together = bound.kind[p] == PointKind::Inside && bound.piece[p] == bound.piece[first];
  if (together && moves(first)) {
    std::array<double, 3 * detail::kSweepBlock> uvw{}, d;
    for (std::size_t k = 0; k < detail::kSweepBlock; ++k)
      for (std::size_t c = 0; c < 3; ++c) uvw[c * detail::kSweepBlock + k] = bound.uvw[first + k][static_cast<Eigen::Index>(c)];
    detail::sweepBlock(model.change[bound.piece[first]], uvw, d);
    for (std::size_t k = 0; k < detail::kSweepBlock; ++k) out[k] = Vec3(d[k], d[detail::kSweepBlock + k], d[2 * detail::kSweepBlock + k]);
    return;
  }
  Weights b;
  for (std::size_t p = first; p < last; ++p) out[p - first] = moves(p) ? model.displacement(bound.piece[p], bound.uvw[p], b.data()) : Vec3(Vec3::Zero());
}

const CasteljauMap::Bound& CasteljauMap::own(const Binding& binding) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->model != model_) throw std::invalid_argument("binding: made by another map");
  return *bound;
}

void CasteljauMap::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const Bound& bound = own(binding);
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0 && size != bound.size()) throw std::invalid_argument(fmt::format("out: {} elements, expected {}", size, bound.size()));
  parallelFor(bound.size(), kGrain, progress, [&](std::size_t begin, std::size_t end) {
    std::array<Vec3, detail::kSweepBlock> moves;
    for (std::size_t p = begin; p < end; ++p) {
      const PointKind kind = bound.kind[p];
      if ((p - begin) % moves.size() == 0) displacements(*model_, bound, p, std::min(moves.size(), end - p), moves.data());
      const Vec3& d = moves[(p - begin) % moves.size()];
      Vec3 x = d == Vec3::Zero() ? bound.rest[p] : Vec3(bound.rest[p] + d);
      const bool invalid = kind == PointKind::Invalid || !x.allFinite();
      if (invalid) x = bound.rest[p];
      if (!out.position.empty()) out.position[p] = x;
      if (!out.safe.empty()) out.safe[p] = x;
      if (!out.status.empty())
        out.status[p] = invalid ? Status::Invalid : kind == PointKind::Stalled ? Status::Stalled : d == Vec3::Zero() ? Status::Fixed : Status::Converged;
      if (!out.residual.empty()) out.residual[p] = kind == PointKind::Stalled && !bound.distance.empty() ? bound.distance[p] : 0.0f;
    }
  });
}

void CasteljauMap::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const Bound& bound = own(binding);
  if (out.size() != bound.size()) throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), bound.size()));
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      out[p].setIdentity();
      if (bound.kind[p] != PointKind::Inside && bound.kind[p] != PointKind::Beyond) continue;
      const std::size_t piece = bound.piece[p];
      const Vec3& uvw = bound.uvw[p];
      const Mat3 change = SweepFrame(model_->change[piece], uvw.x()).jacobian(uvw.y(), uvw.z());
      const Mat3 rest = SweepFrame(model_->rest[piece], uvw.x()).jacobian(uvw.y(), uvw.z());
      const Mat3 d = change * rest.inverse();
      if (d.allFinite()) out[p] += d;
    }
  });
}

void CasteljauMap::level(const Binding& binding, int level, int segment, std::span<Vec3> out) const {
  const Bound& bound = own(binding);
  if (out.size() != bound.size()) throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), bound.size()));
  for (const CasteljauPiece& p : model_->posed.pieces)
    if (level < 0 || segment < 0 || level + segment > p.degree())
      throw std::invalid_argument(fmt::format("level {}, segment {}: a piece has degree {}", level, segment, p.degree()));
  const auto at = [&](std::size_t piece, const Vec3& uvw) { return casteljauLevel(model_->posed.pieces[piece], level, uvw)[static_cast<std::size_t>(segment)]; };
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      out[p] = bound.rest[p];
      if (bound.kind[p] != PointKind::Inside && bound.kind[p] != PointKind::Beyond) continue;
      Vec3 uvw = bound.uvw[p];
      const double u = uvw.x(), inside = std::clamp(u, 0.0, 1.0);
      uvw.x() = inside;
      Vec3 x = at(bound.piece[p], uvw);
      if (u != inside && level > 0) {
        // x_i^j is itself an image of degree j, of the points i .. i + j: its slope is that of their sweep.
        CasteljauPiece part;
        const CasteljauPiece& whole = model_->posed.pieces[bound.piece[p]];
        const auto cut = [&](const std::vector<std::vector<Vec3>>& from, std::vector<std::vector<Vec3>>& to) {
          for (std::size_t k = 0; k < from.size() && k < static_cast<std::size_t>(level); ++k) {
            to.emplace_back();
            if (!from[k].empty())
              to.back().assign(from[k].begin() + segment, from[k].begin() + segment + level - static_cast<std::ptrdiff_t>(k));
          }
        };
        part.points.assign(whole.points.begin() + segment, whole.points.begin() + segment + level + 1);
        cut(whole.s, part.s);
        cut(whole.t, part.t);
        x += (u - inside) * SweepFrame(Sweep(part), inside).jacobian(uvw.y(), uvw.z()).col(0);
      }
      if (x.allFinite()) out[p] = x;
    }
  });
}

}  // namespace fielddeform::map
