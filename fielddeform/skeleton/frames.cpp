#include <Eigen/SVD>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/numeric/rotation.h>
#include <fielddeform/skeleton/frames.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace fielddeform::skeleton {
namespace {

// Sum of a (p - p*)(q - q*)^T over some samples, masses as weights.
Mat3 covariance(const SampledPair& s, std::span<const Index> samples) {
  double mass = 0;
  Vec3 p = Vec3::Zero(), q = Vec3::Zero();
  for (const Index j : samples) {
    const double a = s.set.samples[j].mass;
    mass += a;
    p += a * s.rest[j];
    q += a * s.posed[j];
  }
  if (!(mass > 0)) return Mat3::Zero();
  p /= mass;
  q /= mass;
  Mat3 c = Mat3::Zero();
  for (const Index j : samples) c += s.set.samples[j].mass * (s.rest[j] - p) * (s.posed[j] - q).transpose();
  return c;
}

Quat fit(const Mat3& c) { return Quat(numeric::kabsch(c)).normalized(); }

Quat fitTowards(const Mat3& c, double share, const Quat& prior) {
  return fit(c + share * c.norm() * prior.toRotationMatrix().transpose());
}

// The best rotation of a vertex's ring. A flat ring says how its plane turns as exactly as its second singular value is
// large: the prior has a share of that, not of the whole, or it would decide how slivers turn about their long edges (the
// triangles around a pole by up to half the bend, each about another edge: a fold in everything that they carry).
Quat fitRing(const Mat3& c, const Quat& prior) {
  constexpr double kShare = 0.01, kSurely = 1e-9;  // of a ring as wide as it is long; of any
  const double size = c.norm();
  if (!(size > 0)) return prior;
  const Mat3 unit = c / size;
  const double second = std::sqrt(unit.col(0).cross(unit.col(1)).squaredNorm() + unit.col(1).cross(unit.col(2)).squaredNorm() +
                                  unit.col(2).cross(unit.col(0)).squaredNorm());
  return fitTowards(unit, 2 * kShare * second + kSurely, prior);
}

// Unit tangents along a chain; a sample between coincident neighbours takes the previous tangent.
std::vector<Vec3> tangents(const std::vector<Vec3>& points, const std::vector<Index>& chain, bool closed) {
  const std::size_t n = chain.size();
  const auto direction = [&](std::size_t a, std::size_t b) -> Vec3 {
    const Vec3 d = points[chain[b]] - points[chain[a]];
    const double l = d.norm();
    return l > 0 ? Vec3(d / l) : Vec3::Zero();
  };
  std::vector<Vec3> t(n, Vec3::Zero());
  for (std::size_t j = 0; j < n; ++j) {
    const bool first = j == 0 && !closed, last = j + 1 == n && !closed;
    const Vec3 in = first ? Vec3::Zero() : direction((j + n - 1) % n, j);
    const Vec3 out = last ? Vec3::Zero() : direction(j, (j + 1) % n);
    Vec3 sum = in + out;
    if (sum.squaredNorm() < 1e-20) sum = out.squaredNorm() > 0 ? out : in;
    if (sum.squaredNorm() > 0) t[j] = sum.normalized();
    else if (j > 0) t[j] = t[j - 1];
  }
  for (std::size_t j = n; j-- > 1;)
    if (t[j - 1].squaredNorm() == 0) t[j - 1] = t[j];
  return t;
}

double rollOf(const Primitive& p, const Sample& s) {
  if (p.roll.empty()) return 0;
  double roll = 0;
  for (int k = 0; k < 3; ++k)
    if (s.vertex[k] != kNoIndex) roll += s.weight[k] * p.roll[s.vertex[k]];
  return roll;
}

Quat turnAbout(const Vec3& axis, double angle) { return Quat(Eigen::AngleAxisd(angle, axis)); }

// Transported all the way round, a closed line comes back turned about its tangent; spread that turn along it.
void closeLoop(std::vector<Quat>& r, const std::vector<Vec3>& t0, const std::vector<Vec3>& t1, std::size_t root,
               const std::vector<double>& arc, double length) {
  const std::size_t n = r.size(), before = (root + n - 1) % n;
  const Quat back = minimalRotation(t1[before], t1[root]) * r[before] * minimalRotation(t0[before], t0[root]).conjugate();
  const Quat gap = r[root] * back.conjugate();
  double angle = 2 * std::atan2(gap.vec().dot(t1[root]), gap.w());
  if (angle > std::numbers::pi) angle -= 2 * std::numbers::pi;
  if (angle < -std::numbers::pi) angle += 2 * std::numbers::pi;
  for (std::size_t k = 1; k < n; ++k) {
    const std::size_t j = (root + k) % n;
    double s = arc[j] - arc[root];
    if (s < 0) s += length;
    r[j] = turnAbout(t1[j], angle * s / length) * r[j];
  }
}

// How far a line's bends tell its spin, in [0, 1]: 1 for a rigid motion of a line that is not straight; near 0 if the
// line is straight, or if it was bent by more than a fifth of its own deviation from straight.
double spinEvidence(const SampledPair& s, const std::vector<Index>& chain, const Quat& whole) {
  Vec3 p = Vec3::Zero(), q = Vec3::Zero();
  double mass = 0;
  for (const Index j : chain) {
    mass += s.set.samples[j].mass;
    p += s.set.samples[j].mass * s.rest[j];
    q += s.set.samples[j].mass * s.posed[j];
  }
  if (!(mass > 0)) return 0;
  p /= mass;
  q /= mass;
  Mat3 spread = Mat3::Zero();
  double misfit = 0;
  for (const Index j : chain) {
    const Vec3 x = s.rest[j] - p;
    spread += s.set.samples[j].mass * x * x.transpose();
    misfit += s.set.samples[j].mass * (s.posed[j] - q - whole * x).squaredNorm();
  }
  const double across = spread.trace() - Eigen::JacobiSVD<Mat3>(spread).singularValues()[0];
  if (!(across > 1e-12 * spread.trace())) return 0;
  const double ratio = 25 * misfit / across;
  return 1 / (1 + ratio * ratio);
}

// A line alone does not say how its frames are turned about it. They take the smallest rotations over the whole line, as
// far as its bends do not tell. (A slightly curved spine that is bent another way would else be spun by up to half a
// turn, to lay the slight curve over the new one.)
void settleSpin(const SampledPair& s, const std::vector<Index>& chain, const std::vector<Vec3>& t1, std::size_t root,
                double evidence, std::vector<Quat>& r) {
  double c = 0, sn = 0, mass = 0;
  for (std::size_t j = 0; j < r.size(); ++j) {
    // trace of turn(t, phi) R = const + 2 (w^2 - u^2) cos phi - 4 w u sin phi, for R = (w, v), u = t . v
    const double a = s.set.samples[chain[j]].mass, w = r[j].w(), u = t1[j].dot(r[j].vec());
    mass += a;
    c += a * 2 * (w * w - u * u);
    sn -= a * 4 * w * u;
  }
  if (!(mass > 0)) return;
  const Mat3 m = r[root].toRotationMatrix() * covariance(s, chain);
  const Vec3& t = t1[root];
  const double c1 = m.trace() - t.dot(m * t);
  const double s1 = t.dot(Vec3(m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0)));
  const double amplitude = std::hypot(c1, s1);
  const double known = amplitude > 0 ? evidence / amplitude : 0, rest = (1 - evidence) / (2 * mass);
  const double phi = std::atan2(known * s1 + rest * sn, known * c1 + rest * c);
  if (phi == 0) return;
  for (std::size_t j = 0; j < r.size(); ++j) r[j] = (turnAbout(t1[j], phi) * r[j]).normalized();
}

