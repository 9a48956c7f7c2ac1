#include "isosurface.h"

#include <fielddeform/core/parallel.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace fielddeform::samples {
namespace {

constexpr std::size_t kBlock = 8;  // grid points a block's side: whole blocks far from the surface are skipped

struct Grid {
  Vec3 origin;
  double spacing;
  std::array<std::size_t, 3> size;
  std::vector<float> value;

  std::size_t at(std::size_t i, std::size_t j, std::size_t k) const { return (i * size[1] + j) * size[2] + k; }
  Vec3 point(std::size_t i, std::size_t j, std::size_t k) const {
    return origin + spacing * Vec3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
  }
};

Grid sample(const Box& box, double spacing, const Implicit& value) {
  Grid grid{box.min(), spacing, {}, {}};
  std::array<std::size_t, 3> blocks;
  for (int k = 0; k < 3; ++k) {
    grid.size[k] = static_cast<std::size_t>(std::ceil(box.sizes()[k] / spacing)) + 1;
    blocks[k] = (grid.size[k] + kBlock - 1) / kBlock;
  }
  grid.value.resize(grid.size[0] * grid.size[1] * grid.size[2]);
  const double reach = 2 * spacing * (kBlock - 1) / 2 * std::sqrt(3.0);  // by the slope's bound
  parallelFor(blocks[0] * blocks[1] * blocks[2], 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      const std::array<std::size_t, 3> from{b / (blocks[1] * blocks[2]) * kBlock, b / blocks[2] % blocks[1] * kBlock,
                                            b % blocks[2] * kBlock};
      std::array<std::size_t, 3> to;
      for (int k = 0; k < 3; ++k) to[k] = std::min(from[k] + kBlock, grid.size[k]);
      const double middle = value(grid.point(from[0], from[1], from[2]) + Vec3::Constant(spacing * (kBlock - 1) / 2));
      const bool far = std::abs(middle) > reach;
      for (std::size_t i = from[0]; i < to[0]; ++i) {
        for (std::size_t j = from[1]; j < to[1]; ++j) {
          for (std::size_t k = from[2]; k < to[2]; ++k) {
            grid.value[grid.at(i, j, k)] = static_cast<float>(far ? middle : value(grid.point(i, j, k)));
          }
        }
      }
    }
  });
  return grid;
}

/// Whether the surface crosses a cell as one sheet: no face has only its diagonals in common, and the corners inside
/// hang together along edges, as do those outside. Cells like this make a manifold.
bool isOneSheet(unsigned inside) {
  constexpr unsigned kFaces[6][4] = {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                     {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};
  const auto in = [&](unsigned corner) { return (inside >> corner & 1) != 0; };
  for (const auto& f : kFaces) {
    if (in(f[0]) == in(f[2]) && in(f[1]) == in(f[3]) && in(f[0]) != in(f[1])) return false;
  }
  for (const unsigned set : {inside, ~inside & 0xFFu}) {
    unsigned reached = set & (~set + 1);
    for (int step = 0; step < 4; ++step) {
      unsigned grown = reached;
      for (unsigned corner = 0; corner < 8; ++corner) {
        if (!(reached >> corner & 1)) continue;
        for (unsigned axis = 1; axis < 8; axis *= 2) grown |= 1u << (corner ^ axis);
      }
      reached = grown & set;
    }
    if (reached != set) return false;
  }
  return true;
}

/// Fills cells in which sheets of the surface nearly touch, until none is left.
void fillTightGaps(Grid& grid) {
  static const std::vector<char> oneSheet = [] {
    std::vector<char> table(256);
    for (unsigned i = 0; i < 256; ++i) table[i] = isOneSheet(i);
    return table;
  }();
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t i = 0; i + 1 < grid.size[0]; ++i) {
      for (std::size_t j = 0; j + 1 < grid.size[1]; ++j) {
        for (std::size_t k = 0; k + 1 < grid.size[2]; ++k) {
          unsigned inside = 0;
          const auto corner = [&](unsigned c) -> float& {
            return grid.value[grid.at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2))];
          };
          for (unsigned c = 0; c < 8; ++c) inside |= static_cast<unsigned>(corner(c) < 0) << c;
          if (oneSheet[inside]) continue;
          for (unsigned c = 0; c < 8; ++c) corner(c) = std::min(corner(c), static_cast<float>(-0.3 * grid.spacing));
          changed = true;
        }
      }
    }
  }
}

