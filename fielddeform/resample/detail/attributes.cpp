#include <fielddeform/resample/detail/split.h>

#include <algorithm>
#include <tuple>

namespace fielddeform::resample::detail {
namespace {

using mesh::Attribute;
using mesh::Element;
using mesh::Interpolation;

/// Copies values of one attribute to the end of another's data of the same type.
class Appender {
 public:
  Appender(const Attribute& from, Attribute& to) : from_(from), to_(to) {}

  void copy(std::size_t value) {
    std::visit(
        [&](auto& out) {
          const auto& in = std::get<std::decay_t<decltype(out)>>(from_.data);
          const auto first = in.begin() + static_cast<std::ptrdiff_t>(value) * from_.width;
          out.insert(out.end(), first, first + from_.width);
        },
        to_.data);
  }

  /// The value halfway between two, by the attribute's rule. Nearest takes a.
  void middle(std::size_t a, std::size_t b) {
    if (a == b || from_.onSplit == Interpolation::Nearest) return copy(a);
    const std::size_t at = to_.valueCount();
    copy(a);
    double lengthA = 0, lengthB = 0, length = 0;
    for (int k = 0; k < from_.width; ++k) {
      const double x = from_.get(a, k), y = from_.get(b, k), mean = 0.5 * x + 0.5 * y;
      lengthA += x * x, lengthB += y * y, length += mean * mean;
      to_.set(at, k, mean);
    }
    if (from_.onSplit != Interpolation::Direction || !(length > 0)) return;
    const double scale = 0.5 * (std::sqrt(lengthA) + std::sqrt(lengthB)) / std::sqrt(length);
    for (int k = 0; k < from_.width; ++k) to_.set(at, k, (0.5 * from_.get(a, k) + 0.5 * from_.get(b, k)) * scale);
  }

 private:
  const Attribute& from_;
  Attribute& to_;
};

Attribute emptyCopy(const Attribute& a) {
  return {a.name, a.on, a.width, a.onSplit, mesh::makeData(a.type(), 0), {}, {}};
}

/// An element list where element i is a copy of element sources[i] (ties and means of lists take the first).
Attribute copyLists(const Attribute& a, std::size_t count, auto&& source) {
  Attribute out = emptyCopy(a);
  Appender append(a, out);
  out.listOffsets.push_back(0);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t s = source(i);
    for (Index v = a.listOffsets[s]; v < a.listOffsets[s + 1]; ++v) append.copy(v);
    out.listOffsets.push_back(static_cast<Index>(out.valueCount()));
  }
  return out;
}

struct Work {
  const mesh::Mesh& mesh;
  const mesh::EdgeTable& table;
  std::span<const Index> divided, rank;
  const SplitFaces& faces;