void fitLine(SampledPair& s, Index i, const Primitive& rest, const Primitive& posed, bool alone) {
  const auto& chain = s.set.chain[i];
  const std::size_t n = chain.size();
  const std::vector<Vec3> t0 = tangents(s.rest, chain, rest.closed), t1 = tangents(s.posed, chain, rest.closed);
  const Quat whole = fitTowards(covariance(s, chain), 0.02, s.global);
  std::size_t root = 0;
  double best = -2;
  for (std::size_t j = 0; j < n; ++j) {
    const double c = t1[j].dot(whole * t0[j]);
    if (c > best + 1e-12) best = c, root = j;
  }
  std::vector<Quat> r(n);
  r[root] = minimalRotation(whole * t0[root], t1[root]) * whole;
  const auto carry = [&](std::size_t from, std::size_t to) {
    r[to] = (minimalRotation(t1[from], t1[to]) * r[from] * minimalRotation(t0[from], t0[to]).conjugate()).normalized();
  };
  if (rest.closed) {
    for (std::size_t k = 1; k < n; ++k) carry((root + k - 1) % n, (root + k) % n);
    std::vector<double> arc(n, 0.0);
    double length = 0;
    for (std::size_t j = 0; j < n; ++j) {
      arc[j] = length;
      length += (s.rest[chain[(j + 1) % n]] - s.rest[chain[j]]).norm();
    }
    if (n > 1 && length > 0) closeLoop(r, t0, t1, root, arc, length);
  } else {
    for (std::size_t j = root; j + 1 < n; ++j) carry(j, j + 1);
    for (std::size_t j = root; j > 0; --j) carry(j, j - 1);
    if (const double evidence = alone ? spinEvidence(s, chain, whole) : 1; evidence < 1)
      settleSpin(s, chain, t1, root, evidence, r);
  }
  for (std::size_t j = 0; j < n; ++j) {
    const Sample& sample = s.set.samples[chain[j]];
    const double roll = rollOf(posed, sample) - rollOf(rest, sample);
    s.rotation[chain[j]] = roll == 0 ? r[j] : (turnAbout(t1[j], roll) * r[j]).normalized();
  }
}

