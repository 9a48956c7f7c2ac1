#include <fielddeform/core/parallel.h>
#include <fielddeform/map/detail/press_faces.h>

#include <algorithm>
#include <optional>
#include <queue>

namespace fielddeform::map::detail {
namespace {

constexpr std::size_t kMostPieces = 1024;  // of a face that lies on the tool and cannot be told from one inside

struct Piece {
  std::array<Vec3, 3> corner;  // barycentric
  double lowest = 0;           // no point of it is less far out
  double radius = 0;
};

// Most promising first; ties by the order that they were made in.
struct Later {
  const std::vector<Piece>& piece;
  bool operator()(std::size_t a, std::size_t b) const { return piece[a].lowest != piece[b].lowest ? piece[a].lowest > piece[b].lowest : a > b; }
};

std::optional<FaceContact> deepest(const PressTool& tool, const std::array<Vec3, 3>& x, double tolerance) {
  const auto at = [&](const Vec3& w) { return Vec3(w[0] * x[0] + w[1] * x[1] + w[2] * x[2]); };
  std::optional<Vec3> best;
  double most = tolerance;
  std::vector<Piece> pieces;
  std::priority_queue<std::size_t, std::vector<std::size_t>, Later> open(Later{pieces});
  const auto look = [&](const std::array<Vec3, 3>& corner) {
    const Vec3 middle = (corner[0] + corner[1] + corner[2]) / 3, p = at(middle);
    double radius = 0;
    for (const Vec3& c : corner) radius = std::max(radius, (at(c) - p).norm());
    const double outside = tool.clearance(p, radius - most);
    if (-outside > most) most = -outside, best = middle;
    if (!(outside - radius < -most) || radius <= 0.1 * tolerance) return;
    pieces.push_back({corner, outside - radius, radius});
    open.push(pieces.size() - 1);
  };
  look({Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()});
  while (!open.empty() && pieces.size() < kMostPieces) {
    const Piece piece = pieces[open.top()];
    open.pop();
    if (!(piece.lowest < -most - 0.1 * tolerance)) break;  // the deepest there can be is known to a tenth of the tolerance
    const auto& [a, b, c] = piece.corner;
    const Vec3 ab = 0.5 * (a + b), bc = 0.5 * (b + c), ca = 0.5 * (c + a);
    look({a, ab, ca}), look({ab, b, bc}), look({ca, bc, c}), look({ab, bc, ca});
  }
  if (!best) return std::nullopt;
  return FaceContact{0, *best, tool.contact(at(*best))};
}

}  // namespace

std::vector<FaceContact> facesInside(const PressTool& tool, Points points, std::span<const std::array<Index, 3>> triangles, double tolerance) {
  std::vector<std::optional<FaceContact>> found(triangles.size());
  parallelFor(triangles.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto& [a, b, c] = triangles[t];
      if (points[a].allFinite() && points[b].allFinite() && points[c].allFinite())
        found[t] = deepest(tool, {points[a], points[b], points[c]}, tolerance);
    }
  });
  std::vector<FaceContact> out;
  for (std::size_t t = 0; t < found.size(); ++t)
    if (found[t] && found[t]->contact.depth > tolerance) {
      out.push_back(*found[t]);
      out.back().triangle = static_cast<Index>(t);
    }
  return out;
}

}  // namespace fielddeform::map::detail