  Index nextCorner(Index c) const {
    const Index f = table.faceOf(c);
    return c + 1 < mesh.faceBegin(f + std::size_t{1}) ? c + 1 : mesh.faceBegin(f);
  }
  /// The corners at the lower and the higher vertex of the edge that starts at a corner.
  std::array<Index, 2> ends(Index c) const {
    const Index n = nextCorner(c);
    return table.isForward(c) ? std::array{c, n} : std::array{n, c};
  }
};

Attribute onVertices(const Work& w, const Attribute& a) {
  const std::size_t old = w.mesh.vertexCount();
  if (!a.listOffsets.empty())
    return copyLists(a, old + w.divided.size(),
                     [&](std::size_t i) { return i < old ? i : w.table.vertices(w.divided[i - old])[0]; });
  Attribute out = a;
  Appender append(a, out);
  for (const Index e : w.divided) append.middle(w.table.vertices(e)[0], w.table.vertices(e)[1]);
  return out;
}

Attribute onFaces(const Work& w, const Attribute& a) {
  const auto& parent = w.faces.faceParent;
  if (!a.listOffsets.empty()) return copyLists(a, parent.size(), [&](std::size_t i) { return parent[i]; });
  Attribute out = emptyCopy(a);
  Appender append(a, out);
  for (const Index f : parent) append.copy(f);
  return out;
}

Attribute onCorners(const Work& w, const Attribute& a) {
  const SplitFaces& faces = w.faces;
  if (!a.listOffsets.empty())
    return copyLists(a, faces.source.size(), [&](std::size_t i) {
      return faces.middle[i] ? w.ends(faces.source[i])[0] : faces.source[i];
    });
  Attribute out = emptyCopy(a);
  Appender append(a, out);
  for (std::size_t i = 0; i < faces.source.size(); ++i) {
    const auto [low, high] = w.ends(faces.source[i]);
    if (faces.middle[i]) append.middle(low, high);
    else append.copy(faces.source[i]);
  }
  return out;
}

/// A new value is shared by all faces that agree on the values at both ends of the divided edge; equal ends keep theirs.
Attribute onIndexedCorners(const Work& w, const Attribute& a) {
  using Key = std::tuple<Index, Index, Index>;  // new vertex, value at the lower and at the higher end
  const auto key = [&](Index corner) {
    const auto [low, high] = w.ends(corner);
    return Key{w.rank[w.table.ofCorner(corner)], a.indices[low], a.indices[high]};
  };
  const auto isNew = [](const Key& k) {
    return std::get<1>(k) != std::get<2>(k) && std::get<1>(k) != kNoIndex && std::get<2>(k) != kNoIndex;
  };
  std::vector<Key> keys;
  for (const Index e : w.divided)
    for (const Index c : w.table.uses(e))
      if (const Key k = key(c); isNew(k)) keys.push_back(k);
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());

  Attribute out = a;
  Appender append(a, out);
  const std::size_t old = a.valueCount();
  for (const auto& [vertex, low, high] : keys) append.middle(low, high);
  out.indices.assign(w.faces.source.size(), kNoIndex);
  for (std::size_t i = 0; i < out.indices.size(); ++i) {
    const Index c = w.faces.source[i];
    if (!w.faces.middle[i]) {
      out.indices[i] = a.indices[c];
    } else if (const Key k = key(c); isNew(k)) {
      out.indices[i] = static_cast<Index>(old + (std::lower_bound(keys.begin(), keys.end(), k) - keys.begin()));
    } else {
      out.indices[i] = std::get<1>(k) == std::get<2>(k) ? std::get<1>(k) : kNoIndex;
    }
  }
  return out;
}

/// Lines that follow divided edges pass through the new vertices.
std::vector<mesh::Polyline> refinedLines(const Work& w) {
  std::vector<mesh::Polyline> out = w.mesh.lines();
  for (mesh::Polyline& line : out) {
    std::vector<Index> vertices;
    for (std::size_t i = 0; i < line.vertices.size(); ++i) {
      vertices.push_back(line.vertices[i]);
      if (i + 1 == line.vertices.size()) continue;
      const Index e = w.table.find(line.vertices[i], line.vertices[i + 1]);
      if (e != kNoIndex && w.rank[e] != kNoIndex)
        vertices.push_back(static_cast<Index>(w.mesh.vertexCount()) + w.rank[e]);
    }
    line.vertices = std::move(vertices);
  }
  return out;
}

}  // namespace

mesh::Mesh makeRefined(const mesh::Mesh& mesh, const mesh::EdgeTable& table, std::span<const Index> divided,
                       std::span<const Index> rank, const SplitFaces& faces, std::vector<Vec3> positions) {
  mesh::Mesh out(std::move(positions), faces.corners, faces.offsets);
  const Work work{mesh, table, divided, rank, faces};
  for (const Attribute& a : mesh.attributes()) {
    if (a.on == Element::Vertex) out.attributes().push_back(onVertices(work, a));
    else if (a.on == Element::Face) out.attributes().push_back(onFaces(work, a));
    else out.attributes().push_back(a.indices.empty() ? onCorners(work, a) : onIndexedCorners(work, a));
  }
  out.lines() = refinedLines(work);
  out.loosePoints() = mesh.loosePoints();
  out.setPositionType(mesh.positionType());
  return out;
}

}  // namespace fielddeform::resample::detail
