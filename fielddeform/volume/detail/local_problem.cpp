// The four combinations of energy and solver.
#include <fielddeform/core/error.h>
#include <fielddeform/volume/detail/local_problem.h>

namespace fielddeform::volume::detail {

LocalSolved solveLocally(const LocalEdit& edit, const LocalMask& mask, LocalParts& parts, const LocalLattice& lattice,
                         const ComponentVolumes& volumes, const LocalOptions& options, Progress& progress) {
  const SparseMatrix surface = surfaceMatrix(lattice, parts);
  const SparseMatrix bending = bendingMatrix(lattice);
  const SparseMatrix matrix = surface + stiffness(lattice, mask.length, 4) * bending;
  LocalSolve solve(edit, parts, lattice, matrix, mask.free);
  if (!solve.iterate(options.maxIterations, options.tolerance, progress)) {
    // Where the volume came from cannot give it back: all of the part may.
    for (LocalPart& part : parts.part) part.share.assign(part.size(), 1);
    solve.startAt(std::vector<Vec3>(lattice.active.size(), Vec3::Zero()));
    if (!solve.iterate(options.maxIterations, options.tolerance, progress))
      throw InfeasibleError("no displacement of the part that the volume mask frees restores the volume; use a wider mask");
  }
  LocalSolved out;
  out.deviation = solve.polish(volumes);
  out.displacement = solve.displacement();
  out.iterations = solve.iterations();
  return out;
}

}  // namespace fielddeform::volume::detail
