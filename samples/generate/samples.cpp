#include "samples.h"

#include <fielddeform/mesh/io.h>
#include <fielddeform/skeleton/io.h>

#include <cmath>

#include "figures.h"
#include "shapes.h"

namespace fielddeform::samples {
namespace {

using std::filesystem::path;

void write(const mesh::Mesh& mesh, const path& to) { mesh::writeMesh(mesh, to); }
void write(std::vector<skeleton::Primitive> primitives, const path& to) {
  skeleton::Skeleton skeleton;
  skeleton.primitives = std::move(primitives);
  skeleton::writeSkeleton(skeleton, to);
}

std::vector<Vec3> line(const Vec3& from, const Vec3& to, int points) {
  std::vector<Vec3> out;
  for (int i = 0; i < points; ++i) out.push_back(from + static_cast<double>(i) / (points - 1) * (to - from));
  return out;
}

/// A closed cylinder about y whose radius is bulged (or waisted) by a factor at its middle.
mesh::Mesh drum(double radius, double halfHeight, double middle, int rings, int around) {
  std::vector<Eigen::Vector2d> profile;
  for (int i = 0; i < rings; ++i) {
    const double y = -1 + 2.0 * i / (rings - 1);
    profile.emplace_back(radius * (1 + (middle - 1) * (1 - y * y)), halfHeight * y);
  }
  return revolve(profile, around);
}

// Figures 8 and 9: the skeleton is a cylinder of radius 0.3 and half height 1; both objects are tubes around it.
constexpr double kCylinder = 0.3, kInfluence = 0.9;

mesh::Mesh tubeAround(double radius) {
  const double half = 0.8, round = 0.12;
  constexpr int kSide = 72, kRound = 8, kCap = 6;
  std::vector<Eigen::Vector2d> end;  // from the axis outwards, at height -half
  for (int i = 1; i < kCap; ++i) end.emplace_back((radius - round) * i / kCap, -half);
  for (int i = 0; i <= kRound; ++i) {
    const double a = std::acos(-1.0) / 2 * i / kRound;
    end.emplace_back(radius - round + round * std::sin(a), -half + round - round * std::cos(a));
  }
  std::vector<Eigen::Vector2d> profile = end;
  for (int i = 1; i < kSide; ++i) profile.emplace_back(radius, (half - round) * (2.0 * i / kSide - 1));
  for (auto p = end.rbegin(); p != end.rend(); ++p) profile.emplace_back(p->x(), -p->y());
  return revolve(profile, 96, [](double angle, double) { return 1 + 0.04 * std::cos(12 * angle); });
}

std::vector<skeleton::Primitive> teapotSkeleton() {
  return {polyline("body", line(Vec3(0, 0.1, 0), Vec3(0, 2.5, 0), 13), 2.6),
          polyline("spout",
                   {Vec3(1.9, 0.95, 0), Vec3(2.25, 1.2, 0), Vec3(2.5, 1.55, 0), Vec3(2.68, 1.9, 0), Vec3(2.88, 2.2, 0),
                    Vec3(3.1, 2.45, 0)},
                   0.9),
          polyline("handle",
                   {Vec3(-1.65, 2.13, 0), Vec3(-2.25, 2.14, 0), Vec3(-2.65, 2.05, 0), Vec3(-2.83, 1.8, 0),
                    Vec3(-2.75, 1.4, 0), Vec3(-2.45, 1.0, 0), Vec3(-2.0, 0.8, 0)},
                   0.6)};
}

}  // namespace

const std::vector<Sample>& samples() {
  static const std::vector<Sample> list{
      {"otter", "otter.ply", "scan-like figurine with colours, more than 100 000 vertices",
       [](const path& p) { write(otter(), p); }},
      {"bar", "bar.obj", "rounded square bar, 4 long (Figure 7)", [](const path& p) { write(bar(4, 1, 80), p); }},
      {"bar-spine", "bar-spine.json", "line skeleton of the bar",
       [](const path& p) { write({polyline("spine", line(Vec3(0, -1.8, 0), Vec3(0, 1.8, 0), 33), 1.4)}, p); }},
      {"tube-near", "tube-near.obj", "fluted tube close around the cylinder skeleton (Figure 8)",
       [](const path& p) { write(tubeAround(0.4), p); }},
      {"tube-far", "tube-far.obj", "the same tube far from the cylinder skeleton (Figure 9)",
       [](const path& p) { write(tubeAround(1.0), p); }},
      {"cylinder", "cylinder.json", "cylinder skeleton",
       [](const path& p) { write({solid("core", drum(kCylinder, 1, 1, 21, 32), kInfluence)}, p); }},
      {"cylinder-waisted", "cylinder-waisted.json", "the cylinder's replacement: waisted, other vertices",
       [](const path& p) { write({solid("core", drum(kCylinder, 1, 0.4, 29, 40), kInfluence)}, p); }},
      {"teapot", "teapot.obj", "the Utah teapot, 32 patches (Figure 10)", [](const path& p) { write(teapot(16), p); }},
      {"teapot-skeleton", "teapot-skeleton.json", "lines through body, spout and handle",
       [](const path& p) { write(teapotSkeleton(), p); }},
      {"bunny", "bunny.obj", "rabbit of soft balls (Figure 11)", [](const path& p) { write(bunny(), p); }},
  };
  return list;
}

}  // namespace fielddeform::samples
