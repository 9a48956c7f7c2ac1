// Levenberg-Marquardt over the parameters of up to four deformations at once, the rigid motion eliminated; derivatives by
// differences.
#include <fielddeform/map/barr_fit.h>
#include <fielddeform/map/chain.h>
#include <fielddeform/map/detail/barr_profile.h>
#include <fielddeform/numeric/elementary.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace fielddeform::map {
namespace {

constexpr std::size_t kMostPairs = 600;
constexpr double kSameFit = 1.05;   // a less simple sequence must be better than this
constexpr int kIterations = 80;

using Problem = detail::BarrProblem;

struct Sequence {
  std::vector<BarrEdit> edits;
  detail::RigidFit rigid;
};

// Images of the rest points, from the pivot.
std::vector<Vec3> imagesOf(const Problem& p, const std::vector<BarrEdit>& edits) {
  std::vector<BarrMap> maps;
  for (const BarrEdit& e : edits) maps.emplace_back(e);
  std::vector<Vec3> x(p.pairs.rest);
  const Vec3 pivot = edits.front().pivot;
  for (Vec3& at : x) {
    for (const BarrMap& map : maps) at = map.position(at);
    at -= pivot;
  }
  return x;
}

void settle(const Problem& p, Sequence& s, Eigen::VectorXd* residual) {
  s.rigid = detail::fitRigid(p.pairs, imagesOf(p, s.edits), s.edits.front().pivot, residual);
}

int amounts(BarrKind kind) { return kind == BarrKind::Scale ? 3 : kind == BarrKind::Taper ? 2 : 1; }
int ranges(BarrKind kind) { return kind == BarrKind::Scale ? 0 : 2; }

int parameterCount(const std::vector<BarrEdit>& edits) {
  int n = 5;
  for (const BarrEdit& e : edits) n += ranges(e.kind) + amounts(e.kind);
  return n;
}

// Moved by small parameters: tilt of the axis (2), turn of about, pivot across (2), then of each edit its range and amounts.
std::vector<BarrEdit> moved(const std::vector<BarrEdit>& edits, const Eigen::VectorXd& d, double size) {
  std::vector<BarrEdit> out = edits;
  const BarrEdit& first = edits.front();
  const Vec3 second = first.axis.cross(first.about);
  const Vec3 axis = (first.axis + d[0] * first.about + d[1] * second).normalized();
  const Vec3 about = first.about + d[2] * second;
  const auto grow = [](double& f, double by) { f = std::clamp(f * numeric::exp(by), 1e-6, 1e6); };
  Eigen::Index at = 5;
  for (BarrEdit& e : out) {
    e.axis = axis;
    e.about = (about - axis.dot(about) * axis).normalized();
    e.pivot = first.pivot + size * (d[3] * first.about + d[4] * second);
    if (ranges(e.kind) > 0) {
      e.begin += d[at] * size;
      e.end = std::max(e.end + d[at + 1] * size, e.begin + 1e-6 * size);
      at += 2;
    }
    if (e.kind == BarrKind::Twist || e.kind == BarrKind::Bend) e.angle += d[at++];
    else
      for (int k = 0; k < amounts(e.kind); ++k) grow(e.factor[k], d[at++]);
  }
  return out;
}

Sequence refine(const Problem& p, Sequence s) {
  const auto n = static_cast<Eigen::Index>(3 * p.pairs.rest.size());
  const Eigen::Index m = parameterCount(s.edits);
  Eigen::VectorXd r(n), forward(n), backward(n);
  Eigen::MatrixXd j(n, m);
  settle(p, s, &r);
  double damping = 1e-4;
  for (int iteration = 0; iteration < kIterations && s.rigid.cost > 0; ++iteration) {
    constexpr double kStep = 1e-6;
    for (Eigen::Index k = 0; k < m; ++k) {
      const Eigen::VectorXd d = kStep * Eigen::VectorXd::Unit(m, k);
      Sequence a{moved(s.edits, d, p.size), {}}, b{moved(s.edits, -d, p.size), {}};
      settle(p, a, &forward);
      settle(p, b, &backward);
      j.col(k) = (forward - backward) / (2 * kStep);
    }
    const Eigen::MatrixXd normal = j.transpose() * j;
    const Eigen::VectorXd slope = j.transpose() * r;
    const double ridge = 1e-12 * (normal.trace() + 1e-300);
    double gain = 0;
    for (int attempt = 0; attempt < 8; ++attempt) {
      Eigen::MatrixXd system = normal;
      for (Eigen::Index k = 0; k < m; ++k) system(k, k) += damping * normal(k, k) + ridge;
      Sequence next{moved(s.edits, -system.ldlt().solve(slope), p.size), {}};
      settle(p, next, &forward);
      if (next.rigid.cost < s.rigid.cost) {
        gain = (s.rigid.cost - next.rigid.cost) / s.rigid.cost;
        s = std::move(next);
        r = forward;
        damping = std::max(damping * 0.1, 1e-12);
        break;
      }
      damping = std::min(damping * 10 + 1e-12, 1e6);
    }
    if (gain < 1e-9) break;
  }
  return s;
}

// Which sequence is chosen: frames count as much as points do, or a twisted straight line would be as good as at rest.
double plainCost(const Problem& p, const Sequence& s) {
  const std::vector<Vec3> x = imagesOf(p, s.edits);
  double cost = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    cost += (s.rigid.turn * x[i] + s.rigid.shift - (p.pairs.posed[i] - s.edits.front().pivot)).squaredNorm();
  return cost;
}

// The profile's place where the axis passes the centre.
double lengthAtCentre(const detail::Profile& p) {
  std::size_t nearest = 0;
  for (std::size_t i = 1; i < p.s.size(); ++i)
    if (std::abs(p.s[i]) < std::abs(p.s[nearest])) nearest = i;
  return p.length[nearest];
}

std::optional<Sequence> guess(const SkeletonMotion& motion, const Vec3& centre, const Vec3& axis, BarrKind lengthwise) {
  const detail::Profile p = detail::profileAlong(motion, centre, axis);
  if (p.s.size() < 2 || !(p.s.back() > p.s.front())) return std::nullopt;
  BarrEdit base;
  base.pivot = centre;
  base.axis = axis;
  base.about = p.bendTotal.norm() > 1e-9 ? Vec3(p.bendTotal.normalized()) : anyPerpendicular(axis);
  base.about = (base.about - axis.dot(base.about) * axis).normalized();
  const double rest = p.s.back() - p.s.front(), longer = std::clamp(1 + p.length.back() / rest, 0.01, 100.0);
  const double wider = std::clamp(p.scale.front(), 0.01, 100.0);
  // Where slices lie once the space is scaled or stretched along the axis.
  std::vector<double> s = p.s;
  for (std::size_t i = 0; i < s.size(); ++i) s[i] = lengthwise == BarrKind::Scale ? longer * s[i] : s[i] + p.length[i] - lengthAtCentre(p);
  Sequence out;
  const auto add = [&](BarrKind kind, const std::vector<double>& along, const std::vector<double>& profile) {
    BarrEdit e = base;
    e.kind = kind;
    detail::rangeOf(along, profile, e.begin, e.end);
    if (!(e.end > e.begin)) e.begin = along.front(), e.end = along.back();
    if (!(e.end > e.begin)) e.end = e.begin + 1;
    if (kind == BarrKind::Scale) e.factor = Vec3(wider, wider, longer), e.begin = p.s.front(), e.end = p.s.back();
    if (kind == BarrKind::Stretch) e.factor[0] = std::clamp(1 + p.length.back() / (e.end - e.begin), 0.01, 100.0);
    if (kind == BarrKind::Taper) e.factor.head<2>().setConstant(std::clamp(p.scale.back() / p.scale.front(), 0.01, 100.0));
    if (kind == BarrKind::Twist) e.angle = p.turnAlong.back();
    if (kind == BarrKind::Bend) e.angle = p.bend.back();
    out.edits.push_back(e);
  };
  add(lengthwise, p.s, p.length);
  add(BarrKind::Taper, s, p.scale);
  add(BarrKind::Twist, s, p.turnAlong);
  add(BarrKind::Bend, s, p.bend);
  return out;
}

bool isNothing(const BarrEdit& e) {
  switch (e.kind) {
    case BarrKind::Twist:
    case BarrKind::Bend: return std::abs(e.angle) < 1e-6;
    case BarrKind::Stretch: return std::abs(e.factor[0] - 1) < 1e-6;
    case BarrKind::Taper: return (e.factor.head<2>().array() - 1).abs().maxCoeff() < 1e-6;
    case BarrKind::Scale: return (e.factor.array() - 1).abs().maxCoeff() < 1e-6;
  }
  return false;
}

// Leaves out, one after the other, what the fit is as good without.
Sequence simplified(const Problem& p, Sequence s, double exact) {
  for (std::size_t k = 0; k < s.edits.size() && s.edits.size() > 1;) {
    Sequence less = s;
    less.edits.erase(less.edits.begin() + static_cast<std::ptrdiff_t>(k));
    if (!isNothing(s.edits[k])) less = refine(p, std::move(less));
    else settle(p, less, nullptr);
    if (plainCost(p, less) <= kSameFit * kSameFit * plainCost(p, s) + exact) s = std::move(less);
    else ++k;
  }
  return s;
}

}  // namespace

