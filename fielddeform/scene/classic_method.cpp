// A scene by skeleton and one of the classic maps, as a method of scene::run().
#include <fielddeform/map/influence.h>
#include <fielddeform/scene/detail/classic.h>
#include <fielddeform/scene/detail/method.h>
#include <fielddeform/scene/detail/skeletons.h>
#include <fielddeform/skeleton/fit.h>
#include <fmt/format.h>

#include <algorithm>

namespace fielddeform::scene::detail {
namespace {

bool lacksRadius(const skeleton::Primitive& p) { return !p.radius && p.pointRadius.empty(); }

// Every primitive gets a radius, by the rule of GFFD; true if it had to be chosen.
bool chooseRadii(const Scene& scene, const mesh::Mesh& mesh, skeleton::SkeletonPair& pair) {
  const auto lacking = [](const skeleton::Skeleton& s) { return std::any_of(s.primitives.begin(), s.primitives.end(), lacksRadius); };
  const bool automatic = !scene.tracking.radius && lacking(pair.rest);
  if (scene.tracking.radius) skeleton::fillRadius(pair.rest, *scene.tracking.radius);
  else if (automatic && mesh::objectSize(mesh.positions()) > 0)
    skeleton::fillAutomaticRadius(pair.rest, mesh.positions(), automaticRadiusFactor(scene));
  for (auto& p : pair.rest.primitives)
    if (lacksRadius(p)) p.radius = 1;  // one point has no size to take it from
  for (const auto& p : pair.pairs) {
    if (p.rest == kNoIndex || p.posed == kNoIndex || !lacksRadius(pair.posed.primitives[p.posed])) continue;
    pair.posed.primitives[p.posed].radius = pair.rest.primitives[p.rest].radius;
    pair.posed.primitives[p.posed].pointRadius = pair.rest.primitives[p.rest].pointRadius;
  }
  return automatic;
}

bool joinsInsideAndOutside(const mesh::Mesh& mesh, const std::vector<char>& inside) {
  const auto differs = [&](std::span<const Index> vertices) {
    bool in = false, out = false;
    for (const Index v : vertices)
      if (mesh.positions()[v].allFinite()) (inside[v] ? in : out) = true;
    return in && out;
  };
  for (Index f = 0; f < mesh.faceCount(); ++f)
    if (differs(mesh.face(f))) return true;
  return std::any_of(mesh.lines().begin(), mesh.lines().end(), [&](const auto& line) { return differs(line.vertices); });
}

class ClassicMethod final : public Method {
 public:
  explicit ClassicMethod(const Scene& scene) : scene_(scene), tracking_(scene.tracking) {}

  std::string_view preparation() const noexcept override { return "skeleton"; }
  void prepare(const mesh::Mesh& mesh) override { skeletons_ = prepareSkeletons(scene_, mesh); }

  void bind(const mesh::Mesh& mesh) override {
    pair_ = skeletons_.pair;
    radiusWasAutomatic_ = chooseRadii(scene_, mesh, pair_) || skeletons_.radiusWasAutomatic;
    skeleton::validate(pair_.rest);
    skeleton::validate(pair_.posed);
    if (takes(scene_.method, MethodOption::Falloff)) chooseZone(mesh);
    made_ = make(pair_, mesh.positions(), 1);
    map_ = zoned(made_.map);
    binding_ = map_->bind(mesh.positions());
  }

  void rebind(const mesh::Mesh& mesh) override { binding_ = map_->bind(mesh.positions()); }

  Posed track(const mesh::Mesh& mesh, std::vector<std::string>& warnings, Progress& progress) override {
    Posed posed = applied(*map_, *binding_, progress);
    binding_.reset();
    warnings.insert(warnings.end(), made_.warnings.begin(), made_.warnings.end());
    if (field_ && insideCount_ == 0 && mesh.vertexCount() > 0)
      warnings.push_back("no vertex is within the skeleton's influence: nothing was deformed; is the skeleton on the mesh?");
    return posed;
  }

  resample::Refined refine(mesh::Mesh mesh, mesh::EdgeTable edges, Posed, const resample::Options& options,
                           std::vector<std::string>&, Progress& progress) override {
    return resample::refine(std::move(mesh), *map_, {.edges = std::move(edges)}, options, progress);
  }

  std::vector<double> falloffWeights(const mesh::Mesh& mesh) override {
    const auto* zone = dynamic_cast<const map::ZonedMap*>(map_.get());
    if (!zone || tracking_.falloff != gffd::Falloff::On) return {};
    return zone->weights(*zone->bind(mesh.positions()));
  }

