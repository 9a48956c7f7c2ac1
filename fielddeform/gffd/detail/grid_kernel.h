#pragma once

#include <cstddef>

/// The inner loops of the grid path, in the best vector instructions that the processor has and with the same bytes in
/// all: no lane knows of another, so that a point's result does not depend on which points share its block.
namespace fielddeform::gffd::detail {

inline constexpr std::size_t kLanes = 64;          ///< points of a block
inline constexpr std::size_t kCoefficients = 192;  ///< of a cell: [x][y][z][component]

/// From the values at 4 x 4 x 4 nodes (the cell between the second and third on each axis) to the coefficients of the
/// polynomial that interpolates them (Lagrange, cubic on every axis) in powers of the cell's coordinates in [0, 1].
/// Reproduces constants to the bit.
void cubicFromNodes(double* cell);

/// The polynomial of a cell at points of it. All arrays hold kLanes numbers; those from `count` on are not looked at.
/// @param u, v, w  the cell's coordinates
void cubicAt(const double* cell, std::size_t count, const double* u, const double* v, const double* w, double* x, double* y,
             double* z);

/// Coordinates of a block of points; those from the count on may hold anything finite.
struct Block {
  alignas(64) double x[kLanes], y[kLanes], z[kLanes];
};

/// A primitive as the sum of potentials sees it.
struct LineTerm {
  double radius, weight;
  bool plain;  ///< weight 1: alone, its distance is the blend's
};

/// What is summed up over the primitives for a block. Field::evaluate() with exponential potentials; docs/field.md.
struct LineSums {
  alignas(64) double sum[kLanes], gx[kLanes], gy[kLanes], gz[kLanes];
  alignas(64) double active[kLanes];             // how many reach
  alignas(64) double only[kLanes], plain[kLanes];  // of the last that does: d / r, and whether it is plain
};

/// Offsets from the closest points of one primitive, and where on it those are.
struct LineHits {
  alignas(64) double x[kLanes], y[kLanes], z[kLanes], square[kLanes];
  alignas(64) double element[kLanes];  ///< segment, as a number
  alignas(64) double along[kLanes];    ///< from the segment's start, world; not cut off at its ends
};

struct LineValues {
  alignas(64) double value[kLanes];                         ///< D, world; NaN where no primitive reaches
  alignas(64) double gx[kLanes], gy[kLanes], gz[kLanes];
};

/// D = R d / r and its gradient: one primitive of weight 1, at any distance.
void oneLine(const LineHits& hits, double radius, double reference, LineValues& out);
/// Adds one primitive. @param end  e^-k
void addLine(const LineHits& hits, const LineTerm& term, double sharpness, double end, LineSums& sums);
void finishLines(const LineSums& sums, double sharpness, double end, double slopeFloor, double reference, LineValues& out);

}  // namespace fielddeform::gffd::detail
