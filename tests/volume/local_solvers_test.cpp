// The volume pass by every mask, energy and solver: what holds for all, and where they agree.
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/volume/local.h>
#include <gtest/gtest.h>
#include <tests/support/cases.h>

#include <cmath>

namespace fielddeform::volume {
namespace {

using mesh::Mesh;

/// A capsule whose upper half is stretched; the falloff's weight is 1 above, a smooth step in between.
struct Edit {
  Mesh mesh = tests::makeCapsule({.around = 12, .along = 16, .bump = 0.1});
  std::vector<Vec3> posed;
  std::vector<double> weight, mask;

  Edit() {
    for (const Vec3& p : mesh.positions()) {
      const double t = std::clamp(0.5 + p.z(), 0.0, 1.0), w = t * t * (3 - 2 * t);
      posed.push_back(p + Vec3(0, 0, 0.3 * w * std::max(0.0, p.z() + 0.5)));
      weight.push_back(w);
      mask.push_back(std::clamp(3 * p.x() + 0.5, 0.0, 1.0));
    }
  }
  LocalResult pass(const LocalOptions& options) const {
    Progress silent;
    return preserveLocally({.rest = mesh, .posed = posed, .weight = weight, .mask = mask}, options, silent);
  }
  double deviation(Points x) const { return std::abs(*mesh::volume(mesh, x).value / *mesh::volume(mesh, mesh.positions()).value - 1); }
};

std::string nameOf(const LocalOptions& o) { return std::string(toString(o.mask)) + "/" + std::string(toString(o.energy)) + "/" + std::string(toString(o.solver)); }

std::vector<LocalOptions> combinations() {
  std::vector<LocalOptions> out;
  for (const MaskKind mask : {MaskKind::Auto, MaskKind::None, MaskKind::Rest, MaskKind::Given})
    for (const LocalEnergy energy : {LocalEnergy::Surface, LocalEnergy::Springs})
      for (const LocalSolver solver : {LocalSolver::Exact, LocalSolver::AugmentedLagrangian}) out.push_back({.mask = mask, .nodes = {{5, 5, 6}}, .energy = energy, .solver = solver});
  return out;
}

/// Every energy and solver of one mask restores the volume, and moves nothing that the mask holds.
void expectRestored(MaskKind mask) {
  const Edit edit;
  ASSERT_GT(edit.deviation(edit.posed), 0.05);
  for (const LocalOptions& o : combinations()) {
    if (o.mask != mask) continue;
    const LocalResult r = edit.pass(o);
    EXPECT_LE(edit.deviation(r.position), 1e-12) << nameOf(o);
    EXPECT_LE(r.report.deviation, 1e-12) << nameOf(o);
    EXPECT_EQ(mesh::countFolds(edit.mesh, edit.posed, r.position), 0u) << nameOf(o);
    std::size_t kept = 0;
    for (std::size_t v = 0; v < edit.posed.size(); ++v) {
      const bool still = (o.mask == MaskKind::Auto && edit.weight[v] == 0) || (o.mask == MaskKind::Given && edit.mask[v] == 0) ||
                         (o.mask == MaskKind::Rest && edit.weight[v] >= 0.3);
      if (!still) continue;
      ++kept;
      EXPECT_EQ(r.position[v], edit.posed[v]) << nameOf(o) << ", vertex " << v;
    }
    EXPECT_EQ(kept > 0, o.mask != MaskKind::None) << nameOf(o);
    // Nothing moves by more than the stretch itself did.
    EXPECT_LT(r.report.largest, 0.45) << nameOf(o);
  }
}

TEST(VolumePassSolvers, AllRestoreTheVolumeByTheAutomaticMask) { expectRestored(MaskKind::Auto); }
TEST(VolumePassSolvers, AllRestoreTheVolumeWithoutAMask) { expectRestored(MaskKind::None); }
TEST(VolumePassSolvers, AllRestoreTheVolumeFromTheRest) { expectRestored(MaskKind::Rest); }
TEST(VolumePassSolvers, AllRestoreTheVolumeByAGivenMask) { expectRestored(MaskKind::Given); }

TEST(VolumePassSolvers, SolversOfOneEnergyEndAlike) {
  const Edit edit;
  for (const LocalEnergy energy : {LocalEnergy::Surface, LocalEnergy::Springs}) {
    const LocalResult exact = edit.pass({.energy = energy}), paper = edit.pass({.energy = energy, .solver = LocalSolver::AugmentedLagrangian});
    double far = 0;
    for (std::size_t v = 0; v < exact.position.size(); ++v) far = std::max(far, (exact.position[v] - paper.position[v]).norm());
    // The springs are the same problem in both: apart by the paper's tolerances. With the surface's energy the exact solver sends
    // the correction where the volume came from, the paper's spreads it: apart by a share of the correction.
    EXPECT_LT(far, (energy == LocalEnergy::Springs ? 0.1 : 0.8) * exact.report.largest) << toString(energy);
    EXPECT_NEAR(exact.report.rms, paper.report.rms, 0.3 * exact.report.rms) << toString(energy);
  }
}

TEST(VolumePassSolvers, EveryCombinationScalesByPowersOfTwo) {
  Edit edit;
  for (const LocalOptions& o : combinations()) {
    if (o.mask != MaskKind::Auto) continue;
    const LocalResult r = edit.pass(o);
    Edit large = edit;
    for (Vec3& p : large.mesh.mutablePositions()) p *= 1024;
    for (Vec3& p : large.posed) p *= 1024;
    const LocalResult s = large.pass(o);
    for (std::size_t v = 0; v < r.position.size(); ++v) EXPECT_EQ(s.position[v], Vec3(1024 * r.position[v])) << nameOf(o) << ", vertex " << v;
  }
}

}  // namespace
}  // namespace fielddeform::volume
