#include <fielddeform/gffd/detail/stage.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

LocalMotion motionOf(const MotionBlock& m, std::size_t k) {
  return {Quat(m.qw[k], m.qx[k], m.qy[k], m.qz[k]), Vec3(m.x[k], m.y[k], m.z[k])};
}

LocalMotion motionOf(const MlsBlock& m, std::size_t k) {
  Mat3 r;
  for (int i = 0; i < 9; ++i) r(i / 3, i % 3) = m.turn[i][k];
  return {Quat(r), Vec3(m.x[k], m.y[k], m.z[k])};
}

}  // namespace

void Stage::displacementsAt(const Block& points, std::size_t count, const double* level, const double* weight, Block& out) const {
  const bool fitted = options_.predictor == Predictor::Mls;
  const auto far = [&](std::size_t k) { return levelBoundsNearness_ && level[k] >= kNear; };
  MotionBlock axial;
  MlsBlock mls;
  bool frames = !fitted;
  if (fitted) {
    mls_->at(points, count, mls);
    for (std::size_t k = 0; k < count; ++k) frames = frames || !far(k);
  }
  if (frames && axialLines_) axialLines_->at(points, count, axial);
  const auto nearest = [&](std::size_t k, const Vec3& p) -> LocalMotion {
    return axialLines_ && std::isfinite(axial.x[k]) ? motionOf(axial, k) : axial_->at(p);
  };
  const auto put = [&](std::size_t k, const LocalMotion& motion) {
    const Vec3 d = weight && weight[k] < 1 ? screwPower(motion, weight[k]).translation : motion.translation;
    out.x[k] = d[0];
    out.y[k] = d[1];
    out.z[k] = d[2];
  };
  for (std::size_t k = 0; k < count; ++k) {
    const Vec3 p(points.x[k], points.y[k], points.z[k]);
    if (!fitted) {
      put(k, nearest(k, p));
    } else if (mls.settled[k] != 1) {
      put(k, motionAt(p, level[k]));
    } else {
      const double near = far(k) ? kNear : axialLines_ ? axial.nearness[k] : axial_->nearness(p);
      if (near < kNear) {
        put(k, blend(nearest(k, p), motionOf(mls, k), smoothstep(near / kNear)));
      } else if (weight && weight[k] < 1) {
        put(k, motionOf(mls, k));
      } else {
        out.x[k] = mls.x[k];
        out.y[k] = mls.y[k];
        out.z[k] = mls.z[k];
      }
    }
  }
}

void Stage::nearnessAt(const Block& points, std::size_t count, double* out) const {
  if (axialLines_) return axialLines_->nearness(points, count, out);
  for (std::size_t k = 0; k < count; ++k) out[k] = axial_->nearness(Vec3(points.x[k], points.y[k], points.z[k]));
}

}  // namespace fielddeform::gffd::detail