void fitMesh(SampledPair& s, Index i, const Primitive& rest) {
  const auto& at = s.set.vertexSample[i];
  std::vector<Mat3> c(at.size(), Mat3::Zero());
  const auto edge = [&](Index a, Index b) {
    const Mat3 e = (s.rest[at[b]] - s.rest[at[a]]) * (s.posed[at[b]] - s.posed[at[a]]).transpose();
    c[a] += e;
    c[b] += e;
  };
  for (const auto& face : rest.faces)
    for (std::size_t k = 0; k < face.size(); ++k) edge(face[k], face[(k + 1) % face.size()]);
  for (std::size_t v = 0; v < at.size(); ++v) s.rotation[at[v]] = fitRing(c[v], s.global);
  for (std::size_t j = 0; j < s.set.samples.size(); ++j) {
    const Sample& sample = s.set.samples[j];
    if (sample.primitive != i || sample.vertex[1] == kNoIndex) continue;
    // Carried by the corners' own motions, a coarse cage bends space along an arc, not along its chords.
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    Vec3 posed = Vec3::Zero();
    const Quat& first = s.rotation[at[sample.vertex[0]]];
    for (int k = 0; k < 3; ++k) {
      const Index v = at[sample.vertex[k]];
      const Quat& q = s.rotation[v];
      sum += (q.dot(first) < 0 ? -sample.weight[k] : sample.weight[k]) * q.coeffs();
      posed += sample.weight[k] * (s.posed[v] + q * (s.rest[j] - s.rest[v]));
    }
    s.posed[j] = posed;
    s.rotation[j] = sum.norm() > 0 ? Quat(sum.normalized()) : first;
  }
}

// A thin primitive's own frames know nothing of its neighbours' turn, and one round keeps a share of them: the four-line
// twist by a full turn goes from a mean error of .038 to .021 in four.
constexpr int kTogetherRounds = 4;

