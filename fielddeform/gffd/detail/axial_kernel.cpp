#include <fielddeform/core/detail/simd.h>
#include <fielddeform/gffd/detail/axial_kernel.h>

#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kFall = 4 * 1.4426950408889634;  // weights 2^(-kFall d / r) = exp(-4 d / r)
constexpr double kLeast = 1e-200;                 // of a squared length: below it nothing was summed up

struct OneTask {
  const FrameBlock& frames;
  const Block& points;
  std::size_t count;
  MotionBlock& out;
};

struct AddTask {
  const FrameBlock& frames;
  const Block& points;
  std::size_t count;
  bool first;
  MotionSums& sums;
};

struct FinishTask {
  const MotionSums& sums;
  std::size_t count;
  MotionBlock& out;
};

#define FIELDDEFORM_LEVEL_SOURCE <fielddeform/gffd/detail/axial_kernel_level.h>
#include <fielddeform/core/detail/each_level.h>

FIELDDEFORM_BY_LEVEL(runOne, const OneTask, oneKernel)
FIELDDEFORM_BY_LEVEL(runAdd, const AddTask, addKernel)
FIELDDEFORM_BY_LEVEL(runFinish, const FinishTask, finishKernel)

}  // namespace

void frameMotion(const FrameBlock& frames, const Block& points, std::size_t count, MotionBlock& out) {
  runOne({frames, points, count, out});
}

void addFrameMotion(const FrameBlock& frames, const Block& points, std::size_t count, bool first, MotionSums& sums) {
  runAdd({frames, points, count, first, sums});
}

void finishMotions(const MotionSums& sums, std::size_t count, MotionBlock& out) { runFinish({sums, count, out}); }

}  // namespace fielddeform::gffd::detail
