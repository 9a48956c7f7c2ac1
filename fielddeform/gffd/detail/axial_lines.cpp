#include <fielddeform/gffd/detail/axial_lines.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr std::size_t kWidest = 8;  // lanes of a vector

// Where on its segment a foot lies, in [0, 1].
double shareOf(const LineSegment& s, double along) {
  return s.length > 0 && along > 0 ? std::min(along / s.length, 1.0) : 0.0;
}

}  // namespace

std::optional<AxialLines> AxialLines::of(const skeleton::Skeleton& rest, const skeleton::SampledPair& samples) {
  AxialLines out;
  const auto usual = [](double x) { return x < 1e100; };
  for (std::size_t i = 0; i < rest.primitives.size(); ++i) {
    const skeleton::Primitive& p = rest.primitives[i];
    if (p.type == skeleton::PrimitiveType::Mesh || p.points.empty()) return std::nullopt;
    for (const Vec3& x : p.points)
      if (!usual(x.cwiseAbs().maxCoeff())) return std::nullopt;
    out.lines_.push_back(makeLine(p, i, samples));
    for (const Frame& f : out.lines_.back().frames)
      if (!(f[FrameBlock::kRadius] > 1e-100) || !usual(f[FrameBlock::kRadius])) return std::nullopt;
  }
  if (out.lines_.empty()) return std::nullopt;
  return out;
}

AxialLines::Line AxialLines::makeLine(const skeleton::Primitive& p, std::size_t primitive, const skeleton::SampledPair& samples) {
  const skeleton::SampleSet& set = samples.set;
  const bool line = set.segmentStart[primitive].size() > 1;
  Line out{LineFinder(p), {}, {}};
  std::vector<Index> order = line ? set.chain[primitive] : set.vertexSample[primitive];
  const std::size_t segments = out.finder.segments().size();
  if (line) {
    out.start = set.segmentStart[primitive];
    if (out.start.back() == order.size()) order.push_back(order.front());  // closed
  } else {
    for (std::size_t s = 0; s <= segments; ++s) out.start.push_back(static_cast<Index>(s));
    order.push_back(order.back());  // each point's own frame alone counts; the last has a neighbour too
  }
  Quat last = samples.rotation[order[0]];
  for (const Index j : order) {
    Quat q = samples.rotation[j];
    if (line && q.dot(last) < 0) q.coeffs() = -q.coeffs();
    last = q;
    const Vec3 &at = samples.rest[j], move = samples.posed[j] - at;
    out.frames.push_back({at[0], at[1], at[2], move[0], move[1], move[2], q.x(), q.y(), q.z(), q.w(), samples.scale[j], set.samples[j].radius});
  }
  return out;
}

void AxialLines::framesAt(const Line& line, const LineHits& hits, std::size_t count, FrameBlock& out) {
  const std::size_t filled = (count + kWidest - 1) / kWidest * kWidest;
  for (std::size_t p = 0; p < filled; ++p) {
    const auto element = static_cast<Index>(hits.element[p]);
    // A segment is sampled in equal pieces.
    const Index begin = line.start[element], pieces = line.start[element + 1] - begin;
    const double along = shareOf(line.finder.segments()[element], hits.along[p]) * pieces;
    const Index piece = std::min<Index>(pieces - 1, static_cast<Index>(along));
    const double t = along - piece;
    const Frame &a = line.frames[begin + piece], &b = line.frames[begin + piece + 1];
    for (std::size_t c = 0; c < FrameBlock::kChannels; ++c) out.at[c][p] = a[c] + t * (b[c] - a[c]);
    out.distance[p] = hits.square[p];
  }
}

void AxialLines::at(const Block& points, std::size_t count, MotionBlock& out) const {
  Vec3 centre;
  double radius = 0;
  ballOf(points, count, centre, radius);
  LineHits hits;
  FrameBlock frames;
  MotionSums sums;
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const LineFinder& finder = lines_[i].finder;
    finder.find(finder.nearby(centre, radius), points, count, hits);
    framesAt(lines_[i], hits, count, frames);
    if (lines_.size() == 1) return frameMotion(frames, points, count, out);
    addFrameMotion(frames, points, count, i == 0, sums);
  }
  finishMotions(sums, count, out);
}

void AxialLines::nearness(const Block& points, std::size_t count, double* out) const {
  Vec3 centre;
  double radius = 0;
  ballOf(points, count, centre, radius);
  LineHits hits;
  FrameBlock frames;
  std::fill_n(out, count, std::numeric_limits<double>::infinity());
  for (const Line& line : lines_) {
    line.finder.find(line.finder.nearby(centre, radius), points, count, hits);
    framesAt(line, hits, count, frames);
    for (std::size_t p = 0; p < count; ++p) out[p] = std::min(out[p], std::sqrt(hits.square[p]) / frames.at[FrameBlock::kRadius][p]);
  }
}

}  // namespace fielddeform::gffd::detail
