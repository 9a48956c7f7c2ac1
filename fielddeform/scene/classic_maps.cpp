// The maps of the classic methods from a skeleton pair, one function a method.
#include <fielddeform/map/axial.h>
#include <fielddeform/map/barr_fit.h>
#include <fielddeform/map/casteljau_skeleton.h>
#include <fielddeform/map/chain.h>
#include <fielddeform/map/fitted_lattice.h>
#include <fielddeform/map/rbf_warp.h>
#include <fielddeform/map/skinning.h>
#include <fielddeform/map/wires.h>
#include <fielddeform/scene/detail/classic.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::scene::detail {
namespace {

constexpr map::PairOptions kCentres{.offset = 0.6, .rings = 2, .most = 2000};  // of the dense interpolant
constexpr double kClearly = 0.5;                // several of Barr's deformations must miss by so much less than one
constexpr double kFarOff = 1e-3;                // of the skeleton's size: a fit that misses more is warned of

double sizeOf(const map::PointPairs& pairs) {
  Box box;
  for (const Vec3& p : pairs.rest) box.extend(p);
  return box.sizes().norm();
}

// How far a map misses the skeleton's points.
FitReport measured(std::string found, const map::SpaceMap& map, const map::PointPairs& pairs) {
  FitReport fit;
  fit.found = std::move(found);
  fit.pairs = pairs.own;
  const Points rest = Points(pairs.rest).first(pairs.own);
  std::vector<Vec3> image(pairs.own);
  Progress silent;
  map.apply(*map.bind(rest), {.position = image, .safe = {}, .status = {}, .residual = {}}, silent);
  for (std::size_t i = 0; i < pairs.own; ++i) {
    const double miss = (image[i] - pairs.posed[i]).norm();
    fit.max = std::max(fit.max, miss);
    fit.rms += miss * miss / static_cast<double>(pairs.own);
  }
  fit.rms = std::sqrt(fit.rms);
  return fit;
}

// The root of the mean squared miss of all pairs, frame points too: they see twists of straight lines.
double missOfFrames(const map::SpaceMap& map, const map::PointPairs& pairs) {
  std::vector<Vec3> image(pairs.rest.size());
  Progress silent;
  map.apply(*map.bind(pairs.rest), {.position = image, .safe = {}, .status = {}, .residual = {}}, silent);
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i) sum += (image[i] - pairs.posed[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(image.size()));
}

map::BarrEdit at(map::BarrEdit edit, double t) {
  edit.angle *= t;
  edit.factor = Vec3::Ones() + t * (edit.factor - Vec3::Ones());
  return edit;
}

// An edit that is the whole skeleton's as a map, or null.
std::shared_ptr<const map::SpaceMap> editMap(const ClassicInput& in, const skeleton::Edit& edit) {
  if (!edit.primitive.empty() && in.pair.rest.primitives.size() > 1) return nullptr;
  map::BarrEdit still;
  still.kind = map::BarrKind::Stretch;
  if (const auto* by = std::get_if<skeleton::Translate>(&edit.operation))
    return std::make_shared<map::BarrMap>(still, Quat::Identity(), in.t * by->by);
  if (const auto* turn = std::get_if<skeleton::Rotate>(&edit.operation)) {
    still.pivot = *turn->pivot;
    return std::make_shared<map::BarrMap>(still, Quat(Eigen::AngleAxisd(in.t * turn->angle, turn->axis->normalized())));
  }
  if (const auto barr = map::barrEditOf(in.pair.rest, edit)) return std::make_shared<map::BarrMap>(at(*barr, in.t));
  return nullptr;
}

// The edits themselves, where they are Barr's; else nothing.
std::shared_ptr<const map::SpaceMap> editMaps(const ClassicInput& in) {
  if (in.edits.empty() || in.scene.symmetry) return nullptr;
  std::vector<std::shared_ptr<const map::SpaceMap>> maps;
  for (const skeleton::Edit& edit : in.edits) {
    maps.push_back(editMap(in, edit));
    if (!maps.back()) return nullptr;
  }
  return std::make_shared<map::Chain>(std::move(maps));
}

std::string named(const std::vector<skeleton::Edit>& edits) {
  std::string text;
  for (const skeleton::Edit& edit : edits) text += (text.empty() ? "" : ", then ") + std::string(skeleton::operationName(edit));
  return text;
}

std::optional<map::BarrKind> kindOf(const std::string& word) {
  for (const map::BarrKind kind : {map::BarrKind::Scale, map::BarrKind::Stretch, map::BarrKind::Taper, map::BarrKind::Twist, map::BarrKind::Bend})
    if (word.starts_with(toString(kind))) return kind;
  return std::nullopt;
}

std::string described(const map::BarrEdit& edit) {
  const double degrees = edit.angle * 180 / 3.14159265358979323846;
  switch (edit.kind) {
    case map::BarrKind::Twist:
    case map::BarrKind::Bend: return fmt::format("{} by {:.6g} degrees", toString(edit.kind), degrees);
    case map::BarrKind::Stretch: return fmt::format("stretch by {:.6g}", edit.factor[0]);
    case map::BarrKind::Taper: return fmt::format("taper by {:.6g} and {:.6g}", edit.factor[0], edit.factor[1]);
    case map::BarrKind::Scale: break;
  }
  return fmt::format("scale by {:.6g}, {:.6g}, {:.6g}", edit.factor[0], edit.factor[1], edit.factor[2]);
}

constexpr std::string_view kThen = ", then ";

std::string described(const std::vector<map::BarrEdit>& edits) {
  std::string text;
  for (const map::BarrEdit& edit : edits) text += (text.empty() ? "" : std::string(kThen)) + described(edit);
  return text;
}

ClassicMap skin(const ClassicInput& in, map::SkinBlend blend, std::string_view word) {
  const map::SkeletonMotion motion = map::motionOf(in.pair, word);
  const field::FieldOptions& field = in.scene.tracking.field;
  return {std::make_shared<map::SkinningMap>(
      motion, map::SkinOptions{.blend = blend, .potential = field.potential, .sharpness = field.sharpness})};
}

// The deformation nearest to two poses: one if that does, else several in Barr's order. Poses on the way are of the kind found.
void fitTo(const map::SkeletonMotion& motion, const std::string& found, const map::PointPairs& pairs, ClassicMap& out) {
  if (motion.unedited) {
    out.map = std::make_shared<map::BarrMap>(map::BarrEdit{});
    out.fit = measured("nothing edited", *out.map, pairs);
    return;
  }
  const bool several = found.find(kThen) != std::string::npos;
  if (!several) {
    const map::BarrFit fit = map::fitBarr(motion, {.kind = kindOf(found)});
    out.map = std::make_shared<map::BarrMap>(fit.map());
    out.fit = measured(fit.rigid ? "rigid motion" : described(fit.edit), *out.map, pairs);
    if (!found.empty() || !(missOfFrames(*out.map, pairs) > kFarOff * sizeOf(pairs))) return;
  }
  const map::BarrSequence sequence = map::fitBarrSequence(motion);
  const auto map = sequence.map();
  if (!several && !(missOfFrames(*map, pairs) < kClearly * missOfFrames(*out.map, pairs))) return;
  out.map = map;
  out.fit = measured(described(sequence.edits), *map, pairs);
}

}  // namespace

