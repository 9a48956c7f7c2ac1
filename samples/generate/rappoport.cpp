#include "rappoport.h"

#include <array>
#include <cmath>

namespace fielddeform::samples {
namespace {

using solid::LooseSolid;

/// A soft square: control points of a bicubic patch of half width 1, its sides bulged and its corners drawn in, nearly a disc but
/// with true corners, so that the solid stays regular there.
Eigen::Vector2d softSquare(int i, int j) {
  const std::array<double, 4> at{-1, -1.0 / 3, 1.0 / 3, 1};
  double x = at[static_cast<std::size_t>(i)], y = at[static_cast<std::size_t>(j)];
  const bool sideX = i == 0 || i == 3, sideY = j == 0 || j == 3;
  if (sideX && sideY) return {0.8 * x, 0.8 * y};
  if (sideX) return {1.02 * x, 1.12 * y};
  if (sideY) return {1.12 * x, 1.02 * y};
  return {1.02 * x, 1.02 * y};
}

}  // namespace

solid::SolidFile amphora() {
  // Radius and height of the rows; the polynomial runs well inside them.
  constexpr std::array<std::array<double, 2>, 8> kRows{{{0.34, 0}, {0.16, 0.35}, {1.35, 0.7}, {1.75, 1.6}, {1.05, 2.5}, {0.02, 2.9}, {0.36, 3.35}, {0.5, 3.6}}};
  LooseSolid out{"amphora", {3, 3, 7}, {}};
  for (const auto& [radius, height] : kRows)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 4; ++i) {
        const Eigen::Vector2d p = radius * softSquare(i, j);
        out.points.emplace_back(p.y(), height, p.x());
      }
  solid::SolidFile file;
  file.object = solid::makeObject({out}, {});
  for (const solid::Side side : {solid::Side::W0, solid::Side::W1}) {
    solid::ConstraintSpec c;
    c.kind = solid::ConstraintSpec::Kind::FixSide;
    c.side = {0, side};
    file.constraints.push_back(c);
  }
  file.sizes.resize(1);
  return file;
}

solid::SolidFile telephone(double stretch) {
  // Along u: the middle line in the plane of x and y, which way is up across it, half thickness and half width.
  struct Station {
    double x, y, tilt, thickness, width;
  };
  // Tilt in degrees from y towards x. Joints (3 and 6) are means of their neighbours, so that all rows are C1.
  std::array<Station, 10> s{{{-2.25, -1.0, -90, 0.62, 0.66}, {-2.3, -0.55, -88, 0.66, 0.7}, {-2.05, 0.36, -38, 0.16, 0.3}, {},
                             {-0.75, 0.55, -3, 0.21, 0.3}, {0.75, 0.55, 3, 0.21, 0.3}, {},
                             {2.05, 0.36, 38, 0.16, 0.3}, {2.3, -0.55, 88, 0.6, 0.64}, {2.25, -1.0, 90, 0.56, 0.6}}};
  std::array<std::array<Vec3, 16>, 10> rows;
  for (std::size_t k = 0; k < s.size(); ++k)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 4; ++i) {
        const double a = s[k].tilt * std::acos(-1.0) / 180;
        const Eigen::Vector2d p = softSquare(i, j);
        const Vec3 up(std::sin(a), std::cos(a), 0);
        rows[k][static_cast<std::size_t>(i + 4 * j)] = Vec3(s[k].x, s[k].y, 0) - s[k].width * p.x() * Vec3::UnitZ() + s[k].thickness * p.y() * up;
      }
  for (const std::size_t joint : {3, 6})
    for (std::size_t r = 0; r < 16; ++r) rows[joint][r] = 0.5 * (rows[joint - 1][r] + rows[joint + 1][r]);
  std::vector<LooseSolid> solids{{"earpiece", {3, 3, 3}, {}}, {"handle", {3, 3, 3}, {}}, {"mouthpiece", {3, 3, 3}, {}}};
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t r = 0; r < 16; ++r)
      for (std::size_t i = 0; i < 4; ++i) solids[k].points.push_back(rows[3 * k + i][r]);
  solid::SolidFile file;
  file.object = solid::makeObject(solids, {{{0, solid::Side::U1}, {1, solid::Side::U0}, 1, 1}, {{1, solid::Side::U1}, {2, solid::Side::U0}, 1, 1}});
  for (const std::size_t k : {0, 2}) {
    solid::ConstraintSpec c;
    c.kind = solid::ConstraintSpec::Kind::FixSide;
    c.side = {k, k == 0 ? solid::Side::U0 : solid::Side::U1};
    file.constraints.push_back(c);
  }
  // All of the mouthpiece goes along, but for the face that it shares with the handle: that half way.
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 4; ++i)
        file.moves.push_back({{2, std::array{i, j, k}}, Vec3(i == 0 ? 0.8 * stretch : stretch, 0, 0)});
  file.sizes.resize(3);
  return file;
}

}  // namespace fielddeform::samples
