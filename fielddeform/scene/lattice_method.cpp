// A scene by lattices, one after the other, as a method of scene::run().
#include <fielddeform/map/chain.h>
#include <fielddeform/map/extended_lattice_io.h>
#include <fielddeform/map/lattice_io.h>
#include <fielddeform/map/targets_file.h>
#include <fielddeform/mesh/topology.h>
#include <fielddeform/scene/detail/method.h>
#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <stdexcept>

namespace fielddeform::scene::detail {
namespace {

// A rule is short, what it asks for is not: 400 MB of displacements at most.
constexpr std::size_t kMaxRuleNodes = std::size_t{1} << 24;

map::AxisBasis axisOf(const LatticeRule& rule, int nodes) {
  if (rule.basis == map::BasisKind::Bernstein) return map::AxisBasis::bernstein(nodes);
  return map::AxisBasis::bspline(nodes, rule.degree, rule.border);
}

map::LatticeBox fittedBox(const LatticeRule& rule, Points points) {
  if (rule.box) return *rule.box;
  return rule.oriented ? map::fitOrientedBox(points, rule.padding) : map::fitBox(points, rule.padding);
}

map::Lattice latticeOf(const LatticeRule& rule, Points points) {
  map::Lattice lattice;
  lattice.box = fittedBox(rule, points);
  for (int a = 0; a < 3; ++a) lattice.axis[a] = axisOf(rule, rule.nodes[a]);
  lattice.outside = rule.outside;
  if (lattice.nodeCount() > kMaxRuleNodes)
    throw std::invalid_argument(fmt::format("lattice: {} x {} x {} nodes, at most {} in all", rule.nodes[0], rule.nodes[1],
                                            rule.nodes[2], kMaxRuleNodes));
  if (rule.moves.empty()) return lattice;
  lattice.displacements.assign(lattice.nodeCount(), Vec3::Zero());
  for (const LatticeRule::Move& move : rule.moves) {
    for (int a = 0; a < 3; ++a)
      if (move.node[a] < 0 || move.node[a] >= rule.nodes[a])
        throw std::invalid_argument(fmt::format("lattice: node {},{},{} is moved, the lattice has {} x {} x {} counted from 0",
                                                move.node[0], move.node[1], move.node[2], rule.nodes[0], rule.nodes[1],
                                                rule.nodes[2]));
    lattice.displacements[lattice.index(move.node[0], move.node[1], move.node[2])] += move.by;
  }
  return lattice;
}

using AnyLattice = std::variant<map::Lattice, map::ExtendedLattice>;

// The lattice of a step for a mesh that has come to `points` so far.
AnyLattice latticeOf(const LatticeStep& step, Points points) {
  if (const auto* rule = std::get_if<LatticeRule>(&step.source)) return latticeOf(*rule, points);
  AnyLattice lattice;
  if (const auto* path = std::get_if<std::filesystem::path>(&step.source)) lattice = map::readAnyLattice(*path);
  else if (const auto* given = std::get_if<map::Lattice>(&step.source)) lattice = *given;
  else lattice = std::get<map::ExtendedLattice>(step.source);
  if (!step.fit) return lattice;
  const map::LatticeBox box = map::fitBox(points);
  return std::visit([&](auto& l) -> AnyLattice { return map::refit(std::move(l), box); }, lattice);
}

// The lattice's edges as lines, node to node along each axis.
skeleton::Skeleton edgesOf(const map::Lattice& lattice, const std::vector<Vec3>& nodes) {
  skeleton::Skeleton edges;
  const auto n = lattice.nodes();
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    for (int j = 0; j < n[b]; ++j)
      for (int k = 0; k < n[c]; ++k) {
        skeleton::Primitive line;
        line.name = fmt::format("edge {}", edges.primitives.size());
        for (int i = 0; i < n[axis]; ++i) {
          std::array<int, 3> at{};
          at[axis] = i, at[b] = j, at[c] = k;
          line.points.push_back(nodes[lattice.index(at[0], at[1], at[2])]);
        }
        edges.primitives.push_back(std::move(line));
      }
  }
  return edges;
}

// The edges of cells' control polygons, node to node along each axis; those of common faces once.
skeleton::Skeleton edgesOf(const map::ExtendedLattice& lattice, const std::vector<Vec3>& nodes) {
  std::set<std::array<Index, 4>> rows;
  for (const auto& cell : lattice.cells)
    for (int axis = 0; axis < 3; ++axis)
      for (int n = 0; n < 16; ++n) {
        std::array<Index, 4> row{};
        for (int i = 0; i < 4; ++i) {
          std::array<int, 3> at{};
          at[axis] = i, at[(axis + 1) % 3] = n % 4, at[(axis + 2) % 3] = n / 4;
          row[i] = cell[static_cast<std::size_t>(at[0] + 4 * (at[1] + 4 * at[2]))];
        }
        if (row[3] < row[0]) std::reverse(row.begin(), row.end());
        rows.insert(row);
      }
  skeleton::Skeleton edges;
  for (const auto& row : rows) {
    skeleton::Primitive line;
    line.name = fmt::format("edge {}", edges.primitives.size());
    for (const Index n : row) line.points.push_back(nodes[n]);
    edges.primitives.push_back(std::move(line));
  }
  return edges;
}

class LatticeMethod final : public Method {
 public:
  explicit LatticeMethod(const Scene& scene) : scene_(scene) {}