// Second stage: neighbouring samples of all primitives together decide what one thin primitive cannot.
class Neighbourhoods {
 public:
  explicit Neighbourhoods(const SampledPair& s) : s_(s), order_(s.rest.size()), key_(s.rest.size()) {
    // Sorted along the longest axis, the samples in reach of one are a run.
    Box box;
    for (const Vec3& p : s.rest) box.extend(p);
    int axis = 0;
    box.sizes().maxCoeff(&axis);
    std::iota(order_.begin(), order_.end(), Index{0});
    std::stable_sort(order_.begin(), order_.end(), [&](Index a, Index b) { return s.rest[a][axis] < s.rest[b][axis]; });
    for (std::size_t k = 0; k < key_.size(); ++k) key_[k] = s.rest[order_[k]][axis];
    for (const Sample& sample : s.set.samples) reach_ = std::max(reach_, kReach * sample.radius);
    axis_ = axis;
  }

  std::vector<Quat> fitTogether() const {
    std::vector<Quat> out(s_.rest.size());
    parallelFor(out.size(), 16, [&](std::size_t begin, std::size_t end) {
      for (std::size_t j = begin; j < end; ++j) out[j] = fitAt(j);
    });
    return out;
  }

 private:
  static constexpr double kReach = 36 / 8.0;  // radii; exp(-36) is below rounding

  Quat fitAt(std::size_t j) const {
    double mass = 0;
    Mat3 c = Mat3::Zero();
    const auto first = std::lower_bound(key_.begin(), key_.end(), s_.rest[j][axis_] - reach_) - key_.begin();
    for (std::size_t k = static_cast<std::size_t>(first); k < key_.size() && key_[k] <= s_.rest[j][axis_] + reach_; ++k) {
      const Index m = order_[k];
      const Vec3 p = s_.rest[m] - s_.rest[j];
      const double radius = s_.set.samples[m].radius, reach = kReach * radius, d2 = p.squaredNorm();
      if (d2 > reach * reach) continue;
      const double w = s_.set.samples[m].mass * numeric::exp(-8 * std::sqrt(d2) / radius);
      mass += w;
      c += w * p * (s_.posed[m] - s_.posed[j]).transpose();
    }
    if (mass > 0) c /= mass;
    if (c.norm() == 0) return s_.rotation[j];
    const Vec3 sigma = Eigen::JacobiSVD<Mat3>(c).singularValues();
    return fit(c + (0.3 * sigma[1] + 1e-9 * c.norm()) * s_.rotation[j].toRotationMatrix().transpose());
  }

  const SampledPair& s_;
  std::vector<Index> order_;
  std::vector<double> key_;
  double reach_ = 0;
  int axis_ = 0;
};

}  // namespace

void fitFrames(SampledPair& pair, const Skeleton& restSkeleton, const Skeleton& posedSkeleton) {
  const std::size_t n = pair.rest.size();
  std::vector<Index> all(n);
  for (std::size_t j = 0; j < n; ++j) all[j] = static_cast<Index>(j);
  pair.global = fit(covariance(pair, all));
  pair.rotation.assign(n, pair.global);
  bool together = restSkeleton.primitives.size() > 1;
  for (Index i = 0; i < restSkeleton.primitives.size(); ++i) {
    const Primitive &rest = restSkeleton.primitives[i], &posed = posedSkeleton.primitives[i];
    if (rest.type == PrimitiveType::Polyline && pair.set.chain[i].size() > 1) fitLine(pair, i, rest, posed, restSkeleton.primitives.size() == 1);
    if (rest.type == PrimitiveType::Mesh) fitMesh(pair, i, rest);
    if (rest.type == PrimitiveType::Points) {
      const Quat own = posed.rotation ? *posed.rotation * rest.rotation.value_or(Quat::Identity()).conjugate() : pair.global;
      for (const Index j : pair.set.vertexSample[i]) pair.rotation[j] = own.normalized();
      together = together || (rest.points.size() > 1 && !posed.rotation);
    }
  }
  if (!together) return;
  const Neighbourhoods neighbourhoods(pair);
  for (int k = 0; k < kTogetherRounds; ++k) pair.rotation = neighbourhoods.fitTogether();
}

}  // namespace fielddeform::skeleton
