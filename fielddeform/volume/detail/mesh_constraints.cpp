#include <fielddeform/volume/detail/constraints.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kU[6] = {0, 1, 2, 1, 0, 0}, kV[6] = {0, 1, 2, 2, 2, 1};

/// What the moments of a region ask for: centre (3), then spread (6), as far as they are set.
Eigen::Index countOf(const MomentTarget& m) { return (m.centre ? 3 : 0) + (m.spread ? 6 : 0); }

void momentValues(const MomentTarget& m, const Totals<double>& t, const Vec3& origin, double size, double* c) {
  const Vec3 mean = Vec3(t.first[0], t.first[1], t.first[2]) / t.volume;
  if (m.centre)
    for (int k = 0; k < 3; ++k) *c++ = (mean[k] - ((*m.centre)[k] - origin[k])) / size;
  if (m.spread)
    for (std::size_t k = 0; k < 6; ++k) {
      const auto u = static_cast<int>(kU[k]), v = static_cast<int>(kV[k]);
      *c++ = (t.second[k] / t.volume - mean[u] * mean[v] - (*m.spread)(u, v)) / (size * size);
    }
}

/// Adds the weight of multiplier . c. Off-diagonal entries count once in c and twice in a symmetric W : dS, hence the halves.
template <class T>
TotalsWeight<T> momentWeight(const MomentTarget& m, const Totals<T>& t, double size, const double* multiplier) {
  TotalsWeight<T> w;
  const T v = t.volume;
  const Triple<T> mean{t.first[0] / v, t.first[1] / v, t.first[2] / v};
  if (m.centre) {
    for (std::size_t k = 0; k < 3; ++k) {
      const T l = T(multiplier[k] / size) / v;
      w.first[k] += l;
      w.volume += T(-1.0) * l * mean[k];
    }
    multiplier += 3;
  }
  if (m.spread) {
    std::array<T, 6> lambda;
    for (std::size_t k = 0; k < 6; ++k) lambda[k] = T(multiplier[k] / (size * size) * (k < 3 ? 1 : 0.5));
    const Triple<T> lm = times(lambda, mean);
    T inner{};
    for (std::size_t k = 0; k < 6; ++k) {
      w.second[k] += lambda[k] / v;
      inner += lambda[k] * t.second[k] * T(k < 3 ? 1.0 : 2.0);
    }
    for (std::size_t k = 0; k < 3; ++k) w.first[k] += T(-2.0) * lm[k] / v;
    w.volume += T(-1.0) * inner / (v * v) + T(2.0) * dot(mean, lm) / v;
  }
  return w;
}

}  // namespace

MeshConstraints::MeshConstraints(const MeshModel& model, std::vector<VolumeTarget> volumes, std::vector<MomentTarget> moments, double size)
    : model_(model), volumes_(std::move(volumes)), moments_(std::move(moments)), size_(size), nodes_(model.nodes()) {
  count_ = static_cast<Eigen::Index>(volumes_.size());
  volume_.assign(volumes_.size(), 0.0);
  for (const MomentTarget& m : moments_) count_ += countOf(m);
}

void NodeConstraints::weightedGradient(Points d, const std::function<Vector(const Vector&)>& weights, Vector& c, std::span<Vec3> out) {
  Matrix jacobian;
  derivatives(d, c, jacobian);
  Eigen::Map<Vector>(out[0].data(), static_cast<Eigen::Index>(3 * out.size())) = jacobian * weights(c);
}

const std::vector<Vec3>& MeshConstraints::positions(Points d) {
  if (x_.empty() || !std::equal(d.begin(), d.end(), at_.begin(), at_.end())) {
    model_.positions(d, x_);
    at_.assign(d.begin(), d.end());
    known_ = gradientKnown_ = false;
  }
  return x_;
}

std::vector<Vec3> MeshConstraints::takePositions(Points d) {
  positions(d);
  std::vector<Vec3> out;
  out.swap(x_);
  return out;
}

std::optional<double> MeshConstraints::knownVolume(Points d, std::size_t region) const {
  if (!known_ || x_.empty() || !std::equal(d.begin(), d.end(), at_.begin(), at_.end())) return {};
  for (std::size_t k = 0; k < volumes_.size(); ++k)
    if (volumes_[k].region == region) return volume_[k];
  return {};
}

void MeshConstraints::values(Points d, Vector& c) {
  positions(d);
  if (known_) {
    c = c_;
    return;
  }
  ++evaluations;
  c.resize(count_);
  Eigen::Index k = 0;
  for (const VolumeTarget& v : volumes_) {
    volume_[static_cast<std::size_t>(k)] = model_.volume().value(x_, v.region);
    c[k] = (volume_[static_cast<std::size_t>(k)] - v.target) / v.scale;
    ++k;
  }
  for (const MomentTarget& m : moments_) {
    momentValues(m, regionTotals(model_.volume(), x_, m.region), model_.volume().centre(m.region), size_, c.data() + k);
    k += countOf(m);
  }
  c_ = c, known_ = true;
}

void MeshConstraints::column(std::size_t region, Points g, Matrix& jacobian, Eigen::Index k) const {
  model_.gatherRegion(g, region, {reinterpret_cast<Vec3*>(jacobian.col(k).data()), model_.nodes()});
}

