#pragma once

#include <fielddeform/core/types.h>

#include <array>
#include <vector>

namespace fielddeform::volume {

/// What to do about boundary edges.
enum class Rims : std::uint8_t {
  Refuse,  ///< a region with boundary edges has no volume
  Fixed,   ///< the caller never moves a vertex of a boundary edge: the volume is taken with cones from the rim's centroid, so
           ///< that its changes are those of any fixed cap
};

/// Volumes of the regions of a triangle mesh and their derivatives by the positions. Sums are taken about a centre of the
/// region and in fixed chunks: the same bits on any number of threads. Immutable.
///   V = sum_tri a . (b x c) / 6,  dV/da = (b x c) / 6 and cyclically          [Hirota et al. 1999, section 3.3]
class SurfaceVolume {
 public:
  /// @param rest       #V by 3, finite: where the centres are taken from (positions near these lose no digits)
  /// @param triangles  3 vertex indices each, outward; a polygon is the fan from its corner 0 (Mesh::triangles())
  /// @param region     #T labels 0 .. R-1 or kNoIndex (no region's), or empty: everything is region 0
  /// @throw std::invalid_argument if an index is out of range or a position is not finite
  /// @throw InfeasibleError if a region has boundary or inconsistently oriented edges (naming the first of them by their
  ///        vertices), or no triangles; with Rims::Fixed only for the orientation
  SurfaceVolume(Points rest, std::vector<Index> triangles, std::vector<Index> region = {}, Rims rims = Rims::Refuse);

  std::size_t vertexCount() const noexcept { return vertexCount_; }
  std::size_t regionCount() const noexcept { return centre_.size(); }
  const std::vector<Index>& triangles() const noexcept { return triangles_; }  ///< those of regions, region by region
  std::span<const Index> triangles(std::size_t region) const noexcept {
    return {triangles_.data() + 3 * first_[region], 3 * (first_[region + 1] - first_[region])};
  }
  /// Vertices of a region's triangles, ascending.
  std::span<const Index> vertices(std::size_t region) const noexcept {
    return {regionVertices_.data() + vertexStart_[region], vertexStart_[region + 1] - vertexStart_[region]};
  }
  /// Corners at a vertex: call(b, c, region) with the two vertices that follow it in its triangle, and that triangle's region;
  /// by ascending triangles.
  template <class Call>
  void forEachCorner(std::size_t vertex, Call&& call) const {
    for (std::size_t i = cornerStart_[vertex]; i < cornerStart_[vertex + 1]; ++i) {
      const Index corner = ringTriangle_.corner[i], t = corner - corner % 3;
      const Index k = corner - t, b = k == 2 ? t : corner + 1, c = k == 0 ? t + 2 : corner - 1;
      call(triangles_[b], triangles_[c], ringRegion_.empty() ? Index{0} : ringRegion_[i]);
    }
  }
  const Vec3& centre(std::size_t region) const noexcept { return centre_[region]; }
  /// Vertices of boundary edges; empty if all regions are closed. Ascending.
  const std::vector<Index>& rimVertices() const noexcept { return rim_; }

  /// One volume a region, cubic units. @param x #V by 3
  std::vector<double> values(Points x) const;
  double value(Points x, std::size_t region = 0) const;
  /// sum_r weight_r dV_r/dx.
  /// @param weight one a region, or empty: all 1    @param out #V by 3, overwritten
  void gradient(Points x, std::span<const double> weight, std::span<Vec3> out) const;
  /// sum_r weight_r (d2V_r/dx2) p: the derivative of gradient() along p.
  void hessianTimes(Points x, Points p, std::span<const double> weight, std::span<Vec3> out) const;
  /// V_r and dV_r/dx at the region's own vertices (vertices(r)) alone; at a rim that does not move, any number.
  /// @param out      one a vertex of vertices(region), overwritten
  /// @param scratch  resized; keep it from call to call
  double valueAndGradient(Points x, std::size_t region, std::span<Vec3> out, std::vector<Vec3>& scratch) const;
  /// Coefficients c0 .. c3 of the cubic V_r(x + t d) in t, d a displacement.
  std::array<double, 4> alongLine(Points x, Points d, std::size_t region = 0) const;

 private:
  /// The corners at all vertices, as numbers in triangles_: read as their triangles.
  struct RingTriangles {
    std::vector<Index> corner;
    Index operator[](std::size_t i) const noexcept { return corner[i] / 3; }
  };

  std::vector<Index> sortByRegion(std::span<const Index> triangles, std::span<const Index> region);
  void findCorners(std::span<const Index> regionOf);
  void findVertices();
  bool everyEdgeHasItsReverse() const;
  template <class Term>
  void sumAround(std::span<const double> weight, std::span<Vec3> out, Term&& term) const;

  std::size_t vertexCount_ = 0;
  std::vector<Index> triangles_, rim_;
  std::vector<std::size_t> first_;  ///< #R+1, triangles
  std::vector<Vec3> centre_;
  // The corners at each vertex, for gradients that are gathered in a fixed order.
  std::vector<Index> cornerStart_;
  RingTriangles ringTriangle_;
  std::vector<Index> ringRegion_;  ///< of each corner; empty if there is but one region
  std::vector<std::size_t> vertexStart_;
  std::vector<Index> regionVertices_;
};

}  // namespace fielddeform::volume
