#pragma once

#include <fielddeform/gffd/detail/axial_kernel.h>
#include <fielddeform/gffd/detail/line_finder.h>
#include <fielddeform/skeleton/frames.h>

#include <array>
#include <optional>
#include <vector>

namespace fielddeform::gffd::detail {

/// AxialPredictor for skeletons of lines and points, block by block: the same mathematics, to rounding; each closest point is
/// found once. A point's motion does not depend on which points share its block.
class AxialLines {
 public:
  /// Nothing if a primitive is a mesh, or numbers are so large or small that their squares leave the range of doubles.
  /// @param rest  what `samples` samples, in the same order
  static std::optional<AxialLines> of(const skeleton::Skeleton& rest, const skeleton::SampledPair& samples);

  /// @param count  points of the block, 1 to kLanes. A displacement that is no number: ask AxialPredictor.
  void at(const Block& points, std::size_t count, MotionBlock& out) const;
  /// AxialPredictor::nearness of the block's points.
  void nearness(const Block& points, std::size_t count, double* out) const;

 private:
  using Frame = std::array<double, FrameBlock::kChannels>;
  struct Line {
    LineFinder finder;
    std::vector<Index> start;   // a segment's first frame, one more entry than segments
    std::vector<Frame> frames;  // in order; rotations of neighbours in one hemisphere; a closed line's first again at its end
  };
  static Line makeLine(const skeleton::Primitive& p, std::size_t primitive, const skeleton::SampledPair& samples);
  static void framesAt(const Line& line, const LineHits& hits, std::size_t count, FrameBlock& out);

  std::vector<Line> lines_;
};

}  // namespace fielddeform::gffd::detail
