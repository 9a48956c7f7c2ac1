#include <fielddeform/field/vdb.h>
#include <fielddeform/scene/detail/skeletons.h>
#include <fielddeform/scene/symmetry.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/skeleton/fit.h>
#include <fielddeform/skeleton/interpolate.h>
#include <fielddeform/skeleton/principal_axes.h>
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace fielddeform::scene::detail {
namespace {

namespace fs = std::filesystem;
using skeleton::Edit;
using skeleton::Skeleton;

// Lines are divided into pieces of this share of the mesh's size, which a quarter turn bends by half a degree.
// Wires carry by (1 - u^2)^2: the farthest vertex of a fitted spine, at u = 1 / 1.25, by 0.13, with a radius four times as large by 0.92.
constexpr double kWireReach = 4;
constexpr double kPiece = 1.0 / 100;

template <class... Operations>
bool is(const Edit& edit) {
  return (std::holds_alternative<Operations>(edit.operation) || ...);
}

template <class Source>
Skeleton readOr(const Source& source, const std::string& grid) {
  if (const auto* path = std::get_if<fs::path>(&source)) return field::readSkeletonOrVolume(*path, grid);
  return std::get<Skeleton>(source);
}

// A grid's name that no skeleton has a use for is a mistake.
void requireVolumeFor(const Scene& scene) {
  const auto isVolume = [](const auto& source) {
    const auto* path = std::get_if<fs::path>(&source);
    return path && field::isVdb(*path);
  };
  if (scene.volumeGrid.empty() || isVolume(scene.rest) || (scene.posed && isVolume(*scene.posed))) return;
  throw std::invalid_argument(fmt::format("grid is \"{}\", but no skeleton is a volume (.vdb)", scene.volumeGrid));
}

// Dividing renumbers points: a skeleton whose points are edited by number stays as it is.
bool mayDivide(const std::vector<Edit>& edits) {
  return !edits.empty() && std::none_of(edits.begin(), edits.end(), [](const Edit& e) {
    return is<skeleton::MovePoints, skeleton::Replace>(e);
  });
}

bool lacksRadius(const Skeleton& skeleton) {
  return std::any_of(skeleton.primitives.begin(), skeleton.primitives.end(),
                     [](const skeleton::Primitive& p) { return !p.radius && p.pointRadius.empty(); });
}

bool scalesRadii(const Edit& edit) {
  if (is<skeleton::Taper>(edit)) return true;
  const auto* scale = std::get_if<skeleton::Scale>(&edit.operation);
  return scale && (scale->factor.array() == scale->factor[0]).all();
}

// A fitted spine is nearly straight: the mesh, not the spine, says which way it is to be bent.
void useAxesOfFit(const skeleton::SpineFit& fit, std::vector<Edit>& edits) {
  const auto fill = [&](skeleton::Spine& spine) {
    if (!spine.axis) spine.axis = fit.axis;
  };
  for (Edit& edit : edits) {
    if (auto* bend = std::get_if<skeleton::Bend>(&edit.operation)) {
      fill(bend->spine);
      if (!bend->about) bend->about = fit.about;
    } else if (auto* twist = std::get_if<skeleton::Twist>(&edit.operation)) {
      fill(twist->spine);
    } else if (auto* taper = std::get_if<skeleton::Taper>(&edit.operation)) {
      fill(taper->spine);
    } else if (auto* stretch = std::get_if<skeleton::Stretch>(&edit.operation)) {
      fill(stretch->spine);
    } else if (auto* rotate = std::get_if<skeleton::Rotate>(&edit.operation)) {
      if (!rotate->axis) rotate->axis = fit.axis;
    }
  }
}

// A nearly straight line does not say which way it is to be bent: across its own axis the mesh's longest extent does.
void useAboutOfMesh(const mesh::Mesh& mesh, const Skeleton& rest, std::vector<Edit>& edits) {
  const auto open = [](const Edit& edit) {
    const auto* bend = std::get_if<skeleton::Bend>(&edit.operation);
    return bend && !bend->about;
  };
  if (std::none_of(edits.begin(), edits.end(), open)) return;
  const mesh::SurfaceMoments moments = mesh::surfaceMoments(mesh, mesh.positions());
  const skeleton::Bulk bulk{moments.centroid, moments.covariance, mesh::boundingBox(mesh.positions())};
  if (bulk.box.isEmpty()) return;
  const std::vector<Edit> known = skeleton::resolve(rest, edits);
  for (std::size_t i = 0; i < edits.size(); ++i)
    if (open(edits[i]))
      std::get<skeleton::Bend>(edits[i].operation).about =
          skeleton::autoAbout(bulk, *std::get<skeleton::Bend>(known[i].operation).spine.axis);
}

// A bend that was given by its radius keeps it: an angle in degrees might not read back as the same number.
std::vector<Edit> resolved(const Skeleton& rest, const std::vector<Edit>& edits) {
  std::vector<Edit> out = skeleton::resolve(rest, edits);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto* given = std::get_if<skeleton::Bend>(&edits[i].operation);
    if (!given || !given->radius) continue;
    auto& bend = std::get<skeleton::Bend>(out[i].operation);
    bend.radius = given->radius;
    bend.angle.reset();
  }
  return out;
}

skeleton::SkeletonPair pairOf(const Scene& scene, const mesh::Mesh& mesh, Skeleton rest, Skeleton posed) {
  skeleton::SkeletonPair pair = skeleton::pairSkeletons(std::move(rest), std::move(posed), scene.pairs);
  if (!scene.symmetry) return pair;
  const int axis = static_cast<int>(*scene.symmetry);
  const Box box = mesh::boundingBox(mesh.positions());
  return mirrorEdits(pair, {.axis = axis, .at = box.isEmpty() ? 0 : box.center()[axis]});
}

// Radii of the primitives that a resolved skeleton has under the same name.
void takeRadii(const Skeleton& from, Skeleton& to) {
  for (skeleton::Primitive& primitive : to.primitives) {
    const skeleton::Primitive* known = from.find(primitive.name);
    if (!known || primitive.radius || !primitive.pointRadius.empty()) continue;
    primitive.radius = known->radius;
    if (known->pointRadius.size() == primitive.points.size()) primitive.pointRadius = known->pointRadius;
  }
}

}  // namespace

