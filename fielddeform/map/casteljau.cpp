#include <fielddeform/core/error.h>
#include <fielddeform/map/casteljau.h>
#include <fielddeform/map/detail/casteljau_kernels.h>
#include <fielddeform/map/detail/casteljau_sweep.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using detail::Triple;

Triple<double> triple(const Vec3& p) { return {p.x(), p.y(), p.z()}; }
Vec3 vec(const Triple<double>& p) { return {p[0], p[1], p[2]}; }

void validateHandles(const char* name, const std::vector<std::vector<Vec3>>& levels, int degree) {
  if (levels.size() > static_cast<std::size_t>(degree))
    throw std::invalid_argument(fmt::format("{}: {} levels, a curve of degree {} has {}", name, levels.size(), degree, degree));
  for (std::size_t j = 0; j < levels.size(); ++j) {
    const std::size_t segments = static_cast<std::size_t>(degree) - j;
    if (!levels[j].empty() && levels[j].size() != segments)
      throw std::invalid_argument(fmt::format("{}: level {} has {} handles, expected {}, one a segment, or none", name, j + 1, levels[j].size(), segments));
    for (const Vec3& h : levels[j])
      if (!h.allFinite()) throw std::invalid_argument(fmt::format("{}: a handle of level {} is not finite", name, j + 1));
  }
}

/// Handles of one level, zeros where none are given.
std::vector<Triple<double>> handlesOf(const std::vector<std::vector<Vec3>>& levels, int level, int degree) {
  std::vector<Triple<double>> out(static_cast<std::size_t>(degree - level + 1), Triple<double>{0, 0, 0});
  const auto j = static_cast<std::size_t>(level - 1);
  if (j < levels.size())
    for (std::size_t i = 0; i < levels[j].size(); ++i) out[i] = triple(levels[j][i]);
  return out;
}

double totalLength(const CasteljauCurve& curve) {
  double sum = 0;
  for (const CasteljauPiece& p : curve.pieces) sum += p.length;
  return sum;
}

}  // namespace

void CasteljauPiece::validate() const {
  if (points.size() < 2 || points.size() > kMaxCasteljauDegree + 1)
    throw std::invalid_argument(fmt::format("points: {}, expected 2 to {}", points.size(), kMaxCasteljauDegree + 1));
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!points[i].allFinite()) throw std::invalid_argument(fmt::format("points: {} is not finite", i));
  requirePositive("length", length);
  validateHandles("s", s, degree());
  validateHandles("t", t, degree());
}

void CasteljauCurve::validate() const {
  if (pieces.empty()) throw std::invalid_argument("pieces: none, needs at least 1");
  for (const CasteljauPiece& p : pieces) p.validate();
  const double total = totalLength(*this);
  for (const CasteljauPiece& p : pieces)
    if (!(p.length / total >= 1e-12)) throw std::invalid_argument(fmt::format("length: {:.3g} of {:.3g}, too short a piece", p.length, total));
}

std::vector<Vec3> casteljauLevel(const CasteljauPiece& piece, int level, const Vec3& uvw) {
  piece.validate();
  if (level < 0 || level > piece.degree())
    throw std::invalid_argument(fmt::format("level is {}, expected 0 to {}", level, piece.degree()));
  std::vector<Triple<double>> x;
  for (const Vec3& p : piece.points) x.push_back(triple(p));
  for (int j = 1; j <= level; ++j)
    detail::nextLevel(x.data(), x.size() - static_cast<std::size_t>(j) + 1, handlesOf(piece.s, j, piece.degree()).data(),
                      handlesOf(piece.t, j, piece.degree()).data(), triple(uvw));
  std::vector<Vec3> out;
  for (std::size_t i = 0; i + static_cast<std::size_t>(level) < x.size(); ++i) out.push_back(vec(x[i]));
  return out;
}

CasteljauCurve straightCurve(const LatticeBox& frame, int degree, std::span<const double> lengths) {
  frame.validate();
  if (degree < 1 || degree > kMaxCasteljauDegree)
    throw std::invalid_argument(fmt::format("degree is {}, expected 1 to {}", degree, kMaxCasteljauDegree));
  CasteljauCurve out;
  double total = 0, from = 0;
  for (const double l : lengths) requirePositive("lengths", l), total += l;
  for (const double l : lengths) {
    CasteljauPiece piece;
    piece.length = l;
    for (int i = 0; i <= degree; ++i)
      piece.points.push_back(frame.origin + (from + l * static_cast<double>(i) / degree) / total * frame.axes.col(0));
    piece.s = {std::vector<Vec3>(static_cast<std::size_t>(degree), frame.axes.col(1))};
    piece.t = {std::vector<Vec3>(static_cast<std::size_t>(degree), frame.axes.col(2))};
    out.pieces.push_back(std::move(piece));
    from += l;
  }
  out.validate();
  return out;
}

