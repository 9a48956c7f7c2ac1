#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/topology.h>

#include <algorithm>
#include <numeric>

namespace fielddeform::mesh {
namespace {

struct HalfEdge {
  Index other, corner;
  bool operator<(const HalfEdge& b) const { return other != b.other ? other < b.other : corner < b.corner; }
};

/// Calls f(corner, from, to) for every corner that has an edge.
template <class F>
void forEachHalfEdge(std::span<const Index> corners, std::span<const Index> offsets, F&& f) {
  const std::size_t faces = offsets.empty() ? corners.size() / 3 : offsets.size() - 1;
  for (std::size_t i = 0; i < faces; ++i) {
    const std::size_t begin = offsets.empty() ? 3 * i : offsets[i], end = offsets.empty() ? begin + 3 : offsets[i + 1];
    if (end - begin < 3) continue;
    for (std::size_t c = begin; c < end; ++c) {
      const Index from = corners[c], to = corners[c + 1 < end ? c + 1 : begin];
      if (from != to) f(static_cast<Index>(c), from, to);
    }
  }
}

Index find(std::vector<Index>& parent, Index i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

/// Joins two sets; the smaller index stays the root, so that labels do not depend on the order of joining.
void join(std::vector<Index>& parent, Index a, Index b) {
  a = find(parent, a), b = find(parent, b);
  if (a != b) parent[std::max(a, b)] = std::min(a, b);
}

void add(EdgeCounts& counts, const EdgeTable& table, std::size_t e) {
  const auto uses = table.uses(e);
  std::size_t forward = 0;
  for (const Index c : uses) forward += table.isForward(c);
  const std::size_t backward = uses.size() - forward;
  ++counts.edges;
  counts.boundary += uses.size() == 1;
  counts.nonManifold += uses.size() > 2;
  counts.open += uses.size() % 2;
  counts.inconsistent += std::max(forward, backward) - std::min(forward, backward) > 1;
}

/// Edges of odd use at each vertex, for walking the boundary.
struct OddEdges {
  std::vector<std::array<Index, 2>> edges;
  std::vector<std::array<Index, 2>> ends;  ///< (vertex, index into edges), sorted

  explicit OddEdges(const EdgeTable& table) {
    for (std::size_t e = 0; e < table.size(); ++e)
      if (table.uses(e).size() % 2) edges.push_back(table.vertices(e));
    ends.reserve(2 * edges.size());
    for (std::size_t i = 0; i < edges.size(); ++i)
      for (const Index v : edges[i]) ends.push_back({v, static_cast<Index>(i)});
    std::sort(ends.begin(), ends.end());
  }
};

}  // namespace

EdgeTable::EdgeTable(const Mesh& mesh) : EdgeTable(mesh.vertexCount(), mesh.corners(), mesh.offsets()) {}

EdgeTable::EdgeTable(std::size_t vertexCount, std::span<const Index> corners, std::span<const Index> offsets)
    : cornerEdge_(corners.size(), kNoIndex), firstEdge_(vertexCount + 1, 0), forward_(corners.size()) {
  if (!offsets.empty()) {
    cornerFace_.resize(corners.size());
    for (std::size_t f = 0; f + 1 < offsets.size(); ++f)
      std::fill(cornerFace_.begin() + offsets[f], cornerFace_.begin() + offsets[f + 1], static_cast<Index>(f));
  }
  // Half edges in buckets of their lower vertex, each bucket sorted by (higher vertex, corner).
  std::vector<Index> start(vertexCount + 1, 0);
  forEachHalfEdge(corners, offsets, [&](Index, Index a, Index b) { ++start[std::min(a, b) + 1]; });
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<HalfEdge> half(start.back());
  {
    std::vector<Index> next(start.begin(), start.end() - 1);
    forEachHalfEdge(corners, offsets, [&](Index c, Index a, Index b) {
      half[next[std::min(a, b)]++] = {std::max(a, b), c};
      forward_[c] = a < b;
    });
  }
  parallelFor(vertexCount, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      std::sort(half.begin() + start[v], half.begin() + start[v + 1]);
      Index count = 0;
      for (Index i = start[v]; i < start[v + 1]; ++i) count += i == start[v] || half[i].other != half[i - 1].other;
      firstEdge_[v + 1] = count;
    }
  });
  std::partial_sum(firstEdge_.begin(), firstEdge_.end(), firstEdge_.begin());
  vertices_.resize(firstEdge_.back());
  firstUse_.resize(vertices_.size() + 1);
  uses_.resize(half.size());
  parallelFor(vertexCount, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      Index e = firstEdge_[v];
      for (Index i = start[v]; i < start[v + 1]; ++i) {
        if (i == start[v] || half[i].other != half[i - 1].other) {
          vertices_[e] = {static_cast<Index>(v), half[i].other};
          firstUse_[e++] = i;
        }
        uses_[i] = half[i].corner;
        cornerEdge_[half[i].corner] = e - 1;
      }
    }
  });
  firstUse_.back() = static_cast<Index>(half.size());
}

Index EdgeTable::find(Index a, Index b) const noexcept {
  if (a > b) std::swap(a, b);
  if (a == b || b + std::size_t{1} >= firstEdge_.size()) return kNoIndex;
  const auto first = vertices_.begin() + firstEdge_[a], last = vertices_.begin() + firstEdge_[a + 1];
  const auto found = std::lower_bound(first, last, std::array<Index, 2>{a, b});
  return found != last && (*found)[1] == b ? static_cast<Index>(found - vertices_.begin()) : kNoIndex;
}

