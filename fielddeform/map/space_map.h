#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/core/status.h>
#include <fielddeform/core/types.h>

#include <array>
#include <memory>
#include <span>

namespace fielddeform::map {

/// What a map remembers of the points bound to it. Immutable; made by one map (or a map it is the re-pose of).
class Binding {
 public:
  virtual ~Binding() = default;
  virtual std::size_t size() const = 0;  ///< #P
};

/// Where apply() writes. Caller-owned and reused; each span has #P elements or is empty (not wanted).
struct MapOutput {
  std::span<Vec3> position;     ///< #P by 3, world, deformed
  std::span<Vec3> safe;         ///< #P by 3, world, predicted only: the fold guard's way back
  std::span<Status> status;     ///< #P
  std::span<float> residual;    ///< #P, |D - D*| in world length units, >= 0
};

/// A map of space: immutable, pointwise, safe to use from many threads, knowing nothing of meshes.
/// The result for a point never depends on which other points are bound with it.
class SpaceMap {
 public:
  virtual ~SpaceMap() = default;

  /// Binds rest points (world). Non-finite points are bound as Status::Invalid and come back as they are.
  /// Cost: the expensive half; do it once per mesh.
  virtual std::shared_ptr<const Binding> bind(Points rest) const = 0;

  /// bind(), the same bits, for poses of one rest side one after the other: what only the rest side decides (closest points,
  /// weights) is kept in the binding, and taken over from the last pose's.
  /// @param earlier  the binding of the same points by a map of the same kind, or null: the first. Whatever does not fit is made anew
  /// By default it keeps nothing.
  virtual std::shared_ptr<const Binding> bindAgain(const Binding* earlier, Points rest) const;

  /// Binds the midpoints of pairs of points of an existing binding.
  /// @param binding  the binding of `rest`
  /// @param rest     #P by 3, the points that `binding` was made of
  /// @param ends     #M pairs of indices into `rest`
  /// The default binds the midpoints themselves; a map may carry the ends' values over instead (Qin 2003, Fig. 6).
  virtual std::shared_ptr<const Binding> bindMidpoints(const Binding& binding, Points rest,
                                                       std::span<const std::array<Index, 2>> ends) const;

  /// Whether bindMidpoints() carries values of the ends over, so that it needs their binding. If not, it does the same as
  /// bind() on the midpoints.
  virtual bool midpointsInherit() const { return false; }

  /// Deforms the bound points.
  /// @throw std::invalid_argument if the binding is another map's, or a span has the wrong size
  /// @throw Cancelled
  virtual void apply(const Binding& binding, MapOutput out, Progress& progress) const = 0;

  /// Derivative of the deformed position by the rest position, row = output coordinate. #P matrices.
  virtual void jacobians(const Binding& binding, std::span<Mat3> out) const = 0;
};

}  // namespace fielddeform::map
