// The volume pass after a deformation: what it restores, what it leaves alone, what it refuses.
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/volume/local.h>
#include <gtest/gtest.h>
#include <tests/support/cases.h>
#include <tests/support/marching_tetrahedra.h>
#include <tests/support/shapes.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

namespace fielddeform::volume {
namespace {

using mesh::Mesh;
using tests::makeCapsule;
constexpr double kPi = std::numbers::pi;

Mesh smallCapsule(double bump = 0.15) { return makeCapsule({.around = 32, .along = 40, .bump = bump}); }

std::vector<Vec3> mapped(const Mesh& mesh, const std::function<Vec3(const Vec3&)>& f) {
  std::vector<Vec3> out;
  for (const Vec3& p : mesh.positions()) out.push_back(f(p));
  return out;
}
Vec3 stretchedAbove0(const Vec3& p) { return p.z() > 0 ? Vec3(p.x(), p.y(), 1.5 * p.z()) : p; }

LocalResult preserve(const Mesh& mesh, const std::vector<Vec3>& posed, const LocalOptions& options = {},
                     std::span<const double> weight = {}, std::span<const double> mask = {}) {
  Progress silent;
  return preserveLocally({.rest = mesh, .posed = posed, .weight = weight, .mask = mask}, options, silent);
}

double deviation(const Mesh& mesh, Points x) {
  return std::abs(*mesh::volume(mesh, x).value / *mesh::volume(mesh, mesh.positions()).value - 1);
}

double largestTurn(const Mesh& mesh, Points a, Points b) {
  double turn = 0;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f)
    mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
      const Vec3 n = (a[j] - a[i]).cross(a[k] - a[i]), m = (b[j] - b[i]).cross(b[k] - b[i]);
      turn = std::max(turn, std::atan2(n.cross(m).norm(), n.dot(m)) * 180 / kPi);
    });
  return turn;
}

TEST(VolumePass, AHalfStretchedCapsuleGetsItsVolumeBackAndTheOtherHalfKeepsItsBits) {
  const Mesh mesh = smallCapsule();
  const auto posed = mapped(mesh, stretchedAbove0);
  const LocalResult r = preserve(mesh, posed);
  EXPECT_GT(deviation(mesh, posed), 0.1);
  EXPECT_LE(deviation(mesh, r.position), 1e-13);
  EXPECT_LE(r.report.deviation, 1e-13);
  for (std::size_t v = 0; v < posed.size(); ++v)
    if (mesh.positions()[v].z() <= 0) { EXPECT_EQ(r.position[v], mesh.positions()[v]); }
  EXPECT_EQ(mesh::countFolds(mesh, posed, r.position), 0u);
  EXPECT_LT(largestTurn(mesh, posed, r.position), 15);  // measured 9 to 10 degrees
  // A tube stretched by 1.5 thins to 1 / sqrt(1.5): the tip of the band of the mask is wider, the far part thinner.
  EXPECT_LT(r.report.largest, 0.35 * 0.25);
  EXPECT_TRUE(r.report.needed);
  EXPECT_EQ(r.report.components, 1u);
}

TEST(VolumePass, AWholeStretchedTubeThinsEverywhereAlike) {
  const Mesh mesh = makeCapsule({.length = 6, .around = 32, .along = 80, .bump = 0});
  const auto posed = mapped(mesh, [](const Vec3& p) { return Vec3(p.x(), p.y(), 1.4 * p.z()); });
  const LocalResult r = preserve(mesh, posed);
  EXPECT_LE(deviation(mesh, r.position), 1e-13);
  for (std::size_t v = 0; v < posed.size(); ++v) {
    if (std::abs(mesh.positions()[v].z()) > 2) continue;
    // All of a cylinder's area ratio is 1.4: it thins to 1 / sqrt(1.4), up to what the ends do differently.
    EXPECT_NEAR(r.position[v].head<2>().norm() / mesh.positions()[v].head<2>().norm(), 1 / std::sqrt(1.4), 0.02);
  }
}

