#include <fielddeform/core/parallel.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/map/detail/jet.h>
#include <fielddeform/map/skinning.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/spatial/simplex.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using detail::Jet;
using skeleton::Potential;
using skeleton::Primitive;
using skeleton::PrimitiveType;

constexpr double kNegligible = -40;  // exponent below the greatest weight's: under rounding

bool unclipped(Potential p) { return p == Potential::Exponential || p == Potential::Gaussian; }

Quat mean(const Quat& a, const Quat& b) {
  Quat q;
  q.coeffs() = a.coeffs() + (a.dot(b) < 0 ? -1 : 1) * b.coeffs();
  const double n = q.norm();
  return n > 1e-12 ? Quat(Eigen::Vector4d(q.coeffs() / n)) : a;
}

void addSegments(const SkeletonMotion& m, Index i, std::vector<Bone>& out) {
  const Primitive &rest = m.rest.primitives[i], &posed = m.posed.primitives[i];
  const auto& at = m.samples.set.vertexSample[i];
  const std::size_t n = rest.points.size();
  for (std::size_t v = 0; v + 1 < n + (rest.closed ? 1 : 0); ++v) {
    const std::size_t w = (v + 1) % n;
    Bone bone;
    bone.a = rest.points[v];
    bone.b = rest.points[w];
    bone.radius = 0.5 * (skeleton::radiusOf(rest, static_cast<Index>(v)) + skeleton::radiusOf(rest, static_cast<Index>(w)));
    bone.mass = std::max((bone.b - bone.a).norm() / bone.radius, 1e-12);
    const Quat turn = mean(m.samples.rotation[at[v]], m.samples.rotation[at[w]]);
    bone.rotation = (minimalRotation(turn * (bone.b - bone.a), posed.points[w] - posed.points[v]) * turn).normalized();
    bone.scale = 0.5 * (m.samples.scale[at[v]] + m.samples.scale[at[w]]);
    bone.centre = 0.5 * (bone.a + bone.b);
    bone.move = 0.5 * ((posed.points[v] - bone.a) + (posed.points[w] - bone.b));
    out.push_back(bone);
  }
}

void addPoints(const SkeletonMotion& m, Index i, std::vector<Bone>& out) {
  const Primitive &rest = m.rest.primitives[i], &posed = m.posed.primitives[i];
  for (Index v = 0; v < rest.points.size(); ++v) {
    const Index sample = m.samples.set.vertexSample[i][v];
    Bone bone;
    bone.a = bone.b = bone.centre = rest.points[v];
    bone.radius = skeleton::radiusOf(rest, v);
    if (rest.type == PrimitiveType::Mesh)
      bone.mass = std::max(m.samples.set.samples[sample].mass / (bone.radius * bone.radius), 1e-12);
    bone.rotation = m.samples.rotation[sample];
    bone.scale = m.samples.scale[sample];
    bone.move = posed.points[v] - rest.points[v];
    out.push_back(bone);
  }
}

void align(Quat& q, const Quat& with) {
  if (q.dot(with) < 0) q.coeffs() = -q.coeffs();
}

// Quaternions of one sign from neighbour to neighbour, so that their mean turns the short way between any two.
void alignSigns(const SkeletonMotion& m, Index i, std::size_t first, std::vector<Bone>& bones) {
  if (first > 0) {
    std::size_t nearest = 0;
    for (std::size_t b = 1; b < first; ++b)
      if ((bones[b].centre - bones[first].centre).squaredNorm() < (bones[nearest].centre - bones[first].centre).squaredNorm())
        nearest = b;
    align(bones[first].rotation, bones[nearest].rotation);
  }
  const Primitive& p = m.rest.primitives[i];
  if (p.type != PrimitiveType::Mesh) {
    for (std::size_t b = first + 1; b < bones.size(); ++b) align(bones[b].rotation, bones[b - 1].rotation);
    return;
  }
  std::vector<std::vector<Index>> next(p.points.size());
  for (const auto& face : p.faces)
    for (std::size_t k = 0; k < face.size(); ++k) {
      next[face[k]].push_back(face[(k + 1) % face.size()]);
      next[face[(k + 1) % face.size()]].push_back(face[k]);
    }
  std::vector<char> done(p.points.size(), 0);
  std::vector<Index> queue;
  for (Index start = 0; start < p.points.size(); ++start) {
    if (done[start]) continue;
    if (start > 0) align(bones[first + start].rotation, bones[first].rotation);
    done[start] = 1;
    queue.assign(1, start);
    for (std::size_t at = 0; at < queue.size(); ++at)
      for (const Index v : next[queue[at]]) {
        if (done[v]) continue;
        done[v] = 1;
        align(bones[first + v].rotation, bones[first + queue[at]].rotation);
        queue.push_back(v);
      }
  }
}

}  // namespace

