#pragma once

#include <Eigen/Core>
#include <string_view>
#include <vector>

namespace fielddeform::render::detail {

/// The strokes of a line of text, in units of a ninth of a capital's height: x to the right from 0, y up from the
/// baseline. A pen of width 1 or so draws them.
struct Lettering {
  std::vector<std::vector<Eigen::Vector2f>> strokes;  ///< polylines; a dot is one point twice
  float width = 0;                                    ///< from the first letter's left to the last one's right
};

inline constexpr float kCapitalHeight = 9;
inline constexpr float kDescent = 3;

/// @param text UTF-8; characters without a drawing become a box
Lettering layOut(std::string_view text);

}  // namespace fielddeform::render::detail