std::shared_ptr<const SpaceMap> BarrSequence::map() const {
  std::vector<std::shared_ptr<const SpaceMap>> maps;
  for (std::size_t k = 0; k < edits.size(); ++k)
    maps.push_back(k + 1 < edits.size() ? std::make_shared<BarrMap>(edits[k]) : std::make_shared<BarrMap>(edits[k], turn, shift));
  return std::make_shared<Chain>(std::move(maps));
}

BarrSequence fitBarrSequence(const SkeletonMotion& motion) {
  const Problem p = detail::barrProblem(motion, kMostPairs);
  const Vec3 axis = p.axes.col(2);
  BarrEdit still;
  still.kind = BarrKind::Stretch;
  still.pivot = p.centre;
  Sequence best{{still}, {}};
  settle(p, best, nullptr);
  double least = plainCost(p, best);
  const double exact = 1e-20 * p.size * p.size * static_cast<double>(p.pairs.rest.size());
  for (const BarrKind lengthwise : {BarrKind::Scale, BarrKind::Stretch}) {
    const auto start = guess(motion, p.centre, axis, lengthwise);
    if (!start || least <= exact) continue;
    Sequence s = refine(p, *start);
    const double cost = plainCost(p, s);
    if (cost * kSameFit * kSameFit < least) least = cost, best = std::move(s);
  }
  best = simplified(p, std::move(best), exact);
  BarrSequence out;
  out.edits = best.edits;
  out.turn = best.rigid.turn;
  out.shift = best.rigid.shift;
  out.pairs = p.pairs.own;
  const std::vector<Vec3> x = imagesOf(p, out.edits);
  for (std::size_t i = 0; i < p.pairs.own; ++i) {
    const double miss = (out.turn * x[i] + out.shift - (p.pairs.posed[i] - out.edits.front().pivot)).norm();
    out.max = std::max(out.max, miss);
    out.rms += miss * miss / static_cast<double>(p.pairs.own);
  }
  out.rms = std::sqrt(out.rms);
  return out;
}

}  // namespace fielddeform::map
