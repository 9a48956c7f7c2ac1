#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/normal_regions.h>
#include <fielddeform/field/detail/voxel_distances.h>
#include <fielddeform/spatial/simplex.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace fielddeform::field::detail {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kWithin = 0x1p400;        // own units: squares of squares stay in range
constexpr double kTinySquare = 0x1p-960;   // of a distance whose square keeps its digits
constexpr std::int32_t kTileShift = 5;
constexpr std::int32_t kTile = 1 << kTileShift;  // lattice points along the side of a tile, scanned by one thread
constexpr std::size_t kTileSize = std::size_t{1} << (3 * kTileShift);

Vec3 scaledPoint(const Lattice& lattice, const Cell& c, double scale) { return lattice.point(c) * scale; }

// Cubes of points that search together: any primitive.
void search(const PrimitiveDistance& distance, const Lattice& lattice, const std::vector<Cell>& corners, double reach, const CubeFunction& put) {
  parallelFor(corners.size(), 16, [&](std::size_t begin, std::size_t end) {
    spatial::ClosestTree::BlockHint hint;
    std::array<Vec3, kCube> points;
    std::array<PrimitiveHit, kCube> found;
    std::array<VoxelHit, kCube> hits;
    for (std::size_t b = begin; b < end; ++b)
      for (std::size_t first = 0; first < kBlockSize; first += kCube) {
        for (std::size_t i = 0; i < kCube; ++i) points[i] = lattice.point(pointOf(corners[b], nearOrder(first + i)));
        distance.closestWithin(points, reach, found, hint);
        for (std::size_t i = 0; i < kCube; ++i)
          hits[i] = found[i].element == kNoIndex ? VoxelHit{} : VoxelHit{found[i].distance, found[i].element, found[i].weight};
        put(b, first, hits);
      }
  });
}

// Meshes: every part's region leaves its distances at the lattice points in it, and the least one stays.
class Scan {
 public:
  Scan(const PrimitiveDistance& distance, const Lattice& lattice, const std::vector<Cell>& corners, double reach,
       const NormalRegions& regions, double scale)
      : distance_(distance), lattice_(lattice), corners_(corners), reach_(reach), regions_(regions), scale_(scale) {
    for (const Vec3& p : distance.points()) points_.push_back(p * scale);
    makeTiles();
  }

  void run(const CubeFunction& put) const {
    parallelFor(tiles_.size(), 1, [&](std::size_t begin, std::size_t end) {
      Board board;
      for (std::size_t t = begin; t < end; ++t) {
        clear(tiles_[t], board);
        for (const std::uint32_t r : tiles_[t].regions) scan(regions_.regions()[r], board);
        for (const std::uint32_t b : tiles_[t].blocks) hand(b, board, put);
      }
    });
  }

 private:
  struct Tile {
    Cell low;
    std::vector<std::uint32_t> blocks, regions;
  };
  // A tile's points, z fastest.
  struct Board {
    Cell low{};
    std::uint64_t wanted = 0;  // its blocks
    std::vector<double> square;
    std::vector<Index> element;
    std::vector<HalfSpace> conditions;
    SignedBall known;
  };

  static std::size_t blockOf(int x, int y, int z) { return static_cast<std::size_t>((x >> 3) << 4 | (y >> 3) << 2 | z >> 3); }
  static std::size_t placeOf(int x, int y, int z) { return static_cast<std::size_t>((x << kTileShift | y) << kTileShift | z); }
  Cell offsetOf(std::size_t block, const Board& board) const {
    Cell c = corners_[block];
    for (std::size_t k = 0; k < 3; ++k) c[k] -= board.low[k];
    return c;
  }

  void makeTiles() {
    std::vector<Cell> lows(corners_.size());
    for (std::size_t i = 0; i < corners_.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k) lows[i][k] = corners_[i][k] & ~(kTile - 1);
    std::vector<Cell> sorted = lows;
    std::sort(sorted.begin(), sorted.end());
    sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
    for (const Cell& low : sorted) tiles_.push_back({low, {}, {}});
    for (std::size_t i = 0; i < lows.size(); ++i) find(lows[i])->blocks.push_back(static_cast<std::uint32_t>(i));
    const auto& all = regions_.regions();
    for (std::size_t r = 0; r < all.size(); ++r) addToTiles(static_cast<std::uint32_t>(r), regions_.boxOf(all[r]));
  }

  std::vector<Tile>::iterator find(const Cell& low) {
    const auto at = std::lower_bound(tiles_.begin(), tiles_.end(), low, [](const Tile& t, const Cell& c) { return t.low < c; });
    return at != tiles_.end() && at->low == low ? at : tiles_.end();
  }