  std::string_view preparation() const noexcept override { return "lattice"; }

  void prepare(const mesh::Mesh& mesh) override {
    std::vector<Vec3> points = mesh.positions();
    if (scene_.output.affectedAttribute) affected_.assign(points.size(), 0.0f);
    for (const LatticeStep& step : scene_.lattices) {
      AnyLattice any = latticeOf(step, points);
      if (auto* extended = std::get_if<map::ExtendedLattice>(&any)) {
        addExtended(std::move(*extended), step, points);
      } else {
        auto& lattice = std::get<map::Lattice>(any);
        if (!step.sculpt.moves.empty()) lattice = sculpted(std::move(lattice), step.sculpt, mesh, points);
        maps_.push_back(std::make_shared<const map::LatticeMap>(std::move(lattice)));
      }
      if (!affected_.empty()) markAffected(*maps_.back(), points);
      if (maps_.size() == scene_.lattices.size()) break;
      Progress silent;
      maps_.back()->apply(*maps_.back()->bind(points), {.position = points, .safe = {}, .status = {}, .residual = {}}, silent);
    }
    chain_.emplace(std::vector<std::shared_ptr<const map::SpaceMap>>(maps_.begin(), maps_.end()));
  }

  void bind(const mesh::Mesh& mesh) override { binding_ = chain_->bind(mesh.positions()); }

  void rebind(const mesh::Mesh& mesh) override { bind(mesh); }

  Posed track(const mesh::Mesh&, std::vector<std::string>& warnings, Progress& progress) override {
    Posed posed = applied(*chain_, *binding_, progress);
    binding_.reset();
    for (const map::MoveReport& move : moves_)
      if (!move.advice.empty()) warnings.push_back(move.advice);
    if (std::all_of(maps_.begin(), maps_.end(), [](const auto& m) { return isStill(*m); }))
      warnings.push_back("no node of the lattice was moved: nothing was deformed");
    warnings.insert(warnings.end(), outside_.begin(), outside_.end());
    return posed;
  }

  resample::Refined refine(mesh::Mesh mesh, mesh::EdgeTable edges, Posed, const resample::Options& options,
                           std::vector<std::string>&, Progress& progress) override {
    return resample::refine(std::move(mesh), *chain_, {.edges = std::move(edges)}, options, progress);
  }

  void describe(Report& report) const override {
    report.method = "lattice";
    report.moves = moves_;
  }

  std::vector<float> affected() const override { return affected_; }

  void resolve(Scene& scene) const override {
    scene.lattices.clear();
    for (const auto& map : maps_) {
      if (const auto* extended = dynamic_cast<const map::ExtendedLatticeMap*>(map.get())) scene.lattices.push_back({extended->lattice(), false, {}});
      else scene.lattices.push_back({dynamic_cast<const map::LatticeMap&>(*map).lattice(), false, {}});
    }
  }

  // Of one lattice whose edges can still be told apart.
  skeleton::SkeletonPair overlay() const override {
    constexpr std::size_t kMostNodes = 1000;
    if (maps_.size() != 1 || maps_[0]->nodeCount() > kMostNodes) return {};
    if (const auto* extended = dynamic_cast<const map::ExtendedLatticeMap*>(maps_[0].get())) return overlayOf(extended->lattice(), *maps_[0]);
    return overlayOf(dynamic_cast<const map::LatticeMap&>(*maps_[0]).lattice(), *maps_[0]);
  }

  Posed poseAt(const mesh::Mesh& mesh, double t, Progress& progress) override {
    std::vector<std::shared_ptr<const map::SpaceMap>> maps;
    for (const auto& map : maps_) {
      std::vector<Vec3> part(map->displacements().begin(), map->displacements().end());
      for (Vec3& d : part) d *= t;
      maps.push_back(map->withDisplacements(part));
    }
    if (maps.size() == 1) {  // where points lie in a lattice does not depend on its displacements
      if (!poseBinding_ || poseRest_ != mesh.positions()) {
        poseRest_ = mesh.positions();
        poseBinding_ = maps_[0]->bind(poseRest_);
      }
      return applied(*maps[0], *poseBinding_, progress);
    }
    const map::Chain chain(std::move(maps));
    return applied(chain, *chain.bind(mesh.positions()), progress);
  }

