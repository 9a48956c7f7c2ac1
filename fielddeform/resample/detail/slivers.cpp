#include <fielddeform/mesh/detail/triangle.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/resample/detail/slivers.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::resample::detail {
namespace {

/// Cotangent of the smallest angle of a face's fan; triangles without area aside. Negative if none has area.
double thinness(const mesh::Mesh& mesh, std::size_t face, Points positions) {
  double largest = -1;
  mesh.forEachTriangle(face, [&](Index a, Index b, Index c) {
    const Vec3 &p = positions[a], &q = positions[b], &r = positions[c];
    const Vec3 n = mesh::detail::areaVector(p, q, r);
    if (mesh::detail::hasArea(p, q, r, n))
      largest = std::max(largest, mesh::detail::largestCotangent(p, q, r, n.norm()));
  });
  return largest;
}

double halfAngleCotangent(double cotangent) { return cotangent + std::sqrt(1 + cotangent * cotangent); }

void addLongestSides(const mesh::Mesh& mesh, const mesh::EdgeTable& table, std::size_t face, std::vector<Index>& out) {
  const auto length = [&](Index e) {
    return (mesh.positions()[table.vertices(e)[0]] - mesh.positions()[table.vertices(e)[1]]).norm();
  };
  double longest = 0;
  Index best = kNoIndex;
  const Index begin = mesh.faceBegin(face), end = mesh.faceBegin(face + 1);
  for (Index c = begin; c < end; ++c) {
    const Index e = table.ofCorner(c);
    if (e == kNoIndex) continue;
    const double l = length(e);
    if (l > longest || (l == longest && e < best)) longest = l, best = e;
  }
  if (best == kNoIndex) return;
  if (end - begin == 3) return out.push_back(best);
  for (Index c = begin; c < end; ++c)
    if (const Index e = table.ofCorner(c); e != kNoIndex && length(e) >= 0.9 * longest) out.push_back(e);
}

}  // namespace

std::vector<Index> replacedFaces(std::span<const Index> parentOf) {
  std::vector<Index> out;
  for (std::size_t f = 0; f < parentOf.size(); ++f)
    if ((f > 0 && parentOf[f - 1] == parentOf[f]) || (f + 1 < parentOf.size() && parentOf[f + 1] == parentOf[f]))
      out.push_back(static_cast<Index>(f));
  return out;
}

std::vector<Index> sidesOfThinFaces(const mesh::Mesh& input, const mesh::Mesh& mesh, const mesh::EdgeTable& table,
                                    Points posed, std::span<const Index> parentOf, double minAngle) {
  std::vector<Index> out;
  if (!(minAngle > 0)) return out;
  const auto angle = numeric::sincos(minAngle);
  const double bound = angle.cos / angle.sin;
  for (const Index f : replacedFaces(parentOf)) {
    const double thin = std::min(thinness(mesh, f, mesh.positions()), thinness(mesh, f, posed));
    if (!(thin > bound)) continue;
    if (thin > halfAngleCotangent(thinness(input, parentOf[f], input.positions()))) addLongestSides(mesh, table, f, out);
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

}  // namespace fielddeform::resample::detail
