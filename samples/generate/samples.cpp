#include "samples.h"

#include <fielddeform/mesh/io.h>
#include <fielddeform/skeleton/fit.h>
#include <fielddeform/skeleton/io.h>

#include <cmath>
#include <numbers>

#include "figures.h"
#include "hirota.h"
#include "hsu.h"
#include "rappoport.h"
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

// Figures 8 and 9: the skeleton is a cylinder of radius 0.3 and half height 1; both objects are pipes around it.
constexpr double kCylinder = 0.3, kInfluence = 0.9;

/// A pipe about y, fluted, open above and below, its rims round.
mesh::Mesh pipe(double outer) {
  const double half = 0.8, wall = 0.06;
  constexpr int kSide = 72, kRim = 8;
  std::vector<Eigen::Vector2d> profile;
  const double middle = outer - wall / 2;
  for (const double side : {1.0, -1.0}) {  // up the outside, over the rim, down the inside
    for (int i = 0; i < kSide; ++i) profile.emplace_back(middle + side * wall / 2, side * half * (2.0 * i / kSide - 1));
    for (int i = 0; i < kRim; ++i) {
      const double a = std::numbers::pi * i / kRim;
      profile.emplace_back(middle + side * wall / 2 * std::cos(a), side * (half + wall / 2 * std::sin(a)));
    }
  }
  return revolve(
      profile, 96, [](double angle, double) { return 1 + 0.04 * std::cos(12 * angle); }, Ends::Joined);
}

std::vector<skeleton::Primitive> teapotSkeleton() {
  return {polyline("body", line(Vec3(0, 0.1, 0), Vec3(0, 2.5, 0), 13), 2.6),
          polyline("spout",
                   {Vec3(1.9, 0.95, 0), Vec3(2.25, 1.2, 0), Vec3(2.5, 1.55, 0), Vec3(2.68, 1.9, 0), Vec3(2.88, 2.2, 0),
                    Vec3(3.22, 2.5, 0)},
                   0.5),
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
      {"baluster", "baluster.obj", "turned baluster, 4 long (Figure 7)", [](const path& p) { write(baluster(), p); }},
      {"baluster-spine", "baluster-spine.json", "a line through it",
       [](const path& p) { write({polyline("spine", line(Vec3(0, -1.8, 0), Vec3(0, 1.8, 0), 37), 1.2)}, p); }},
      {"pipe-near", "pipe-near.obj", "fluted pipe close around the cylinder skeleton (Figure 8)",
       [](const path& p) { write(pipe(0.43), p); }},
      {"pipe-far", "pipe-far.obj", "the same pipe far from the cylinder skeleton (Figure 9)",
       [](const path& p) { write(pipe(1.1), p); }},
      {"cylinder", "cylinder.json", "cylinder skeleton",
       [](const path& p) { write({solid("core", drum(kCylinder, 1, 1, 13, 32), kInfluence)}, p); }},
      {"cylinder-waisted", "cylinder-waisted.json", "the cylinder's replacement: waisted, other vertices",
       [](const path& p) { write({solid("core", drum(kCylinder, 1, 0.4, 17, 40), kInfluence)}, p); }},
      {"teapot", "teapot.obj", "the Utah teapot, 32 patches (Figure 10)", [](const path& p) { write(teapot(16), p); }},
      {"teapot-skeleton", "teapot-skeleton.json", "lines through body, spout and handle",
       [](const path& p) { write(teapotSkeleton(), p); }},
      {"bunny", "bunny.obj", "rabbit of soft balls (Figure 11)", [](const path& p) { write(bunny(), p); }},
      {"bunny-lod", "bunny-lod.json", "the rabbit simplified to a tenth of its faces, as a skeleton",
       [](const path& p) { skeleton::writeSkeleton(skeleton::fitLod(bunny(), {.faces = 2800}).skeleton, p); }},
      {"torus", "torus.obj", "torus of 4096 triangles (Hirota's)", [](const path& p) { write(torus(16), p); }},
      {"club", "club.obj", "Indian club (Hirota's)", [](const path& p) { write(club(64), p); }},
      {"quadruped", "quadruped.obj", "standing animal in place of Hirota's cow", [](const path& p) { write(quadruped(), p); }},
      {"pitcher", "pitcher.obj", "pitcher of bicubic patches: wall, lip, handle (Hirota's)",
       [](const path& p) { write(pitcher(12), p); }},
      {"pitcher-3", "pitcher-3.obj", "the pitcher's patches in 3 by 3 quads each: a level of detail",
       [](const path& p) { write(pitcher(3), p); }},
      {"pitcher-6", "pitcher-6.obj", "the same in 6 by 6", [](const path& p) { write(pitcher(6), p); }},
      {"cube", "cube.obj", "unit cube of squares (Chang & Rockwood's)", [](const path& p) { write(unitCube(20), p); }},
      {"amphora", "amphora.json", "amphora, one solid (Rappoport's)", [](const path& p) { solid::writeSolids(amphora(), p); }},
      {"telephone", "telephone.json", "telephone handset of three solids, to be stretched (Rappoport's)",
       [](const path& p) { solid::writeSolids(telephone(), p); }},
      {"block", "block.obj", "block of squares (Hsu's)", [](const path& p) { write(block(60), p); }},
      {"ball-tool", "ball-tool.obj", "ball that dips into the block (Hsu's)",
       [](const path& p) { write(ball(Vec3(0, 0.75, 0), 0.55, 64), p); }},
      {"ball", "ball.obj", "ball to be pressed (Hsu's)", [](const path& p) { write(ball(Vec3::Zero(), 1, 96), p); }},
      {"egg", "egg.obj", "elongated sphere for a bust (Hsu's)", [](const path& p) { write(egg(160), p); }},
      {"ring", "ring.obj", "finger ring with straight prongs (Hsu's)", [](const path& p) { write(prongRing(), p); }},
      {"stone", "stone.obj", "the stone that the prongs are to hold (Hsu's)", [](const path& p) { write(stone(), p); }},
  };
  return list;
}

}  // namespace fielddeform::samples
