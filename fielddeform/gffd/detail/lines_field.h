#pragma once

#include <fielddeform/field/field.h>
#include <fielddeform/gffd/detail/grid_kernel.h>

#include <array>
#include <optional>
#include <vector>

namespace fielddeform::gffd::detail {

/// Coordinates of a block of points; those from the count on may hold anything finite.
struct Block {
  alignas(64) double x[kLanes], y[kLanes], z[kLanes];
};

/// The field of a skeleton of lines and points with one radius each and exponential potentials, block by block: the same
/// mathematics as field::Field, to rounding. A point's value does not depend on which points share its block: the
/// distance is the least over all segments, found by walking along the line where that is certain to find it (below), and
/// by trying every segment that can be the nearest elsewhere.
///
/// f(s) = |P - line(s)|^2 / 2 has slope -(P - line) . t, which grows by the length of a segment along it and falls by at
/// most |P - vertex| |t' - t| at a vertex. Where that fall is less than 0.9 lengths at both ends of every segment near the
/// block, a foot farther from a segment's end than the fall has no other minimum beyond that end: the walk may stop.
class LinesField {
 public:
  /// Nothing if the field is of another kind.
  static std::optional<LinesField> of(const skeleton::Skeleton& skeleton, const field::FieldOptions& options, double reference);

  /// @param count  points of the block, 1 to kLanes
  void evaluate(const Block& points, std::size_t count, LineValues& out) const;

 private:
  struct Segment {
    Vec3 a, b, along;        // along: unit, or zero for a point
    double length;
    double before, after;    // |t' - t| at its ends; 0 at the ends of an open line
  };
  struct Group {
    Vec3 centre;
    double radius;
    double turn;             // greatest |t' - t| / length
    Index begin, end;
  };
  struct Line {
    LineTerm term;
    bool closed = false;
    std::vector<Segment> segments;
    std::vector<Group> groups;
  };
  struct Nearby {
    Index begin = 0, end = 0;  // segments that can be nearest to a point of the block
    Index start = 0;           // the nearest to its centre
    double reach = 0;          // no point of the block is farther from a point of those segments
    double least = 0;          // no point of the block is nearer to the line
    bool certain = false;      // the walk finds the nearest
  };
  static Line makeLine(const skeleton::Primitive& p);
  Nearby nearby(const Line& line, const Vec3& centre, double radius) const;
  static void walk(const Line& line, const Nearby& near, const Block& points, std::size_t count, LineHits& hits);
  static void tryAll(const Line& line, const Nearby& near, const Block& points, std::size_t count, LineHits& hits);

  std::vector<Line> lines_;
  double sharpness_ = 4, end_ = 0, slopeFloor_ = 0, reference_ = 1;
};

}  // namespace fielddeform::gffd::detail
