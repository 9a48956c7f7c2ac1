#pragma once

#include <fielddeform/solid/object.h>

#include <span>

namespace fielddeform::solid {

/// Bernstein functions and their derivatives at u; beyond [0, 1] they go on along their tangents, so that what is made of them is C1.
/// @param value, slope  degree + 1
void bernstein(int degree, double u, double* value, double* slope);

/// Weights of the control points at (u, v, w), a slot; with their gradients by u, v, w if wanted.
void weights(const std::array<int, 3>& degree, const Vec3& uvw, std::span<double> weight, std::span<Vec3> gradient = {});

/// @param points  a slot, as pointsOf() gives them
Vec3 evaluate(const std::array<int, 3>& degree, Points points, const Vec3& uvw);
/// dF/d(u, v, w), columns.
Mat3 derivative(const std::array<int, 3>& degree, Points points, const Vec3& uvw);
Vec3 evaluate(const Object& object, std::size_t solid, const Vec3& uvw);
Mat3 derivative(const Object& object, std::size_t solid, const Vec3& uvw);

/// The same solid with one degree more along an axis, exactly.
LooseSolid elevated(const LooseSolid& solid, std::size_t axis);

/// An inner control point from those of the boundary by the trivariate Coons formula over the net: the sum of the three linear
/// blends of opposite faces, less those of edges, plus that of corners.
/// @return slots of the boundary and their weights
/// @throw std::invalid_argument if (i, j, k) is not inside
std::vector<std::pair<std::size_t, double>> coonsWeights(const std::array<int, 3>& degree, const std::array<int, 3>& ijk);
/// Slots that lie on no side.
std::vector<std::array<int, 3>> innerPoints(const std::array<int, 3>& degree);
/// Every inner control point replaced by that of the formula.
void fillInner(Object& object);

}  // namespace fielddeform::solid
