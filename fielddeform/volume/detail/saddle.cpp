#include <fielddeform/numeric/sqp.h>
#include <fielddeform/volume/detail/saddle.h>

#include <algorithm>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kTriangles = 256;
constexpr double kLeast = 1e-3;  // of curvature, whose unit is about 1: conjugate gradients end well off the stationary point

}  // namespace

const MeshModel* coarseLevel(const Prepared::Impl& impl, std::size_t least, std::size_t& level) {
  for (std::size_t l = 0; l + 1 < impl.levels.size(); ++l)
    if (impl.levels[l].basis() && impl.levels[l].triangles() >= least && 2 * impl.levels[l].triangles() < impl.fine().triangles()) {
      level = l;
      return &impl.levels[l];
    }
  return nullptr;
}

std::vector<VolumeTarget> coarseTargets(const Prepared::Impl& impl, const std::vector<double>& base, bool& faithful) {
  std::vector<VolumeTarget> out = impl.targets(impl.levels.size() - 1);
  const bool open = impl.problem.rims == Rims::Fixed;
  for (VolumeTarget& t : out) {
    const double fine = impl.baseVolume.back()[t.region], share = base[t.region] / fine;
    if (!open && !(share > 0.7 && share < 1.4)) {
      faithful = false;
      continue;  // its curvature is used with the fine scale
    }
    t.target = open ? base[t.region] + (t.target - fine) : t.target * share;
    if (!open) t.scale *= share;
  }
  return out;
}

SaddleTest::SaddleTest(const Prepared::Impl& impl, Points start) : impl_(impl), start_(start.begin(), start.end()) {}

void SaddleTest::prepare() {
  if (constraints_) return;
  std::size_t level = 0;
  const MeshModel* model = impl_.fine().triangles() <= 2 * kTriangles && impl_.fine().basis() ? &impl_.fine() : coarseLevel(impl_, kTriangles, level);
  if (!model) {
    own_.emplace(clustered(*impl_.problem.map, impl_.problem.surface, impl_.fine(), kTriangles, impl_.problem.rims));
    model = &*own_;
  }
  bool faithful = true;
  auto targets = coarseTargets(impl_, model->volume().values(model->base()), faithful);
  if (impl_.problem.constraints.moments.empty() && impl_.free.size() + 3 <= kFormNodes) {
    std::vector<Vec3> x;
    model->positions(start_, x);
    constraints_ = std::make_unique<FormConstraints>(FormConstraints::ofFree(*model, x, start_, impl_.free, std::move(targets)));
  } else {
    constraints_ = std::make_unique<MeshConstraints>(*model, std::move(targets), impl_.problem.constraints.moments, impl_.extent);
  }
}

std::optional<Eigen::VectorXd> SaddleTest::direction(const Core& core, const Eigen::VectorXd& x, const Eigen::VectorXd& multiplier) {
  if (core.variables() > kDenseVariables || core.variables() == 0) return {};
  prepare();
  Reduced reduced(core, *constraints_, *constraints_, LinearMode::AsConstraints);
  return numeric::negativeCurvature(reduced, x, multiplier, kLeast);
}

}  // namespace fielddeform::volume::detail
