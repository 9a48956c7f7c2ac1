#pragma once

#include <fielddeform/core/types.h>

#include <array>
#include <limits>
#include <memory>

namespace fielddeform::spatial {

/// Closest point on a set of elements.
struct ClosestPoint {
  Index element = kNoIndex;  ///< kNoIndex: none within the bound, no elements, or the query is not finite
  double distance = std::numeric_limits<double>::infinity();  ///< world, >= 0
  Vec3 point = Vec3::Zero();   ///< world
  Vec3 offset = Vec3::Zero();  ///< query minus point, more exact than the difference of the two
  Vec3 weight = Vec3::Zero();  ///< barycentric weights of `point` on the element's vertices, >= 0, sum 1; unused ones 0
};

/// Exact closest points on points, segments or triangles, in double precision, by a tree of boxes.
/// Of elements at the same distance the lowest index wins; nothing depends on how the tree was built. Degenerate
/// elements count as the segments or points that they are. Scaling elements and query by a power of two scales the
/// answer by it, bit for bit. Immutable and safe to use from many threads. Memory: about 250 bytes a triangle.
class ClosestTree {
 public:
  /// @param points    #P by 3, world
  /// @param segments  pairs, @param triangles triples of indices into points
  /// @throw std::invalid_argument for an index out of range, a point that is not finite, or 2^31 elements and more
  static ClosestTree ofPoints(Points points);
  static ClosestTree ofSegments(Points points, std::span<const std::array<Index, 2>> segments);
  static ClosestTree ofTriangles(Points points, std::span<const std::array<Index, 3>> triangles);
  ~ClosestTree();
  ClosestTree(ClosestTree&&) noexcept;
  ClosestTree& operator=(ClosestTree&&) noexcept;

  std::size_t size() const noexcept;  ///< elements

  struct QueryOptions {
    double maxDistance = std::numeric_limits<double>::infinity();  ///< world; nothing farther is found
    Index hint = kNoIndex;  ///< an element that is probably near: speeds the query up, never changes its answer
  };
  ClosestPoint closest(const Vec3& query, const QueryOptions& options) const;
  ClosestPoint closest(const Vec3& query) const { return closest(query, {}); }
  /// closest() of a query whose nearest element is known, bit for bit. @param element  what closest() of the same query found
  ClosestPoint closestOn(Index element, const Vec3& query) const;
  /// Kept from one call of closestTogether to the next; it changes no answer. Not for two threads at once.
  struct BlockHint {
    struct Kept {
      virtual ~Kept() = default;
    };
    Index element = kNoIndex;    ///< probably near
    std::size_t size = 64;       ///< as many queries shared a search
    std::shared_ptr<Kept> kept;  ///< the searches of the last call: queries that moved a little since share them again
  };
  /// closest() of each query, bit for bit, on the calling thread: much quicker where queries that follow one another lie
  /// near one another, compared with the size of an element. Up to 64 of them share one search that lists the elements
  /// that can be the nearest to any of them (docs/tracking.md, "Blocks"); these are tried in vector instructions.
  /// @throw std::invalid_argument if the sizes differ
  void closestTogether(Points queries, std::span<ClosestPoint> out, BlockHint& hint,
                       double maxDistance = std::numeric_limits<double>::infinity()) const;
  /// Many queries, in parallel. @throw std::invalid_argument if the sizes differ
  void closest(Points queries, std::span<ClosestPoint> out) const;

 private:
  struct Impl;
  explicit ClosestTree(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::spatial
