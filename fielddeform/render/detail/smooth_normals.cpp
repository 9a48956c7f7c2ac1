#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/render/detail/smooth_normals.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace fielddeform::render::detail {
namespace {

using Eigen::Vector3f;
constexpr std::size_t kGrain = 4096;
constexpr std::size_t kFewNeighbours = 64;  // beyond, comparing all pairs round a vertex would be quadratic

/// For every point the first point at the same place.
std::vector<Index> firstAtSamePlace(const std::vector<Vector3f>& points) {
  std::vector<std::uint64_t> keys(points.size());
  parallelFor(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      std::uint64_t key = 0;
      for (int k = 0; k < 3; ++k) key = splitmix64(key, std::bit_cast<std::uint32_t>(points[i][k] + 0.0f));
      keys[i] = key;
    }
  });
  const std::vector<Index> order = sortedOrder(keys);
  std::vector<Index> first(points.size());
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    for (; end < order.size() && keys[order[end]] == keys[order[begin]]; ++end) {
      const bool same = points[order[end]] == points[order[begin]];  // or a collision of the hash
      first[order[end]] = same ? order[begin] : order[end];
    }
    begin = end;
  }
  return first;
}

/// Corners around every place, as rows of one array.
struct Around {
  std::vector<Index> begin, corner;
};

Around cornersAround(const std::vector<Index>& place, std::size_t places) {
  Around around{std::vector<Index>(places + 1, 0), std::vector<Index>(place.size())};
  for (const Index p : place) ++around.begin[p + 1];
  for (std::size_t i = 0; i < places; ++i) around.begin[i + 1] += around.begin[i];
  std::vector<Index> next(around.begin.begin(), around.begin.end() - 1);
  for (std::size_t c = 0; c < place.size(); ++c) around.corner[next[place[c]]++] = static_cast<Index>(c);
  return around;
}

Vector3f unitOr(const Vector3f& v, const Vector3f& other) {
  const float length = v.norm();
  return length > 1e-12f ? Vector3f(v / length) : other;
}

}  // namespace

std::vector<Vector3f> smoothNormals(const std::vector<Vector3f>& points, const std::vector<Index>& corners,
                                    double creaseAngle) {
  const std::size_t triangles = corners.size() / 3;
  std::vector<Vector3f> flat(triangles), weighted(corners.size());
  parallelFor(triangles, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const Eigen::Vector3d p[3] = {points[corners[3 * t]].cast<double>(), points[corners[3 * t + 1]].cast<double>(),
                                    points[corners[3 * t + 2]].cast<double>()};
      const Eigen::Vector3d n = (p[1] - p[0]).cross(p[2] - p[0]);
      flat[t] = n.norm() > 0 ? Vector3f(n.normalized().cast<float>()) : Vector3f(Vector3f::Zero());
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d a = p[(k + 1) % 3] - p[k], b = p[(k + 2) % 3] - p[k];
        const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
        weighted[3 * t + k] = static_cast<float>(angle) * flat[t];
      }
    }
  });
  std::vector<Vector3f> normals(corners.size());
  if (creaseAngle <= 0) {
    for (std::size_t c = 0; c < corners.size(); ++c) normals[c] = flat[c / 3];
    return normals;
  }
  const std::vector<Index> first = firstAtSamePlace(points);
  std::vector<Index> place(corners.size());
  for (std::size_t c = 0; c < corners.size(); ++c) place[c] = first[corners[c]];
  const Around around = cornersAround(place, points.size());
  // Exactly opposite normals meet at a crease of pi, which then counts as smooth.
  const float cosine = creaseAngle >= std::numbers::pi ? -2.0f : static_cast<float>(std::cos(creaseAngle));
  parallelFor(corners.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c) {
      const Vector3f& own = flat[c / 3];
      const Index from = around.begin[place[c]], to = around.begin[place[c] + 1];
      Vector3f sum = Vector3f::Zero();
      if (to - from <= kFewNeighbours) {
        for (Index k = from; k < to; ++k) {
          const Index other = around.corner[k];
          if (own.dot(flat[other / 3]) >= cosine) sum += weighted[other];
        }
      } else if (around.corner[from] == c) {
        for (Index k = from; k < to; ++k) sum += weighted[around.corner[k]];
      }
      normals[c] = unitOr(sum, own);
    }
  });
  for (std::size_t c = 0; c < corners.size(); ++c) {  // many neighbours: their first corner holds the mean of all
    const Index from = around.begin[place[c]], to = around.begin[place[c] + 1];
    if (to - from <= kFewNeighbours || around.corner[from] == c) continue;
    const Vector3f& mean = normals[around.corner[from]];
    normals[c] = flat[c / 3].dot(mean) >= cosine ? mean : flat[c / 3];
  }
  return normals;
}

}  // namespace fielddeform::render::detail
