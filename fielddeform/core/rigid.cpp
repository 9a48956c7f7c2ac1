#include <fielddeform/core/rigid.h>

#include <cmath>

namespace fielddeform {
namespace {

// Dual part of the unit dual quaternion of a motion: q_d = 1/2 t q_r.
Quat dualPart(const Rigid& m) {
  Quat d = Quat(0, m.translation.x(), m.translation.y(), m.translation.z()) * m.rotation;
  d.coeffs() *= 0.5;
  return d;
}

}  // namespace

Vec3 anyPerpendicular(const Vec3& v) {
  if (v.squaredNorm() == 0) return Vec3::UnitX();
  int smallest = 0;
  for (int k = 1; k < 3; ++k)
    if (std::abs(v[k]) < std::abs(v[smallest])) smallest = k;
  return v.cross(Vec3::Unit(smallest)).normalized();
}

Quat minimalRotation(const Vec3& a, const Vec3& b) {
  const double la = a.norm(), lb = b.norm();
  if (!(la > 0) || !(lb > 0)) return Quat::Identity();
  const Vec3 u = a / la, v = b / lb;
  // 1 + cos without cancellation near opposite directions.
  const double c1 = 0.5 * (u + v).squaredNorm();
  if (c1 < 1e-24) {
    const Vec3 axis = anyPerpendicular(u);
    return Quat(0, axis.x(), axis.y(), axis.z());
  }
  const Vec3 cross = u.cross(v);
  Quat q(c1, cross.x(), cross.y(), cross.z());
  q.normalize();
  return q;
}

Rigid screwPower(const Rigid& motion, double w) {
  Quat q = motion.rotation;
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double s = q.vec().norm();
  if (s < 1e-12) {
    // Almost no turn: the axis is undetermined, the limit is a straight slide.
    Quat r(1, w * q.x(), w * q.y(), w * q.z());
    r.normalize();
    return {r, w * motion.translation};
  }
  const Vec3 axis = q.vec() / s;
  const double angle = 2 * std::atan2(s, q.w());
  const double half = 0.5 * w * angle;
  const Quat r(std::cos(half), axis.x() * std::sin(half), axis.y() * std::sin(half), axis.z() * std::sin(half));
  // t = slide * axis + (1 - R) c with c the axis's point nearest the origin.
  const Vec3& t = motion.translation;
  const double slide = axis.dot(t);
  const Vec3 across = t - slide * axis;
  const Vec3 centre = 0.5 * (across + axis.cross(across) * (q.w() / s));
  return {r, w * slide * axis + centre - r * centre};
}

Rigid blend(std::span<const Rigid> motions, std::span<const double> weights) {
  Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = Eigen::Vector4d::Zero();
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const bool opposite = motions[i].rotation.dot(motions[0].rotation) < 0;
    const double w = opposite ? -weights[i] : weights[i];
    real += w * motions[i].rotation.coeffs();
    dual += w * dualPart(motions[i]).coeffs();
  }
  const double length = real.norm();
  if (!(length > 0)) return motions.empty() ? Rigid{} : motions[0];
  Quat r, d;
  r.coeffs() = real / length;
  d.coeffs() = dual / length;
  const Quat t = d * r.conjugate();
  return {r, 2 * t.vec()};
}

Rigid blend(const Rigid& a, const Rigid& b, double weightOfB) {
  const Rigid motions[2] = {a, b};
  const double weights[2] = {1 - weightOfB, weightOfB};
  return blend(motions, weights);
}

}  // namespace fielddeform