double automaticRadiusFactor(const Scene& scene) noexcept {
  return scene.tracking.autoRadiusFactor * (scene.method == MethodKind::Wires ? kWireReach : 1);
}

Skeletons prepareSkeletons(const Scene& scene, const mesh::Mesh& mesh) {
  requireVolumeFor(scene);
  Skeletons s;
  s.edits = scene.edits;
  if (const auto* rule = std::get_if<AxisRest>(&scene.rest)) {
    skeleton::SpineFit fit = skeleton::fitSpine(mesh, {.axis = rule->axis});
    useAxesOfFit(fit, s.edits);
    s.source = std::move(fit.skeleton);
    s.radiusWasAutomatic = !scene.tracking.radius;
    auto& radius = s.source.primitives[0].radius;
    if (scene.tracking.radius) radius = scene.tracking.radius;
    else if (radius && scene.method == MethodKind::Wires) *radius *= kWireReach;
  } else {
    s.source = readOr(scene.rest, scene.volumeGrid);
  }
  if (!scene.tracking.radius && std::any_of(s.edits.begin(), s.edits.end(), scalesRadii)) {
    s.radiusWasAutomatic = lacksRadius(s.source);
    skeleton::fillAutomaticRadius(s.source, mesh.positions(), automaticRadiusFactor(scene));
  } else if (scene.tracking.radius) {
    skeleton::fillRadius(s.source, *scene.tracking.radius);
  }
  s.rest = s.source;
  const double size = mesh::objectSize(mesh.positions());
  if (mayDivide(s.edits) && size > 0) s.rest = skeleton::subdivide(s.source, kPiece * size);
  useAboutOfMesh(mesh, s.rest, s.edits);
  s.edits = resolved(s.rest, s.edits);
  Skeleton posed = scene.posed ? readOr(*scene.posed, scene.volumeGrid) : skeleton::applyEdits(s.rest, s.edits);
  s.pair = pairOf(scene, mesh, s.rest, std::move(posed));
  return s;
}

Skeleton poseAt(const Skeletons& s, const Scene& scene, const mesh::Mesh& mesh, const skeleton::SkeletonPair& resolved,
                double t) {
  if (scene.posed || s.edits.empty()) return skeleton::interpolatePose(resolved, t);
  Skeleton rest = s.rest;
  takeRadii(resolved.rest, rest);
  return pairOf(scene, mesh, rest, skeleton::applyEditsAt(rest, s.edits, t)).posed;
}

void storeSkeletons(const Skeletons& s, const skeleton::SkeletonPair& resolved, Scene& scene) {
  Skeleton rest = s.source;
  takeRadii(resolved.rest, rest);
  scene.rest = std::move(rest);
  scene.edits = s.edits;
  if (scene.posed) {
    Skeleton posed = readOr(*scene.posed, scene.volumeGrid);
    takeRadii(resolved.posed, posed);
    scene.posed = std::move(posed);
  }
  scene.volumeGrid.clear();  // what it named is in the scene now
}

}  // namespace fielddeform::scene::detail