std::vector<Bone> bonesOf(const SkeletonMotion& motion, Potential potential) {
  std::vector<Bone> bones;
  for (Index i = 0; i < motion.rest.primitives.size(); ++i) {
    const std::size_t first = bones.size();
    if (motion.rest.primitives[i].type == PrimitiveType::Polyline) addSegments(motion, i, bones);
    else addPoints(motion, i, bones);
    for (std::size_t b = first; b < bones.size(); ++b) bones[b].potential = motion.rest.primitives[i].potential.value_or(potential);
    alignSigns(motion, i, first, bones);
  }
  return bones;
}

SkinningMap::SkinningMap(std::vector<Bone> bones, const SkinOptions& options) : bones_(std::move(bones)), options_(options) {
  if (bones_.empty()) throw std::invalid_argument("bones: none, needs at least 1");
  for (const Potential p : {Potential::Exponential, Potential::Gaussian, Potential::Metaball, Potential::SoftObject})
    kernels_.emplace_back(p, options.sharpness);
  for (const Bone& b : bones_)
    if (!(b.radius > 0) || !(b.mass > 0) || !b.centre.allFinite() || !b.move.allFinite())
      throw std::invalid_argument("a bone has no positive radius and mass, or is not finite");
}

SkinningMap::SkinningMap(const SkeletonMotion& motion, const SkinOptions& options)
    : SkinningMap(bonesOf(motion, options.potential), options) {
  identity_ = motion.unedited;
}

void SkinningMap::weigh(const Vec3& rest, bool slopes, std::vector<Weight>& out) const {
  // Unclipped potentials by their exponents, the greatest of them taken off: they have a share at any distance.
  thread_local std::vector<double> exponent;
  exponent.resize(bones_.size());
  out.clear();
  double greatest = -std::numeric_limits<double>::infinity();
  const double k = options_.sharpness;
  const auto offsetOf = [&](const Bone& b) { return spatial::closestOnSegment(rest, b.a, b.b).offset; };
  for (std::size_t i = 0; i < bones_.size(); ++i) {
    const Bone& b = bones_[i];
    const double u = offsetOf(b).norm() / b.radius;
    if (unclipped(b.potential)) {
      exponent[i] = b.potential == Potential::Exponential ? -k * u : -k * u * u;
    } else {
      const double e = kernels_[static_cast<std::size_t>(b.potential)].value(k * u);
      exponent[i] = e > 0 ? numeric::log(e) : -std::numeric_limits<double>::infinity();
    }
    greatest = std::max(greatest, exponent[i]);
  }
  if (!std::isfinite(greatest)) return;
  double sum = 0;
  Vec3 sumSlope = Vec3::Zero();
  for (std::size_t i = 0; i < bones_.size(); ++i) {
    if (!(exponent[i] > greatest + kNegligible)) continue;
    const Bone& b = bones_[i];
    Weight w{static_cast<Index>(i), b.mass * numeric::exp(exponent[i] - greatest), Vec3::Zero()};
    if (slopes) {
      const Vec3 offset = offsetOf(b);
      const double d = offset.norm(), u = d / b.radius;
      double logSlope = 0;  // of the exponent by d
      if (b.potential == Potential::Exponential) logSlope = -k / b.radius;
      else if (b.potential == Potential::Gaussian) logSlope = -2 * k * u / b.radius;
      else {
        const field::Kernel& kernel = kernels_[static_cast<std::size_t>(b.potential)];
        logSlope = kernel.derivative(k * u) * k / b.radius / kernel.value(k * u);
      }
      if (d > 0) w.slope = (w.value * logSlope / d) * offset;
    }
    sum += w.value;
    sumSlope += w.slope;
    out.push_back(w);
  }
  for (Weight& w : out) {
    w.value /= sum;
    w.slope = (w.slope - w.value * sumSlope) / sum;
  }
}

std::vector<double> SkinningMap::weights(const Vec3& rest) const {
  std::vector<Weight> w;
  weigh(rest, false, w);
  std::vector<double> out(bones_.size(), 0.0);
  for (const Weight& x : w) out[x.bone] = x.value;
  return out;
}

// The displacement of a point that the bone carries.
Vec3 SkinningMap::moveOf(const Bone& b, const Vec3& rest) const {
  const Vec3 from = rest - b.centre;
  return b.move + (b.scale * (b.rotation * from) - from);
}

// The weights of all points, one after the other.
struct SkinningMap::Kept final : RestSide {
  struct Entry {
    Index bone;
    double value;
  };
  std::vector<std::size_t> start{0};  // #P + 1
  std::vector<Entry> entry;
};

