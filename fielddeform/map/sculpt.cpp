#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/map/detail/auto_refine.h>
#include <fielddeform/map/detail/press_faces.h>
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

constexpr double kPressDamping = 0.05;
constexpr int kFaceRounds = 12;

// What a tool asks of thousands of vertices is a wish, met to a share. Exact least squares would throw nodes that hardly reach
// the surface far away for the last digits: they fold space there. Damped, they stay.
ManipulationOptions forTools(ManipulationOptions options, double damping) {
  options.solver.tolerance = std::max(options.solver.tolerance, 1e-6);
  options.solver.maxIterations = std::min(options.solver.maxIterations, 300);
  options.solver.damping = std::max(options.solver.damping, damping);
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
  struct Held {
    std::size_t point = 0;
    Vec3 target = Vec3::Zero();  // world
    double depth = 0;
  };
  struct Inside {
    std::vector<Held> held;  // deepest first
    std::size_t tooDeep = 0, facesTooDeep = 0;
    double deepest = 0;
    bool clashes() const { return tooDeep > 0 || facesTooDeep > 0; }
  };
  Inside inside(const PressTool& tool) const;
  void pressRound(const Inside& in, MoveReport& report);
  Inside pressFaces(const PressTool& tool, Inside in, MoveReport& report);

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
  // Damped misses grow with the square: 0.05 for the default of 2 %.
  ManipulationOptions options = forTools(options_.solve, 0.35 * std::sqrt(options_.toolTolerance));
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

// The vertices inside a tool, deepest first; where none is too deep, the corners of faces that are.
Sculptor::Inside Sculptor::inside(const PressTool& tool) const {
  // A little beyond the surface, so that the last round ends outside and not on the last bit.
  const double tolerance = options_.pressTolerance * size(), faceTolerance = options_.faceTolerance * size();
  std::vector<PressTool::Contact> contact(now_.size());
  parallelFor(now_.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) contact[v] = tool.contact(now_[v]);
  });
  Inside in;
  for (std::size_t v = 0; v < contact.size(); ++v) {
    const PressTool::Contact& c = contact[v];
    if (!(c.depth > 0)) continue;
    in.held.push_back({v, c.surface + 0.5 * tolerance * c.out, c.depth});
    in.deepest = std::max(in.deepest, c.depth);
    in.tooDeep += c.depth > tolerance;
  }
  if (in.tooDeep == 0 && !tool.isPlane()) {
    const auto faces = detail::facesInside(tool, now_, options_.triangles, faceTolerance);
    in.facesTooDeep = faces.size();
    std::vector<Vec3> push(faces.empty() ? 0 : now_.size(), Vec3::Zero());
    std::vector<double> depth(push.size(), 0);
    for (const auto& [triangle, weight, c] : faces) {
      in.deepest = std::max(in.deepest, c.depth);
      for (int k = 0; k < 3; ++k) {  // the shortest moves of the corners that bring the place out
        const Index v = options_.triangles[triangle][static_cast<std::size_t>(k)];
        const Vec3 move = (c.depth + 0.5 * faceTolerance) * weight[k] / weight.squaredNorm() * c.out;
        if (move.squaredNorm() > push[v].squaredNorm()) push[v] = move, depth[v] = c.depth;
      }
    }
    for (std::size_t v = 0; v < push.size(); ++v)
      if (depth[v] > 0) in.held.push_back({v, now_[v] + push[v], depth[v]});
  }
  std::stable_sort(in.held.begin(), in.held.end(), [](const Held& a, const Held& b) { return a.depth > b.depth; });
  return in;
}

void Sculptor::pressRound(const Inside& in, MoveReport& report) {
  progress_.throwIfCancelled();
  Targets targets;
  targets.pinnedPoints = options_.pinnedPoints;
  const std::size_t most = mostTargets();
  for (const Held& held : in.held) {
    if (targets.points.size() == most) break;
    targets.points.push_back({rest_[held.point], held.target, 1});
  }
  ++report.rounds;
  detail::Solved solved = detail::solveRefining(piece_, targets, forTools(options_.solve, kPressDamping), 0, progress_);
  report.solve = std::move(solved.report);
  accept(std::move(solved.before), std::move(solved.displacements));
}

// Corners give way to what cuts the faces between them, a few times: where that does not end, one face's way out is another's way
// in, and the lattice would only be dented. Then everything stays as the points left it.
Sculptor::Inside Sculptor::pressFaces(const PressTool& tool, Inside in, MoveReport& report) {
  const std::vector<Vec3> displacements = piece_.lattice.displacements;
  const std::vector<float> affected = affected_;
  const Inside before = in;
  for (int round = 0; round < kFaceRounds && in.clashes() && report.rounds < options_.pressRounds; ++round) {
    pressRound(in, report);
    in = inside(tool);
  }
  if (!in.clashes()) return in;
  piece_.lattice.displacements = displacements;
  map_ = map_->withDisplacements(displacements);
  affected_ = affected;
  place();
  return before;
}

MoveReport Sculptor::operator()(const Press& move) {
  MoveReport report = begin("press");
  Inside in = inside(move.tool);
  report.vertices = in.held.size();
  report.deepestBefore = in.deepest;
  double best = in.deepest;
  int stalled = 0;
  while (in.tooDeep > 0 && report.rounds < options_.pressRounds) {
    pressRound(in, report);
    in = inside(move.tool);
    stalled = in.deepest < 0.9 * best ? 0 : stalled + 1;
    best = std::min(best, in.deepest);
    if (stalled < 8) continue;
    std::vector<detail::Failure> failures;
    for (const Held& held : in.held)
      if (held.depth > options_.pressTolerance * size()) failures.push_back({rest_[held.point], held.depth});
    auto finer = detail::refineWhereItFails(piece_, failures, options_.maxNodes);
    if (!finer) continue;
    std::vector<Vec3> same = finer->lattice.displacements;
    accept(std::move(*finer), std::move(same));
    ++report.refinements;
    stalled = 0;
  }
  if (in.tooDeep == 0 && in.facesTooDeep > 0) in = pressFaces(move.tool, std::move(in), report);
  report.nodes = piece_.lattice.nodes();
  report.deepestAfter = in.deepest;
  report.penetrating = in.tooDeep;
  report.penetratingFaces = in.facesTooDeep;
  if (report.penetrating > 0)
    report.advice = fmt::format("{} vertices are still inside the tool, the deepest by {:.3g}: a lattice of more nodes gives way more freely",
                                report.penetrating, report.deepestAfter);
  else if (report.penetratingFaces > 0)
    report.advice = fmt::format("{} faces are still cut by the tool between their corners, the deepest by {:.3g}: a lattice of more nodes, or an "
                                "object of smaller faces, gives way more freely", report.penetratingFaces, report.deepestAfter);
  return report;
}

}  // namespace

void SculptOptions::validate() const {
  solve.validate();
  requirePositive("toolTolerance", toolTolerance);
  requirePositive("pressTolerance", pressTolerance);
  requirePositive("faceTolerance", faceTolerance);
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