  void addToTiles(std::uint32_t region, const Box& box) {
    constexpr double kFarthest = 1 << 30;
    Cell low, high;
    for (int k = 0; k < 3; ++k) {
      low[static_cast<std::size_t>(k)] = static_cast<std::int32_t>(std::floor(std::clamp(box.min()[k], -kFarthest, kFarthest))) & ~(kTile - 1);
      high[static_cast<std::size_t>(k)] = static_cast<std::int32_t>(std::floor(std::clamp(box.max()[k], -kFarthest, kFarthest)));
    }
    for (std::int32_t x = low[0]; x <= high[0]; x += kTile)
      for (std::int32_t y = low[1]; y <= high[1]; y += kTile)
        for (std::int32_t z = low[2]; z <= high[2]; z += kTile)
          if (const auto tile = find({x, y, z}); tile != tiles_.end()) tile->regions.push_back(region);
  }

  void clear(const Tile& tile, Board& board) const {
    board.low = tile.low;
    board.square.assign(kTileSize, kInfinity);
    board.element.assign(kTileSize, kNoIndex);
    board.wanted = 0;
    for (const std::uint32_t b : tile.blocks) {
      const Cell c = offsetOf(b, board);
      board.wanted |= std::uint64_t{1} << blockOf(c[0], c[1], c[2]);
    }
  }

  // Integers from low to high, in a tile.
  struct Range {
    int begin, end;
    Range(double low, double high, std::int32_t first)
        : begin(static_cast<int>(std::ceil(std::clamp(low - first, 0.0, double{kTile})))),
          end(static_cast<int>(std::floor(std::clamp(high - first, -1.0, kTile - 1.0))) + 1) {}
  };

  void scan(const Region& r, Board& board) const {
    std::array<Vec3, 3> held;
    const auto corners = regions_.corners(r, held);
    const Box box = regions_.boxOf(r);
    regions_.conditions(r, board.conditions);
    const std::size_t a = r.axis > 2 ? 0 : r.axis;
    const Range slices(box.min()[static_cast<int>(a)], box.max()[static_cast<int>(a)], board.low[a]);
    for (int k = slices.begin; k < slices.end; ++k) {
      double low[2], high[2];
      if (!sliceOf(r, corners, box, board.low[a] + k, low, high)) continue;
      const std::size_t b = (a + 1) % 3, c = (a + 2) % 3;
      const Range first(low[0], high[0], board.low[b]), second(low[1], high[1], board.low[c]);
      Cell at;
      at[a] = k;
      for (at[b] = first.begin; at[b] < first.end; ++at[b])
        for (at[c] = second.begin; at[c] < second.end; ++at[c]) visit(r, at, board);
    }
  }

  // The rectangle of a slice that holds the region's points. False: none.
  bool sliceOf(const Region& r, std::span<const Vec3> corners, const Box& box, double at, double* low, double* high) const {
    const int a = r.axis > 2 ? 0 : r.axis;
    for (int k = 0; k < 2; ++k) {
      const int other = (a + 1 + k) % 3;
      low[k] = r.axis > 2 ? box.min()[other] : kInfinity;
      high[k] = r.axis > 2 ? box.max()[other] : -kInfinity;
    }
    if (r.axis > 2) return true;
    double least = kInfinity, most = -kInfinity;
    for (const Vec3& q : corners) {
      least = std::min(least, r.sign * (at - q[a]));
      most = std::max(most, r.sign * (at - q[a]));
    }
    if (most < -regions_.margin()) return false;
    most = std::max(most, 0.0);
    for (const Vec3& q : corners) {
      // Between the part's own corners the pencil may have begun anywhere.
      const double to = least >= 0 ? r.sign * (at - q[a]) : most, from = least >= 0 ? to : 0;
      for (int k = 0; k < 2; ++k) {
        const double x = q[(a + 1 + k) % 3], lowest = static_cast<double>(r.low[k]), highest = static_cast<double>(r.high[k]);
        low[k] = std::min({low[k], x + from * lowest, x + to * lowest});
        high[k] = std::max({high[k], x + from * highest, x + to * highest});
      }
    }
    for (int k = 0; k < 2; ++k) low[k] -= regions_.margin(), high[k] += regions_.margin();
    return true;
  }

