#include <fielddeform/core/parallel.h>
#include <fielddeform/resample/detail/references.h>

#include <algorithm>

namespace fielddeform::resample::detail {
namespace {

/// Mean reference of a face's edges, added in ascending order so that it does not depend on which corner is the first.
double meanReference(const EdgeMemory& memory, const mesh::EdgeTable& table, const mesh::Mesh& mesh, std::size_t face) {
  std::vector<double> lengths;
  for (Index c = mesh.faceBegin(face); c < mesh.faceBegin(face + 1); ++c)
    if (table.ofCorner(c) != kNoIndex) lengths.push_back(memory.reference[table.ofCorner(c)]);
  if (lengths.empty()) return 0;
  std::sort(lengths.begin(), lengths.end());
  double sum = 0;
  for (const double l : lengths) sum += l;
  return sum / static_cast<double>(lengths.size());
}

}  // namespace

EdgeMemory::EdgeMemory(const mesh::EdgeTable& table, Points rest) : reference(table.size()), settled(table.size(), 0) {
  parallelFor(table.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e)
      reference[e] = (rest[table.vertices(e)[0]] - rest[table.vertices(e)[1]]).norm();
  });
}

EdgeMemory carryOver(const EdgeMemory& memory, const mesh::EdgeTable& old, const mesh::Mesh& oldMesh,
                     std::span<const Index> divided, std::span<const Index> rank, const mesh::EdgeTable& table,
                     Points rest, std::span<const Index> faceParent) {
  const std::size_t oldVertices = oldMesh.vertexCount();
  EdgeMemory out;
  out.reference.resize(table.size());
  out.settled.assign(table.size(), 0);
  parallelFor(table.size(), 2048, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const auto [a, b] = table.vertices(e);  // a < b: new vertices come last
      if (b < oldVertices) {
        if (const Index before = old.find(a, b); before != kNoIndex) {
          out.reference[e] = memory.reference[before];
          out.settled[e] = rank[before] == kNoIndex ? memory.settled[before] : 0;
          continue;
        }
      } else if (a < oldVertices) {
        const auto whole = divided[b - oldVertices];
        const auto ends = old.vertices(whole);
        if (a == ends[0] || a == ends[1]) {
          out.reference[e] = memory.reference[whole];
          continue;
        }
      }
      double reference = (rest[a] - rest[b]).norm();
      for (const Index c : table.uses(e))
        reference = std::max(reference, meanReference(memory, old, oldMesh, faceParent[table.faceOf(c)]));
      out.reference[e] = reference;
    }
  });
  return out;
}

}  // namespace fielddeform::resample::detail
