#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/topology.h>
#include <fielddeform/volume/detail/index_lists.h>
#include <fielddeform/volume/surface_volume.h>
#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace fielddeform::volume {
namespace {

constexpr std::size_t kGrain = 4096;

void checkInput(Points rest, const std::vector<Index>& triangles, const std::vector<Index>& region) {
  if (triangles.size() >= kNoIndex) throw std::invalid_argument("triangles: more than 2^32 corners");
  if (triangles.size() % 3) throw std::invalid_argument("triangles: the indices are no whole triangles");
  if (!region.empty() && region.size() != triangles.size() / 3)
    throw std::invalid_argument(fmt::format("region: {} labels for {} triangles", region.size(), triangles.size() / 3));
  const std::size_t bad = deterministicReduce(
      triangles.size(), 16 * kGrain, triangles.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c)
          if (triangles[c] >= rest.size() || !rest[triangles[c]].allFinite()) return c;
        return triangles.size();
      },
      [](std::size_t a, std::size_t b) { return std::min(a, b); });
  if (bad == triangles.size()) return;
  const Index v = triangles[bad];
  if (v >= rest.size()) throw std::invalid_argument(fmt::format("triangles: vertex {} of {}", v, rest.size()));
  throw std::invalid_argument(fmt::format("rest: vertex {} is not finite", v));
}

/// "3-7, 7-9 and 4 more"
std::string nameEdges(const std::vector<std::array<Index, 2>>& edges) {
  std::string names;
  const std::size_t shown = std::min<std::size_t>(edges.size(), 4);
  for (std::size_t i = 0; i < shown; ++i) names += fmt::format("{}{}-{}", i ? ", " : "", edges[i][0], edges[i][1]);
  if (edges.size() > shown) names += fmt::format(" and {} more", edges.size() - shown);
  return names;
}

using Edges = std::vector<std::array<Index, 2>>;
struct RegionEdges {
  Edges open, turned;  ///< used an odd number of times; used more often in one direction
};

/// Each region on its own: an edge between two regions is open in both. @param regionOf  #T, or empty: all of region 0
std::vector<RegionEdges> regionEdges(std::size_t vertices, std::span<const Index> triangles, std::span<const Index> regionOf,
                                     std::size_t regions) {
  std::vector<RegionEdges> out(regions);
  const mesh::EdgeTable table(vertices, triangles);
  const auto regionAt = [&](Index corner) { return regionOf.empty() ? Index{0} : regionOf[corner / 3]; };
  for (std::size_t e = 0; e < table.size(); ++e) {
    const auto uses = table.uses(e);  // ascending corners, so region by region
    for (std::size_t i = 0; i < uses.size();) {
      const Index r = regionAt(uses[i]);
      std::size_t forward = 0, count = 0;
      for (; i < uses.size() && regionAt(uses[i]) == r; ++i, ++count) forward += table.isForward(uses[i]);
      if (count % 2) out[r].open.push_back(table.vertices(e));
      if (std::max(forward, count - forward) - std::min(forward, count - forward) > 1) out[r].turned.push_back(table.vertices(e));
    }
  }
  return out;
}

void refuse(const RegionEdges& edges, std::size_t r, std::size_t regions, bool empty, Rims rims) {
  const std::string whose = regions > 1 ? fmt::format("region {}", r) : std::string("the mesh");
  if (empty) throw InfeasibleError(fmt::format("{} has no triangles, so no volume to keep", whose));
  const auto& [open, turned] = edges;
  if (!turned.empty())
    throw InfeasibleError(fmt::format("{} is not consistently oriented, so it has no volume: faces turned against each other at {} "
                                      "edge{} (vertices {})", whose, turned.size(), turned.size() == 1 ? "" : "s", nameEdges(turned)));
  if (!open.empty() && rims == Rims::Refuse)
    throw InfeasibleError(fmt::format("{} is open, so it has no volume: {} boundary edge{} (vertices {})", whose, open.size(),
                                      open.size() == 1 ? "" : "s", nameEdges(open)));
}