  void visit(const Region& r, const Cell& at, Board& board) const {
    if (!(board.wanted >> blockOf(at[0], at[1], at[2]) & 1)) return;
    const Cell cell{board.low[0] + at[0], board.low[1] + at[1], board.low[2] + at[2]};
    for (const HalfSpace& h : board.conditions)
      if (h.g[0] * cell[0] + h.g[1] * cell[1] + h.g[2] * cell[2] > h.most) return;
    const Vec3 q = scaledPoint(lattice_, cell, scale_);
    const std::size_t place = placeOf(at[0], at[1], at[2]);
    double& best = board.square[place];
    Index& element = board.element[place];
    for (const Index e : regions_.elements(r)) {
      const double square = test(q, e).squaredDistance;
      if (square > best || (square == best && element < e)) continue;
      best = square;
      element = e;
    }
  }

  spatial::SimplexHit test(const Vec3& q, Index element) const {
    const auto& f = distance_.elements()[element];
    return spatial::closestOnTriangle(q, points_[f[0]], points_[f[1]], points_[f[2]]);
  }

  void hand(std::size_t block, Board& board, const CubeFunction& put) const {
    const Cell offset = offsetOf(block, board);
    std::array<VoxelHit, kCube> hits;
    for (std::size_t first = 0; first < kBlockSize; first += kCube) {
      for (std::size_t i = 0; i < kCube; ++i) {
        const Cell at = pointOf(offset, nearOrder(first + i));
        const std::size_t place = placeOf(at[0], at[1], at[2]);
        hits[i] = hitOf(pointOf(corners_[block], nearOrder(first + i)), board.square[place], board.element[place]);
      }
      if (distance_.isSigned()) sign(corners_[block], first, hits, board.known);
      put(block, first, hits);
    }
  }

  VoxelHit hitOf(const Cell& cell, double square, Index element) const {
    if (element == kNoIndex) return {};
    VoxelHit hit{0, element, Vec3::Zero()};
    if (square >= kTinySquare) hit.distance = std::sqrt(square) / scale_;
    else hit.distance = distance_.closest(lattice_.point(cell), kInfinity, {element, false})->distance;
    if (hit.distance > reach_) return {};
    if (distance_.hasPointRadius()) hit.weight = test(scaledPoint(lattice_, cell, scale_), element).weight;
    return hit;
  }

  void sign(const Cell& corner, std::size_t first, std::array<VoxelHit, kCube>& hits, SignedBall& known) const {
    std::array<Vec3, kCube> points;
    std::array<double, kCube> distance;
    std::array<bool, kCube> inside{};
    for (std::size_t i = 0; i < kCube; ++i) {
      points[i] = lattice_.point(pointOf(corner, nearOrder(first + i)));
      distance[i] = hits[i].element == kNoIndex ? -1 : hits[i].distance;
    }
    distance_.signsOf(points, distance, inside, known);
    for (std::size_t i = 0; i < kCube; ++i)
      if (inside[i]) hits[i].distance = -hits[i].distance;
  }

  const PrimitiveDistance& distance_;
  const Lattice& lattice_;
  const std::vector<Cell>& corners_;
  double reach_;
  const NormalRegions& regions_;
  double scale_;               // to own units: a power of two
  std::vector<Vec3> points_;   // own units
  std::vector<Tile> tiles_;
};

// The power of two that brings coordinates near one.
double scaleOf(const std::vector<Vec3>& points) {
  double largest = 0;
  for (const Vec3& p : points) largest = std::max(largest, p.cwiseAbs().maxCoeff());
  return largest > 0 ? std::ldexp(1.0, -std::clamp(std::ilogb(largest), -1000, 1000)) : 1;
}

bool inRange(const Lattice& lattice, const std::vector<Cell>& corners, double scale) {
  double greatest = 0;
  for (const Cell& corner : corners)
    for (const Vec3& p : {lattice.point(corner), lattice.point(pointOf(corner, kBlockSize - 1))})
      for (int k = 0; k < 3; ++k) greatest = std::abs(p[k]) <= greatest ? greatest : std::abs(p[k]);  // also a NaN
  return greatest * scale < kWithin;
}

}  // namespace

void voxelDistances(const PrimitiveDistance& distance, const Lattice& lattice, const std::vector<Cell>& corners, double reach,
                    const CubeFunction& put, double mostSteps) {
  const double voxels = static_cast<double>(corners.size() * kBlockSize), scale = scaleOf(distance.points());
  if (distance.corners() == 3 && inRange(lattice, corners, scale))
    if (const auto regions = NormalRegions::of(distance, lattice, reach / lattice.voxel, mostSteps * voxels))
      return Scan(distance, lattice, corners, reach, *regions, scale).run(put);
  search(distance, lattice, corners, reach, put);
}

}  // namespace fielddeform::field::detail
