#pragma once

#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/mesh.h>
#include <tests/support/cases.h>

#include <vector>

namespace fielddeform::gffd::tests {

/// A skeleton of one polyline.
inline skeleton::Skeleton lineSkeleton(std::vector<Vec3> points, double radius) {
  skeleton::Primitive p;
  p.name = "line";
  p.points = std::move(points);
  p.radius = radius;
  return {{p}, {}};
}

inline Deformed track(const mesh::Mesh& mesh, const skeleton::Skeleton& rest, const skeleton::Skeleton& posed,
                      const Options& options = {}) {
  const ResolvedOptions resolved = resolve(options, mesh, skeleton::pairSkeletons(rest, posed));
  const GffdMap map(resolved);
  Progress silent;
  return deform(mesh, map, *map.bind(mesh.positions()), silent);
}

inline Deformed track(const fielddeform::tests::Case& c, const Options& options = {}) {
  return track(c.mesh, c.rest, c.posed, options);
}

inline double meanDistance(Points a, Points b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).norm();
  return sum / static_cast<double>(a.size());
}

inline double greatestDistance(Points a, Points b) {
  double greatest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) greatest = std::max(greatest, (a[i] - b[i]).norm());
  return greatest;
}

/// A small capsule for tests that need no resolution.
inline mesh::Mesh smallCapsule(double bump = 0.15) {
  return fielddeform::tests::makeCapsule({.around = 24, .along = 30, .bump = bump});
}

}  // namespace fielddeform::gffd::tests
