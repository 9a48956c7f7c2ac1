#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/gffd/detail/binding.h>
#include <fielddeform/gffd/gffd_map.h>
#include <fielddeform/mesh/quality.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace fielddeform::gffd {
namespace {

constexpr std::size_t kSamplePoints = 4096;
constexpr std::size_t kAxialPrimitives = 8;  // the closest frame costs a search in every one
// A surface's cells have about six nodes each and are checked at several points: below as many vertices a cell the predictor
// itself is quicker. At nodes it goes by blocks for lines and points, one by one for meshes. Of few vertices nobody sees the
// difference.
constexpr std::size_t kVerticesPerCell = 5, kVerticesPerMlsCell = 2, kVerticesPerMeshCell = 7, kFewVertices = 10000;

// Greatest distance from a mesh's vertices to the nearest primitive.
double greatestDistance(const mesh::Mesh& mesh, skeleton::Skeleton skeleton, field::FieldOptions options) {
  options.distance = {};  // only closest points are asked for
  for (auto& p : skeleton.primitives) {
    p.radius = 1;
    p.pointRadius.clear();
  }
  const field::Field field(skeleton, options);
  const auto& points = mesh.positions();
  return deterministicReduce(
      points.size(), 1024, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double greatest = 0;
        for (std::size_t i = begin; i < end; ++i) {
          if (!points[i].allFinite()) continue;
          double nearest = std::numeric_limits<double>::infinity();
          for (std::size_t k = 0; k < field.primitiveCount(); ++k)
            nearest = std::min(nearest, std::abs(field.closest(k, points[i]).distance));
          greatest = std::max(greatest, nearest);
        }
        return greatest;
      },
      [](double a, double b) { return std::max(a, b); });
}

// Every primitive gets a radius; true if it had to be chosen automatically.
bool chooseRadii(const Options& options, const mesh::Mesh& mesh, skeleton::SkeletonPair& pair) {
  const auto lacks = [](const skeleton::Primitive& p) { return !p.radius && p.pointRadius.empty(); };
  const auto anyLacks = [&](const skeleton::Skeleton& s) { return std::any_of(s.primitives.begin(), s.primitives.end(), lacks); };
  std::optional<double> chosen = options.radius;
  const bool automatic = !chosen && (anyLacks(pair.rest) || anyLacks(pair.posed));
  if (automatic) {
    double reach = greatestDistance(mesh, pair.rest, options.field);
    if (!(reach > 0)) reach = 0.05 * mesh::objectSize(mesh.positions());
    if (!(reach > 0)) reach = 1;  // one point on the skeleton: any radius does
    chosen = options.autoRadiusFactor * reach;
  }
  for (auto& p : pair.rest.primitives)
    if (lacks(p)) p.radius = chosen;
  for (const auto& pr : pair.pairs) {
    if (pr.posed == kNoIndex) continue;
    auto& to = pair.posed.primitives[pr.posed];
    if (!lacks(to)) continue;
    if (pr.rest != kNoIndex) {
      const auto& from = pair.rest.primitives[pr.rest];
      to.radius = from.radius;
      if (pr.kind == skeleton::PairKind::Matched) to.pointRadius = from.pointRadius;
      if (!to.radius && to.pointRadius.empty()) to.radius = *std::max_element(from.pointRadius.begin(), from.pointRadius.end());
    } else {
      to.radius = chosen;
    }
  }
  return automatic;
}

