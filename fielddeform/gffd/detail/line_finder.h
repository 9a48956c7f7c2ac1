#pragma once

#include <fielddeform/gffd/detail/line_walk.h>
#include <fielddeform/skeleton/skeleton.h>

#include <vector>

namespace fielddeform::gffd::detail {

/// The closest points of a polyline or of points, block by block. A point's foot does not depend on which points share its
/// block: the distance is the least over all segments, found by walking along the line where that is certain to find it
/// (below), and by trying every segment that can be the nearest elsewhere; of segments equally near the first counts.
///
/// f(s) = |P - line(s)|^2 / 2 has slope -(P - line) . t, which grows by the length of a segment along it and falls by at
/// most |P - vertex| |t' - t| at a vertex. From the falls for points within a reach follows, from the line's end backwards, how
/// steep f must be at a segment's end to rise ever after: a foot so far from it has no other minimum beyond, and the walk may
/// stop. Where a line bends more sharply than a point is far away, that is late.
class LineFinder {
 public:
  struct Nearby {
    Index begin = 0, end = 0;  ///< segments that can be nearest to a point of the block
    Index start = 0;           ///< the nearest to its centre
    double least = 0;          ///< no point of the block is nearer to the line
    const WalkStop* stops = nullptr;  ///< of all segments: where a walk may stop; null: it could miss the nearest
  };

  /// @param p  a polyline or points
  explicit LineFinder(const skeleton::Primitive& p);
  /// What a ball of points sees of the line.
  Nearby nearby(const Vec3& centre, double radius) const;
  /// Element: the segment, or the point, by its place on the line.
  /// @param count  points of the block, 1 to kLanes; the places from there on are filled with the first's hit
  void find(const Nearby& near, const Block& points, std::size_t count, LineHits& hits) const;
  const std::vector<LineSegment>& segments() const noexcept { return segments_; }

 private:
  struct Ball {
    Vec3 centre;
    double radius;
  };
  void findBalls();
  void findStops();
  void findNearest(const Vec3& centre, Nearby& out, double& square) const;
  std::size_t outermost(bool last, std::size_t level, std::size_t i, const Vec3& centre, double distance) const;
  double reachOf(std::size_t first, std::size_t last, const Vec3& centre, double radius) const;
  const WalkStop* stopsFor(double reach) const;

  bool closed_ = false;
  std::vector<LineSegment> segments_;
  std::vector<std::vector<WalkStop>> stops_;  ///< for reaches greatest_, a step_-th of it, ...; empty: no walks
  double greatest_ = 0, step_ = 0;            ///< reach, world
  std::vector<std::vector<Ball>> balls_;      ///< around kLeaf segments each; then around kFan balls each, down to one
};

/// The middle of a block's box and a radius of it around.
/// @param count  at least 1
void ballOf(const Block& points, std::size_t count, Vec3& centre, double& radius);

}  // namespace fielddeform::gffd::detail