/// The middle of the rim of an open region, else of its bounding box.
Vec3 centreOf(Points rest, std::span<const Index> triangles, const std::vector<std::array<Index, 2>>& rim) {
  Box box;
  if (rim.empty()) {
    box = deterministicReduce(
        triangles.size(), 16 * kGrain, box,
        [&](std::size_t begin, std::size_t end) {
          Box some;
          for (const Index v : triangles.subspan(begin, end - begin)) some.extend(rest[v]);
          return some;
        },
        [](const Box& a, const Box& b) { return Box(a).extend(b); });
    return 0.5 * box.min() + 0.5 * box.max();
  }
  for (const auto& e : rim) box.extend(rest[e[0]]), box.extend(rest[e[1]]);
  const Vec3 near = 0.5 * box.min() + 0.5 * box.max();
  Vec3 sum = Vec3::Zero();
  for (const auto& e : rim) sum += (rest[e[0]] - near) + (rest[e[1]] - near);
  return near + sum / (2.0 * static_cast<double>(rim.size()));
}

}  // namespace

SurfaceVolume::SurfaceVolume(Points rest, std::vector<Index> triangles, std::vector<Index> region, Rims rims)
    : vertexCount_(rest.size()) {
  checkInput(rest, triangles, region);
  std::vector<Index> regionOf;  // empty: all of region 0
  if (region.empty()) {
    first_ = {0, triangles.size() / 3};
    triangles_ = std::move(triangles);
  } else {
    regionOf = sortByRegion(triangles, region);
    triangles = {}, region = {};
  }
  findCorners(regionOf);
  const std::size_t regions = first_.size() - 1;
  const auto edges = everyEdgeHasItsReverse() ? std::vector<RegionEdges>(regions)
                                              : regionEdges(vertexCount_, triangles_, regionOf, regions);
  for (std::size_t r = 0; r < regions; ++r) {
    const auto own = std::span<const Index>(triangles_).subspan(3 * first_[r], 3 * (first_[r + 1] - first_[r]));
    refuse(edges[r], r, regions, own.empty(), rims);
    centre_.push_back(centreOf(rest, own, edges[r].open));
    for (const auto& e : edges[r].open) rim_.insert(rim_.end(), e.begin(), e.end());
  }
  std::sort(rim_.begin(), rim_.end());
  rim_.erase(std::unique(rim_.begin(), rim_.end()), rim_.end());
  findVertices();
}

// Sets first_ and triangles_. @return the triangles' regions, empty if there is but one
std::vector<Index> SurfaceVolume::sortByRegion(std::span<const Index> triangles, std::span<const Index> region) {
  std::size_t regions = 0;
  for (const Index r : region)
    if (r != kNoIndex) regions = std::max<std::size_t>(regions, std::size_t{r} + 1);
  if (regions == 0) regions = 1;  // the caller says: no triangles
  if (regions > region.size() + 1) throw std::invalid_argument(fmt::format("region: label {} of {} triangles", regions - 1, region.size()));
  first_.assign(regions + 1, 0);
  for (const Index r : region)
    if (r != kNoIndex) ++first_[r + 1];
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  triangles_.resize(3 * first_.back());
  std::vector<Index> regionOf(regions > 1 ? first_.back() : 0);
  std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
  for (std::size_t t = 0; t < region.size(); ++t) {
    if (region[t] == kNoIndex) continue;
    const std::size_t to = next[region[t]]++;
    std::copy_n(triangles.begin() + static_cast<std::ptrdiff_t>(3 * t), 3, triangles_.begin() + static_cast<std::ptrdiff_t>(3 * to));
    if (!regionOf.empty()) regionOf[to] = region[t];
  }
  return regionOf;
}

