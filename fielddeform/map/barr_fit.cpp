// Levenberg-Marquardt over at most nine parameters with the rigid motion eliminated (Kabsch); derivatives by differences.
#include <fielddeform/map/barr_fit.h>
#include <fielddeform/map/detail/barr_profile.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/numeric/rotation.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace fielddeform::map {
namespace {

using Problem = detail::BarrProblem;
using detail::Profile;
using detail::profileAlong;
using detail::rangeOf;

constexpr std::size_t kMostPairs = 1000;
constexpr double kSameFit = 1.05;      // a less simple kind must be better than this
constexpr int kIterations = 60;

struct Candidate {
  BarrEdit edit;
  Quat turn = Quat::Identity();
  Vec3 shift = Vec3::Zero();
  double cost = 0;  // weighted sum of squares
};

// The best rigid motion behind the edit; fills residuals (3 per pair, weighted) if wanted.
void settle(const Problem& p, Candidate& c, Eigen::VectorXd* residual) {
  const BarrMap map(c.edit);
  const std::size_t n = p.pairs.rest.size();
  std::vector<Vec3> x(n);
  for (std::size_t i = 0; i < n; ++i) x[i] = map.position(p.pairs.rest[i]) - c.edit.pivot;
  const detail::RigidFit rigid = detail::fitRigid(p.pairs, x, c.edit.pivot, residual);
  c.turn = rigid.turn;
  c.shift = rigid.shift;
  c.cost = rigid.cost;
}

// An edit moved by small parameters: range ends, amount, tilt of the axis (2), turn of about, pivot across (2), second factor.
constexpr int kParameters = 9;
BarrEdit moved(const BarrEdit& e, const Eigen::Matrix<double, kParameters, 1>& d, double size) {
  BarrEdit out = e;
  const Vec3 second = e.axis.cross(e.about);
  out.axis = (e.axis + d[3] * e.about + d[4] * second).normalized();
  const Vec3 about = e.about + d[5] * second;
  out.about = (about - out.axis.dot(about) * out.axis).normalized();
  out.begin = e.begin + d[0] * size;
  out.end = std::max(e.end + d[1] * size, out.begin + 1e-6 * size);
  const auto grow = [](double f, double by) { return std::clamp(f * numeric::exp(by), 1e-6, 1e6); };
  switch (e.kind) {
    case BarrKind::Scale:
      out.factor = Vec3(grow(e.factor[0], d[0]), grow(e.factor[1], d[1]), grow(e.factor[2], d[2]));
      out.begin = e.begin;
      out.end = e.end;
      break;
    case BarrKind::Stretch: out.factor[0] = grow(e.factor[0], d[2]); break;
    case BarrKind::Taper:
      out.factor[0] = grow(e.factor[0], d[2]);
      out.factor[1] = grow(e.factor[1], d[8]);
      break;
    case BarrKind::Twist:
    case BarrKind::Bend: out.angle = e.angle + d[2]; break;
  }
  out.pivot = e.pivot + size * (d[6] * e.about + d[7] * second);
  return out;
}

Candidate refine(const Problem& p, Candidate c) {
  const auto n = static_cast<Eigen::Index>(3 * p.pairs.rest.size());
  Eigen::VectorXd r(n), shifted(n);
  Eigen::MatrixXd j(n, kParameters);
  settle(p, c, &r);
  double damping = 1e-4;
  for (int iteration = 0; iteration < kIterations && c.cost > 0; ++iteration) {
    constexpr double kStep = 1e-6;
    for (int k = 0; k < kParameters; ++k) {
      Eigen::Matrix<double, kParameters, 1> d = Eigen::Matrix<double, kParameters, 1>::Zero();
      d[k] = kStep;
      Candidate forward = c, backward = c;
      forward.edit = moved(c.edit, d, p.size);
      backward.edit = moved(c.edit, -d, p.size);
      settle(p, forward, &shifted);
      j.col(k) = shifted;
      settle(p, backward, &shifted);
      j.col(k) = (j.col(k) - shifted) / (2 * kStep);
    }
    Eigen::Matrix<double, kParameters, kParameters> normal = j.transpose() * j;
    const Eigen::Matrix<double, kParameters, 1> slope = j.transpose() * r;
    const double ridge = 1e-12 * (normal.trace() + 1e-300);
    bool better = false;
    double gain = 0;
    for (int attempt = 0; attempt < 8 && !better; ++attempt) {
      auto system = normal;
      for (int k = 0; k < kParameters; ++k) system(k, k) += damping * normal(k, k) + ridge;
      Candidate next = c;
      next.edit = moved(c.edit, -system.ldlt().solve(slope), p.size);
      settle(p, next, &shifted);
      if (next.cost < c.cost) {
        gain = (c.cost - next.cost) / c.cost;
        c = next;
        r = shifted;
        damping = std::max(damping * 0.1, 1e-12);
        better = true;
      } else {
        damping = std::min(damping * 10 + 1e-12, 1e6);
      }
    }
    if (!better || gain < 1e-9) break;
  }
  return c;
}

std::vector<Candidate> guesses(const SkeletonMotion& motion, const Vec3& centre, const Vec3& axis) {
  const Profile p = profileAlong(motion, centre, axis);
  if (p.s.size() < 2 || !(p.s.back() > p.s.front())) return {};
  BarrEdit base;
  base.pivot = centre;
  base.axis = axis;
  const Vec3 across = p.turn - axis.dot(p.turn) * axis;
  base.about = across.norm() > 1e-9 ? Vec3(across.normalized()) : anyPerpendicular(axis);
  std::vector<Candidate> out;
  const auto add = [&](BarrKind kind, const std::vector<double>& profile) {
    Candidate c;
    c.edit = base;
    c.edit.kind = kind;
    rangeOf(p.s, profile, c.edit.begin, c.edit.end);
    if (!(c.edit.end > c.edit.begin)) c.edit.begin = p.s.front(), c.edit.end = p.s.back();
    if (kind == BarrKind::Twist) c.edit.angle = p.turnAlong.back();
    if (kind == BarrKind::Bend) c.edit.angle = p.turnAcross.back();
    if (kind == BarrKind::Stretch) c.edit.factor[0] = std::clamp(1 + p.length.back() / (c.edit.end - c.edit.begin), 0.01, 100.0);
    if (kind == BarrKind::Taper) c.edit.factor.head<2>().setConstant(std::clamp(p.scale.back() / p.scale.front(), 0.01, 100.0));
    out.push_back(c);
  };
  add(BarrKind::Stretch, p.length);
  add(BarrKind::Taper, p.scale);
  add(BarrKind::Twist, p.turnAlong);
  add(BarrKind::Bend, p.turnAcross);
  return out;
}

Candidate scaleGuess(const Vec3& centre, const Mat3& axes, const Problem& p) {
  Candidate c;
  c.edit.kind = BarrKind::Scale;
  c.edit.pivot = centre;
  c.edit.axis = axes.col(2);
  c.edit.about = axes.col(0);
  c.edit.begin = -0.5 * p.size;
  c.edit.end = 0.5 * p.size;
  return c;
}

double plainCost(const Problem& p, const Candidate& c) {
  // Which kind is chosen: frames count as much as points do, or a twisted straight line would be as good as at rest.
  const BarrMap map(c.edit, c.turn, c.shift);
  double cost = 0;
  for (std::size_t i = 0; i < p.pairs.rest.size(); ++i) cost += (map.position(p.pairs.rest[i]) - p.pairs.posed[i]).squaredNorm();
  return cost;
}

}  // namespace