// A palm with two fingers; one is stretched beside the other.
struct Fingers {
  Mesh mesh;
  std::vector<Vec3> posed;
  std::vector<double> weight;
};
Fingers fingers() {
  const auto capsule = [](const Vec3& p, double x) {
    return (p - Vec3(x, 0, std::clamp(p.z(), -0.2, 0.9))).norm() - 0.1;
  };
  const auto value = [&](const Vec3& p) {
    const double palm = 0.4 * ((p - Vec3(0, 0, -0.4)).cwiseQuotient(Vec3(0.8, 0.5, 0.8)).norm() - 0.5);
    return -std::log(std::exp(-20 * palm) + std::exp(-20 * capsule(p, -0.14)) + std::exp(-20 * capsule(p, 0.14))) / 20;
  };
  Fingers f;
  f.mesh = tests::marchingTetrahedra(Box(Vec3(-0.6, -0.5, -1), Vec3(0.6, 0.5, 1.2)), 44, value);
  for (const Vec3& p : f.mesh.positions()) {
    const double t = p.x() > 0 ? std::clamp((p.z() - 0.25) / 0.2, 0.0, 1.0) : 0;
    f.weight.push_back(t * t * (3 - 2 * t));
    f.posed.push_back(p + f.weight.back() * Vec3(0, 0, 0.5 * (p.z() - 0.25)));
  }
  return f;
}

TEST(VolumePass, AFingerIsMendedBesideAnUnmovedOne) {
  const Fingers f = fingers();
  const LocalResult r = preserve(f.mesh, f.posed, {}, f.weight);
  EXPECT_TRUE(r.report.fromFalloff);
  EXPECT_LE(deviation(f.mesh, r.position), 1e-13);
  for (std::size_t v = 0; v < f.posed.size(); ++v)
    if (f.weight[v] == 0) { EXPECT_EQ(r.position[v], f.mesh.positions()[v]); }
  EXPECT_EQ(mesh::countFolds(f.mesh, f.posed, r.position), 0u);
  EXPECT_LT(largestTurn(f.mesh, f.posed, r.position), 40);
  EXPECT_LT(r.report.undone, 0.05);
}

TEST(VolumePass, TheDistanceToWhatStayedServesAsWellAsTheFalloff) {
  const Fingers f = fingers();
  const LocalResult with = preserve(f.mesh, f.posed, {}, f.weight), without = preserve(f.mesh, f.posed);
  EXPECT_FALSE(without.report.fromFalloff);
  EXPECT_LE(deviation(f.mesh, without.position), 1e-13);
  double most = 0;
  for (std::size_t v = 0; v < f.posed.size(); ++v) {
    most = std::max(most, (with.position[v] - without.position[v]).norm());
    if (f.posed[v] == f.mesh.positions()[v]) { EXPECT_EQ(without.position[v], f.posed[v]); }
  }
  EXPECT_LT(most, 0.03);  // a third of the finger's radius; 0.02 measured
}

struct Bump {
  Mesh mesh = makeCapsule({.length = 1e-9, .radius = 1, .around = 48, .along = 40, .bump = 0});
  std::vector<Vec3> posed;
  std::vector<double> weight;
  Bump() {
    for (const Vec3& p : mesh.positions()) {
      const double t = std::clamp(1 - (p - Vec3(1, 0, 0)).norm() / 1.5, 0.0, 1.0);
      weight.push_back(t * t * (3 - 2 * t));
      posed.push_back(p + 0.35 * weight.back() * p);
    }
  }
};

TEST(VolumePass, ABumpIsPartlyUndoneAndThatIsSaid) {
  const Bump b;
  const LocalResult r = preserve(b.mesh, b.posed, {}, b.weight);
  EXPECT_LE(deviation(b.mesh, r.position), 1e-13);
  EXPECT_GT(r.report.undone, 0.2);
  EXPECT_GT(r.report.tau, 0.3);
  ASSERT_EQ(r.report.warnings.size(), 2u);
  EXPECT_NE(r.report.warnings[1].find("--volume-mask rest"), std::string::npos);
}

TEST(VolumePass, ABumpIsKeptIfTheRestGivesTheVolume) {
  const Bump b;
  const LocalResult r = preserve(b.mesh, b.posed, {.mask = MaskKind::Rest}, b.weight);
  EXPECT_LE(deviation(b.mesh, r.position), 1e-13);
  for (std::size_t v = 0; v < b.posed.size(); ++v)
    if (b.weight[v] >= 0.3) { EXPECT_EQ(r.position[v], b.posed[v]); }
}

