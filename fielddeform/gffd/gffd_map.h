#pragma once

#include <fielddeform/gffd/options.h>
#include <fielddeform/map/space_map.h>

#include <memory>
#include <string>
#include <vector>

namespace fielddeform::gffd {

/// What stands behind one distance of a map's fields.
struct NamedDistance {
  std::string pose;           ///< "rest", "posed", "posed 1/4" of substeps, "rest, moving part" where primitives are removed
  std::string primitive;      ///< its name; empty: one grid of the whole field
  field::DistanceReport report;
};

/// GFFD as a map of space: points keep their value in the field while the skeleton goes from rest to posed.
/// Embedding (bind) depends on the rest skeleton only, so one binding serves every pose. [Qin et al. 2003]
///
/// Statuses: Fixed (outside every influence at rest, or nothing was edited), Converged, Stalled, Invalid. Limited comes
/// from the guard, which looks at a mesh (guard.h). Residuals are |D - D*| in world units.
class GffdMap final : public map::SpaceMap {
 public:
  /// @throw std::invalid_argument if the options still hold an Auto
  explicit GffdMap(ResolvedOptions resolved);
  ~GffdMap() override;
  GffdMap(const GffdMap&);
  GffdMap& operator=(const GffdMap&);

  std::shared_ptr<const map::Binding> bind(Points rest) const override;
  std::shared_ptr<const map::Binding> bindMidpoints(const map::Binding& binding, Points rest,
                                                    std::span<const std::array<Index, 2>> ends) const override;
  bool midpointsInherit() const override;
  void apply(const map::Binding& binding, map::MapOutput out, Progress& progress) const override;
  /// As apply(), and says which way the points went.
  EvaluationCounts applyCounted(const map::Binding& binding, map::MapOutput out, Progress& progress) const;
  /// By central differences of the whole map, step 1e-5 R.
  void jacobians(const map::Binding& binding, std::span<Mat3> out) const override;

  /// |D(position) - D*| of some bound points at other positions, e.g. after the guard. World units.
  /// @param points  #N indices into the binding; position and out have #N elements
  void residuals(const map::Binding& binding, std::span<const Index> points, Points position,
                 std::span<float> out) const;

  /// The same rest skeleton, another pose. Bindings of this map stay valid for the new one. As this one lives on, the grids of
  /// its posed fields count against the new one's memory, here and below.
  /// @throw std::invalid_argument if the pose removes other primitives than this map's, or is invalid
  /// @throw field::GridMemoryError if the grids would exceed what is left
  GffdMap withPose(skeleton::Skeleton posed) const;
  /// The same edit tracked in n substeps; bindings stay valid.
  /// @param takenMegabytes  by grids of further maps that live on
  GffdMap withSubsteps(int substeps, double takenMegabytes = 0) const;
  /// The same edit by another predictor (not Auto); bindings stay valid.
  GffdMap withPredictor(Predictor predictor, double takenMegabytes = 0) const;
  /// Of the grids of its posed fields, which it shares with no other map (1e6 bytes).
  double posedMegabytes() const noexcept;

  const ResolvedOptions& resolved() const noexcept;
  /// What became of variational and grid distances; empty where they are exact.
  std::vector<NamedDistance> distanceReports() const;
  /// True if every bound point comes back as it went in (nothing was edited).
  bool isIdentity() const noexcept;
  /// Bound points outside the rest field that lie inside the posed one: the skeleton was moved into them.
  std::size_t countPierced(const map::Binding& binding) const;
  bool hasFalloff() const noexcept;
  /// Whether predictions come from a grid. It can be asked for and yet not be: for a rigid edit, the paper's trackers,
  /// substeps, or a skeleton too large for its radius.
  bool usesGrid() const noexcept;
  /// The falloff's share of every bound point, in [0, 1]: 0 outside the influence, 1 where it is full.
  /// @return #P, or empty if the falloff is off
  std::vector<double> falloffWeights(const map::Binding& binding) const;
  /// Points in the rest field's influence region.
  std::size_t countMovable(const map::Binding& binding) const;

 private:
  struct Impl;
  explicit GffdMap(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

}  // namespace fielddeform::gffd
