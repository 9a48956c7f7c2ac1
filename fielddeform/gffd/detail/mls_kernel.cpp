#include <fielddeform/core/detail/simd.h>
#include <fielddeform/gffd/detail/mls_kernel.h>

#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kNegligible = -52.15;    // 2^x below 2e-16
constexpr double kFrames = 0.3;           // their share beside the points' own fit
constexpr int kSteps = 4;
constexpr double kArrived = 1e-12;        // squared half angle of the last step: its error is of third order
constexpr double kIllConditioned = 1e-9;  // det / tr^3 of the Hessian below which Newton steps are not trusted

struct Task {
  std::span<const MlsTerm> terms;
  std::span<const MlsRun> runs;
  const Block& points;
  std::size_t count;
  MlsBlock& out;
};

#define FIELDDEFORM_LEVEL_SOURCE <fielddeform/gffd/detail/mls_kernel_level.h>
#include <fielddeform/core/detail/each_level.h>

FIELDDEFORM_BY_LEVEL(runMls, const Task, mlsKernel)

}  // namespace

void mlsMotions(std::span<const MlsTerm> terms, std::span<const MlsRun> runs, const Block& points, std::size_t count, MlsBlock& out) {
  runMls({terms, runs, points, count, out});
}

}  // namespace fielddeform::gffd::detail
