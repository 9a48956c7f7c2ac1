#include <fielddeform/render/detail/canvas.h>
#include <fielddeform/render/detail/font.h>
#include <gtest/gtest.h>

namespace fielddeform::render::detail {
namespace {

int inkIn(const Image& image, int x0, int y0, int x1, int y1) {
  int count = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) count += image.pixel(x, y)[0] < 200;
  }
  return count;
}

TEST(Font, DrawsEveryPrintableCharacterAndNoTwoAlike) {
  const Lettering box = layOut("\xE2\x98\x83");  // a snowman, which has no drawing
  ASSERT_EQ(box.strokes.size(), 1u);
  for (char a = '!'; a <= '~'; ++a) {
    const Lettering one = layOut(std::string(1, a));
    EXPECT_FALSE(one.strokes.empty()) << a;
    EXPECT_NE(one.strokes, box.strokes) << a;
    for (char b = '!'; b < a; ++b) EXPECT_NE(one.strokes, layOut(std::string(1, b)).strokes) << a << b;
  }
}

TEST(Font, StaysBetweenDescentAndAscent) {
  for (char a = '!'; a <= '~'; ++a) {
    for (const auto& stroke : layOut(std::string(1, a)).strokes) {
      for (const auto& p : stroke) {
        EXPECT_GE(p.y(), -kDescent - 0.5f) << a;
        EXPECT_LE(p.y(), kCapitalHeight + 1.5f) << a;
        EXPECT_GE(p.x(), -0.6f) << a;  // a spline swings a little beyond its points
      }
    }
  }
}

TEST(Font, WidthAddsUpAndMalformedTextIsBoxes) {
  EXPECT_EQ(layOut("").width, 0);
  EXPECT_GT(layOut("ab").width, layOut("a").width + layOut("b").width);
  EXPECT_EQ(layOut("\xC3").strokes.size(), 1u);          // cut off
  EXPECT_EQ(layOut("\xFF\xFE\x80").strokes.size(), 3u);  // never valid
  EXPECT_EQ(layOut("90\xC2\xB0").strokes.size(), 3u);    // a degree sign is one drawing
}

TEST(Canvas, TextLeavesInkOnlyInItsPlace) {
  Image image = blank(200, 60, {1, 1, 1});
  drawText(image, "Hx", {.x = 100, .baseline = 40, .capitalHeight = 20}, {0, 0, 0});
  EXPECT_GT(inkIn(image, 80, 18, 120, 42), 60);
  EXPECT_EQ(inkIn(image, 0, 0, 200, 18) + inkIn(image, 0, 43, 200, 60), 0);
  EXPECT_EQ(inkIn(image, 0, 0, 70, 60) + inkIn(image, 130, 0, 200, 60), 0);
}

TEST(Canvas, LongTextStaysWithinItsWidth) {
  Image image = blank(300, 40, {1, 1, 1});
  drawText(image, "a label that is much too long for its place \xC3\xA4\xC3\xA4\xC3\xA4",
           {.x = 150, .baseline = 25, .capitalHeight = 12, .maxWidth = 100}, {0, 0, 0});
  EXPECT_GT(inkIn(image, 100, 0, 200, 40), 50);
  EXPECT_EQ(inkIn(image, 0, 0, 97, 40) + inkIn(image, 203, 0, 300, 40), 0);
}

TEST(Canvas, TextOutsideThePictureIsCutOff) {
  Image image = blank(20, 10, {1, 1, 1});
  drawText(image, "WWWWWWWWWW", {.x = 10, .baseline = 300, .capitalHeight = 300}, {0, 0, 0});
  drawText(image, "WW", {.x = -500, .baseline = -40, .capitalHeight = 12}, {0, 0, 0});
  SUCCEED();  // under the sanitizers
}

TEST(Canvas, LinearLightAndBackIsTheSameColor) {
  for (int i = 0; i <= 255; ++i) {
    const float v = static_cast<float>(i) / 255;
    EXPECT_NEAR(toSrgb(toLinear({v, v, v})).g, v, 1e-5);
  }
  EXPECT_NEAR(toLinear({0.5f, 0.5f, 0.5f}).x(), 0.2140f, 1e-4);  // IEC 61966-2-1
}

}  // namespace
}  // namespace fielddeform::render::detail
