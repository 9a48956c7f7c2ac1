#include <fielddeform/core/detail/simd.h>
#include <fielddeform/gffd/detail/grid_kernel.h>
#include <fielddeform/numeric/elementary.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kLog2E = 1.4426950408889634;

struct NodesTask {
  double* cell;
};

struct CubicTask {
  const double* cell;
  std::size_t count;
  const double *u, *v, *w;
  double *x, *y, *z;
};

struct OneTask {
  const LineHits& hits;
  double radius, reference;
  LineValues& out;
};

struct AddTask {
  const LineHits& hits;
  const LineTerm& term;
  double sharpness, end;
  LineSums& sums;
};

struct FinishTask {
  const LineSums& sums;
  double sharpness, end, slopeFloor, reference;
  LineValues& out;
};

#define FIELDDEFORM_LEVEL_SOURCE <fielddeform/gffd/detail/grid_kernel_level.h>
#include <fielddeform/core/detail/each_level.h>

FIELDDEFORM_BY_LEVEL(runNodes, const NodesTask, nodesKernel)
FIELDDEFORM_BY_LEVEL(runCubic, const CubicTask, cubicKernel)
FIELDDEFORM_BY_LEVEL(runOne, const OneTask, oneKernel)
FIELDDEFORM_BY_LEVEL(runAdd, const AddTask, addKernel)
FIELDDEFORM_BY_LEVEL(runFinish, const FinishTask, finishKernel)

}  // namespace

void cubicFromNodes(double* cell) { runNodes({cell}); }

void cubicAt(const double* cell, std::size_t count, const double* u, const double* v, const double* w, double* x, double* y,
             double* z) {
  runCubic({cell, count, u, v, w, x, y, z});
}

void oneLine(const LineHits& hits, double radius, double reference, LineValues& out) { runOne({hits, radius, reference, out}); }

void addLine(const LineHits& hits, const LineTerm& term, double sharpness, double end, LineSums& sums) {
  runAdd({hits, term, sharpness, end, sums});
}

void finishLines(const LineSums& sums, double sharpness, double end, double slopeFloor, double reference, LineValues& out) {
  runFinish({sums, sharpness, end, slopeFloor, reference, out});
}

}  // namespace fielddeform::gffd::detail
