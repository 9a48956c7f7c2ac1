#include <fielddeform/mesh/summary.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::mesh {
namespace {

double medianEdgeLength(const EdgeTable& table, Points positions) {
  std::vector<double> length;
  length.reserve(table.size());
  for (std::size_t e = 0; e < table.size(); ++e) {
    const auto [a, b] = table.vertices(e);
    const double l = (positions[a] - positions[b]).norm();
    if (std::isfinite(l)) length.push_back(l);
  }
  if (length.empty()) return 0;
  const auto middle = length.begin() + static_cast<std::ptrdiff_t>(length.size() / 2);
  std::nth_element(length.begin(), middle, length.end());
  return *middle;
}

void countElements(const Mesh& mesh, Summary& out) {
  out.vertices = mesh.vertexCount();
  out.faces = mesh.faceCount();
  out.corners = mesh.cornerCount();
  for (std::size_t f = 0; f < out.faces; ++f) {
    const std::size_t n = mesh.face(f).size();
    out.triangles += n == 3, out.quads += n == 4, out.polygons += n > 4;
  }
  out.lines = mesh.lines().size();
  out.loosePoints = mesh.loosePoints().size();
  out.positionType = mesh.positionType();
  for (const Attribute& a : mesh.attributes())
    out.attributes.push_back(
        {a.name, a.on, a.type(), a.width, a.valueCount(), !a.indices.empty(), !a.listOffsets.empty()});
}

}  // namespace

Summary summarize(const Mesh& mesh) {
  Summary out;
  const Points positions = mesh.positions();
  countElements(mesh, out);
  out.bounds = boundingBox(positions);
  out.size = objectSize(positions);

  const EdgeTable table(mesh);
  const EdgeCounts edges = countEdges(table);
  out.edges = edges.edges;
  out.closed = edges.closed();
  out.oriented = edges.oriented();
  out.boundaryEdges = edges.boundary;
  out.boundaryLoops = boundaryLoops(table).size();
  out.components = componentMeasures(mesh, positions, components(table, mesh.faceCount()));
  out.moments = surfaceMoments(mesh, positions);
  out.volume = volume(mesh, positions, edges);
  out.volumeAsWritten = volumeAsWritten(mesh, positions, edges);
  out.minAngle = smallestAngle(mesh, positions);
  out.sharpEdges = countSharpEdges(mesh, positions);
  out.medianEdge = medianEdgeLength(table, positions);

  DefectCounts& d = out.defects;
  for (const Vec3& p : positions) d.invalidPoints += !p.allFinite();
  d.duplicatePoints = duplicatePoints(positions).size();
  d.isolatedVertices = isolatedVertices(mesh).size();
  d.degenerateFaces = degenerateFaces(mesh, positions).size();
  d.duplicateFaces = duplicateFaces(mesh).size();
  d.nonManifoldEdges = edges.nonManifold;
  d.nonManifoldVertices = nonManifoldVertices(mesh, table).size();
  d.inconsistentEdges = edges.inconsistent;
  out.manifold = d.nonManifoldEdges == 0 && d.nonManifoldVertices == 0;
  return out;
}

}  // namespace fielddeform::mesh