TEST(VolumePass, AHingesStillHalfDoesNotPay) {
  // The lower half "moves" by rounding only, as under a skeleton whose part there stayed.
  const Mesh mesh = smallCapsule();
  const auto posed = mapped(mesh, [](const Vec3& p) {
    const double a = std::clamp(p.z() / 0.2, 0.0, 1.0) * kPi / 3;
    return Vec3(std::cos(a) * p.x() + std::sin(a) * std::max(p.z(), 0.0) + 1e-15, p.y(),
                p.z() < 0 ? p.z() : -std::sin(a) * p.x() + std::cos(a) * p.z());
  });
  const LocalResult r = preserve(mesh, posed);
  EXPECT_LE(deviation(mesh, r.position), 1e-13);
  for (std::size_t v = 0; v < posed.size(); ++v)
    if (mesh.positions()[v].z() < -0.05) { EXPECT_EQ(r.position[v], posed[v]); }
}

TEST(VolumePass, EveryComponentKeepsItsOwnVolume) {
  const Mesh one = makeCapsule({.around = 24, .along = 30, .bump = 0}), two = makeCapsule({.around = 20, .along = 26});
  const auto shifted = [](const Mesh& m, double x) {
    return Mesh(mapped(m, [&](const Vec3& p) { return Vec3(p.x() + x, p.y(), p.z()); }), m.triangles());
  };
  const Mesh mesh = test::together(test::together(one, shifted(two, 0.7)), shifted(one, 4));
  const std::size_t third = one.vertexCount() + two.vertexCount();
  std::vector<Vec3> posed = mesh.positions();
  for (std::size_t v = 0; v < third; ++v)
    posed[v].z() *= v < one.vertexCount() ? 1.4 : posed[v].z() > 0 ? 0.8 : 1.0;
  const LocalResult r = preserve(mesh, posed);
  EXPECT_EQ(r.report.components, 2u);
  const mesh::EdgeTable table(mesh);
  const auto components = mesh::components(table, mesh.faceCount());
  const auto before = mesh::componentMeasures(mesh, mesh.positions(), components);
  const auto after = mesh::componentMeasures(mesh, r.position, components);
  for (std::size_t c = 0; c < before.size(); ++c)
    EXPECT_NEAR(*after[c].volume.value / *before[c].volume.value, 1, 1e-13);
  for (std::size_t v = third; v < posed.size(); ++v) EXPECT_EQ(r.position[v], mesh.positions()[v]);
}

Mesh withoutFaces(const Mesh& mesh, const std::function<bool(const Vec3&)>& cut) {
  std::vector<Index> corners;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    const auto c = mesh.face(f);
    if (!std::any_of(c.begin(), c.end(), [&](Index v) { return cut(mesh.positions()[v]); }))
      corners.insert(corners.end(), c.begin(), c.end());
  }
  return Mesh(mesh.positions(), corners);
}

TEST(VolumePass, AnOpenMeshWhoseRimStaysGivesTheClosedOnesResult) {
  const Mesh closed = smallCapsule(), open = withoutFaces(closed, [](const Vec3& p) { return p.z() < -0.8; });
  const auto posed = mapped(closed, stretchedAbove0);
  const LocalResult a = preserve(closed, posed), b = preserve(open, posed);
  double most = 0;
  for (std::size_t v = 0; v < posed.size(); ++v) most = std::max(most, (a.position[v] - b.position[v]).norm());
  EXPECT_LE(most, 3e-15);  // rounding of coordinates of size 1; nothing else differs
  EXPECT_LE(deviation(closed, b.position), 1e-13);
}

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const InfeasibleError& error) {
    return error.what();
  }
  return "";
}

TEST(VolumePass, AnOpenMeshWhoseRimMovedIsRefusedByTheNumberOfItsEdges) {
  const Mesh open = withoutFaces(smallCapsule(), [](const Vec3& p) { return p.z() > 0.8; });
  const auto said = refusal([&] { preserve(open, mapped(open, stretchedAbove0)); });
  EXPECT_NE(said.find("32 boundary edges moved"), std::string::npos) << said;
  const auto below = mapped(open, [](const Vec3& p) { return p.z() < 0 ? Vec3(p.x(), p.y(), 1.5 * p.z()) : p; });
  const auto unmasked = refusal([&] { preserve(open, below, {.mask = MaskKind::None}); });
  EXPECT_NE(unmasked.find("32 boundary edges"), std::string::npos) << unmasked;
}

