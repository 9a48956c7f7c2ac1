#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/map/axis_basis.h>

#include <array>
#include <cstddef>

/// The inner loops of lattices, in the best vector instructions that the processor has and with the same bytes in all.
namespace fielddeform::map::detail {

inline constexpr std::size_t kBlock = 64;  ///< points whose weights are held at a time

/// Where a point stands among the pieces of three axes (AxisBasis::Place, packed).
struct Cell {
  Index first = 0;                      ///< node of weight (0, 0, 0)
  std::array<std::uint16_t, 3> piece{};
};

/// The polynomial pieces of three axes of degree <= 3, padded to four functions.
struct PieceTable {
  explicit PieceTable(const std::array<AxisBasis, 3>& axes);
  std::array<std::vector<double>, 3> power;               ///< [piece][power][function]: 16 numbers a piece
  std::array<std::array<double, 4>, 3> offset{}, sign{};  ///< [axis][function]: x = offset + sign t
};

/// Shape of a lattice, as its weights see it.
struct Shape {
  std::array<std::size_t, 3> nodes{}, support{};
  std::array<std::size_t, 3> at{};  ///< where an axis's weights begin among those of a point
  std::size_t stride = 0;           ///< weights of a point
  explicit Shape(const std::array<AxisBasis, 3>& axes);
};

/// The twelve weights (four an axis) of points in pieces.
/// @param t      #P, AxisBasis::Place::t of the axes      @param cell  #P
/// @param weight #P by 12
void pieceWeights(const PieceTable& table, std::size_t count, const Vec3* t, const Cell* cell, double* weight);

/// out_p = sum of weights times node values.
/// @param weight  #P by shape.stride    @param values  #N by 3    @param rows  scratch of support[1] * support[2] numbers
void combine(const Shape& shape, std::size_t count, const Cell* cell, const double* weight, const Vec3* values, double* rows,
             Vec3* out);

/// sums_i += weights times point values, one point after another.
void scatter(const Shape& shape, std::size_t count, const Cell* cell, const double* weight, const Vec3* points, double* rows,
             Vec3* sums);

/// out = rest + displacement; bit for bit rest where nothing is added. Whether all that was written is finite.
bool addDisplacements(std::size_t count, const Vec3* rest, const Vec3* displacement, Vec3* out);

}  // namespace fielddeform::map::detail
