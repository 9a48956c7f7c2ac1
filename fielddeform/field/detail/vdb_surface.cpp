#include <fielddeform/core/error.h>
#include <fielddeform/field/detail/vdb_reader.h>
#include <fielddeform/field/detail/vdb_surface.h>
#include <fmt/format.h>

#include <algorithm>

namespace fielddeform::field::detail {
namespace {

constexpr double kBytesEach = kBlockSize * sizeof(float) + 3 * sizeof(Cell);  // of a block

// Blocks through which the surface may pass: those around stored blocks, and where cubes of one value inside meet others
// outside.
class SurfaceBlocks {
 public:
  SurfaceBlocks(const VdbVolume& volume, double isovalue, std::size_t most) : volume_(volume), isovalue_(isovalue), most_(most) {
    for (const Cell& c : volume.blocks) addAround(c);
    const bool outside = isInside(volume.background);
    for (std::size_t level = 0; level < 3; ++level)
      for (const VdbVolume::Tile& tile : volume.tiles[level])
        if (isInside(tile.value) != outside) addBorder(tile, level);
    tidy();
  }
  /// False: more than allowed.
  bool fits() const { return blocks_.size() <= most_; }
  std::vector<Cell> take() { return std::move(blocks_); }

 private:
  bool isInside(float value) const {
    return volume_.fog ? static_cast<double>(value) > isovalue_ : static_cast<double>(value) < isovalue_;
  }

  void addAround(const Cell& c) {
    if (!fits()) return;
    for (int i = -8; i <= 8; i += 8)
      for (int j = -8; j <= 8; j += 8)
        for (int k = -8; k <= 8; k += 8) blocks_.push_back({c[0] + i, c[1] + j, c[2] + k});
    if (blocks_.size() > full_) tidy();
  }

  void tidy() {
    std::sort(blocks_.begin(), blocks_.end());
    blocks_.erase(std::unique(blocks_.begin(), blocks_.end()), blocks_.end());
    full_ = 2 * blocks_.size() + 4096;
  }

  void addBorder(const VdbVolume::Tile& tile, std::size_t level) {
    const std::int32_t side = VdbVolume::kSides[level];
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const std::int32_t step : {-side, side}) {
        Cell beside = tile.low;
        beside[axis] += step;
        look(beside, level, axis, step > 0, isInside(tile.value));
      }
  }

  // The cube beside a tile: of one value, or by its parts that touch the tile. Beside a stored block nothing is to be done.
  void look(const Cell& low, std::size_t level, std::size_t axis, bool above, bool inside) {
    if (!fits()) return;
    const std::int32_t side = VdbVolume::kSides[level];
    const auto value = volume_.uniform(low, level);
    if (value && isInside(*value) == inside) return;
    if (!value && level == 0) return;
    const std::int32_t part = value ? 8 : VdbVolume::kSides[level - 1];
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (std::int32_t a = 0; a < side && fits(); a += part)
      for (std::int32_t b = 0; b < side && fits(); b += part) {
        Cell c = low;
        c[u] += a, c[v] += b;
        if (!above) c[axis] += side - part;
        if (value) addAround(c);
        else look(c, level - 1, axis, above, inside);
      }
  }

  const VdbVolume& volume_;
  double isovalue_;
  std::size_t most_, full_ = 4096;
  std::vector<Cell> blocks_;
};

void fill(const VdbVolume& volume, double isovalue, VdbContent& content) {
  content.values.resize(content.corners.size() * kBlockSize);
  const auto signedValue = [&](float value) {
    const double v = static_cast<double>(value);
    return static_cast<float>(volume.fog ? isovalue - v : v - isovalue);
  };
  for (std::size_t b = 0; b < content.corners.size(); ++b) {
    float* out = content.values.data() + b * kBlockSize;
    if (const float* in = volume.block(content.corners[b])) std::transform(in, in + kBlockSize, out, signedValue);
    else std::fill(out, out + kBlockSize, signedValue(*volume.uniform(content.corners[b], 0)));
  }
}

}  // namespace

VdbContent readVdbContent(std::string_view bytes, const std::filesystem::path& path, const std::string& grid,
                          std::optional<double> isovalue, double maxMegabytes) {
  const VdbVolume volume = readVdbVolume(bytes, path, grid, maxMegabytes);
  VdbContent content;
  content.name = volume.name;
  content.fog = volume.fog;
  content.toWorld = volume.toWorld;
  const double iso = isovalue.value_or(content.fog ? 0.5 : 0);
  SurfaceBlocks blocks(volume, iso, static_cast<std::size_t>(maxMegabytes * 1e6 / kBytesEach));
  if (!blocks.fits()) throw IoError(path, fmt::format("the surface of grid \"{}\" takes more than {:.4g} MB", volume.name, maxMegabytes));
  content.corners = blocks.take();
  fill(volume, iso, content);
  return content;
}

}  // namespace fielddeform::field::detail