TEST(VolumePass, SurfacesWithoutVolumeAreRefused) {
  Mesh turned = smallCapsule();
  std::vector<Index> corners = turned.corners();
  std::swap(corners[300], corners[301]);
  turned = Mesh(turned.positions(), corners);
  EXPECT_NE(refusal([&] { preserve(turned, mapped(turned, stretchedAbove0)); }).find("inconsistently oriented"), std::string::npos);
  const Mesh mesh = smallCapsule();
  auto posed = mapped(mesh, stretchedAbove0);
  posed[100].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(refusal([&] { preserve(mesh, posed); }).find("not finite"), std::string::npos);
}

TEST(VolumePass, NothingIsDoneWhereNothingIsToBeDone) {
  const Mesh mesh = smallCapsule();
  const LocalResult same = preserve(mesh, mesh.positions());
  EXPECT_EQ(same.position, mesh.positions());
  EXPECT_FALSE(same.report.needed);
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  const auto rigid = mapped(mesh, [&](const Vec3& p) { return Vec3(turn * p + Vec3(5, -3, 2)); });
  EXPECT_EQ(preserve(mesh, rigid).position, rigid);
  EXPECT_TRUE(preserve(Mesh(), {}).position.empty());
}

TEST(VolumePass, WhereEverythingMovedCentroidAndMeanRotationStay) {
  const Mesh mesh = smallCapsule(0.2);
  const auto posed = mapped(mesh, [](const Vec3& p) {
    const double a = p.z() + 1.5;
    return Vec3((1 + 0.1 * a) * p.x() + 0.3 * a * a, p.y() * (1 + 0.05 * a), 1.2 * p.z());
  });
  const LocalResult r = preserve(mesh, posed);
  EXPECT_LE(deviation(mesh, r.position), 1e-13);
  std::vector<double> area(posed.size(), 0);
  double total = 0;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    const auto c = mesh.face(f);
    const double a = (mesh.positions()[c[1]] - mesh.positions()[c[0]]).cross(mesh.positions()[c[2]] - mesh.positions()[c[0]]).norm() / 6;
    for (const Index v : c) area[v] += a;
    total += 3 * a;
  }
  Vec3 centre = Vec3::Zero(), shift = Vec3::Zero(), turn = Vec3::Zero();
  for (std::size_t v = 0; v < posed.size(); ++v) centre += area[v] / total * posed[v];
  for (std::size_t v = 0; v < posed.size(); ++v) {
    shift += area[v] / total * (r.position[v] - posed[v]);
    turn += area[v] / total * (posed[v] - centre).cross(r.position[v] - posed[v]);
  }
  EXPECT_LE(shift.norm(), 1e-14);  // the equations make both zero, rounding aside
  EXPECT_LE(turn.norm(), 1e-14);
  EXPECT_GT(r.report.rms, 0.01);
}

TEST(VolumePass, ThreadsDoNotChangeTheBits) {
  const Mesh mesh = makeCapsule({.around = 100, .along = 120});
  const auto posed = mapped(mesh, stretchedAbove0);
  const auto on = [&](int threads) {
    const ThreadLimit limit(threads);
    return preserve(mesh, posed).position;
  };
  EXPECT_EQ(on(1), on(4));
}

TEST(VolumePass, APowerOfTwoScalesEveryBit) {
  const Mesh mesh = smallCapsule();
  const auto posed = mapped(mesh, stretchedAbove0);
  const auto scaled = [](const std::vector<Vec3>& x, double s) {
    std::vector<Vec3> out = x;
    for (Vec3& p : out) p *= s;
    return out;
  };
  const auto expected = preserve(mesh, posed).position;
  for (const double s : {0x1p-40, 0x1p60}) {
    const Mesh other(scaled(mesh.positions(), s), mesh.triangles());
    EXPECT_EQ(preserve(other, scaled(posed, s)).position, scaled(expected, s));
  }
}

TEST(VolumePass, OtherUnitsAndPlacesMakeNoDifference) {
  const Mesh mesh = smallCapsule();
  const auto posed = mapped(mesh, stretchedAbove0);
  const auto expected = preserve(mesh, posed).position;
  const auto there = [](const Vec3& p) { return Vec3(1e3 * p + Vec3(1e6, -2e6, 3e6)); };
  const Mesh other(mapped(mesh, there), mesh.triangles());
  std::vector<Vec3> moved;
  for (const Vec3& p : posed) moved.push_back(there(p));
  const LocalResult r = preserve(other, moved);
  double most = 0;
  for (std::size_t v = 0; v < posed.size(); ++v) most = std::max(most, (r.position[v] - there(expected[v])).norm());
  EXPECT_LE(most, 2e3 * 1e-9);
  EXPECT_LE(r.report.deviation, 1e-12);
}

