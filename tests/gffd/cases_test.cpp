// The closed-form cases: what the trackers are measured by. Bounds are the best columns of the prototype's table
// (docs/tracking.md), times 1.1 for the mean distance.
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

#include <fielddeform/mesh/quality.h>

namespace fielddeform::gffd::tests {
namespace {

std::size_t flippedAgainst(const mesh::Mesh& mesh, Points ideal, Points posed) {
  std::size_t count = 0;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f)
    mesh.forEachTriangle(f, [&](Index a, Index b, Index c) {
      count += (posed[b] - posed[a]).cross(posed[c] - posed[a]).dot((ideal[b] - ideal[a]).cross(ideal[c] - ideal[a])) < 0;
    });
  return count;
}

struct Bound {
  const char* name;
  double mean;
  std::size_t flips, folds;
};

class TrackingCases : public testing::TestWithParam<Bound> {};

TEST_P(TrackingCases, AutoMeetsTheBestColumn) {
  const Bound& bound = GetParam();
  const auto c = fielddeform::tests::makeCase(bound.name);
  const Deformed d = track(c);
  const StatusCounts n = countStatuses(d.status);
  EXPECT_EQ(n[0] + n[1] + n[2] + n[3] + n[4], c.mesh.vertexCount());
  EXPECT_EQ(n[static_cast<int>(Status::Stalled)], 0u);
  if (!c.ideal.empty()) {
    EXPECT_LE(meanDistance(d.position, c.ideal), bound.mean);
    EXPECT_LE(flippedAgainst(c.mesh, c.ideal, d.position), bound.flips);
  }
  EXPECT_LE(d.folds, bound.folds);
}

// The stretch and the rigid motions are exact in the best column: rounding of a model two units long is what is left.
INSTANTIATE_TEST_SUITE_P(, TrackingCases,
                         testing::Values(Bound{"bend90", 1.1 * .0017, 0, 0}, Bound{"bend180", 1.1 * .0034, 0, 0},
                                         Bound{"twist4_180", 1.1 * .023, 0, 0}, Bound{"twist4_360", 1.1 * .029, 0, 0},
                                         Bound{"twist2_180", 1.1 * .044, 0, 0}, Bound{"stretch2", 1e-12, 0, 0},
                                         Bound{"trans", 2e-9, 0, 0}, Bound{"rottrans", 2e-9, 0, 0},
                                         Bound{"branch", 0, 0, 7}, Bound{"cagebend90", 1.1 * .009, 1, 0},
                                         Bound{"lodtwist180", 1.1 * .005, 0, 0}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace fielddeform::gffd::tests
