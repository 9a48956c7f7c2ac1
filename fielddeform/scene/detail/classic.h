#pragma once

#include <fielddeform/map/space_map.h>
#include <fielddeform/scene/report.h>
#include <fielddeform/scene/scene.h>

#include <memory>

namespace fielddeform::scene::detail {

/// What a map of space by skeleton is made from.
struct ClassicInput {
  const Scene& scene;                      ///< options; edits
  const skeleton::SkeletonPair& pair;      ///< every primitive has a radius
  Points points;                           ///< #V, the mesh at rest
  const std::vector<skeleton::Edit>& edits;///< resolved; empty if there is a posed skeleton
  double t = 1;                            ///< of the edits: `pair` is posed as they are at t
  std::string found{};                     ///< what fit() found for t = 1, or empty: poses on the way are of the same kind
};

struct ClassicMap {
  std::shared_ptr<const map::SpaceMap> map;
  std::optional<FitReport> fit{};          ///< for methods that fit parameters
  std::vector<std::string> warnings{};
  std::optional<std::array<int, 3>> nodes{};
};

using MakeClassic = ClassicMap (*)(const ClassicInput&);

/// The maker of a method's map; null for GFFD, which is more than a map. The table of methods is in methods.cpp.
MakeClassic makerOf(MethodKind kind) noexcept;

ClassicMap makeBarr(const ClassicInput& input);
ClassicMap makeLinearSkin(const ClassicInput& input);
ClassicMap makeDualQuaternionSkin(const ClassicInput& input);
ClassicMap makeRbf(const ClassicInput& input);
ClassicMap makeFittedLattice(const ClassicInput& input);
ClassicMap makeAxial(const ClassicInput& input);
ClassicMap makeWires(const ClassicInput& input);
ClassicMap makeCasteljau(const ClassicInput& input);

}  // namespace fielddeform::scene::detail
