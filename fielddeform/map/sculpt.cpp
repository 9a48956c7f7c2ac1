#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/map/detail/auto_refine.h>
#include <fielddeform/map/sculpt.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace fielddeform::map {
namespace {

constexpr std::size_t kAdviceTargets = 500;   // more are not tried out for the advice
constexpr std::size_t kAdviceNodes = 20'000;

constexpr double kDamping = 0.05;

// What a tool asks of thousands of vertices is a wish, met to a share. Exact least squares would throw nodes that hardly reach
// the surface far away for the last digits: they fold space there. Damped, they stay.
ManipulationOptions forTools(ManipulationOptions options) {
  options.solver.tolerance = std::max(options.solver.tolerance, 1e-6);
  options.solver.maxIterations = std::min(options.solver.maxIterations, 300);
  options.solver.damping = std::max(options.solver.damping, kDamping);
  return options;
}

double falloff(Profile profile, double r) {
  switch (profile) {
    case Profile::Smooth: return (1 - r * r) * (1 - r * r);
    case Profile::Linear: return 1 - r;
    case Profile::Flat: return 1;
  }
  return 1;
}

class Sculptor {
 public:
  Sculptor(Lattice lattice, Points rest, const SculptOptions& options, Progress& progress)
      : rest_(rest), options_(options), progress_(progress) {
    options.validate();
    lattice.validate();
    piece_.lattice = std::move(lattice);
    if (piece_.lattice.displacements.empty()) piece_.lattice.displacements.assign(piece_.lattice.nodeCount(), Vec3::Zero());
    if (!options.solve.nodeCost.empty() && options.maxNodes > 0)
      throw std::invalid_argument("maxNodes: a lattice with node costs cannot be refined");
    if (!options.pinnedNodes.empty()) piece_.pinned.assign(piece_.lattice.nodeCount(), 0);
    for (const Index n : options.pinnedNodes) {
      if (n >= piece_.pinned.size())
        throw std::invalid_argument(fmt::format("pinned node {}: must be less than {}", n, piece_.pinned.size()));
      piece_.pinned[n] = 1;
    }
    affected_.assign(rest.size(), 0.0f);
    rebind();
  }

  MoveReport operator()(const Targets& move) {
    MoveReport report = begin("targets");
    report.vertices = move.points.size() + move.directions.size();
    solve(move, options_.solve, report);
    if (report.solve.unmet > 0 || report.solve.outside > 0) advise(move, report);
    return report;
  }

  MoveReport operator()(const Magnet& move) {
    requirePositive("radius", move.radius);
    requireFinite("strength", move.strength);
    for (const Vec3* v : {&move.centre, &move.by, move.towards ? &*move.towards : &move.centre})
      if (!v->allFinite()) throw std::invalid_argument("magnet: a number is not finite");
    return pull("magnet", [&](const Vec3& x) -> std::optional<Vec3> {
      const double r = (x - move.centre).stableNorm() / move.radius;
      if (!(r < 1)) return {};
      return Vec3(falloff(move.profile, r) * (move.towards ? Vec3(move.strength * (*move.towards - x)) : move.by));
    });
  }

  MoveReport operator()(const SuctionCup& move) {
    requirePositive("radius", move.radius);
    requireFinite("turn", move.turn);
    const double depth = move.depth.value_or(move.radius);
    requirePositive("depth", depth);
    if (!move.centre.allFinite() || !move.by.allFinite() || !move.axis.allFinite() || !(move.axis.stableNorm() > 0))
      throw std::invalid_argument("suction: numbers must be finite, and the axis must have a length");
    const Vec3 axis = move.axis.stableNormalized();
    const Mat3 turn = Eigen::AngleAxisd(move.turn, axis).toRotationMatrix() - Mat3::Identity();
    return pull("suction", [&](const Vec3& x) -> std::optional<Vec3> {
      const Vec3 arm = x - move.centre;
      const double height = axis.dot(arm);
      if (!(std::abs(height) <= depth) || !((arm - height * axis).stableNorm() <= move.radius)) return {};
      return Vec3(move.by + turn * arm);
    });
  }

  MoveReport operator()(const Press& move);

  Sculpted finish(std::vector<MoveReport> moves) && { return {std::move(piece_.lattice), std::move(moves), std::move(affected_)}; }