void MeshConstraints::singleGradient(Points d, Vector& c) {
  positions(d);
  const VolumeTarget& v = volumes_[0];
  if (!gradientKnown_) {
    ++evaluations;
    g_.resize(model_.volume().vertices(v.region).size());
    volume_[0] = model_.volume().valueAndGradient(x_, v.region, g_, scratch_);
    gradient_.resize(model_.nodes());
    model_.gatherRegion(g_, v.region, gradient_);
  }
  c = Vector::Constant(1, (volume_[0] - v.target) / v.scale);
  c_ = c, known_ = gradientKnown_ = true;
}

void MeshConstraints::derivatives(Points d, Vector& c, Matrix& jacobian) {
  jacobian.resize(static_cast<Eigen::Index>(3 * model_.nodes()), count_);
  if (single()) {
    singleGradient(d, c);
    for (std::size_t i = 0; i < gradient_.size(); ++i) jacobian.col(0).segment<3>(3 * static_cast<Eigen::Index>(i)) = gradient_[i] / volumes_[0].scale;
    return;
  }
  ++evaluations;
  c.resize(count_);
  positions(d);
  const SurfaceVolume& surface = model_.volume();
  Eigen::Index k = 0;
  for (const VolumeTarget& v : volumes_) {
    g_.resize(surface.vertices(v.region).size());
    volume_[static_cast<std::size_t>(k)] = surface.valueAndGradient(x_, v.region, g_, scratch_);
    c[k] = (volume_[static_cast<std::size_t>(k)] - v.target) / v.scale;
    column(v.region, g_, jacobian, k);
    jacobian.col(k++) /= v.scale;
  }
  for (const MomentTarget& m : moments_) {
    const auto totals = regionTotals(surface, x_, m.region);
    momentValues(m, totals, surface.centre(m.region), size_, c.data() + k);
    g_.resize(surface.vertices(m.region).size());
    for (Eigen::Index i = 0; i < countOf(m); ++i) {
      double one[9] = {};
      one[i] = 1;
      regionGradient(surface, x_, m.region, momentWeight(m, totals, size_, one), g_);
      column(m.region, g_, jacobian, k++);
    }
  }
  c_ = c, known_ = true;
}

void MeshConstraints::weightedGradient(Points d, const std::function<Vector(const Vector&)>& weights, Vector& c, std::span<Vec3> out) {
  const SurfaceVolume& surface = model_.volume();
  const auto add = [&](std::size_t region, double factor) {
    model_.gatherRegion(g_, region, nodes_);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += factor * nodes_[i];
  };
  if (single()) {
    singleGradient(d, c);
    const double factor = weights(c)[0] / volumes_[0].scale;
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = factor * gradient_[i];
    return;
  }
  for (Vec3& g : out) g.setZero();
  values(d, c);
  const Vector w = weights(c);
  Eigen::Index k = 0;
  for (const VolumeTarget& v : volumes_) {
    g_.resize(surface.vertices(v.region).size());
    surface.valueAndGradient(x_, v.region, g_, scratch_);
    add(v.region, w[k++] / v.scale);
  }
  for (const MomentTarget& m : moments_) {
    g_.resize(surface.vertices(m.region).size());
    regionGradient(surface, x_, m.region, momentWeight(m, regionTotals(surface, x_, m.region), size_, w.data() + k), g_);
    add(m.region, 1);
    k += countOf(m);
  }
}

void MeshConstraints::linearize(Points d, const Vector& multiplier) {
  positions(d);
  multiplier_ = multiplier;
}

void MeshConstraints::hessianTimes(Points p, std::span<Vec3> out) {
  const SurfaceVolume& surface = model_.volume();
  model_.combine(p, p_);
  std::vector<double> weight(surface.regionCount(), 0.0);
  Eigen::Index k = 0;
  for (const VolumeTarget& v : volumes_) weight[v.region] += multiplier_[k++] / v.scale;
  g_.resize(x_.size());
  surface.hessianTimes(x_, p_, weight, g_);
  model_.gather(g_, out);
  for (const MomentTarget& m : moments_) {
    const auto w = momentWeight(m, regionTotals(surface, x_, p_, m.region), size_, multiplier_.data() + k);
    k += countOf(m);
    g_.resize(surface.vertices(m.region).size());
    regionGradient(surface, x_, p_, m.region, w, g_);
    model_.gatherRegion(g_, m.region, nodes_);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += nodes_[i];
  }
}

void MeshConstraints::addHessian(Points d, const Vector& multiplier, std::span<const Index> rows, Matrix& h) {
  linearize(d, multiplier);
  const std::size_t n = model_.nodes();
  std::vector<Vec3> unit(n, Vec3::Zero()), column(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (rows[i] == kNoIndex) continue;
    for (int c = 0; c < 3; ++c) {
      unit[i] = Vec3::Unit(c);
      hessianTimes(unit, column);
      for (std::size_t j = 0; j < n; ++j)
        if (rows[j] != kNoIndex) h.col(3 * static_cast<Eigen::Index>(rows[i]) + c).segment<3>(3 * static_cast<Eigen::Index>(rows[j])) += column[j];
    }
    unit[i].setZero();
  }
}

}  // namespace fielddeform::volume::detail
