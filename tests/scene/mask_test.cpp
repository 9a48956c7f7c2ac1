#include <fielddeform/core/error.h>
#include <fielddeform/scene/mask.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

namespace fielddeform::scene {
namespace {

mesh::Mesh points(std::size_t n) { return mesh::Mesh(std::vector<Vec3>(n, Vec3(1, 2, 3)), {}); }

class MaskFile : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = std::filesystem::temp_directory_path() /
            (std::string("fielddeform_mask_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
  }
  void TearDown() override { std::filesystem::remove(path_); }
  Mask with(const std::string& text) const {
    std::ofstream(path_) << text;
    return {"", path_};
  }
  std::filesystem::path path_;
};

TEST_F(MaskFile, HoldsOneNumberAVertex) {
  EXPECT_EQ(readMask(with("0 0.5\r\n1, 1e-3\n"), points(4)), (std::vector<double>{0, 0.5, 1, 1e-3}));
  EXPECT_EQ(readMask(with(""), points(0)), std::vector<double>{});
}

TEST_F(MaskFile, TooFewTooManyOrOtherThingsAreErrorsWithALine) {
  for (const char* text : {"1\n2\n", "1\n2\n3\n4", "1\nnan\n3", "1\ninf\n3", "1\nx\n3", "1\n2-\n3"}) {
    try {
      readMask(with(text), points(3));
      ADD_FAILURE() << text;
    } catch (const IoError& problem) {
      EXPECT_TRUE(problem.position().line) << problem.what();
    }
  }
  EXPECT_THROW(readMask({"", "absent/file"}, points(1)), IoError);
}

TEST(Mask, AttributeMustBeOneFiniteNumberAVertex) {
  mesh::Mesh mesh = points(2);
  mesh::Attribute attribute;
  attribute.name = "weight";
  attribute.data = std::vector<float>{0.5f, 1.0f};
  mesh.attributes() = {attribute};
  EXPECT_EQ(readMask({"weight", {}}, mesh), (std::vector<double>{0.5, 1}));
  EXPECT_THROW(readMask({"absent", {}}, mesh), std::invalid_argument);
  mesh.attributes()[0].data = std::vector<float>{0.5f, std::nanf("")};
  EXPECT_THROW(readMask({"weight", {}}, mesh), std::invalid_argument);
  mesh.attributes()[0].data = std::vector<float>{1, 2, 3, 4};
  mesh.attributes()[0].width = 2;
  EXPECT_THROW(readMask({"weight", {}}, mesh), std::invalid_argument);
}

TEST(Mask, ScalesTheDisplacementAndIsExactAtZeroAndOne) {
  const std::vector<Vec3> rest{{0.1, 0, 0}, {0.1, 0, 0}, {0.1, 0, 0}, {NAN, 0, 0}};
  std::vector<Vec3> position{{0.7, 0, 0}, {0.7, 0, 0}, {0.7, 0, 0}, {NAN, 0, 0}};
  std::vector<Status> status{Status::Converged, Status::Limited, Status::Converged, Status::Invalid};
  std::vector<float> residual{1, 1, 1, 1};
  applyMask(std::vector<double>{1, 0, 0.5, 0}, rest, position, status, residual);
  EXPECT_EQ(position[0], Vec3(0.7, 0, 0));
  EXPECT_EQ(position[1], Vec3(0.1, 0, 0));
  EXPECT_NEAR(position[2].x(), 0.4, 1e-15);
  EXPECT_EQ(status, (std::vector<Status>{Status::Converged, Status::Fixed, Status::Converged, Status::Invalid}));
  EXPECT_EQ(residual, (std::vector<float>{1, 0, 1, 1}));
}

}  // namespace
}  // namespace fielddeform::scene