void SurfaceVolume::findCorners(std::span<const Index> regionOf) {
  detail::IndexLists corners = detail::makeIndexLists(vertexCount_, triangles_.size(), [&](std::size_t begin, std::size_t end, auto&& put) {
    for (std::size_t c = begin; c < end; ++c) put(triangles_[c], static_cast<Index>(c));
  });
  cornerStart_ = std::move(corners.start);
  ringTriangle_.corner = std::move(corners.item);
  ringRegion_.resize(regionOf.empty() ? 0 : triangles_.size());
  for (std::size_t i = 0; i < ringRegion_.size(); ++i) ringRegion_[i] = regionOf[ringTriangle_[i]];
}

// A vertex's corners come region by region, as the triangles do.
void SurfaceVolume::findVertices() {
  const auto eachRegionOfVertex = [&](auto&& call) {
    for (std::size_t v = 0; v < vertexCount_; ++v) {
      if (ringRegion_.empty()) {
        if (cornerStart_[v] != cornerStart_[v + 1]) call(v, Index{0});
        continue;
      }
      for (std::size_t i = cornerStart_[v]; i < cornerStart_[v + 1]; ++i)
        if (i == cornerStart_[v] || ringRegion_[i] != ringRegion_[i - 1]) call(v, ringRegion_[i]);
    }
  };
  vertexStart_.assign(first_.size(), 0);
  eachRegionOfVertex([&](std::size_t, Index r) { ++vertexStart_[r + 1]; });
  std::partial_sum(vertexStart_.begin(), vertexStart_.end(), vertexStart_.begin());
  regionVertices_.resize(vertexStart_.back());
  std::vector<std::size_t> following(vertexStart_.begin(), vertexStart_.end() - 1);
  eachRegionOfVertex([&](std::size_t v, Index r) { regionVertices_[following[r]++] = static_cast<Index>(v); });
}

// The table of edges is three times the work: of use only where something is to be named.
bool SurfaceVolume::everyEdgeHasItsReverse() const {
  return deterministicReduce(
      vertexCount_, kGrain, 1,
      [&](std::size_t begin, std::size_t end) {
        std::vector<std::array<Index, 2>> out, in;  // the other end and the region of edges that leave a vertex, and reach it
        for (std::size_t v = begin; v < end; ++v) {
          out.clear(), in.clear();
          bool whole = true;
          forEachCorner(v, [&](Index b, Index c, Index r) {
            whole = whole && b != v && c != v && b != c;
            out.push_back({b, r}), in.push_back({c, r});
          });
          if (!whole) return 0;  // no triangle: leave it to the table
          std::sort(out.begin(), out.end()), std::sort(in.begin(), in.end());
          if (out != in) return 0;
        }
        return 1;
      },
      std::bit_and<>()) != 0;
}

double SurfaceVolume::value(Points x, std::size_t region) const {
  if (x.size() != vertexCount_) throw std::invalid_argument(fmt::format("{} positions, expected {}", x.size(), vertexCount_));
  const std::size_t first = first_[region];
  const Vec3 o = centre_[region];
  return deterministicReduce(
      first_[region + 1] - first, kGrain, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double sum = 0;
        for (std::size_t t = first + begin; t < first + end; ++t) {
          const Vec3 a = x[triangles_[3 * t]] - o, b = x[triangles_[3 * t + 1]] - o, c = x[triangles_[3 * t + 2]] - o;
          sum += a.dot(b.cross(c));
        }
        return sum;
      },
      std::plus<>()) / 6;
}

std::vector<double> SurfaceVolume::values(Points x) const {
  std::vector<double> out(regionCount());
  for (std::size_t r = 0; r < out.size(); ++r) out[r] = value(x, r);
  return out;
}

template <class Term>
void SurfaceVolume::sumAround(std::span<const double> weight, std::span<Vec3> out, Term&& term) const {
  parallelFor(vertexCount_, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      Vec3 sum = Vec3::Zero();
      forEachCorner(v, [&](Index b, Index c, Index r) { sum += (weight.empty() ? 1.0 : weight[r]) * term(b, c, centre_[r]); });
      out[v] = sum / 6;
    }
  });
}

