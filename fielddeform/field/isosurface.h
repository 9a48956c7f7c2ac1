#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/field/field.h>
#include <fielddeform/mesh/mesh.h>

namespace fielddeform::field {

struct SampleOptions {
  std::optional<double> voxel = {};  ///< spacing of the samples, world, > 0; absent: a 16th of the smallest radius
  double maxMegabytes = 2048;        ///< more is refused before it is taken
  void validate() const;             ///< @throw std::invalid_argument
};

/// The surface D = value of a field (D: the pseudo-distance, world), closed and oriented outwards, by tetrahedra on a
/// lattice around the skeleton. Vertices lie on the surface to 1e-3 of a voxel; what is thinner than a voxel is lost.
/// The vertex attribute "isovalue" holds the value. Empty where the field does not take the value.
/// @param voxel absent  a 16th of the smallest radius, and at most a third of the distance that the value stands for
/// @throw std::invalid_argument for a value that is not finite, or if the samples exceed the memory; Cancelled
mesh::Mesh isosurface(const Field& field, double value, const SampleOptions& options, Progress& progress);

}  // namespace fielddeform::field