/// One vertex a cell that the surface crosses: the mean of its edges' crossings.
std::vector<Vec3> cellVertices(const Grid& grid, std::vector<Index>& cellVertex) {
  std::vector<Vec3> vertices;
  cellVertex.assign(grid.value.size(), kNoIndex);
  for (std::size_t i = 0; i + 1 < grid.size[0]; ++i) {
    for (std::size_t j = 0; j + 1 < grid.size[1]; ++j) {
      for (std::size_t k = 0; k + 1 < grid.size[2]; ++k) {
        Vec3 sum = Vec3::Zero();
        int crossings = 0;
        for (int corner = 0; corner < 8; ++corner) {
          const std::array<std::size_t, 3> a{i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2 & 1)};
          const double va = grid.value[grid.at(a[0], a[1], a[2])];
          for (int axis = 0; axis < 3; ++axis) {
            if (corner >> axis & 1) continue;
            std::array<std::size_t, 3> b = a;
            ++b[axis];
            const double vb = grid.value[grid.at(b[0], b[1], b[2])];
            if ((va < 0) == (vb < 0)) continue;
            sum += grid.point(a[0], a[1], a[2]) + va / (va - vb) * grid.spacing * Vec3::Unit(axis);
            ++crossings;
          }
        }
        if (crossings == 0) continue;
        cellVertex[grid.at(i, j, k)] = static_cast<Index>(vertices.size());
        vertices.push_back(sum / crossings);
      }
    }
  }
  return vertices;
}

/// Four cells meet at a grid edge that crosses the surface: a quad each.
std::vector<std::array<Index, 4>> quads(const Grid& grid, const std::vector<Index>& cellVertex) {
  std::vector<std::array<Index, 4>> out;
  const std::size_t step[3] = {grid.size[1] * grid.size[2], grid.size[2], 1};
  for (std::size_t i = 1; i + 1 < grid.size[0]; ++i) {
    for (std::size_t j = 1; j + 1 < grid.size[1]; ++j) {
      for (std::size_t k = 1; k + 1 < grid.size[2]; ++k) {
        const std::size_t at = grid.at(i, j, k);
        for (int axis = 0; axis < 3; ++axis) {
          const bool in = grid.value[at] < 0, inNext = grid.value[at + step[axis]] < 0;
          if (in == inNext) continue;
          const std::size_t u = step[(axis + 1) % 3], v = step[(axis + 2) % 3];
          std::array<Index, 4> quad{cellVertex[at - u - v], cellVertex[at - v], cellVertex[at], cellVertex[at - u]};
          if (inNext) std::swap(quad[1], quad[3]);
          out.push_back(quad);
        }
      }
    }
  }
  return out;
}

/// Moves every vertex towards the mean of its neighbours and back onto the surface, by steps of Newton's method.
void relax(std::vector<Vec3>& vertices, const std::vector<std::array<Index, 4>>& faces, const Implicit& value,
           double spacing, int steps) {
  std::vector<Vec3> sum(vertices.size(), Vec3::Zero());
  std::vector<int> count(vertices.size(), 0);
  for (const auto& f : faces) {
    for (int k = 0; k < 4; ++k) {
      sum[f[k]] += vertices[f[(k + 1) % 4]] + vertices[f[(k + 3) % 4]];
      count[f[k]] += 2;
    }
  }
  parallelFor(vertices.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      Vec3 p = 0.5 * vertices[v] + 0.5 * sum[v] / std::max(1, count[v]);
      for (int step = 0; step < steps; ++step) {
        const Vec3 g = gradient(value, p, 0.2 * spacing);
        const double slope = std::max(g.squaredNorm(), 0.04);
        const Vec3 move = value(p) / slope * g;
        p -= move * std::min(1.0, 0.7 * spacing / std::max(move.norm(), 1e-12));
      }
      vertices[v] = p;
    }
  });
}

}  // namespace

Vec3 gradient(const Implicit& value, const Vec3& at, double h) {
  Vec3 g;
  for (int k = 0; k < 3; ++k) g[k] = (value(at + h * Vec3::Unit(k)) - value(at - h * Vec3::Unit(k))) / (2 * h);
  return g;
}

mesh::Mesh isosurface(const Box& box, double spacing, const Implicit& value) {
  Grid grid = sample(box, spacing, value);
  fillTightGaps(grid);
  std::vector<Index> cellVertex;
  std::vector<Vec3> vertices = cellVertices(grid, cellVertex);
  const auto faces = quads(grid, cellVertex);
  for (int round = 0; round < 4; ++round) relax(vertices, faces, value, spacing, round == 3 ? 2 : 1);
  std::vector<Index> corners;
  for (const auto& f : faces) {
    const bool first = (vertices[f[0]] - vertices[f[2]]).norm() <= (vertices[f[1]] - vertices[f[3]]).norm();
    if (first)
      corners.insert(corners.end(), {f[0], f[1], f[2], f[0], f[2], f[3]});
    else
      corners.insert(corners.end(), {f[1], f[2], f[3], f[1], f[3], f[0]});
  }
  return {std::move(vertices), std::move(corners)};
}

}  // namespace fielddeform::samples