// Faces to try the predictors on: all of a small mesh; of a larger one patches of a face with its neighbours, chosen by
// hash, so that the choice does not depend on the order of anything but the faces themselves.
mesh::Mesh samplePatches(const mesh::Mesh& mesh) {
  const std::size_t faces = mesh.faceCount();
  if (mesh.vertexCount() <= kSamplePoints || faces == 0) return mesh;
  std::vector<std::pair<std::uint64_t, Index>> order(faces);
  for (Index f = 0; f < faces; ++f) order[f] = {splitmix64(0, f), f};
  const std::size_t seeds = std::min(faces, kSamplePoints / 8);
  std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(seeds - 1), order.end());
  std::vector<char> chosen(faces, 0);
  std::unordered_map<std::uint64_t, char> edges;
  const auto forEachEdge = [&](Index f, auto&& call) {
    const auto c = mesh.face(f);
    for (std::size_t k = 0; k < c.size(); ++k) {
      const std::uint64_t a = std::min(c[k], c[(k + 1) % c.size()]), b = std::max(c[k], c[(k + 1) % c.size()]);
      call(a << 32 | b);
    }
  };
  for (std::size_t i = 0; i < seeds; ++i) {
    chosen[order[i].second] = 1;
    forEachEdge(order[i].second, [&](std::uint64_t e) { edges[e] = 1; });
  }
  for (Index f = 0; f < faces; ++f)
    if (!chosen[f]) forEachEdge(f, [&](std::uint64_t e) { chosen[f] = chosen[f] || edges.contains(e); });
  std::unordered_map<Index, Index> number;
  std::vector<Vec3> positions;
  std::vector<Index> corners, offsets{0};
  for (Index f = 0; f < faces; ++f) {
    if (!chosen[f] || positions.size() + mesh.face(f).size() > kSamplePoints) continue;
    for (const Index v : mesh.face(f)) {
      const auto [at, isNew] = number.try_emplace(v, static_cast<Index>(positions.size()));
      if (isNew) positions.push_back(mesh.positions()[v]);
      corners.push_back(at->second);
    }
    offsets.push_back(static_cast<Index>(corners.size()));
  }
  return {std::move(positions), std::move(corners), std::move(offsets)};
}

struct Trial {
  std::size_t folds = 0;
  double stretch = 1;
};

Trial tryPredictor(Predictor predictor, const ResolvedOptions& base, const mesh::Mesh& sample) {
  ResolvedOptions r = base;
  r.options.predictor = predictor;
  r.options.evaluation = Evaluation::Exact;
  if (r.around) r.around = std::make_shared<const std::vector<Vec3>>(sample.positions().begin(), sample.positions().end());
  if (r.options.falloff == Falloff::Auto) r.options.falloff = Falloff::Off;
  const GffdMap map(r);
  const auto binding = map.bind(sample.positions());
  std::vector<Vec3> posed(sample.vertexCount());
  Progress silent;
  map.apply(*binding, {.position = posed, .safe = {}, .status = {}, .residual = {}}, silent);
  const mesh::StretchReport stretch = mesh::edgeStretch(mesh::EdgeTable(sample), sample.positions(), posed);
  return {mesh::countFolds(sample, sample.positions(), posed), stretch.max};
}

void choosePredictor(ResolvedOptions& r, const mesh::Mesh& mesh) {
  if (r.options.predictor != Predictor::Auto) {
    r.predictorReason = "named by the user";
    return;
  }
  r.options.predictor = Predictor::Mls;
  r.predictorWasAutomatic = true;
  const auto& pairs = r.skeletons.pairs;
  const auto matched = [](const skeleton::PrimitivePair& p) { return p.kind == skeleton::PairKind::Matched; };
  if (pairs.size() > kAxialPrimitives || !std::all_of(pairs.begin(), pairs.end(), matched)) {
    r.predictorReason = pairs.size() > kAxialPrimitives ? "many primitives" : "not every primitive has a correspondence";
    return;
  }
  if (mesh.vertexCount() == 0) {
    r.predictorReason = "no vertices to try the predictors on";
    return;
  }
  const mesh::Mesh sample = samplePatches(mesh);
  const Trial mls = tryPredictor(Predictor::Mls, r, sample), axial = tryPredictor(Predictor::Axial, r, sample);
  const bool better = axial.folds <= mls.folds && axial.stretch <= 1.1 * mls.stretch;
  if (better) r.options.predictor = Predictor::Axial;
  r.sampledStretch = better ? axial.stretch : mls.stretch;
  r.predictorReason = fmt::format("on {} sampled vertices axial has {} folds and stretch {:.3g}, mls {} and {:.3g}",
                                  sample.vertexCount(), axial.folds, axial.stretch, mls.folds, mls.stretch);
}

