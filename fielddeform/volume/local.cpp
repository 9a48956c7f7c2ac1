// The volume pass: what moved, where it may move, the lattice, the solve, and what it did. Phases in preserveLocally().
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/detail/local_problem.h>
#include <fielddeform/volume/local.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::volume {

using detail::ComponentVolumes;
using detail::LocalEdit;
using detail::LocalLattice;
using detail::LocalMask;
using detail::LocalParts;

namespace {

constexpr double kKept = 1e-12;          // |dV / V| that needs no pass, and that the pass promises
constexpr double kMuchOfThickness = 0.3; // tau
constexpr double kMuchUndone = 0.2;
constexpr std::size_t kBatch = 64;       // components solved together: their lengths are found by a dense system

void checkShares(const char* name, std::span<const double> values, std::size_t count) {
  if (values.size() != count) throw std::invalid_argument(fmt::format("{} has {} numbers, expected {}", name, values.size(), count));
  for (std::size_t v = 0; v < values.size(); ++v)
    if (!(values[v] >= 0 && values[v] <= 1))
      throw std::invalid_argument(fmt::format("{} is {} at vertex {}, expected 0 to 1", name, values[v], v));
}

void validate(const LocalInput& input, const LocalOptions& options) {
  options.validate();
  const std::size_t n = input.rest.vertexCount();
  if (input.posed.size() != n) throw std::invalid_argument(fmt::format("{} posed positions, expected {}", input.posed.size(), n));
  if (!input.weight.empty()) checkShares("weight", input.weight, n);
  if (options.mask == MaskKind::Given) checkShares("mask", input.mask, n);
}

void measureChange(const std::vector<ComponentVolumes::Value>& values, LocalReport& report) {
  double change = 0, volume = 0;
  for (const auto& v : values) {
    change += v.change(), volume += v.rest;
    report.deviation = std::max(report.deviation, v.deviation());
  }
  report.components = values.size();
  report.change = volume != 0 ? change / volume : 0;
}

// Sums over all moved vertices, of A d.u, A |u|^2, A |d|^2 and A, u the edit and d the pass's displacement.
struct Moves {
  double back = 0, edit = 0, square = 0, area = 0, largest = 0;

  void add(const LocalEdit& e, const LocalParts& parts, const std::vector<Vec3>& moved) {
    for (const auto& part : parts.part)
      for (std::size_t i = 0; i < part.size(); ++i) {
        const Index v = part.vertex[i];
        const Vec3 u = e.posed[v] - e.rest[v];
        const double a = part.area[i] * parts.area;
        back -= a * moved[v].dot(u);
        edit += a * u.squaredNorm();
        if (part.mask[i] == 0) continue;
        square += a * moved[v].squaredNorm();
        area += a;
        largest = std::max(largest, moved[v].norm());
      }
  }
  void describe(const LocalEdit& e, LocalReport& r) const {
    r.undone = edit > 0 ? back / edit : 0;
    r.rms = area > 0 ? std::ldexp(std::sqrt(square / area), e.exponent) : 0;
    r.largest = std::ldexp(largest, e.exponent);
  }
};

// |dV| over what would pass if the whole part gave one thickness.
double shareOfThickness(const LocalParts& parts, double length) {
  double share = 0;
  for (const auto& part : parts.part) {
    double room = 0;
    for (std::size_t i = 0; i < part.size(); ++i) room += part.area[i] * part.mask[i];
    room *= parts.area * length;
    if (room > 0) share = std::max(share, std::abs(part.target - part.before) / room);
  }
  return share;
}

// The components of one batch, with a lattice of their own.
void passOver(const LocalEdit& edit, const LocalMask& mask, const std::vector<ComponentVolumes::Value>& values,
              const LocalOptions& options, Progress& progress, std::vector<Vec3>& moved, Moves& moves, LocalReport& report) {
  progress.throwIfCancelled();
  std::vector<std::uint8_t> held(edit.components.count(), 0);
  for (const auto& value : values) held[value.component] = 1;
  const ComponentVolumes volumes(edit, held);
  LocalParts parts = detail::makeParts(edit, mask, values);
  const LocalLattice lattice = detail::makeLattice(parts, mask.length, options.nodes);
  if (report.freeNodes == 0) {
    report.nodes = lattice.lattice.nodes();
    report.cell = std::ldexp(lattice.cell.maxCoeff(), edit.exponent);
  }
  report.freeNodes += lattice.active.size();
  report.tau = std::max(report.tau, shareOfThickness(parts, mask.length));
  const detail::LocalSolved solved = detail::solveLocally(edit, mask, parts, lattice, volumes, options, progress);
  report.iterations = std::max(report.iterations, solved.iterations);
  report.deviation = std::max(report.deviation, solved.deviation);
  for (const auto& part : parts.part)
    for (std::size_t i = 0; i < part.size(); ++i)
      if (part.mask[i] > 0) moved[part.vertex[i]] = solved.displacement[part.vertex[i]];
  moves.add(edit, parts, moved);
}

void judge(LocalReport& r, bool hasRest) {
  const char* instead = r.mask == MaskKind::Rest || !hasRest ? "" : "; --volume-mask rest takes the volume from what the edit left alone instead";
  if (r.tau > kMuchOfThickness)
    r.warnings.push_back(fmt::format("the volume to be restored is {:.0f} % of the thickness of what moved: expect visible changes{}",
                                     100 * r.tau, instead));
  if (r.undone > kMuchUndone)
    r.warnings.push_back(fmt::format("the volume pass takes back {:.0f} % of the edit{}", 100 * r.undone, instead));
}

}  // namespace

