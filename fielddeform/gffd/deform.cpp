#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/quality.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace fielddeform::gffd {
namespace {

constexpr double kTear = 1.5;  // times the greatest stretch of the sample

// Greatest ratio of posed to rest length over the edges of all faces.
double greatestStretch(const mesh::Mesh& rest, Points posed) {
  return deterministicReduce(
      rest.faceCount(), 8192, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double greatest = 0;
        for (std::size_t f = begin; f < end; ++f) {
          const auto c = rest.face(f);
          for (std::size_t k = 0; k < c.size(); ++k) {
            const Index a = c[k], b = c[(k + 1) % c.size()];
            const double before = (rest.positions()[b] - rest.positions()[a]).squaredNorm();
            const double after = (posed[b] - posed[a]).squaredNorm();
            if (after > greatest * before && before > 0) greatest = after / before;
          }
        }
        return std::sqrt(greatest);
      },
      [](double a, double b) { return std::max(a, b); });
}

}  // namespace

Deformed deformOnce(const mesh::Mesh& rest, const GffdMap& map, const map::Binding& binding, Progress& progress, bool keepSafe) {
  const std::size_t n = rest.vertexCount();
  Deformed d{std::vector<Vec3>(n), std::vector<Status>(n), std::vector<float>(n), {}, {}, 0, map, {}, {}};
  const Options& options = map.resolved().options;
  const bool guarded = options.guard && options.corrector && !map.isIdentity();
  std::vector<Vec3> safe(guarded || keepSafe ? n : 0);
  progress.beginStage("track");
  d.evaluation = map.applyCounted(binding, {.position = d.position, .safe = safe, .status = d.status, .residual = d.residual}, progress);
  if (guarded) {
    progress.beginStage("guard");
    d.guard = guard(rest, safe, d.position, d.status);
    refreshResiduals(map, binding, d);
  }
  if (keepSafe) d.safe = std::move(safe);
  else safe = {};
  d.folds = map.isIdentity() ? 0 : mesh::countFolds(rest, rest.positions(), d.position);
  return d;
}

void refreshResiduals(const GffdMap& map, const map::Binding& binding, Deformed& d) {
  std::vector<Vec3> moved(d.guard.limited.size());
  for (std::size_t k = 0; k < moved.size(); ++k) moved[k] = d.position[d.guard.limited[k]];
  std::vector<float> residual(moved.size());
  map.residuals(binding, d.guard.limited, moved, residual);
  for (std::size_t k = 0; k < moved.size(); ++k) d.residual[d.guard.limited[k]] = residual[k];
}

Deformed deform(const mesh::Mesh& rest, const GffdMap& map, const map::Binding& binding, Progress& progress, bool keepSafe) {
  Deformed best = deformOnce(rest, map, binding, progress, keepSafe);
  const Options& options = map.resolved().options;
  if (!options.retry || map.isIdentity()) return best;
  const auto name = [](const Deformed& d) {
    const Options& o = d.map.resolved().options;
    return fmt::format("{} in {} substep{} with {} folded edges", toString(o.predictor), o.substeps,
                       o.substeps == 1 ? "" : "s", d.folds);
  };
  std::string tried;
  // Grids of the first map and of the best one live while another is made; where no memory is left for its own, it is not tried.
  bool replaced = false;
  const auto attemptAlso = [&](const std::string& what, const auto& make) -> std::optional<Deformed> {
    if (tried.empty()) tried = name(best);
    try {
      Deformed next = deformOnce(rest, make(replaced ? map.posedMegabytes() : 0), binding, progress, keepSafe);
      tried += "; " + name(next);
      return next;
    } catch (const field::GridMemoryError& problem) {
      tried += fmt::format("; not {} ({})", what, problem.what());
      return std::nullopt;
    }
  };
  const auto take = [&](std::optional<Deformed>& next) {
    best = std::move(*next);
    replaced = true;
  };
  // The predictor was chosen on a sample; a tear that the sample missed shows on the whole surface.
  const ResolvedOptions& resolved = map.resolved();
  if (resolved.predictorWasAutomatic && options.predictor == Predictor::Axial) {
    const double stretch = greatestStretch(rest, best.position);
    if (best.folds > 0 || stretch > kTear * std::max(1.0, resolved.sampledStretch)) {
      auto next = attemptAlso("mls", [&](double taken) { return best.map.withPredictor(Predictor::Mls, taken); });
      if (next && (next->folds < best.folds || (next->folds == best.folds && greatestStretch(rest, next->position) < stretch))) take(next);
    }
  }
  for (const int substeps : {2, 4}) {
    if (substeps <= options.substeps || best.folds == 0) continue;
    auto next = attemptAlso(fmt::format("{} substeps", substeps), [&](double taken) { return best.map.withSubsteps(substeps, taken); });
    if (next && next->folds < best.folds) take(next);
  }
  if (!tried.empty()) best.retry = fmt::format("tried {}; kept {}", tried, name(best));
  return best;
}

}  // namespace fielddeform::gffd