TEST(VolumePass, AFlatPatchOfACubeCanBePulledOut) {
  std::vector<Vec3> corners;
  Mesh cube = tests::marchingTetrahedra(Box(Vec3(-1, -1, -1), Vec3(1, 1, 1)), 24,
                                        [](const Vec3& p) { return p.cwiseAbs().maxCoeff() - 0.83; });
  const auto posed = mapped(cube, [](const Vec3& p) {
    const double t = std::clamp(1 - p.head<2>().norm() / 0.6, 0.0, 1.0);
    return p.z() > 0.5 ? Vec3(p + Vec3(0, 0, 0.02 * t * t * (3 - 2 * t))) : p;
  });
  const LocalResult r = preserve(cube, posed);
  EXPECT_LE(deviation(cube, r.position), 1e-12);
  for (const Vec3& p : r.position) EXPECT_TRUE(p.allFinite());
  EXPECT_FALSE(r.report.warnings.empty());  // a flat patch has no thickness to give
}

TEST(VolumePass, AGivenMaskIsTheMask) {
  const Mesh mesh = smallCapsule();
  const auto posed = mapped(mesh, stretchedAbove0);
  std::vector<double> mask(posed.size());
  for (std::size_t v = 0; v < mask.size(); ++v) mask[v] = std::clamp(0.5 - 2 * mesh.positions()[v].z(), 0.0, 1.0);
  const LocalResult r = preserve(mesh, posed, {.mask = MaskKind::Given}, {}, mask);
  EXPECT_LE(deviation(mesh, r.position), 1e-13);
  for (std::size_t v = 0; v < mask.size(); ++v)
    if (mask[v] == 0) { EXPECT_EQ(r.position[v], posed[v]); }
  std::fill(mask.begin(), mask.end(), 0.0);
  EXPECT_NE(refusal([&] { preserve(mesh, posed, {.mask = MaskKind::Given}, {}, mask); }), "");
  mask[3] = 1.5;
  EXPECT_THROW(preserve(mesh, posed, {.mask = MaskKind::Given}, {}, mask), std::invalid_argument);
  EXPECT_THROW(preserve(mesh, posed, {.mask = MaskKind::Given}), std::invalid_argument);
}

TEST(VolumePass, ALatticeOfGivenNodesIsUsed) {
  const Mesh mesh = smallCapsule();
  const LocalResult r = preserve(mesh, mapped(mesh, stretchedAbove0), {.nodes = {{5, 6, 9}}});
  EXPECT_EQ(r.report.nodes, (std::array<int, 3>{5, 6, 9}));
  EXPECT_LE(deviation(mesh, r.position), 1e-13);
  EXPECT_THROW(preserve(mesh, mesh.positions(), {.nodes = {{3, 6, 9}}}), std::invalid_argument);
}

TEST(VolumePass, QuadsCountAsTheirFans) {
  const Mesh quads = test::bar(20, 4, 1, 4), triangles(quads.positions(), quads.triangles());
  const auto posed = mapped(quads, [](const Vec3& p) { return Vec3(p.x(), p.y(), p.z() > 2 ? 2 * p.z() - 2 : p.z()); });
  const LocalResult r = preserve(quads, posed);
  EXPECT_LE(deviation(quads, r.position), 1e-13);
  EXPECT_LE(deviation(triangles, r.position), 1e-13);
}

TEST(VolumePass, AVertexThatHappensToStayBelongsToWhatMoved) {
  // The ring at z = 0 of a stretch about 0 does not move at all; it must thin with the rest.
  const Mesh mesh = makeCapsule({.length = 4, .around = 24, .along = 41, .bump = 0});
  const auto posed = mapped(mesh, [](const Vec3& p) { return Vec3(p.x(), p.y(), 1.5 * p.z()); });
  const LocalResult r = preserve(mesh, posed);
  std::size_t ring = 0;
  for (std::size_t v = 0; v < posed.size(); ++v) {
    if (std::abs(mesh.positions()[v].z()) > 1e-12) continue;
    ++ring;
    EXPECT_NEAR(r.position[v].head<2>().norm(), 0.25 / std::sqrt(1.5), 0.01);
  }
  EXPECT_EQ(ring, 24u);
}

}  // namespace
}  // namespace fielddeform::volume