ClassicMap makeBarr(const ClassicInput& in) {
  const map::SkeletonMotion motion = map::motionOf(in.pair, "barr");
  const map::PointPairs pairs = map::pointPairs(motion, kCentres);
  ClassicMap out;
  if (auto edits = editMaps(in); edits && !motion.unedited) {
    out.map = std::move(edits);
    out.fit = measured(named(in.edits), *out.map, pairs);
  } else {
    fitTo(motion, in.found, pairs, out);
  }
  if (out.fit->max > kFarOff * sizeOf(pairs))
    out.warnings.push_back(fmt::format("the skeleton's motion is none of Barr's deformations: the nearest, {}, misses its points by up to {:.3g}",
                                       out.fit->found, out.fit->max));
  return out;
}

ClassicMap makeLinearSkin(const ClassicInput& in) { return skin(in, map::SkinBlend::Linear, "lbs"); }
ClassicMap makeDualQuaternionSkin(const ClassicInput& in) { return skin(in, map::SkinBlend::DualQuaternion, "dqs"); }

ClassicMap makeRbf(const ClassicInput& in) {
  const map::SkeletonMotion motion = map::motionOf(in.pair, "rbf");
  map::PointPairs pairs = map::pointPairs(motion, kCentres);
  if (motion.unedited) pairs.posed = pairs.rest;
  ClassicMap out;
  const auto warp = std::make_shared<map::RbfWarp>(pairs.rest, pairs.posed);
  out.map = warp;
  out.fit = measured(fmt::format("{} centres", pairs.rest.size()), *warp, pairs);
  return out;
}

ClassicMap makeFittedLattice(const ClassicInput& in) {
  const map::SkeletonMotion motion = map::motionOf(in.pair, "lattice");
  map::FittedLattice fitted = map::fitLattice(motion, in.points, {.nodes = in.scene.latticeNodes});
  ClassicMap out;
  out.nodes = fitted.lattice.nodes();
  const auto& n = *out.nodes;
  const map::PointPairs pairs = map::pointPairs(motion, kCentres);
  out.map = std::make_shared<map::LatticeMap>(std::move(fitted.lattice));
  out.fit = measured(fmt::format("{} x {} x {} nodes", n[0], n[1], n[2]), *out.map, pairs);
  if (out.fit->max > kFarOff * sizeOf(pairs))
    out.warnings.push_back(fmt::format("a lattice of {} nodes misses the skeleton's points by up to {:.3g}", out.fit->found.substr(0, out.fit->found.size() - 6), out.fit->max));
  return out;
}

ClassicMap makeAxial(const ClassicInput& in) {
  return {std::make_shared<map::AxialMap>(map::motionOf(in.pair, "axial"), in.scene.tracking.field.sharpness)};
}

ClassicMap makeCasteljau(const ClassicInput& in) {
  return {map::casteljauBy(map::motionOf(in.pair, "casteljau"))};
}

ClassicMap makeWires(const ClassicInput& in) {
  return {std::make_shared<map::WireMap>(map::motionOf(in.pair, "wires"), map::WireOptions{.blend = in.scene.wireBlend, .local = in.scene.wireLocal})};
}

}  // namespace fielddeform::scene::detail