void SurfaceVolume::gradient(Points x, std::span<const double> weight, std::span<Vec3> out) const {
  if (x.size() != vertexCount_ || out.size() != vertexCount_ || (!weight.empty() && weight.size() != regionCount()))
    throw std::invalid_argument("gradient: sizes differ from the surface's");
  sumAround(weight, out, [&](Index b, Index c, const Vec3& o) { return Vec3((x[b] - o).cross(x[c] - o)); });
}

double SurfaceVolume::valueAndGradient(Points x, std::size_t region, std::span<Vec3> out, std::vector<Vec3>& normal) const {
  const auto own = vertices(region);
  if (x.size() != vertexCount_ || out.size() != own.size()) throw std::invalid_argument("valueAndGradient: sizes differ from the surface's");
  // Around a vertex whose corners close up, the sum of b x c is that of (b - a) x (c - a): one product serves all three
  // corners of a triangle.
  const std::size_t first = first_[region], count = first_[region + 1] - first;
  const Vec3 o = centre_[region];
  normal.resize(count);
  const double volume = deterministicReduce(
      count, kGrain, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double sum = 0;
        for (std::size_t t = begin; t < end; ++t) {
          const Index* v = triangles_.data() + 3 * (first + t);
          const Vec3 &a = x[v[0]], b = x[v[1]] - a, c = x[v[2]] - a;
          normal[t] = b.cross(c);
          sum += normal[t].dot(a - o);
        }
        return sum;
      },
      std::plus<>()) / 6;
  const bool alone = regionCount() == 1;
  parallelFor(own.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      Vec3 sum = Vec3::Zero();
      for (std::size_t i = cornerStart_[own[k]]; i < cornerStart_[own[k] + 1]; ++i)
        if (alone || ringRegion_[i] == region) sum += normal[ringTriangle_[i] - first];
      out[k] = sum / 6;
    }
  });
  return volume;
}

void SurfaceVolume::hessianTimes(Points x, Points p, std::span<const double> weight, std::span<Vec3> out) const {
  if (x.size() != vertexCount_ || p.size() != vertexCount_ || out.size() != vertexCount_ ||
      (!weight.empty() && weight.size() != regionCount()))
    throw std::invalid_argument("hessianTimes: sizes differ from the surface's");
  sumAround(weight, out, [&](Index b, Index c, const Vec3& o) { return Vec3(p[b].cross(x[c] - o) + (x[b] - o).cross(p[c])); });
}

std::array<double, 4> SurfaceVolume::alongLine(Points x, Points d, std::size_t region) const {
  if (x.size() != vertexCount_ || d.size() != vertexCount_) throw std::invalid_argument("alongLine: sizes differ from the surface's");
  using Vec4 = Eigen::Vector4d;
  const std::size_t first = first_[region];
  const Vec3 o = centre_[region];
  const Vec4 sum = deterministicReduce(
      first_[region + 1] - first, kGrain, Vec4(Vec4::Zero()),
      [&](std::size_t begin, std::size_t end) {
        Vec4 s = Vec4::Zero();
        for (std::size_t t = first + begin; t < first + end; ++t) {
          const Index i = triangles_[3 * t], j = triangles_[3 * t + 1], k = triangles_[3 * t + 2];
          const Vec3 a = x[i] - o, b = x[j] - o, c = x[k] - o;
          const Vec3 &p = d[i], &q = d[j], &r = d[k];
          const Vec3 bc = b.cross(c), qr = q.cross(r), mixed = b.cross(r) + q.cross(c);
          s += Vec4(a.dot(bc), p.dot(bc) + a.dot(mixed), a.dot(qr) + p.dot(mixed), p.dot(qr));
        }
        return s;
      },
      [](const Vec4& a, const Vec4& b) { return Vec4(a + b); }) / 6;
  return {sum[0], sum[1], sum[2], sum[3]};
}

}  // namespace fielddeform::volume
