#include <cmath>

#include "figures.h"
#include "isosurface.h"
#include "sculpt.h"

namespace fielddeform::samples {
namespace {

double figure(const Vec3& p) {
  const Vec3 q(std::abs(p.x()), p.y(), p.z());
  double d = ellipsoid(p, {0, 0.46, -0.16}, {0.40, 0.42, 0.52});                         // body
  d = join(d, ellipsoid(p, {0, 0.66, 0.14}, {0.29, 0.36, 0.28}), 0.20);                  // chest
  d = join(d, limb(p, {0, 0.84, 0.22}, {0, 1.08, 0.30}, 0.18, 0.16), 0.14);              // neck
  d = join(d, ellipsoid(p, {0, 1.18, 0.38}, {0.225, 0.22, 0.28}), 0.09);                 // head
  d = join(d, ellipsoid(p, {0, 1.11, 0.58}, {0.125, 0.105, 0.11}), 0.08);                // muzzle
  d = join(d, ellipsoid(q, {0.085, 1.09, 0.56}, {0.085, 0.085, 0.085}), 0.05);           // cheeks
  d = join(d, ellipsoid(q, {0.155, 1.255, 0.50}, {0.045, 0.050, 0.050}), 0.02);          // eyes
  d = join(d, limb(q, {0.09, 1.32, 0.28}, {0.17, 1.86, 0.10}, 0.060, 0.092), 0.06);      // ears
  d = join(d, ellipsoid(q, {0.33, 0.32, -0.22}, {0.20, 0.30, 0.32}), 0.10);              // haunches
  d = join(d, limb(q, {0.33, 0.085, -0.10}, {0.365, 0.075, 0.30}, 0.095, 0.075), 0.08);  // hind feet
  d = join(d, limb(q, {0.14, 0.55, 0.30}, {0.125, 0.10, 0.40}, 0.11, 0.075), 0.10);      // forelegs
  d = join(d, limb(q, {0.125, 0.075, 0.40}, {0.13, 0.070, 0.50}, 0.075, 0.065), 0.06);
  return join(d, ellipsoid(p, {0, 0.36, -0.72}, {0.14, 0.14, 0.13}), 0.05);  // tail
}

}  // namespace

mesh::Mesh bunny(double fineness) {
  return isosurface(Box(Vec3(-0.65, -0.10, -0.97), Vec3(0.65, 2.07, 0.87)), 0.024 / fineness, figure);
}

}  // namespace fielddeform::samples