std::string_view toString(FrameAxis axis) noexcept {
  return std::array<std::string_view, 5>{"auto", "x", "y", "z", "oriented"}[static_cast<std::size_t>(axis)];
}

LatticeBox fitFrame(Points points, FrameAxis axis) {
  LatticeBox box = axis == FrameAxis::Oriented ? fitOrientedBox(points) : fitBox(points);
  Eigen::Index u = 0;
  if (axis == FrameAxis::Auto) {
    for (Eigen::Index k = 1; k < 3; ++k)
      if (box.axes(k, k) > box.axes(u, u)) u = k;
  } else if (axis != FrameAxis::Oriented) {
    u = static_cast<Eigen::Index>(axis) - static_cast<Eigen::Index>(FrameAxis::X);
  }
  LatticeBox frame;
  const Vec3 across = box.axes.col((u + 1) % 3), up = box.axes.col((u + 2) % 3);
  frame.origin = box.origin + 0.5 * across + 0.5 * up;
  frame.axes.col(0) = box.axes.col(u);
  frame.axes.col(1) = 0.5 * across;
  frame.axes.col(2) = 0.5 * up;
  return frame;
}

JointGaps jointGaps(const CasteljauCurve& curve) {
  curve.validate();
  const double total = totalLength(curve);
  JointGaps gaps;
  for (std::size_t k = 0; k + 1 < curve.pieces.size(); ++k) {
    const CasteljauPiece &a = curve.pieces[k], &b = curve.pieces[k + 1];
    const detail::SweepFrame end(detail::Sweep(a), 1), begin(detail::Sweep(b), 0);
    const double ha = a.length / total, hb = b.length / total;
    gaps.position = std::max(gaps.position, (end.c - begin.c).norm());
    gaps.handle = std::max({gaps.handle, (end.s - begin.s).norm(), (end.t - begin.t).norm()});
    gaps.slope = std::max(gaps.slope, (end.dc / ha - begin.dc / hb).norm());
    gaps.handleSlope = std::max({gaps.handleSlope, (end.ds / ha - begin.ds / hb).norm(), (end.dt / ha - begin.dt / hb).norm()});
  }
  return gaps;
}

CasteljauCurve joinC1(CasteljauCurve curve) {
  curve.validate();
  if (curve.pieces.size() < 2) return curve;
  for (const CasteljauPiece& p : curve.pieces)
    if (p.degree() < 3) throw std::invalid_argument(fmt::format("pieces: one of degree {}, expected 3 or more to be joined with continuous slopes", p.degree()));
  std::vector<detail::Sweep> sweeps;
  for (const CasteljauPiece& p : curve.pieces) sweeps.emplace_back(p);
  // Control vectors next to a joint move only by what is added to their handle of level 1.
  const auto blend = [](const CasteljauPiece& a, const CasteljauPiece& b, const Vec3& before, const Vec3& after, double na, double nb) {
    const double wa = na / a.length, wb = nb / b.length;  // slopes n (P - Q) / length agree
    return Vec3((wa * before + wb * after) / (wa + wb));
  };
  for (std::size_t k = 0; k + 1 < curve.pieces.size(); ++k) {
    CasteljauPiece &a = curve.pieces[k], &b = curve.pieces[k + 1];
    const double na = a.degree(), nb = b.degree();
    const Vec3 joint = blend(a, b, a.points[a.points.size() - 2], b.points[1], na, nb);
    a.points.back() = b.points.front() = joint;
    for (const bool first : {true, false}) {
      auto &ha = first ? a.s : a.t, &hb = first ? b.s : b.t;
      const auto &ca = first ? sweeps[k].s : sweeps[k].t, &cb = first ? sweeps[k + 1].s : sweeps[k + 1].t;
      if (ha.empty()) ha.emplace_back();
      if (hb.empty()) hb.emplace_back();
      ha[0].resize(a.points.size() - 1, Vec3::Zero());
      hb[0].resize(b.points.size() - 1, Vec3::Zero());
      const Vec3 common = blend(a, b, vec(ca[ca.size() - 2]), vec(cb[1]), na - 1, nb - 1);
      ha[0].back() += common - vec(ca.back());
      hb[0].front() += common - vec(cb.front());
    }
  }
  return curve;
}

}  // namespace fielddeform::map