// Whether a grid is quicker than the predictor at every vertex. Vertices far from the skeleton count, though they do not
// move: at worst the choice is not the quicker one.
Evaluation chooseEvaluation(const mesh::Mesh& mesh, const ResolvedOptions& r) {
  const auto& frame = r.embedding->cells;
  const std::size_t n = mesh.vertexCount();
  if (!frame || n < kFewVertices || r.options.substeps > 1) return Evaluation::Exact;
  // A mesh carries the object in facets, whose kinks no cubic follows; blocks of vertices share the search for the facet.
  const auto isMesh = [](const skeleton::Primitive& p) { return p.type == skeleton::PrimitiveType::Mesh; };
  const auto& primitives = r.skeletons.rest.primitives;
  if (r.options.predictor == Predictor::Axial && std::any_of(primitives.begin(), primitives.end(), isMesh)) return Evaluation::Exact;
  std::size_t perCell = r.options.predictor == Predictor::Mls ? kVerticesPerMlsCell : kVerticesPerCell;
  if (std::any_of(primitives.begin(), primitives.end(), isMesh)) perCell = kVerticesPerMeshCell;
  const auto& points = mesh.positions();
  const std::size_t cells =
      detail::countCells(*frame, points, [&](std::size_t i) { return points[i].allFinite(); }, n / perCell);
  return cells * perCell <= n ? Evaluation::Grid : Evaluation::Exact;
}

// Grids near the vertices. The paper's trackers go their own ways between the poses: theirs reach everywhere.
bool followsMesh(const Options& options) {
  const auto& d = options.field.distance;
  return d.kind == field::Distance::Grid && d.grid.around == field::GridAround::Mesh && options.predictor != Predictor::Warp &&
         options.predictor != Predictor::Gradient;
}

// Vertices that are not finite have no value to tear away from: they do not count.
bool joinsMovableAndFixed(const mesh::Mesh& mesh, const detail::GffdBinding& binding) {
  const auto differs = [&](std::span<const Index> vertices) {
    bool movable = false, fixed = false;
    for (const Index v : vertices) {
      if (!binding.rest[v].allFinite()) continue;
      (binding.movable(v) ? movable : fixed) = true;
    }
    return movable && fixed;
  };
  for (Index f = 0; f < mesh.faceCount(); ++f)
    if (differs(mesh.face(f))) return true;
  for (const auto& line : mesh.lines())
    if (differs(line.vertices)) return true;
  return false;
}

}  // namespace

ResolvedOptions resolve(const Options& options, const mesh::Mesh& mesh, const skeleton::SkeletonPair& skeletons,
                        std::shared_ptr<const map::Binding>* binding) {
  options.validate();
  if (skeletons.rest.primitives.empty())
    throw std::invalid_argument("the rest skeleton has no primitives, expected at least one");
  if (skeletons.posed.primitives.empty())
    throw std::invalid_argument("the posed skeleton has no primitives, expected at least one: nothing would be left to follow");
  ResolvedOptions r;
  r.options = options;
  r.skeletons = skeletons;
  r.radiusWasAutomatic = chooseRadii(options, mesh, r.skeletons);
  skeleton::validate(r.skeletons.rest);
  skeleton::validate(r.skeletons.posed);
  if (options.predictor == Predictor::Gradient || options.predictor == Predictor::Warp) {
    // The paper's trackers know neither; a predicted position to fall back on does not exist.
    r.options.guard = false;
    r.options.falloff = Falloff::Off;
    r.options.retry = false;
  }
  if (options.strictValue) {
    r.options.guard = false;
    r.options.falloff = Falloff::Off;
  }
  if (followsMesh(options)) r.around = std::make_shared<const std::vector<Vec3>>(mesh.positions().begin(), mesh.positions().end());
  r.embedding = detail::makeEmbedding(r.skeletons, options.field, r.around ? Points(*r.around) : Points());
  r.referenceRadius = r.embedding->radius;
  choosePredictor(r, mesh);
  if (r.options.evaluation == Evaluation::Auto) r.options.evaluation = chooseEvaluation(mesh, r);
  if (r.options.falloff == Falloff::Auto) {
    const auto bound = detail::bindPoints(r.embedding, mesh.positions());
    r.options.falloff = joinsMovableAndFixed(mesh, *bound) ? Falloff::On : Falloff::Off;
    if (binding) *binding = bound;
  }
  return r;
}

}  // namespace fielddeform::gffd
