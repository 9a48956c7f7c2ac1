#include <fielddeform/core/error.h>
#include <fielddeform/map/casteljau.h>
#include <fielddeform/numeric/elementary.h>
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

void requireLine(const char* name, Points line, bool closed) {
  if (line.size() < (closed ? 3u : 2u)) throw std::invalid_argument(fmt::format("{}: {} points, needs at least {}", name, line.size(), closed ? 3 : 2));
  if (closed && line.front() == line.back()) throw std::invalid_argument(fmt::format("{}: points 0 and {} coincide", name, line.size() - 1));
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (!line[i].allFinite()) throw std::invalid_argument(fmt::format("{}: point {} is not finite", name, i));
    if (i > 0 && !((line[i] - line[i - 1]).stableNorm() > 0)) throw std::invalid_argument(fmt::format("{}: points {} and {} coincide", name, i - 1, i));
  }
}

/// Derivative of a line by the parameter at its points: that of the parabola through three neighbours [Bessel].
std::vector<Vec3> tangents(Points line, std::span<const double> length, bool closed) {
  const std::size_t n = line.size();
  const auto step = [&](std::size_t k) { return Vec3((line[(k + 1) % n] - line[k]) / length[k]); };
  std::vector<Vec3> out(n);
  if (n == 2) return {step(0), step(0)};
  for (std::size_t i = closed ? 0 : 1; i + (closed ? 0 : 1) < n; ++i) {
    const std::size_t before = (i + n - 1) % n;
    out[i] = (length[i] * step(before) + length[before] * step(i)) / (length[before] + length[i]);
  }
  if (closed) return out;
  out[0] = 2 * step(0) - out[1];
  out[n - 1] = 2 * step(n - 2) - out[n - 2];
  return out;
}

/// Unit tangents at the points of a line; where it turns back on itself, the direction behind the point.
std::vector<Vec3> directions(Points line, bool closed) {
  std::vector<Vec3> out;
  const std::size_t n = line.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 before = closed || i > 0 ? Vec3((line[i] - line[(i + n - 1) % n]).stableNormalized()) : Vec3::Zero();
    const Vec3 after = closed || i + 1 < n ? Vec3((line[(i + 1) % n] - line[i]).stableNormalized()) : Vec3::Zero();
    const Vec3 mean = before + after;
    out.push_back(mean.norm() > 1e-9 ? Vec3(mean.normalized()) : after != Vec3::Zero() ? after : before);
  }
  return out;
}

/// Sides across a line, carried along it without spin; around a closed one turned evenly by what they miss after one round.
std::vector<Vec3> sidesAlong(Points line, const std::vector<Vec3>& along, const Vec3& side, bool closed) {
  const std::size_t n = line.size();
  std::vector<Vec3> out;
  Vec3 s = side;
  for (std::size_t i = 0; i < n + (closed ? 1 : 0); ++i) {
    if (i > 0) s = Quat::FromTwoVectors(along[i - 1], along[i % n]) * s;
    s = (s - s.dot(along[i % n]) * along[i % n]).normalized();
    out.push_back(s);
  }
  if (!closed) return out;
  const double miss = numeric::atan2(along[0].dot(out[n].cross(out[0])), out[n].dot(out[0]));
  out.pop_back();
  double length = 0, total = 0;
  for (std::size_t i = 0; i < n; ++i) total += (line[(i + 1) % n] - line[i]).stableNorm();
  for (std::size_t i = 0; i < n; ++i) {
    const auto turn = numeric::sincos(miss * length / total);
    out[i] = turn.cos * out[i] + turn.sin * along[i].cross(out[i]);
    length += (line[(i + 1) % n] - line[i]).stableNorm();
  }
  return out;
}

/// Frames (tangent, s, t) along a line.
std::vector<Mat3> transported(Points line, const Vec3& side, bool closed) {
  const std::vector<Vec3> along = directions(line, closed), sides = sidesAlong(line, along, side, closed);
  std::vector<Mat3> out;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const Vec3& s = sides[i];
    Mat3 f;
    f << along[i], s, along[i].cross(s);
    out.push_back(f);
  }
  return out;
}

Vec3 anySide(const Vec3& along) {
  Eigen::Index k = 0;
  along.cwiseAbs().minCoeff(&k);
  return along.cross(Vec3(Vec3::Unit(k))).normalized();
}

}  // namespace

