#include <fielddeform/skeleton/sampling.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::skeleton {
namespace {

double smallestRadius(const Primitive& p) {
  double r = p.radius.value_or(0);
  if (!p.pointRadius.empty()) r = *std::min_element(p.pointRadius.begin(), p.pointRadius.end());
  return r;
}

int pieces(double length, double spacing) {
  if (!(spacing > 0) || !(length > spacing)) return 1;
  return static_cast<int>(std::min(1e6, std::ceil(length / spacing * (1 - 1e-9))));
}

std::size_t segmentCount(const Primitive& p) {
  return p.points.size() < 2 ? 0 : p.points.size() - (p.closed ? 0 : 1);
}

template <class F>
void forEachFan(const Primitive& p, F&& call) {
  for (const auto& face : p.faces)
    for (std::size_t k = 2; k < face.size(); ++k) call(face[0], face[k - 1], face[k]);
}

double longestEdge(const Primitive& p, Index a, Index b, Index c) {
  return std::max({(p.points[a] - p.points[b]).norm(), (p.points[b] - p.points[c]).norm(), (p.points[c] - p.points[a]).norm()});
}

// How many samples a primitive would get besides its points.
double extraSamples(const Primitive& p, double spacing) {
  double n = 0;
  const double h = spacing * smallestRadius(p);
  if (p.type == PrimitiveType::Polyline)
    for (std::size_t i = 0; i < segmentCount(p); ++i)
      n += pieces((p.points[(i + 1) % p.points.size()] - p.points[i]).norm(), h) - 1;
  if (p.type == PrimitiveType::Mesh)
    forEachFan(p, [&](Index a, Index b, Index c) {
      const double k = pieces(longestEdge(p, a, b, c), h);
      n += (k + 1) * (k + 2) / 2 - 3;
    });
  return n;
}

class Sampler {
 public:
  Sampler(const Skeleton& skeleton, double spacing) : skeleton_(skeleton), spacing_(spacing) {
    const std::size_t n = skeleton.primitives.size();
    out_.vertexSample.resize(n);
    out_.chain.resize(n);
    out_.segmentStart.resize(n);
  }

  SampleSet run() {
    for (std::size_t i = 0; i < skeleton_.primitives.size(); ++i) {
      const Primitive& p = skeleton_.primitives[i];
      if (p.type == PrimitiveType::Polyline) addPolyline(static_cast<Index>(i), p);
      else addVertices(static_cast<Index>(i), p, p.type == PrimitiveType::Points ? 1.0 : 0.0);
      if (p.type == PrimitiveType::Mesh) addTriangles(static_cast<Index>(i), p);
    }
    return std::move(out_);
  }

 private:
  Index add(Index primitive, std::array<Index, 3> vertex, const Vec3& weight, double mass) {
    const Primitive& p = skeleton_.primitives[primitive];
    double radius = 0;
    for (int k = 0; k < 3; ++k)
      if (vertex[k] != kNoIndex) radius += weight[k] * radiusOf(p, vertex[k]);
    out_.samples.push_back({primitive, vertex, weight, mass, radius});
    return static_cast<Index>(out_.samples.size() - 1);
  }

  void addVertices(Index i, const Primitive& p, double mass) {
    for (Index v = 0; v < p.points.size(); ++v)
      out_.vertexSample[i].push_back(add(i, {v, kNoIndex, kNoIndex}, Vec3::UnitX(), mass));
  }

