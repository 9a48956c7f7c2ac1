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
using detail::LocalPart;
using detail::LocalParts;

namespace {

constexpr double kKept = 1e-12;          // |dV / V| that needs no pass, and that the pass promises
constexpr double kMuchOfThickness = 0.3; // tau
constexpr double kMuchUndone = 0.2;
constexpr std::size_t kGrain = 8192;
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

// Sums over moved vertices, of A d.u, A |u|^2, A |d|^2 and A, u the edit and d the pass's displacement.
struct Moves {
  double back = 0, edit = 0, square = 0, area = 0, largest = 0;

  Moves& operator+=(const Moves& o) {
    back += o.back, edit += o.edit, square += o.square, area += o.area;
    largest = std::max(largest, o.largest);
    return *this;
  }
  void add(const LocalEdit& e, const LocalPart& part, double areas, Points moved) {
    *this += deterministicReduce(
        part.size(), kGrain, Moves(),
        [&](std::size_t begin, std::size_t end) {
          Moves some;
          for (std::size_t i = begin; i < end; ++i) {
            const Index v = part.vertex[i];
            const Vec3 u = e.posed[v] - e.rest[v];
            const double a = part.area[i] * areas, squareMove = moved[v].squaredNorm();
            some.back -= a * moved[v].dot(u);
            some.edit += a * u.squaredNorm();
            if (part.mask[i] == 0) continue;
            some.square += a * squareMove;
            some.area += a;
            some.largest = std::max(some.largest, squareMove);
          }
          some.largest = std::sqrt(some.largest);
          return some;
        },
        [](Moves a, const Moves& b) { return a += b; });
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
void passOver(const LocalEdit& edit, const LocalMask& mask, const ComponentVolumes& volumes, LocalParts parts,
              const LocalOptions& options, Progress& progress, std::span<Vec3> moved, Moves& moves, LocalReport& report) {
  const LocalLattice lattice = detail::makeLattice(parts, mask.length, options.nodes);
  if (report.freeNodes == 0) {
    report.nodes = lattice.lattice.nodes();
    report.cell = std::ldexp(lattice.cell.maxCoeff(), edit.exponent);
  }
  report.freeNodes += lattice.active.size();
  report.tau = std::max(report.tau, shareOfThickness(parts, mask.length));
  const detail::LocalSolved solved = detail::solveLocally(edit, mask, parts, lattice, volumes, options, progress, moved);
  report.iterations = std::max(report.iterations, solved.iterations);
  report.deviation = std::max(report.deviation, solved.deviation);
  for (const LocalPart& part : parts.part) moves.add(edit, part, parts.area, moved);
}

// Of the held components, some at a time. @return #V by 3, scaled: how far every vertex is moved
std::vector<Vec3> passOverAll(LocalEdit& edit, const LocalMask& mask, const ComponentVolumes& volumes,
                              const std::vector<ComponentVolumes::Value>& values, const LocalOptions& options, Progress& progress,
                              LocalReport& report) {
  Moves moves;
  std::vector<Vec3> moved;
  for (std::size_t first = 0; first < values.size(); first += kBatch) {
    progress.throwIfCancelled();
    const std::size_t last = std::min(values.size(), first + kBatch);
    const std::vector<ComponentVolumes::Value> batch(values.begin() + static_cast<std::ptrdiff_t>(first),
                                                     values.begin() + static_cast<std::ptrdiff_t>(last));
    std::optional<ComponentVolumes> own;
    if (batch.size() < values.size()) {
      std::vector<std::uint8_t> held(edit.components.count(), 0);
      for (const auto& value : batch) held[value.component] = 1;
      own.emplace(edit, held);
    }
    detail::AreaChanges areas = detail::measureAreas(edit, mask, batch);
    if (last == values.size()) edit.giveBackEdges();
    LocalParts parts = detail::makeParts(edit, mask, batch, std::move(areas));
    moved.resize(edit.vertexCount(), Vec3::Zero());
    passOver(edit, mask, own ? *own : volumes, std::move(parts), options, progress, moved, moves, report);
  }
  moves.describe(edit, report);
  return moved;
}

// From displacements to positions. @param moved  #V by 3, scaled
void place(Points posed, const LocalMask& mask, int exponent, std::vector<Vec3>& moved) {
  const double factor = std::ldexp(1.0, exponent);
  const bool direct = std::isnormal(factor);
  parallelFor(moved.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      if (mask.value[v] > 0)
        for (int k = 0; k < 3; ++k) moved[v][k] = posed[v][k] + (direct ? moved[v][k] * factor : std::ldexp(moved[v][k], exponent));
      else
        moved[v] = posed[v];
    }
  });
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
  LocalResult result;
  LocalReport& report = result.report;
  report.mask = options.mask;

  LocalEdit edit(input);
  const auto held = detail::heldComponents(edit, input, options.mask);
  const ComponentVolumes volumes(edit, held);
  const auto values = volumes.measure(edit.posed);
  measureChange(values, report);
  if (report.deviation <= kKept) {
    result.position.assign(input.posed.begin(), input.posed.end());
    return result;
  }
  progress.throwIfCancelled();

  const LocalMask mask = detail::makeMask(edit, input, options.mask, held);
  report.needed = true;
  report.fromFalloff = mask.fromFalloff;
  report.moved = mask.moved;
  report.length = std::ldexp(mask.length, edit.exponent);
  report.deviation = 0;
  result.position = passOverAll(edit, mask, volumes, values, options, progress, report);
  judge(report, !mask.free);
  place(input.posed, mask, edit.exponent, result.position);
  if (!(report.deviation <= kKept))
    report.warnings.push_back(fmt::format("rounding keeps the volume from coming closer than {:.1e}: the object is far from the "
                                          "origin, or hardly encloses any", report.deviation));
  return result;
}

}  // namespace fielddeform::volume