 private:
  MoveReport begin(const char* kind) const {
    MoveReport report;
    report.kind = kind;
    report.nodes = piece_.lattice.nodes();
    return report;
  }
  double size() const { return piece_.lattice.box.axes.colwise().norm().norm(); }
  std::size_t mostTargets() const {
    std::size_t support = 1;
    for (const AxisBasis& a : piece_.lattice.axis) support *= static_cast<std::size_t>(a.support());
    return std::max<std::size_t>(1, options_.maxEntries / support);
  }

  void rebind() {
    map_ = std::make_unique<LatticeMap>(piece_.lattice);
    binding_ = map_->bind(rest_);
    place();
  }
  void place() {
    now_.resize(rest_.size());
    map_->apply(*binding_, {now_, {}, {}, {}}, progress_);
  }
  // Takes over a solve: its finer lattice, its displacements.
  void accept(detail::Workpiece before, std::vector<Vec3> displacements) {
    const bool finer = before.lattice.nodeCount() != piece_.lattice.nodeCount();
    piece_ = std::move(before);
    if (finer) rebind();
    const std::vector<float> share = affectedRegion(*map_, *binding_, piece_.lattice.displacements, displacements);
    for (std::size_t v = 0; v < share.size(); ++v) affected_[v] = std::max(affected_[v], share[v]);
    piece_.lattice.displacements = std::move(displacements);
    map_ = map_->withDisplacements(piece_.lattice.displacements);
    place();
  }
  void solve(Targets targets, const ManipulationOptions& options, MoveReport& report) {
    targets.pinnedPoints.insert(targets.pinnedPoints.end(), options_.pinnedPoints.begin(), options_.pinnedPoints.end());
    detail::Solved solved = detail::solveRefining(piece_, targets, options, options_.maxNodes, progress_);
    report.solve = std::move(solved.report);
    report.refinements += solved.refinements;
    contradictory_ = solved.contradictory;
    accept(std::move(solved.before), std::move(solved.displacements));
    report.nodes = piece_.lattice.nodes();
  }
  template <class Pull>
  MoveReport pull(const char* kind, Pull&& wanted);
  void advise(const Targets& targets, MoveReport& report);
  std::vector<std::size_t> inside(const PressTool& tool, std::vector<PressTool::Contact>& contact) const;

  Points rest_;
  const SculptOptions& options_;
  Progress& progress_;
  detail::Workpiece piece_;
  std::unique_ptr<LinearMap> map_;
  std::shared_ptr<const Binding> binding_;
  std::vector<Vec3> now_;  // #V, where the vertices are
  std::vector<float> affected_;
  bool contradictory_ = false;
};

// One solve for the vertices that a tool takes hold of: evenly thinned out if there are more than the memory allows.
template <class Pull>
MoveReport Sculptor::pull(const char* kind, Pull&& wanted) {
  MoveReport report = begin(kind);
  Targets targets;
  double farthest = 0;
  for (std::size_t v = 0; v < rest_.size(); ++v) {
    if (!rest_[v].allFinite()) continue;
    if (const std::optional<Vec3> d = wanted(now_[v])) {
      targets.points.push_back({rest_[v], now_[v] + *d, 1});
      farthest = std::max(farthest, d->stableNorm());
    }
  }
  report.vertices = targets.points.size();
  if (targets.points.empty()) {
    report.advice = fmt::format("the {} took hold of no vertex", kind);
    return report;
  }
  if (const std::size_t most = mostTargets(); targets.points.size() > most) {
    std::vector<PointTarget> some;
    for (std::size_t i = 0; i < most; ++i) some.push_back(targets.points[i * targets.points.size() / most]);
    targets.points = std::move(some);
  }
  ManipulationOptions options = forTools(options_.solve);
  options.tolerance = std::max(options.tolerance, options_.toolTolerance * farthest / size());
  solve(targets, options, report);
  if (report.solve.unmet > 0)
    report.advice = fmt::format("the {} is followed to {:.3g} where {:.3g} are wanted: a lattice of more nodes follows closer", kind,
                                report.solve.largestMiss, options_.toolTolerance * farthest);
  return report;
}

void Sculptor::advise(const Targets& targets, MoveReport& report) {
  report.advice = report.solve.advice;
  if (report.solve.unmet == 0) return;
  const std::string missed = fmt::format("{} of {} targets are not met, the worst by {:.3g}", report.solve.unmet, report.vertices,
                                         report.solve.largestMiss);
  if (contradictory_) {
    report.advice = missed + ": some ask for two places at once";
    return;
  }
  if (options_.maxNodes > 0) {
    report.advice = fmt::format("{} with {} nodes, of {} allowed", missed, piece_.lattice.nodeCount(), options_.maxNodes);
    return;
  }
  if (report.vertices > kAdviceTargets || !options_.solve.nodeCost.empty()) return;
  // Tried out, so that the number is one that does.
  Targets all = targets;
  all.pinnedPoints.insert(all.pinnedPoints.end(), options_.pinnedPoints.begin(), options_.pinnedPoints.end());
  const detail::Solved finer =
      detail::solveRefining(piece_, all, options_.solve, std::max(kAdviceNodes, 2 * piece_.lattice.nodeCount()), progress_);
  const auto n = finer.before.lattice.nodes();
  report.advice = finer.report.unmet == 0
                      ? fmt::format("{}: {} x {} x {} nodes, refined where it is missed, would meet all", missed, n[0], n[1], n[2])
                      : fmt::format("{}: even {} x {} x {} nodes would leave {:.3g}", missed, n[0], n[1], n[2], finer.report.largestMiss);
}

// The vertices inside a tool, deepest first.
std::vector<std::size_t> Sculptor::inside(const PressTool& tool, std::vector<PressTool::Contact>& contact) const {
  contact.resize(now_.size());
  parallelFor(now_.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) contact[v] = tool.contact(now_[v]);
  });
  std::vector<std::size_t> list;
  for (std::size_t v = 0; v < contact.size(); ++v)
    if (contact[v].depth > 0) list.push_back(v);
  std::stable_sort(list.begin(), list.end(), [&](std::size_t a, std::size_t b) { return contact[a].depth > contact[b].depth; });
  return list;
}

