#include <fielddeform/render/render.h>
#include <gtest/gtest.h>

namespace fielddeform::render {

TEST(RenderUnavailable, SaysSoInsteadOfDrawing) {
  EXPECT_FALSE(available());
  Progress progress;
  EXPECT_THROW(render({}, progress), std::runtime_error);
  EXPECT_THROW(writePng({}, "picture.png"), std::runtime_error);
}

}  // namespace fielddeform::render
