#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/quality.h>
#include <fmt/format.h>

#include <optional>

namespace fielddeform::gffd {
namespace {

Deformed attempt(const mesh::Mesh& rest, const GffdMap& map, const map::Binding& binding, Progress& progress) {
  const std::size_t n = rest.vertexCount();
  Deformed d{std::vector<Vec3>(n), std::vector<Status>(n), std::vector<float>(n), {}, 0, map, {}};
  const Options& options = map.resolved().options;
  const bool guarded = options.guard && options.corrector && !map.isIdentity();
  std::vector<Vec3> safe(guarded ? n : 0);
  progress.beginStage("track");
  map.apply(binding, {.position = d.position, .safe = safe, .status = d.status, .residual = d.residual}, progress);
  if (guarded) {
    progress.beginStage("guard");
    d.guard = guard(rest, safe, d.position, d.status);
    refreshResiduals(map, binding, d);
  }
  safe = {};
  d.folds = map.isIdentity() ? 0 : mesh::countFolds(rest, rest.positions(), d.position);
  return d;
}

}  // namespace

void refreshResiduals(const GffdMap& map, const map::Binding& binding, Deformed& d) {
  std::vector<Vec3> moved(d.guard.limited.size());
  for (std::size_t k = 0; k < moved.size(); ++k) moved[k] = d.position[d.guard.limited[k]];
  std::vector<float> residual(moved.size());
  map.residuals(binding, d.guard.limited, moved, residual);
  for (std::size_t k = 0; k < moved.size(); ++k) d.residual[d.guard.limited[k]] = residual[k];
}

Deformed deform(const mesh::Mesh& rest, const GffdMap& map, const map::Binding& binding, Progress& progress) {
  Deformed best = attempt(rest, map, binding, progress);
  const Options& options = map.resolved().options;
  if (best.folds == 0 || !options.retry) return best;
  const std::size_t first = best.folds;
  const int before = options.substeps;
  for (const int substeps : {2, 4}) {
    if (substeps <= before || best.folds == 0) continue;
    Deformed next = attempt(rest, map.withSubsteps(substeps), binding, progress);
    if (next.folds < best.folds) best = std::move(next);
  }
  const int kept = best.map.resolved().options.substeps;
  best.retry = fmt::format("{} folded edges in {} substep{}, retried with 2 and 4: kept {} with {}", first, before,
                           before == 1 ? "" : "s", kept, best.folds);
  return best;
}

}  // namespace fielddeform::gffd
