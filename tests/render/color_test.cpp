#include <fielddeform/render/color_map.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fielddeform::render {
namespace {

void expectColor(const std::optional<Color>& c, float r, float g, float b) {
  ASSERT_TRUE(c.has_value());
  EXPECT_FLOAT_EQ(c->r, r);
  EXPECT_FLOAT_EQ(c->g, g);
  EXPECT_FLOAT_EQ(c->b, b);
}

TEST(Color, ReadsHexadecimalAndNames) {
  expectColor(parseColor("#ff8000"), 1, 128.0f / 255, 0);
  expectColor(parseColor("FF8000"), 1, 128.0f / 255, 0);
  expectColor(parseColor("#f80"), 1, 136.0f / 255, 0);
  expectColor(parseColor("white"), 1, 1, 1);
}

TEST(Color, RefusesOtherText) {
  for (const char* text : {"", "#", "#ff", "#ff80001", "#ggg", "whit", "ff 000"})
    EXPECT_FALSE(parseColor(text)) << text;
}

TEST(ColorMap, EndsAreClampedAndNanIsGrey) {
  for (const ColorMap map : {ColorMap::Viridis, ColorMap::Heat, ColorMap::Diverging}) {
    const Color low = mapColor(map, 0), under = mapColor(map, -std::numeric_limits<double>::infinity());
    const Color high = mapColor(map, 1), over = mapColor(map, 7);
    EXPECT_EQ(low.r, under.r);
    EXPECT_EQ(high.b, over.b);
    EXPECT_NE(low.r, high.r);
    const Color none = mapColor(map, std::nan(""));
    EXPECT_TRUE(none.r == none.g && none.g == none.b);
    EXPECT_EQ(colorMapFromString(toString(map)), map);
  }
  EXPECT_FALSE(colorMapFromString("rainbow"));
}

TEST(ColorMap, ViridisGrowsBrighter) {
  double before = -1;
  for (int i = 0; i <= 20; ++i) {
    const Color c = mapColor(ColorMap::Viridis, i / 20.0);
    const double brightness = 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
    EXPECT_GT(brightness, before);
    before = brightness;
  }
}

TEST(ColorMap, ScalarsAreValuesOrLengths) {
  mesh::Attribute numbers, vectors;
  numbers.data = std::vector<std::int16_t>{-3, 4};
  EXPECT_EQ(scalarsOf(numbers), (std::vector<double>{-3, 4}));
  vectors.width = 3;
  vectors.data = std::vector<double>{3, 4, 0, 0, 0, 2};
  EXPECT_EQ(scalarsOf(vectors), (std::vector<double>{5, 2}));
}

}  // namespace
}  // namespace fielddeform::render
