#pragma once

#include <fielddeform/field/field.h>
#include <fielddeform/gffd/detail/line_finder.h>

#include <optional>
#include <vector>

namespace fielddeform::gffd::detail {

/// The field of a skeleton of lines and points with one radius each and exponential potentials, block by block: the same
/// mathematics as field::Field, to rounding. A point's value does not depend on which points share its block.
class LinesField {
 public:
  /// Nothing if the field is of another kind.
  static std::optional<LinesField> of(const skeleton::Skeleton& skeleton, const field::FieldOptions& options, double reference);

  /// D is at least R, or no number, where no primitive reaches.
  /// @param count  points of the block, 1 to kLanes
  void evaluate(const Block& points, std::size_t count, LineValues& out) const;

 private:
  struct Line {
    LineTerm term;
    LineFinder finder;
  };

  std::vector<Line> lines_;
  double sharpness_ = 4, end_ = 0, slopeFloor_ = 0, reference_ = 1;
};

}  // namespace fielddeform::gffd::detail