void LocalOptions::validate() const {
  if (maxIterations < 1) throw std::invalid_argument(fmt::format("maxIterations is {}, expected >= 1", maxIterations));
  requirePositive("tolerance", tolerance);
  if (nodes)
    for (const int n : *nodes)
      if (n < 4 || n > 64) throw std::invalid_argument(fmt::format("volume lattice has {} nodes along an axis, expected 4 to 64", n));
}

std::string_view toString(MaskKind kind) noexcept {
  constexpr std::string_view kWords[] = {"auto", "none", "rest", "given"};
  return kWords[static_cast<std::size_t>(kind)];
}
std::string_view toString(LocalEnergy energy) noexcept { return energy == LocalEnergy::Surface ? "surface" : "springs"; }
std::string_view toString(LocalSolver solver) noexcept {
  return solver == LocalSolver::Exact ? "exact" : "augmented-lagrangian";
}

LocalResult preserveLocally(const LocalInput& input, const LocalOptions& options, Progress& progress) {
  validate(input, options);
  LocalResult result{{input.posed.begin(), input.posed.end()}, {}};
  LocalReport& report = result.report;
  report.mask = options.mask;

  const LocalEdit edit(input);
  const auto held = detail::heldComponents(edit, input, options.mask);
  const ComponentVolumes volumes(edit, held);
  const auto values = volumes.measure(edit.posed);
  measureChange(values, report);
  if (report.deviation <= kKept) return result;
  progress.throwIfCancelled();

  const LocalMask mask = detail::makeMask(edit, input, options.mask, held);
  report.needed = true;
  report.fromFalloff = mask.fromFalloff;
  report.moved = mask.moved;
  report.length = std::ldexp(mask.length, edit.exponent);
  report.deviation = 0;
  std::vector<Vec3> moved(edit.vertexCount(), Vec3::Zero());
  Moves moves;
  for (std::size_t first = 0; first < values.size(); first += kBatch) {
    const std::size_t last = std::min(values.size(), first + kBatch);
    passOver(edit, mask, {values.begin() + static_cast<std::ptrdiff_t>(first), values.begin() + static_cast<std::ptrdiff_t>(last)},
             options, progress, moved, moves, report);
  }
  moves.describe(edit, report);
  judge(report, !mask.free);
  parallelFor(result.position.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      for (int k = 0; mask.value[v] > 0 && k < 3; ++k) result.position[v][k] += std::ldexp(moved[v][k], edit.exponent);
  });
  if (!(report.deviation <= kKept))
    report.warnings.push_back(fmt::format("rounding keeps the volume from coming closer than {:.1e}: the object is far from the "
                                          "origin, or hardly encloses any", report.deviation));
  return result;
}

}  // namespace fielddeform::volume
