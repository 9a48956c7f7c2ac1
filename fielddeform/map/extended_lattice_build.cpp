// Extended lattices put together, checked and carried over to other boxes.
#include <fielddeform/core/error.h>
#include <fielddeform/map/detail/tricubic.h>
#include <fielddeform/map/extended_lattice.h>
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

namespace fielddeform::map {
namespace {

Box boxOf(Points points) {
  Box box;
  for (const Vec3& p : points) box.extend(p);
  return box;
}

using Key = std::array<std::int64_t, 3>;
struct KeyHash {
  std::size_t operator()(const Key& k) const noexcept {
    std::uint64_t h = 0x9E3779B97F4A7C15u;
    for (const std::int64_t x : k) h = (h ^ static_cast<std::uint64_t>(x)) * 0xD6E8FEB86659FD93u, h ^= h >> 32;
    return static_cast<std::size_t>(h);
  }
};

// Points that have come so far, in cubes as wide as the distance within which two are one: no more than a few a cube.
class Found {
 public:
  Found(const Vec3& origin, double reach) : origin_(origin), reach_(reach) {}

  // The first point within reach, or this one, which gets the number `next`.
  Index of(const Vec3& x, Index next) {
    Key key{};
    for (int k = 0; k < 3; ++k) key[static_cast<std::size_t>(k)] = static_cast<std::int64_t>(std::floor((x[k] - origin_[k]) / reach_));
    Index found = kNoIndex;
    for (int n = 0; n < 27; ++n) {
      const auto cube = cubes_.find({key[0] + n % 3 - 1, key[1] + n / 3 % 3 - 1, key[2] + n / 9 - 1});
      if (cube == cubes_.end()) continue;
      for (const auto& [point, number] : cube->second)
        if ((point - x).norm() <= reach_) found = std::min(found, number);
    }
    if (found != kNoIndex) return found;
    cubes_[key].emplace_back(x, next);
    return next;
  }

 private:
  Vec3 origin_;
  double reach_;
  std::unordered_map<Key, std::vector<std::pair<Vec3, Index>>, KeyHash> cubes_;
};

}  // namespace

ExtendedLattice weld(std::span<const ExtendedLattice> parts, double tolerance, std::vector<std::vector<Index>>* nodeOf) {
  requireInRange("tolerance", tolerance, 1e-15, 1);
  Box box;
  for (const ExtendedLattice& part : parts) {
    part.validate();
    box.extend(boxOf(part.nodes));
  }
  const double size = parts.empty() ? 0 : box.sizes().stableNorm();
  if (!std::isfinite(size)) throw std::invalid_argument("nodes: farther apart than a double holds");
  Found found(parts.empty() ? Vec3(Vec3::Zero()) : box.min(), size > 0 ? tolerance * size : 1);
  ExtendedLattice out;
  std::vector<double> count;
  bool moved = false;
  if (nodeOf) nodeOf->clear();
  for (const ExtendedLattice& part : parts) {
    std::vector<Index> at;
    for (std::size_t n = 0; n < part.nodes.size(); ++n) {
      const Index number = found.of(part.nodes[n], static_cast<Index>(out.nodes.size()));
      if (number == out.nodes.size()) {
        out.nodes.push_back(part.nodes[n]);
        out.displacements.push_back(Vec3::Zero());
        count.push_back(0);
      }
      at.push_back(number);
      if (!part.displacements.empty()) out.displacements[number] += (part.displacements[n] - out.displacements[number]) / (count[number] + 1);
      moved = moved || !part.displacements.empty();
      ++count[number];
    }
    for (std::array<Index, 64> cell : part.cells) {
      for (Index& n : cell) n = at[n];
      out.cells.push_back(cell);
    }
    if (nodeOf) nodeOf->push_back(std::move(at));
  }
  if (!moved) out.displacements.clear();
  return out;
}

Index foldedCell(const ExtendedLattice& lattice) {
  lattice.validate();
  for (std::size_t c = 0; c < lattice.cells.size(); ++c) {
    const auto& cell = lattice.cells[c];
    Box box;
    for (const Index n : cell) box.extend(lattice.nodes[n]);
    const Vec3 size = box.sizes();
    if (!(size.minCoeff() > 0) || !size.allFinite()) return static_cast<Index>(c);
    int side = 0;  // of the determinant so far; left-handed cells are as good
    for (int n = 0; n < 125; ++n) {
      const Vec3 u((n % 5 + 0.5) / 5, (n / 5 % 5 + 0.5) / 5, (n / 25 + 0.5) / 5);
      // In the box's own measure, so that determinants stay in range.
      const double det = detail::localJacobian(u, [&](std::size_t k) {
                           return Vec3((lattice.nodes[cell[k]] - box.min()).cwiseQuotient(size));
                         }).determinant();
      const int here = det > 1e-12 ? 1 : det < -1e-12 ? -1 : 0;
      if (here == 0 || here == -side) return static_cast<Index>(c);
      side = here;
    }
  }
  return kNoIndex;
}

ExtendedLattice refit(ExtendedLattice lattice, const LatticeBox& box) {
  lattice.validate();
  box.validate();
  const Box from = boxOf(lattice.nodes);
  const Vec3 size = from.sizes();
  if (!(size.minCoeff() > 0) || !size.allFinite()) throw std::invalid_argument("nodes: flat, they span no box to carry over");
  for (Vec3& p : lattice.nodes) p = box.origin + box.axes * (p - from.min()).cwiseQuotient(size);
  for (Vec3& d : lattice.displacements) d = box.axes * d.cwiseQuotient(size);
  lattice.validate();
  return lattice;
}

}  // namespace fielddeform::map
