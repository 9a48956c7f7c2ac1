#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/polygonise.h>

#include <algorithm>
#include <stdexcept>
#include <unordered_map>

namespace fielddeform::field::detail {
namespace {

// The six ways from corner 0 to corner 7 of a cell; bit 0, 1, 2 of a corner: x, y, z.
constexpr std::array<std::array<unsigned, 4>, 6> kTetrahedra{
    {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}}};

constexpr double kVertexBytes = 200;  // an edge, its place in a table, a position, two triangles

struct Edge {
  Cell a, b;
  float va, vb;
};

class Surface {
 public:
  Surface(const std::vector<Cell>& corners, std::span<const float> values, std::size_t most)
      : corners_(corners), values_(values), most_(most) {
    for (std::size_t b = 0; b < corners.size(); ++b) addBlock(b);
  }
  std::vector<Edge> edges;
  std::vector<Index> triangles;

 private:
  void addBlock(std::size_t b) {
    for (unsigned n = 0; n < 8; ++n) {
      const Cell c{corners_[b][0] + (n & 1 ? kSide : 0), corners_[b][1] + (n & 2 ? kSide : 0), corners_[b][2] + (n & 4 ? kSide : 0)};
      const auto at = std::lower_bound(corners_.begin(), corners_.end(), c);
      block_[n] = at != corners_.end() && *at == c ? static_cast<std::size_t>(at - corners_.begin()) : kNone;
    }
    for (std::size_t j = 0; j < kBlockSize; ++j) addCell(j);
  }

  void addCell(std::size_t j) {
    const std::size_t low[3] = {j >> 6, j >> 3 & 7, j & 7};
    unsigned inside = 0;
    for (unsigned n = 0; n < 8; ++n) {
      std::size_t at[3];
      unsigned beyond = 0;
      for (unsigned k = 0; k < 3; ++k) {
        at[k] = low[k] + (n >> k & 1);
        beyond |= static_cast<unsigned>(at[k] >> 3) << k;
      }
      if (block_[beyond] == kNone) return;
      id_[n] = block_[beyond] * kBlockSize + ((at[0] & 7) << 6 | (at[1] & 7) << 3 | (at[2] & 7));
      inside |= static_cast<unsigned>(values_[id_[n]] < 0) << n;
    }
    if (inside == 0 || inside == 0xFF) return;
    for (const auto& t : kTetrahedra) addTetrahedron(t, inside);
  }

  void addTetrahedron(const std::array<unsigned, 4>& t, unsigned inside) {
    unsigned in[4], out[4];
    int ins = 0, outs = 0;
    for (const unsigned c : t) (inside >> c & 1 ? in[ins++] : out[outs++]) = c;
    if (ins == 0 || outs == 0) return;
    const Vec3 outward = mean(out, outs) - mean(in, ins);
    const auto cut = [&](unsigned a, unsigned b) { return Corner{vertex(a, b), 0.5 * (at(a) + at(b))}; };
    if (ins == 1) {
      triangle(cut(in[0], out[0]), cut(in[0], out[1]), cut(in[0], out[2]), outward);
    } else if (ins == 3) {
      triangle(cut(in[0], out[0]), cut(in[1], out[0]), cut(in[2], out[0]), outward);
    } else {
      const Corner a = cut(in[0], out[0]), b = cut(in[0], out[1]), c = cut(in[1], out[1]), d = cut(in[1], out[0]);
      triangle(a, b, c, outward);
      triangle(a, c, d, outward);
    }
  }

  struct Corner {
    Index vertex;
    Vec3 about;  // the middle of its edge: enough to tell which way the triangle looks
  };
  static Vec3 at(unsigned corner) { return Vec3(corner & 1, corner >> 1 & 1, corner >> 2); }
  static Vec3 mean(const unsigned* corners, int n) {
    Vec3 sum = Vec3::Zero();
    for (int i = 0; i < n; ++i) sum += at(corners[i]);
    return sum / n;
  }
  void triangle(const Corner& a, const Corner& b, const Corner& c, const Vec3& outward) {
    const bool turned = (b.about - a.about).cross(c.about - a.about).dot(outward) < 0;
    triangles.insert(triangles.end(), {a.vertex, turned ? c.vertex : b.vertex, turned ? b.vertex : c.vertex});
  }
  Index vertex(unsigned a, unsigned b) {
    if (a > b) std::swap(a, b);
    const std::uint64_t key = id_[a] * 8 + (a ^ b);  // the lower end and the direction
    const auto [found, isNew] = vertices_.try_emplace(key, static_cast<Index>(edges.size()));
    if (isNew && edges.size() >= most_) throw std::length_error("surface");
    if (isNew) edges.push_back({cell(id_[a]), cell(id_[b]), values_[id_[a]], values_[id_[b]]});
    return found->second;
  }
  Cell cell(std::size_t id) const { return pointOf(corners_[id / kBlockSize], id % kBlockSize); }

  static constexpr std::size_t kNone = ~std::size_t{0};
  const std::vector<Cell>& corners_;
  std::span<const float> values_;
  std::size_t most_;
  std::size_t block_[8] = {};  // of the current block and those above it
  std::size_t id_[8] = {};     // of the current cell's points
  std::unordered_map<std::uint64_t, Index> vertices_;
};

}  // namespace

double betweenEnds(double t) { return t > 0.001 ? std::min(t, 0.999) : 0.001; }

mesh::Mesh polygonise(const std::vector<Cell>& corners, std::span<const float> values, double megabytes,
                      const std::function<Vec3(const Cell&, const Cell&, double, double)>& place) {
  Surface surface(corners, values, static_cast<std::size_t>(std::min(megabytes * 1e6 / kVertexBytes, static_cast<double>(kNoIndex))));
  std::vector<Vec3> positions(surface.edges.size());
  parallelFor(positions.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Edge& e = surface.edges[i];
      positions[i] = place(e.a, e.b, e.va, e.vb);
    }
  });
  return {std::move(positions), std::move(surface.triangles)};
}

}  // namespace fielddeform::field::detail