 private:
  template <class Lattice>
  static skeleton::SkeletonPair overlayOf(const Lattice& lattice, const map::LinearMap& map) {
    std::vector<Vec3> nodes(map.restNodes().begin(), map.restNodes().end());
    skeleton::SkeletonPair pair;
    pair.rest = edgesOf(lattice, nodes);
    for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i] += map.displacements()[i];
    pair.posed = edgesOf(lattice, nodes);
    return pair;
  }

  void addExtended(map::ExtendedLattice lattice, const LatticeStep& step, Points points) {
    if (!step.sculpt.moves.empty())
      throw std::invalid_argument("extended lattices do not follow points: expected targets and tools only with other lattices");
    const auto map = std::make_shared<const map::ExtendedLatticeMap>(std::move(lattice));
    if (const std::size_t n = map->outsideCount(*map->bind(points)); n > 0)
      outside_.push_back(fmt::format("{} of {} vertices lie in no cell of the extended lattice: they stay where they are", n, points.size()));
    maps_.push_back(map);
  }

  map::Lattice sculpted(map::Lattice lattice, const Sculpt& sculpt, const mesh::Mesh& mesh, std::vector<Vec3> points) {
    map::SculptOptions options;
    options.maxNodes = sculpt.maxNodes;
    options.solve.tolerance = sculpt.tolerance;
    if (!sculpt.pins.empty()) options.pinnedPoints = map::readPins(sculpt.pins, points);
    std::vector<map::Move> moves;
    bool presses = false;
    for (const map::MoveSpec& move : sculpt.moves) {
      moves.push_back(map::loadMove(move, points));
      presses = presses || std::holds_alternative<map::Press>(moves.back());
    }
    std::vector<std::array<Index, 3>> triangles;
    if (presses) {
      for (std::size_t f = 0; f < mesh.faceCount(); ++f)
        mesh.forEachTriangle(f, [&](Index a, Index b, Index c) { triangles.push_back({a, b, c}); });
      options.triangles = triangles;
      addMiddles(mesh, points);
    }
    Progress silent;
    map::Sculpted result = map::sculpt(std::move(lattice), points, moves, options, silent);
    moves_.insert(moves_.end(), result.moves.begin(), result.moves.end());
    return std::move(result.lattice);
  }

  // The middles of edges and faces are pressed like vertices: they spread over the lattice what faces that are still cut would ask
  // of their three corners alone, which leaves dents.
  static void addMiddles(const mesh::Mesh& mesh, std::vector<Vec3>& points) {
    const mesh::EdgeTable edges(mesh);
    points.reserve(points.size() + edges.size() + mesh.faceCount());
    for (std::size_t e = 0; e < edges.size(); ++e) points.push_back(0.5 * (points[edges.vertices(e)[0]] + points[edges.vertices(e)[1]]));
    for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
      const auto corners = mesh.face(f);
      Vec3 sum = Vec3::Zero();
      for (const Index v : corners) sum += points[v];
      points.push_back(sum / static_cast<double>(corners.size()));
    }
  }

  void markAffected(const map::LinearMap& map, Points points) {
    const std::vector<Vec3> still(map.nodeCount(), Vec3::Zero());
    const std::vector<float> share = map::affectedRegion(map, *map.bind(points), still, map.displacements());
    for (std::size_t v = 0; v < affected_.size(); ++v) affected_[v] = std::max(affected_[v], share[v]);
  }

  static bool isStill(const map::LinearMap& map) {
    const Points moved = map.displacements();
    return std::all_of(moved.begin(), moved.end(), [](const Vec3& d) { return d.isZero(0); });
  }

  static Posed applied(const map::SpaceMap& map, const map::Binding& binding, Progress& progress) {
    const std::size_t n = binding.size();
    Posed posed{std::vector<Vec3>(n), std::vector<Status>(n), std::vector<float>(n)};
    map.apply(binding, {.position = posed.position, .safe = {}, .status = posed.status, .residual = posed.residual}, progress);
    return posed;
  }

  const Scene& scene_;
  std::vector<map::MoveReport> moves_;
  std::vector<float> affected_;  // #V, if it is wanted
  std::vector<std::string> outside_;  // warnings
  std::vector<std::shared_ptr<const map::LinearMap>> maps_;
  std::optional<map::Chain> chain_;
  std::shared_ptr<const map::Binding> binding_;
  std::shared_ptr<const map::Binding> poseBinding_;  // of one lattice, for poses on the way
  std::vector<Vec3> poseRest_;                       // what it binds
};

}  // namespace

std::unique_ptr<Method> makeLatticeMethod(const Scene& scene) { return std::make_unique<LatticeMethod>(scene); }

}  // namespace fielddeform::scene::detail