CasteljauCurve curveThrough(Points line, std::span<const Mat3> frames, std::span<const double> lengths, bool closed) {
  requireLine("line", line, closed);
  if (frames.size() != line.size()) throw std::invalid_argument(fmt::format("frames: {}, expected {}, one a point", frames.size(), line.size()));
  const std::size_t pieces = line.size() - (closed ? 0 : 1);
  if (lengths.size() != pieces) throw std::invalid_argument(fmt::format("lengths: {}, expected {}", lengths.size(), pieces));
  for (const double l : lengths) requirePositive("lengths", l);
  const std::vector<Vec3> slope = tangents(line, lengths, closed);
  CasteljauCurve out;
  for (std::size_t k = 0; k < pieces; ++k) {
    CasteljauPiece piece;
    const double h = lengths[k];
    const std::size_t next = (k + 1) % line.size();
    piece.length = h;
    piece.points = {line[k], line[k] + h / 3 * slope[k], line[next] - h / 3 * slope[next], line[next]};
    // A quadratic through the ends' means: the middle handle of a piece is the mean of its ends' frames, the handle at a joint
    // the mean of its neighbours' middles (joinC1), and the ends' own slope is 0, so that space beyond them is carried rigidly.
    for (const int column : {1, 2}) {
      const Vec3 middle = 0.5 * (frames[k].col(column) + frames[next].col(column));
      (column == 1 ? piece.s : piece.t) = {{middle, middle, middle}};
    }
    out.pieces.push_back(std::move(piece));
  }
  for (std::size_t k = 0; k + (closed ? 0 : 1) < out.pieces.size(); ++k) {
    CasteljauPiece &a = out.pieces[k], &b = out.pieces[(k + 1) % out.pieces.size()];
    for (const bool first : {true, false}) {
      Vec3 &left = (first ? a.s : a.t)[0][2], &right = (first ? b.s : b.t)[0][0];
      const Vec3 joint = (b.length * (first ? a.s : a.t)[0][1] + a.length * (first ? b.s : b.t)[0][1]) / (a.length + b.length);
      left = right = joint;
    }
  }
  return out;
}

CasteljauPair curvesAlong(Points rest, Points posed, std::span<const Quat> rotation, std::span<const double> scale, bool closed) {
  requireLine("rest", rest, closed);
  requireLine("posed", posed, closed);
  const std::size_t n = rest.size();
  if (posed.size() != n) throw std::invalid_argument(fmt::format("posed: {} points, rest has {}", posed.size(), n));
  if (!rotation.empty() && rotation.size() != n) throw std::invalid_argument(fmt::format("rotation: {}, expected {}", rotation.size(), n));
  if (!scale.empty() && scale.size() != n) throw std::invalid_argument(fmt::format("scale: {}, expected {}", scale.size(), n));
  for (const double s : scale) requirePositive("scale", s);
  std::vector<double> lengths;
  double total = 0;
  for (std::size_t k = 0; k + (closed ? 0 : 1) < n; ++k) lengths.push_back((rest[(k + 1) % n] - rest[k]).stableNorm()), total += lengths.back();
  // Handles as long as a segment is on average: v and w are of the size of u.
  const double unit = total / static_cast<double>(lengths.size());
  const Vec3 along = directions(rest, closed).front(), side = anySide(along);
  std::vector<Mat3> before = transported(rest, side, closed), after;
  if (rotation.empty()) {
    const Vec3 to = directions(posed, closed).front();
    after = transported(posed, Vec3(Quat::FromTwoVectors(along, to) * side), closed);
  } else {
    for (std::size_t i = 0; i < n; ++i) after.push_back(rotation[i].toRotationMatrix() * before[i]);
  }
  for (std::size_t i = 0; i < n; ++i) {
    before[i] *= unit;
    after[i] *= scale.empty() ? unit : unit * scale[i];
  }
  // The same bits where nothing was edited.
  bool same = scale.empty();
  for (std::size_t i = 0; i < n && same; ++i) same = rest[i] == posed[i] && (rotation.empty() || rotation[i].isApprox(Quat::Identity(), 0));
  CasteljauPair pair{curveThrough(rest, before, lengths, closed), {}};
  pair.posed = same ? pair.rest : curveThrough(posed, after, lengths, closed);
  return pair;
}

}  // namespace fielddeform::map