std::vector<double> SkinningMap::restKey() const {
  std::vector<double> key{options_.sharpness};
  for (const Bone& b : bones_)
    key.insert(key.end(), {b.a.x(), b.a.y(), b.a.z(), b.b.x(), b.b.y(), b.b.z(), b.radius, b.mass, static_cast<double>(b.potential)});
  return key;
}

std::shared_ptr<RestSide> SkinningMap::keepRest(Points rest) const {
  constexpr std::size_t kGrain = 1024;
  std::vector<std::vector<Kept::Entry>> parts((rest.size() + kGrain - 1) / kGrain);
  std::vector<std::size_t> count(rest.size(), 0);
  parallelFor(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    std::vector<Weight> weights;
    for (std::size_t part = begin; part < end; ++part)
      for (std::size_t p = part * kGrain; p < std::min((part + 1) * kGrain, rest.size()); ++p) {
        if (!rest[p].allFinite()) continue;
        weigh(rest[p], false, weights);
        count[p] = weights.size();
        for (const Weight& w : weights) parts[part].push_back({w.bone, w.value});
      }
  });
  auto kept = std::make_shared<Kept>();
  for (const std::size_t n : count) kept->start.push_back(kept->start.back() + n);
  kept->entry.reserve(kept->start.back());
  for (auto& part : parts) {
    kept->entry.insert(kept->entry.end(), part.begin(), part.end());
    part = {};
  }
  return kept;
}

Vec3 SkinningMap::displacementOf(const RestSide& side, std::size_t i, const Vec3& rest) const {
  if (identity_) return Vec3::Zero();
  const auto& kept = static_cast<const Kept&>(side);
  return blended(std::span(kept.entry).subspan(kept.start[i], kept.start[i + 1] - kept.start[i]), rest);
}

Vec3 SkinningMap::displacement(const Vec3& rest) const {
  if (identity_) return Vec3::Zero();
  thread_local std::vector<Weight> weights;
  weigh(rest, false, weights);
  return blended(weights, rest);
}

template <class Weights>
Vec3 SkinningMap::blended(const Weights& weights, const Vec3& rest) const {
  Vec3 sum = Vec3::Zero();
  if (options_.blend == SkinBlend::Linear) {
    for (const auto& w : weights) sum += w.value * moveOf(bones_[w.bone], rest);
    return sum;
  }
  // In coordinates whose origin is the point, the blended motion's translation is its displacement.
  Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = Eigen::Vector4d::Zero();
  for (const auto& w : weights) {
    const Quat& q = bones_[w.bone].rotation;
    const Vec3 t = moveOf(bones_[w.bone], rest);
    real += w.value * q.coeffs();
    dual += w.value * (Quat(0, 0.5 * t.x(), 0.5 * t.y(), 0.5 * t.z()) * q).coeffs();
  }
  const double n = real.squaredNorm();
  if (!(n > 1e-24)) return sum;
  return 2 / n * (Quat(dual) * Quat(real).conjugate()).vec();
}

Mat3 SkinningMap::jacobian(const Vec3& rest) const {
  Mat3 j = Mat3::Identity();
  if (identity_) return j;
  std::vector<Weight> weights;
  weigh(rest, true, weights);
  const auto turnOf = [&](const Bone& b) -> Mat3 { return b.scale * b.rotation.toRotationMatrix() - Mat3::Identity(); };
  if (options_.blend == SkinBlend::Linear) {
    for (const Weight& w : weights) {
      const Bone& b = bones_[w.bone];
      j += w.value * turnOf(b) + moveOf(b, rest) * w.slope.transpose();
    }
    return j;
  }
  std::array<Jet, 4> real{}, dual{};  // x, y, z, w
  for (const Weight& w : weights) {
    const Bone& b = bones_[w.bone];
    const Quat& q = b.rotation;
    const Vec3 t = moveOf(b, rest);
    const Mat3 turn = turnOf(b);
    const Eigen::Vector4d d = (Quat(0, 0.5 * t.x(), 0.5 * t.y(), 0.5 * t.z()) * q).coeffs();
    std::array<Eigen::Vector4d, 3> dd;
    for (int k = 0; k < 3; ++k) dd[k] = (Quat(0, 0.5 * turn(0, k), 0.5 * turn(1, k), 0.5 * turn(2, k)) * q).coeffs();
    for (int c = 0; c < 4; ++c) {
      real[c] = real[c] + Jet{w.value * q.coeffs()[c], q.coeffs()[c] * w.slope};
      dual[c] = dual[c] + Jet{w.value * d[c], d[c] * w.slope + w.value * Vec3(dd[0][c], dd[1][c], dd[2][c])};
    }
  }
  j += detail::translationOf(real, dual).j;
  return j;
}

}  // namespace fielddeform::map
