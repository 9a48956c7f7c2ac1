#include <fielddeform/volume/energy.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "tests/volume/volume_testing.h"

namespace fielddeform::volume {
namespace {

using test::added, test::noise;

std::vector<Vec3> gridNodes(int nx, int ny, int nz) {
  std::vector<Vec3> out;
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) out.emplace_back(0.5 * i, 0.4 * j, 0.7 * k);
  return out;
}

void expectDerivatives(const Energy& energy, std::uint64_t seed) {
  const std::size_t n = energy.nodeCount();
  const auto d = noise(seed, n), p = noise(seed + 1, n);
  std::vector<Vec3> g(n), plus(n), minus(n), scaled(d);
  for (Vec3& v : scaled) v *= 0.1;
  EXPECT_NEAR(energy.gradient(scaled, g), energy.value(scaled), 1e-13);
  const double h = 1e-6;
  EXPECT_NEAR(test::dot(g, p), (energy.value(added(scaled, p, h)) - energy.value(added(scaled, p, -h))) / (2 * h), 1e-8);
  const auto hessian = energy.hessian(scaled);
  energy.gradient(added(scaled, p, h), plus);
  energy.gradient(added(scaled, p, -h), minus);
  const Eigen::VectorXd hp = hessian * Eigen::Map<const Eigen::VectorXd>(p[0].data(), static_cast<Eigen::Index>(3 * n));
  for (std::size_t i = 0; i < n; ++i)
    EXPECT_LT((hp.segment<3>(static_cast<Eigen::Index>(3 * i)) - (plus[i] - minus[i]) / (2 * h)).norm(), 1e-7);
}

TEST(SpringNetwork, DerivativesAgreeWithCentralDifferences) {
  const auto rest = gridNodes(3, 4, 2);
  for (const Springs kind : {Springs::AxesAndDiagonals, Springs::Kuhn, Springs::All})
    expectDerivatives(SpringNetwork({3, 4, 2}, rest, kind), 10);
}

TEST(SpringNetwork, CountsTheNeighboursOfAnInnerNode) {
  const auto rest = gridNodes(3, 3, 3);
  const auto neighbours = [&](Springs kind) {
    int count = 0;
    const SpringNetwork network({3, 3, 3}, rest, kind);
    for (const auto& s : network.springs()) count += s.start == 13 || s.end == 13;
    return count;
  };
  EXPECT_EQ(neighbours(Springs::AxesAndDiagonals), 14);
  EXPECT_EQ(neighbours(Springs::Kuhn), 14);
  EXPECT_EQ(neighbours(Springs::All), 26);
}

int zeroModes(Springs kind, int nx, int ny, int nz) {
  const auto rest = gridNodes(nx, ny, nz);
  const SpringNetwork network({nx, ny, nz}, rest, kind);
  const std::vector<Vec3> zero(rest.size(), Vec3::Zero());
  const Eigen::MatrixXd h = network.hessian(zero);
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(h, Eigen::EigenvaluesOnly).eigenvalues();
  return static_cast<int>((values.array() < 1e-10 * values.maxCoeff()).count());
}

TEST(SpringNetwork, OnlyRigidMotionsAreFreeButForSixPlusEight) {
  for (const auto& n : {std::array{3, 3, 3}, std::array{5, 2, 2}}) {
    EXPECT_EQ(zeroModes(Springs::All, n[0], n[1], n[2]), 6);
    EXPECT_EQ(zeroModes(Springs::Kuhn, n[0], n[1], n[2]), 6);
    EXPECT_GT(zeroModes(Springs::AxesAndDiagonals, n[0], n[1], n[2]), 6);  // the page's 3 to 6 spurious modes
  }
}

TEST(SpringNetwork, DoesNotFeelARigidMotion) {
  const auto rest = gridNodes(4, 3, 3);
  const SpringNetwork network({4, 3, 3}, rest);
  const Mat3 turn = Eigen::AngleAxisd(2.3, Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
  std::vector<Vec3> d;
  for (const Vec3& p : rest) d.push_back(turn * p + Vec3(3, 1, -2) - p);
  EXPECT_LT(network.value(d), 1e-26);  // rounding of 1e-15 in some 200 lengths, squared
}

TEST(QuadraticEnergy, DerivativesAgreeWithCentralDifferences) {
  SparseMatrix h(4, 4);
  h.insert(0, 0) = 2, h.insert(1, 1) = 3, h.insert(2, 2) = 1, h.insert(3, 3) = 5;
  h.insert(0, 2) = h.insert(2, 0) = -0.5;
  h.insert(1, 3) = h.insert(3, 1) = 0.25;
  expectDerivatives(QuadraticEnergy(h), 20);
  h.coeffRef(0, 2) = 7;
  EXPECT_THROW(QuadraticEnergy{h}, std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::volume