  void addPolyline(Index i, const Primitive& p) {
    const std::size_t n = p.points.size(), segments = segmentCount(p);
    const double h = spacing_ * smallestRadius(p);
    auto& chain = out_.chain[i];
    for (Index s = 0; s < segments || s == 0; ++s) {
      if (s < n) out_.vertexSample[i].push_back(add(i, {s, kNoIndex, kNoIndex}, Vec3::UnitX(), 0));
      out_.segmentStart[i].push_back(static_cast<Index>(chain.size()));
      chain.push_back(out_.vertexSample[i].back());
      if (segments == 0) return;
      const Index e = static_cast<Index>((s + 1) % n);
      const int k = pieces((p.points[e] - p.points[s]).norm(), h);
      for (int j = 1; j < k; ++j) {
        const double t = static_cast<double>(j) / k;
        chain.push_back(add(i, {s, e, kNoIndex}, Vec3(1 - t, t, 0), 0));
      }
    }
    if (p.closed) {
      out_.segmentStart[i].push_back(static_cast<Index>(chain.size()));
    } else {
      out_.vertexSample[i].push_back(add(i, {static_cast<Index>(n - 1), kNoIndex, kNoIndex}, Vec3::UnitX(), 0));
      out_.segmentStart[i].push_back(static_cast<Index>(chain.size()));
      chain.push_back(out_.vertexSample[i].back());
    }
    const std::size_t last = p.closed ? chain.size() : chain.size() - 1;
    for (std::size_t j = 0; j < last; ++j) {
      const Index a = chain[j], b = chain[(j + 1) % chain.size()];
      const double half = 0.5 * (out_.position(skeleton_, b) - out_.position(skeleton_, a)).norm();
      out_.samples[a].mass += half;
      out_.samples[b].mass += half;
    }
  }

  void addTriangles(Index i, const Primitive& p) {
    const double h = spacing_ * smallestRadius(p);
    forEachFan(p, [&](Index a, Index b, Index c) {
      const double area = 0.5 * (p.points[b] - p.points[a]).cross(p.points[c] - p.points[a]).norm();
      const int k = pieces(longestEdge(p, a, b, c), h);
      const double third = area / (3.0 * k * k);
      // Lattice point (u, v) of the k-fold subdivision; the number of sub-triangles that meet there times a third.
      for (int u = 0; u <= k; ++u)
        for (int v = 0; u + v <= k; ++v) {
          const int w = k - u - v;
          const int zeros = (u == 0) + (v == 0) + (w == 0);
          const int meeting = zeros == 0 ? 6 : zeros == 1 ? 3 : 1;
          const Index corner = u == k ? b : v == k ? c : a;
          if (zeros == 2) out_.samples[out_.vertexSample[i][corner]].mass += third;
          else add(i, {a, b, c}, Vec3(w, u, v) / k, meeting * third);
        }
    });
  }

  const Skeleton& skeleton_;
  double spacing_;
  SampleSet out_;
};

}  // namespace

double radiusOf(const Primitive& primitive, Index point) {
  if (!primitive.pointRadius.empty()) return primitive.pointRadius[point];
  if (!primitive.radius)
    throw std::invalid_argument(fmt::format("primitive '{}' has no radius, expected a number > 0", primitive.name));
  return *primitive.radius;
}

Vec3 SampleSet::position(const Skeleton& skeleton, std::size_t sample) const {
  const Sample& s = samples[sample];
  const auto& points = skeleton.primitives[s.primitive].points;
  if (s.vertex[1] == kNoIndex) return points[s.vertex[0]];
  Vec3 x = s.weight[0] * points[s.vertex[0]] + s.weight[1] * points[s.vertex[1]];
  if (s.vertex[2] != kNoIndex) x += s.weight[2] * points[s.vertex[2]];
  return x;
}

SampleSet sampleSkeleton(const Skeleton& skeleton, double spacing, std::size_t limit) {
  for (const Primitive& p : skeleton.primitives)
    if (p.pointRadius.empty()) radiusOf(p, 0);
  const auto total = [&](double s) {
    double n = 0;
    for (const Primitive& p : skeleton.primitives) n += extraSamples(p, s);
    return n;
  };
  while (total(spacing) > static_cast<double>(limit)) spacing *= 1.5;
  return Sampler(skeleton, spacing).run();
}

}  // namespace fielddeform::skeleton
