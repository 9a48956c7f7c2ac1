#pragma once

#include <fielddeform/map/lattice.h>
#include <fielddeform/volume/cubic_form.h>

namespace fielddeform::volume {

/// The form of the smoothly deformed solid: not of the mesh of deformed vertices, but of the image of everything inside the mesh.
///   V(X) = integral over Omega of det(dx'/du) du = sum_{i<j<k} C_ijk det[X_i X_j X_k],
///   C_ijk = integral over Omega of det(grad phi_i, grad phi_j, grad phi_k) du
/// X are node positions (rest + displacement). Omega is the solid inside the triangles, in lattice coordinates; the integrals come
/// from its Legendre moments (divergence theorem, Gauss points on the triangles) and a rule of 3l by 3m by 3n points that they
/// are fitted to, l, m, n the lattice's degrees. Positive for outward triangles, whatever the lattice's handedness.
/// Relative error: rounding (1e-13) below 100 triangles of a lattice of small degree, else below 1e-9.
/// @param triangles  3 indices each, closed and outward (not checked here)
/// @throw std::invalid_argument if an axis is not Bernstein, or a point lies outside the box by more than 1e-9 of it
CubicForm curvedForm(const map::Lattice& lattice, Points positions, std::span<const Index> triangles);

}  // namespace fielddeform::volume
