#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/mesh/detail/triangle.h>
#include <fielddeform/mesh/topology.h>

#include <algorithm>
#include <bit>

namespace fielddeform::mesh {
namespace {

/// Indices i in [0, count) that equal an earlier one. `hash` must agree where `compare` (three-way, a total order) says
/// equal; indices with hash kSkipped are left out. Runs of one hash are sorted, so that a hostile file costs n log n.
constexpr std::uint64_t kSkipped = ~std::uint64_t{0};

template <class Hash, class Compare>
std::vector<Index> repeated(std::size_t count, Hash&& hash, Compare&& compare) {
  std::vector<std::uint64_t> keys(count);
  parallelFor(count, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) keys[i] = hash(i);
  });
  std::vector<std::uint32_t> order = sortedOrder(keys);
  std::vector<Index> out;
  for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
    for (end = begin + 1; end < count && keys[order[end]] == keys[order[begin]];) ++end;
    if (end - begin == 1 || keys[order[begin]] == kSkipped) continue;
    std::sort(order.begin() + static_cast<std::ptrdiff_t>(begin), order.begin() + static_cast<std::ptrdiff_t>(end),
              [&](std::uint32_t a, std::uint32_t b) {
                const int c = compare(a, b);
                return c != 0 ? c < 0 : a < b;
              });
    for (std::size_t i = begin + 1; i < end; ++i)
      if (compare(order[i - 1], order[i]) == 0) out.push_back(order[i]);
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::vector<Index> sortedFace(const Mesh& mesh, std::size_t f) {
  const auto face = mesh.face(f);
  std::vector<Index> v(face.begin(), face.end());
  std::sort(v.begin(), v.end());
  return v;
}

}  // namespace

std::vector<Index> duplicateFaces(const Mesh& mesh) {
  // Sums of hashed indices do not depend on the order of a face's corners.
  const auto hash = [&](std::size_t f) {
    std::uint64_t h = mesh.face(f).size();
    for (const Index v : mesh.face(f)) h += splitmix64(0, v);
    return h == kSkipped ? 0 : h;
  };
  return repeated(mesh.faceCount(), hash, [&](std::size_t a, std::size_t b) {
    const auto x = sortedFace(mesh, a), y = sortedFace(mesh, b);
    return x < y ? -1 : static_cast<int>(y < x);
  });
}

std::vector<Index> duplicatePoints(Points positions) {
  const auto hash = [&](std::size_t i) {
    const Vec3& p = positions[i];
    if (!p.allFinite()) return kSkipped;
    std::uint64_t h = 0;
    for (int k = 0; k < 3; ++k) h = splitmix64(h, std::bit_cast<std::uint64_t>(p[k] + 0.0));  // + 0.0: -0 equals 0
    return h == kSkipped ? 0 : h;
  };
  return repeated(positions.size(), hash, [&](std::size_t a, std::size_t b) {
    const Vec3 &p = positions[a], &q = positions[b];
    for (int k = 0; k < 3; ++k)
      if (p[k] != q[k]) return p[k] < q[k] ? -1 : 1;
    return 0;
  });
}

std::vector<Index> degenerateFaces(const Mesh& mesh, Points positions) {
  std::vector<Index> out;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    bool area = false, finite = true;
    for (const Index v : mesh.face(f)) finite = finite && positions[v].allFinite();
    mesh.forEachTriangle(f, [&](Index a, Index b, Index c) {
      const Vec3 &p = positions[a], &q = positions[b], &r = positions[c];
      area = area || (a != b && b != c && c != a && detail::hasArea(p, q, r, detail::areaVector(p, q, r)));
    });
    if (finite && !area) out.push_back(static_cast<Index>(f));
  }
  return out;
}

}  // namespace fielddeform::mesh