MoveReport Sculptor::operator()(const Press& move) {
  MoveReport report = begin("press");
  std::vector<PressTool::Contact> contact;
  std::vector<std::size_t> in = inside(move.tool, contact);
  const double tolerance = options_.pressTolerance * size();
  const auto deepest = [&] { return in.empty() ? 0.0 : contact[in.front()].depth; };
  report.vertices = in.size();
  report.deepestBefore = deepest();
  double best = deepest();
  int stalled = 0;
  while (deepest() > tolerance && report.rounds < options_.pressRounds) {
    progress_.throwIfCancelled();
    Targets targets;
    targets.pinnedPoints = options_.pinnedPoints;
    const std::size_t most = mostTargets();
    for (const std::size_t v : in) {
      if (targets.points.size() == most) break;
      // A little beyond the surface, so that the last round ends outside and not on the last bit.
      targets.points.push_back({rest_[v], contact[v].surface + 0.5 * tolerance * contact[v].out, 1});
    }
    ++report.rounds;
    detail::Solved solved = detail::solveRefining(piece_, targets, forTools(options_.solve), 0, progress_);
    report.solve = std::move(solved.report);
    accept(std::move(solved.before), std::move(solved.displacements));
    in = inside(move.tool, contact);
    stalled = deepest() < 0.9 * best ? 0 : stalled + 1;
    best = std::min(best, deepest());
    if (stalled < 8) continue;
    std::vector<detail::Failure> failures;
    for (const std::size_t v : in)
      if (contact[v].depth > tolerance) failures.push_back({rest_[v], contact[v].depth});
    auto finer = detail::refineWhereItFails(piece_, failures, options_.maxNodes);
    if (!finer) continue;
    std::vector<Vec3> same = finer->lattice.displacements;
    accept(std::move(*finer), std::move(same));
    ++report.refinements;
    stalled = 0;
  }
  report.nodes = piece_.lattice.nodes();
  report.deepestAfter = deepest();
  for (const std::size_t v : in) report.penetrating += contact[v].depth > tolerance;
  if (report.penetrating > 0)
    report.advice = fmt::format("{} vertices are still inside the tool, the deepest by {:.3g}: a lattice of more nodes gives way more freely",
                                report.penetrating, report.deepestAfter);
  return report;
}

}  // namespace

void SculptOptions::validate() const {
  solve.validate();
  requirePositive("toolTolerance", toolTolerance);
  requirePositive("pressTolerance", pressTolerance);
  requireInRange("pressRounds", pressRounds, 1, 1e9);
  for (const Vec3& p : pinnedPoints)
    if (!p.allFinite()) throw std::invalid_argument("pinnedPoints: a point is not finite");
}

Sculpted sculpt(Lattice lattice, Points rest, std::span<const Move> moves, const SculptOptions& options, Progress& progress) {
  Sculptor sculptor(std::move(lattice), rest, options, progress);
  std::vector<MoveReport> reports;
  for (const Move& move : moves) reports.push_back(std::visit(sculptor, move));
  return std::move(sculptor).finish(std::move(reports));
}

}  // namespace fielddeform::map