EdgeCounts countEdges(const EdgeTable& table) {
  EdgeCounts counts;
  for (std::size_t e = 0; e < table.size(); ++e) add(counts, table, e);
  return counts;
}

std::vector<std::vector<Index>> boundaryLoops(const EdgeTable& table) {
  const OddEdges odd(table);
  std::vector<bool> used(odd.edges.size(), false);
  const auto nextEdge = [&](Index v, std::vector<Index>& cursor) {
    for (Index& i = cursor[v]; i < odd.ends.size() && odd.ends[i][0] == v; ++i)
      if (!used[odd.ends[i][1]]) return odd.ends[i][1];
    return kNoIndex;
  };
  Index vertices = 0;
  for (const auto& e : odd.edges) vertices = std::max(vertices, e[1] + 1);
  std::vector<Index> cursor(vertices, 0), placeOnPath(vertices, kNoIndex);
  for (std::size_t i = odd.ends.size(); i-- > 0;) cursor[odd.ends[i][0]] = static_cast<Index>(i);

  // Every vertex has an even number of these edges, so a walk can only end where it began. Whenever it meets itself,
  // the part since then is cut off as a loop.
  std::vector<std::vector<Index>> loops;
  for (std::size_t start = 0; start < odd.edges.size(); ++start) {
    if (used[start]) continue;
    std::vector<Index> path{odd.edges[start][0]};
    placeOnPath[path[0]] = 0;
    for (Index e = static_cast<Index>(start); e != kNoIndex; e = nextEdge(path.back(), cursor)) {
      used[e] = true;
      const Index to = odd.edges[e][0] == path.back() ? odd.edges[e][1] : odd.edges[e][0];
      if (placeOnPath[to] == kNoIndex) {
        placeOnPath[to] = static_cast<Index>(path.size());
        path.push_back(to);
        continue;
      }
      const auto from = path.begin() + placeOnPath[to];
      loops.emplace_back(from, path.end());
      for (auto v = from + 1; v != path.end(); ++v) placeOnPath[*v] = kNoIndex;
      path.erase(from + 1, path.end());
    }
    for (const Index v : path) placeOnPath[v] = kNoIndex;
  }
  return loops;
}

Components components(const EdgeTable& table, std::size_t faceCount) {
  Components out;
  std::vector<Index> parent(faceCount);
  std::iota(parent.begin(), parent.end(), 0u);
  std::vector<bool> hasEdge(faceCount, false);
  for (std::size_t e = 0; e < table.size(); ++e)
    for (const Index c : table.uses(e)) {
      hasEdge[table.faceOf(c)] = true;
      join(parent, table.faceOf(table.uses(e)[0]), table.faceOf(c));
    }
  out.ofFace.assign(faceCount, kNoIndex);
  for (std::size_t f = 0; f < faceCount; ++f) {
    if (!hasEdge[f]) continue;
    const Index root = find(parent, static_cast<Index>(f));
    if (root == f) out.edges.emplace_back();
    out.ofFace[f] = root == f ? static_cast<Index>(out.edges.size() - 1) : out.ofFace[root];
  }
  for (std::size_t e = 0; e < table.size(); ++e)
    add(out.edges[out.ofFace[table.faceOf(table.uses(e)[0])]], table, e);
  return out;
}

std::vector<Index> nonManifoldVertices(const Mesh& mesh, const EdgeTable& table) {
  const auto& corners = mesh.corners();
  std::vector<Index> parent(corners.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto nextCorner = [&](Index c) {
    const Index f = table.faceOf(c);
    return c + 1 < mesh.faceBegin(f + 1) ? c + 1 : mesh.faceBegin(f);
  };
  const auto joinAt = [&](Index a, Index b) { join(parent, a, b); };
  for (std::size_t e = 0; e < table.size(); ++e) {
    const auto uses = table.uses(e);
    for (const Index c : uses.subspan(1)) {
      const Index a0 = uses[0], a1 = nextCorner(a0), b0 = c, b1 = nextCorner(b0);
      const bool same = corners[a0] == corners[b0];
      joinAt(a0, same ? b0 : b1);
      joinAt(a1, same ? b1 : b0);
    }
  }
  std::vector<std::uint8_t> fans(mesh.vertexCount(), 0);
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    if (mesh.face(f).size() < 3) continue;
    for (Index c = mesh.faceBegin(f); c < mesh.faceBegin(f + 1); ++c)
      if (parent[c] == c && fans[corners[c]] < 2) ++fans[corners[c]];
  }
  std::vector<Index> out;
  for (std::size_t v = 0; v < fans.size(); ++v)
    if (fans[v] > 1) out.push_back(static_cast<Index>(v));
  return out;
}

std::vector<Index> isolatedVertices(const Mesh& mesh) {
  std::vector<bool> used(mesh.vertexCount(), false);
  for (const Index v : mesh.corners()) used[v] = true;
  for (const Polyline& line : mesh.lines())
    for (const Index v : line.vertices) used[v] = true;
  for (const Index v : mesh.loosePoints()) used[v] = true;
  std::vector<Index> out;
  for (std::size_t v = 0; v < used.size(); ++v)
    if (!used[v]) out.push_back(static_cast<Index>(v));
  return out;
}

}  // namespace fielddeform::mesh
