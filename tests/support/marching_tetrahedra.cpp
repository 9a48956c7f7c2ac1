#include "marching_tetrahedra.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace fielddeform::tests {
namespace {

struct Grid {
  std::array<Index, 3> dims;
  std::vector<Vec3> points;
  std::vector<double> values;
};

Grid sample(const Box& box, int cells, const std::function<double(const Vec3&)>& value) {
  const Vec3 size = box.max() - box.min();
  const double h = size.maxCoeff() / cells;
  Grid grid;
  for (int k = 0; k < 3; ++k) grid.dims[k] = static_cast<Index>(std::ceil(size[k] / h)) + 1;
  for (Index i = 0; i < grid.dims[0]; ++i) {
    for (Index j = 0; j < grid.dims[1]; ++j) {
      for (Index k = 0; k < grid.dims[2]; ++k) grid.points.push_back(box.min() + h * Vec3(i, j, k));
    }
  }
  for (const Vec3& p : grid.points) {
    const double v = value(p);
    grid.values.push_back(std::abs(v) < 1e-9 ? 1e-9 : v);  // a vertex on a grid point would be many vertices
  }
  return grid;
}

class Extractor {
 public:
  explicit Extractor(const Grid& grid) : grid_(grid) {}

  void tetrahedron(const std::array<Index, 4>& corner) {
    std::vector<Index> in, out;
    for (const Index c : corner) (grid_.values[c] < 0 ? in : out).push_back(c);
    if (in.empty() || out.empty()) return;
    const Vec3 outward = mean(out) - mean(in);
    if (in.size() == 1) {
      const Index a = cut(in[0], out[0]), b = cut(in[0], out[1]), c = cut(in[0], out[2]);
      triangle(a, b, c, outward);
    } else if (in.size() == 3) {
      const Index a = cut(in[0], out[0]), b = cut(in[1], out[0]), c = cut(in[2], out[0]);
      triangle(a, b, c, outward);
    } else {
      const Index a = cut(in[0], out[0]), b = cut(in[0], out[1]), c = cut(in[1], out[1]), d = cut(in[1], out[0]);
      triangle(a, b, c, outward);
      triangle(a, c, d, outward);
    }
  }
  mesh::Mesh take() { return {std::move(vertices_), std::move(corners_)}; }

 private:
  Vec3 mean(const std::vector<Index>& at) const {
    Vec3 sum = Vec3::Zero();
    for (const Index i : at) sum += grid_.points[i];
    return sum / static_cast<double>(at.size());
  }
  Index cut(Index a, Index b) {
    if (a > b) std::swap(a, b);
    const auto [entry, isNew] = cuts_.try_emplace({a, b}, static_cast<Index>(vertices_.size()));
    if (isNew) {
      const double t = std::clamp(grid_.values[a] / (grid_.values[a] - grid_.values[b]), 0.1, 0.9);
      vertices_.push_back(grid_.points[a] * (1 - t) + grid_.points[b] * t);
    }
    return entry->second;
  }
  void triangle(Index a, Index b, Index c, const Vec3& outward) {
    const Vec3 normal = (vertices_[b] - vertices_[a]).cross(vertices_[c] - vertices_[a]);
    if (normal.dot(outward) < 0) std::swap(b, c);
    corners_.insert(corners_.end(), {a, b, c});
  }

  const Grid& grid_;
  std::map<std::pair<Index, Index>, Index> cuts_;
  std::vector<Vec3> vertices_;
  std::vector<Index> corners_;
};

}  // namespace

mesh::Mesh marchingTetrahedra(const Box& box, int cells, const std::function<double(const Vec3&)>& value) {
  const Grid grid = sample(box, cells, value);
  const std::array<Index, 3> stride{grid.dims[1] * grid.dims[2], grid.dims[2], 1};
  Extractor extractor(grid);
  // The six tetrahedra of a cube follow the orders in which its corner can walk the three axes.
  std::array<int, 3> order{0, 1, 2};
  do {
    for (Index i = 0; i + 1 < grid.dims[0]; ++i) {
      for (Index j = 0; j + 1 < grid.dims[1]; ++j) {
        for (Index k = 0; k + 1 < grid.dims[2]; ++k) {
          std::array<Index, 4> corner{i * stride[0] + j * stride[1] + k * stride[2]};
          for (int q = 0; q < 3; ++q) corner[q + 1] = corner[q] + stride[order[q]];
          extractor.tetrahedron(corner);
        }
      }
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return extractor.take();
}

}  // namespace fielddeform::tests
