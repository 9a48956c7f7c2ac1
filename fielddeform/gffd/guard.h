#pragma once

#include <fielddeform/core/status.h>
#include <fielddeform/mesh/mesh.h>

#include <span>
#include <vector>

namespace fielddeform::gffd {

struct GuardOptions {
  double minCosine = 0.3;    ///< a triangle's normal may turn from its predicted one by at most acos of this
  double maxStretch = 2.5;   ///< an edge may be longer than predicted by at most this factor
  int maxRounds = 20;
};

struct GuardReport {
  std::vector<Index> limited;  ///< vertices that were held back, ascending
  int rounds = 0;              ///< rounds that found something
  std::size_t remaining = 0;   ///< triangles still over the bounds after the last round
};

/// Holds corrections back where they would fold or tear the surface: X = safe + lambda (position - safe), lambda lowered
/// around bad triangles and smoothed over their ring. Changes `position` of the limited vertices and sets their status
/// to Limited. Vertices whose status is Fixed or Invalid are never moved.
/// @param safe      #V by 3, predicted positions
/// @param position  #V by 3, in: corrected, out: guarded
/// @param status    #V
GuardReport guard(const mesh::Mesh& mesh, std::span<const Vec3> safe, std::span<Vec3> position,
                  std::span<Status> status, const GuardOptions& options = {});

}  // namespace fielddeform::gffd
