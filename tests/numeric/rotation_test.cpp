#include <fielddeform/core/random.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/numeric/rotation.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace fielddeform::numeric {
namespace {

double centred(std::uint64_t seed, std::uint64_t i) { return 2 * uniform01(seed, i) - 1; }

Mat3 randomMatrix(std::uint64_t seed) {
  Mat3 m;
  for (int i = 0; i < 9; ++i) m.data()[i] = centred(seed, static_cast<std::uint64_t>(i));
  return m;
}

Quat randomRotation(std::uint64_t seed) {
  return Quat(centred(seed, 10), centred(seed, 11), centred(seed, 12), centred(seed, 13)).normalized();
}

bool isRotation(const Mat3& r) {
  return (r * r.transpose() - Mat3::Identity()).norm() < 3e-15 && std::abs(r.determinant() - 1) < 3e-15;
}

// The greatest possible tr(R C): s1 + s2 +- s3.
double optimum(const Mat3& c) {
  const Vec3 s = Eigen::JacobiSVD<Mat3>(c).singularValues();
  return s[0] + s[1] + (c.determinant() < 0 ? -s[2] : s[2]);
}

TEST(Kabsch, RecoversTheRotationBetweenTwoPointSets) {
  double worst = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const Mat3 r = randomRotation(seed).toRotationMatrix();
    Mat3 c = Mat3::Zero();
    for (std::uint64_t i = 0; i < 20; ++i) {
      const Vec3 p(centred(seed, 20 + 3 * i), centred(seed, 21 + 3 * i), centred(seed, 22 + 3 * i));
      c += p * (r * p).transpose();
    }
    worst = std::max(worst, (kabsch(c) - r).norm());
  }
  EXPECT_LT(worst, 1e-14);  // the sum itself carries 20 roundings and a condition of a few
}

TEST(Kabsch, IsExactForAMultipleOfARotation) {
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    const Mat3 r = randomRotation(seed).toRotationMatrix();
    EXPECT_LT((kabsch(3 * r.transpose()) - r).norm(), 2e-15);
  }
}

TEST(Kabsch, MaximisesTheTraceAmongRotations) {
  for (std::uint64_t seed = 0; seed < 5000; ++seed) {
    const Mat3 c = randomMatrix(seed);  // half of them are reflections
    const Mat3 r = kabsch(c);
    EXPECT_TRUE(isRotation(r));
    EXPECT_NEAR((r * c).trace(), optimum(c), 1e-14);
  }
}

TEST(Kabsch, HandlesEveryConditionFromWellPosedToDegenerate) {
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    const double small = std::ldexp(1.0, -static_cast<int>(seed % 60)), smaller = std::ldexp(small, -static_cast<int>(seed % 23));
    const Vec3 s(1, small, seed % 2 ? smaller : -smaller);
    const Mat3 c = randomRotation(seed) * s.asDiagonal() * randomRotation(seed + 9999).toRotationMatrix();
    const Mat3 r = kabsch(c);
    EXPECT_TRUE(isRotation(r)) << seed;
    // What lies below 1e-14 of s1 counts as undetermined, which costs up to twice that.
    EXPECT_NEAR((r * c).trace(), 1 + small + (seed % 2 ? smaller : -smaller), 3e-14) << seed;
  }
}

TEST(Kabsch, PlaneOfPointsDeterminesTheRotation) {
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    const Mat3 r = randomRotation(seed).toRotationMatrix();
    const Mat3 c = Vec3(2, 1, 0).asDiagonal() * r.transpose();
    EXPECT_LT((kabsch(c) - r).norm(), 3e-15);
  }
}

TEST(Kabsch, LineOfPointsTakesTheShortestRotation) {
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    const Vec3 p = randomMatrix(seed).col(0), q = randomMatrix(seed).col(1);
    const Mat3 expected = minimalRotation(p, q).toRotationMatrix();
    EXPECT_LT((kabsch(p * q.transpose()) - expected).norm(), 1e-14);
  }
}

TEST(Kabsch, OppositeLineTurnsByHalfACircle) {
  const Mat3 r = kabsch(Vec3(0, 0, 2) * Vec3(0, 0, -3).transpose());
  EXPECT_TRUE(isRotation(r));
  EXPECT_LT((r * Vec3::UnitZ() + Vec3::UnitZ()).norm(), 1e-15);
}

TEST(Kabsch, NothingGivenIsTheIdentity) {
  EXPECT_EQ(kabsch(Mat3::Zero()), Mat3::Identity());
  EXPECT_EQ(kabsch(Mat3::Constant(std::nan(""))), Mat3::Identity());
  Mat3 infinite = Mat3::Identity();
  infinite(1, 2) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(kabsch(infinite), Mat3::Identity());
}

TEST(Kabsch, PureReflectionsGiveSomeBestRotation) {
  for (const Vec3& s : {Vec3(-1, -1, -1), Vec3(1, 1, -1), Vec3(3, 1, -1), Vec3(-2, 1, 1)}) {
    const Mat3 c = s.asDiagonal();
    const Mat3 r = kabsch(c);
    EXPECT_TRUE(isRotation(r));
    EXPECT_NEAR((r * c).trace(), optimum(c), 1e-15);
  }
}

TEST(Kabsch, DoesNotSeePowersOfTwo) {
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    Mat3 c = randomMatrix(seed);
    if (seed % 3 == 1) c.col(2).setZero();
    if (seed % 3 == 2) c = c.col(0) * c.row(1);
    const Mat3 r = kabsch(c);
    for (const int e : {10, -10, 900, -900}) EXPECT_EQ(kabsch(std::ldexp(1.0, e) * c), r) << seed << ' ' << e;
  }
}

TEST(Kabsch, HugeAndDenormalMatricesGiveRotations) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    EXPECT_TRUE(isRotation(kabsch(randomMatrix(seed) * 1.7e308)));
    EXPECT_TRUE(isRotation(kabsch(randomMatrix(seed) * 1e-318)));
  }
}

TEST(PolarRefine, EqualsKabschFromAnyStart) {
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    Mat3 c = randomMatrix(seed) + 2 * randomRotation(seed).toRotationMatrix();
    const Mat3 expected = kabsch(c);
    const double angle = seed % 2 ? 0.3 : 3.0;
    const Quat start = Quat(Eigen::AngleAxisd(angle, randomMatrix(seed).col(2).normalized())) * Quat(expected);
    EXPECT_LT((polarRefine(c, start).toRotationMatrix() - expected).norm(), 2e-14) << seed;
  }
}

}  // namespace
}  // namespace fielddeform::numeric