BarrFit fitBarr(const SkeletonMotion& motion, const BarrFitOptions& options) {
  const Problem p = detail::barrProblem(motion, kMostPairs);
  Mat3 axes = p.axes;
  if (axes.determinant() < 0) axes.col(0) = -axes.col(0);

  Candidate best = scaleGuess(p.centre, axes, p);
  best.edit.kind = BarrKind::Stretch;  // by 1: the rigid motion alone
  settle(p, best, nullptr);
  double least = plainCost(p, best);
  const double exact = 1e-24 * p.size * p.size * static_cast<double>(p.pairs.rest.size());
  BarrFit fit;
  fit.rigid = least <= exact && !options.kind;
  if (!fit.rigid) {
    std::vector<Candidate> starts{scaleGuess(p.centre, axes, p)};
    // The longest axis first: of equals the first is kept.
    for (int k = 2; k >= 0; --k)
      for (const Candidate& c : guesses(motion, p.centre, axes.col(k))) starts.push_back(c);
    std::stable_sort(starts.begin(), starts.end(), [](const Candidate& a, const Candidate& b) { return a.edit.kind < b.edit.kind; });
    for (const Candidate& start : starts) {
      if (options.kind && start.edit.kind != *options.kind) continue;
      const Candidate c = refine(p, start);
      const double cost = plainCost(p, c);
      if (cost * kSameFit * kSameFit < least) least = cost, best = c;
    }
  }
  fit.edit = best.edit;
  fit.turn = best.turn;
  fit.shift = best.shift;
  fit.pairs = p.pairs.own;
  const BarrMap map = fit.map();
  for (std::size_t i = 0; i < p.pairs.own; ++i) {
    const double miss = (map.position(p.pairs.rest[i]) - p.pairs.posed[i]).norm();
    fit.max = std::max(fit.max, miss);
    fit.rms += miss * miss / static_cast<double>(p.pairs.own);
  }
  fit.rms = std::sqrt(fit.rms);
  return fit;
}

}  // namespace fielddeform::map