  void describe(Report& report) const override {
    report.method = toString(scene_.method);
    report.fit = made_.fit;
  }

  void resolve(Scene& scene) const override {
    scene.edits = skeletons_.edits;
    scene.tracking.falloff = tracking_.falloff;
    scene.tracking.radius.reset();
    if (made_.nodes) scene.latticeNodes = made_.nodes;
    storeSkeletons(skeletons_, pair_, scene);
  }

  bool radiusWasAutomatic() const noexcept override { return radiusWasAutomatic_; }
  skeleton::SkeletonPair overlay() const override { return pair_; }

  // The pose on the way is made anew, not the result in part: an arc stays an arc.
  Posed poseAt(const mesh::Mesh& mesh, double t, Progress& progress) override {
    skeleton::SkeletonPair pair = pair_;
    pair.posed = detail::poseAt(skeletons_, scene_, mesh, pair_, t);
    const std::shared_ptr<const map::SpaceMap> map = zoned(make(pair, mesh.positions(), t).map);
    if (lastPose_ && lastRest_ != mesh.positions()) lastPose_.reset();
    if (!lastPose_) lastRest_ = mesh.positions();
    lastPose_ = map->bindAgain(lastPose_.get(), mesh.positions());
    return applied(*map, *lastPose_, progress);
  }

 private:
  ClassicMap make(const skeleton::SkeletonPair& pair, Points points, double t) const {
    static const std::vector<skeleton::Edit> none;
    return makerOf(scene_.method)(
        {scene_, pair, points, scene_.posed ? none : skeletons_.edits, t, t < 1 && made_.fit ? made_.fit->found : std::string()});
  }

  // The influence region as GFFD has it, and whether the displacement must die out in it.
  void chooseZone(const mesh::Mesh& mesh) {
    field_ = std::make_shared<const field::Field>(pair_.rest, tracking_.field);
    std::vector<field::FieldValue> values(mesh.vertexCount());
    field_->evaluate(mesh.positions(), values);
    std::vector<char> inside(values.size());
    for (std::size_t v = 0; v < values.size(); ++v) insideCount_ += inside[v] = values[v].inside;
    if (tracking_.falloff == gffd::Falloff::Auto)
      tracking_.falloff = joinsInsideAndOutside(mesh, inside) ? gffd::Falloff::On : gffd::Falloff::Off;
  }

  std::shared_ptr<const map::SpaceMap> zoned(std::shared_ptr<const map::SpaceMap> map) const {
    if (!field_) return map;
    return std::make_shared<map::ZonedMap>(std::move(map), field_,
                                           tracking_.falloff == gffd::Falloff::On ? tracking_.falloffBand : 0);
  }

  static Posed applied(const map::SpaceMap& map, const map::Binding& binding, Progress& progress) {
    const std::size_t n = binding.size();
    Posed posed{std::vector<Vec3>(n), std::vector<Status>(n), std::vector<float>(n)};
    map.apply(binding, {.position = posed.position, .safe = {}, .status = posed.status, .residual = posed.residual}, progress);
    return posed;
  }

  const Scene& scene_;
  gffd::Options tracking_;  // falloff resolved by chooseZone()
  Skeletons skeletons_;
  skeleton::SkeletonPair pair_;
  ClassicMap made_;
  std::shared_ptr<const map::SpaceMap> map_;
  std::shared_ptr<const map::Binding> binding_;
  std::shared_ptr<const map::Binding> lastPose_;  // on the way: the rest side is looked at once
  std::vector<Vec3> lastRest_;                    // what it binds
  std::shared_ptr<const field::Field> field_;  // null: the method knows no zone
  std::size_t insideCount_ = 0;
  bool radiusWasAutomatic_ = false;
};

}  // namespace

std::unique_ptr<Method> makeClassicMethod(const Scene& scene) { return std::make_unique<ClassicMethod>(scene); }

std::unique_ptr<Method> makeMethod(const Scene& scene) {
  if (!scene.lattices.empty()) return makeLatticeMethod(scene);
  return makerOf(scene.method) ? makeClassicMethod(scene) : makeGffdMethod(scene);
}

}  // namespace fielddeform::scene::detail

namespace fielddeform::scene {

std::string_view methodOf(const Scene& scene) noexcept { return scene.lattices.empty() ? toString(scene.method) : "lattice"; }

}  // namespace fielddeform::scene
