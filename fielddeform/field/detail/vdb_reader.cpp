// .vdb files, versions 222 to 224: header, metadata, one descriptor a grid, and per grid metadata, transform, the
// tree's shape with the values of its inner nodes, and the values of its leaves. Every size is held against what is left of
// the file, and everything taken against the memory allowed, before it is taken.
#include <fielddeform/core/error.h>
#include <fielddeform/field/detail/vdb_bytes.h>
#include <fielddeform/field/detail/vdb_reader.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>

namespace fielddeform::field::detail {
namespace {

constexpr std::int64_t kMagic = 0x56444220;
constexpr std::uint32_t kOldest = 222, kNewest = 224;
constexpr std::int32_t kFarthest = 1 << 30;  // voxels: indices and their neighbours fit into 32 bits
constexpr float kMost = 1e30f;               // values beyond are held there, so that differences are numbers
constexpr std::size_t kUuid = 36;

// What precedes a node's values: which of two values the inactive ones have.
enum Inactive : std::uint8_t { Background, MinusBackground, One, MaskOfBackground, MaskOfOne, MaskOfTwo, AllStored };

struct Descriptor {
  std::string name, type, parent;
  std::uint64_t grid = 0, blocks = 0;
  bool half = false;

  std::string plainName() const { return name.substr(0, name.find('\x1e')); }  // then a number that tells equal names apart
  bool isFloat() const { return type == "Tree_float_5_4_3"; }
  bool isNumbers() const { return isFloat() || type == "Tree_double_5_4_3"; }
};

bool isOn(std::string_view mask, std::size_t i) { return static_cast<unsigned char>(mask[i >> 3]) >> (i & 7) & 1; }

std::size_t countOn(std::string_view mask) {
  std::size_t n = 0;
  for (const char c : mask) n += static_cast<std::size_t>(std::popcount(static_cast<unsigned char>(c)));
  return n;
}

class Reader {
 public:
  Reader(std::string_view bytes, const std::filesystem::path& path, double maxMegabytes)
      : in_(bytes, path), megabytes_(maxMegabytes), left_(maxMegabytes * 1e6) {}

  VdbVolume read(const std::string& name) {
    const Descriptor chosen = choose(readHeader(), name);
    volume_.name = chosen.plainName();
    isFloat_ = chosen.isFloat();
    half_ = chosen.half;
    in_.seek(chosen.grid, "the grid's place");
    compression_ = in_.take<std::uint32_t>("the compression");
    readMetadata();
    readTransform();
    if (!chosen.parent.empty())
      throw IoError(in_.path(), fmt::format("grid \"{}\" shares the tree of \"{}\": read that one", volume_.name, chosen.parent));
    readTree();
    in_.seek(chosen.blocks, "the leaves' place");
    for (std::size_t i = 0; i < volume_.blocks.size(); ++i) {
      const std::string_view mask = in_.take(kBlockSize / 8, "a leaf's mask");
      readValues(mask, kBlockSize, volume_.values.data() + i * kBlockSize);
    }
    volume_.sort();
    return std::move(volume_);
  }

 private:
  std::vector<Descriptor> readHeader() {
    if (in_.take<std::int64_t>("the first word") != kMagic) in_.fail("no OpenVDB file", "a file that begins with \" BDV\"");
    const auto version = in_.take<std::uint32_t>("the version");
    if (version < kOldest || version > kNewest)
      in_.fail(fmt::format("file version {}", version), fmt::format("{} to {}", kOldest, kNewest));
    in_.take(8, "the library's version");
    if (!in_.take<std::uint8_t>("whether there are offsets"))
      in_.fail("a stream without the places of its grids", "a file that was written with them");
    in_.take(kUuid, "the identifier");
    Metadata unused;
    readMetadata(unused);
    const auto count = in_.take<std::uint32_t>("the number of grids");
    std::vector<Descriptor> all;
    for (std::uint32_t i = 0; i < count; ++i) {
      Descriptor d;
      d.name = in_.text("a grid's name");
      d.type = in_.text("a grid's type");
      constexpr std::string_view kHalf = "_HalfFloat";
      d.half = d.type.ends_with(kHalf);
      if (d.half) d.type.resize(d.type.size() - kHalf.size());
      d.parent = in_.text("a grid's parent");
      d.grid = in_.take<std::uint64_t>("a grid's place");
      d.blocks = in_.take<std::uint64_t>("a grid's place");
      const auto end = in_.take<std::uint64_t>("a grid's place");
      if (end < in_.at()) in_.fail(fmt::format("a grid that ends at {}", end), "an end behind its description");
      spend(sizeof(Descriptor) + d.name.size() + d.type.size());
      all.push_back(std::move(d));
      in_.seek(end, "a grid's end");  // where the next is described
    }
    return all;
  }

  Descriptor choose(const std::vector<Descriptor>& all, const std::string& name) const {
    std::string names;
    int listed = 0;
    for (const Descriptor& d : all) {
      if (!d.isNumbers()) continue;
      if (name.empty() || d.plainName() == name || d.name == name) return d;
      if (++listed <= 20) names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", d.plainName());
    }
    if (names.empty()) throw IoError(in_.path(), "no grid of floats or doubles, expected at least one");
    throw IoError(in_.path(), fmt::format("no grid \"{}\", expected one of {}", name, names));
  }

  struct Value {
    std::string type, bytes;
  };
  using Metadata = std::map<std::string, Value>;

  void readMetadata(Metadata& out) {
    const auto count = in_.take<std::uint32_t>("the number of metadata");
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::string key = in_.text("a metadatum's name"), type = in_.text("a metadatum's type");
      const std::string value = in_.text("a metadatum");
      if (key == "class" || key == "is_saved_as_half_float") out[key] = {type, value};
    }
  }

  void readMetadata() {
    Metadata metadata;
    readMetadata(metadata);
    volume_.fog = metadata["class"].bytes == "fog volume";
    const std::string& half = metadata["is_saved_as_half_float"].bytes;
    half_ = half_ || (!half.empty() && half[0] != 0);
  }

  Vec3 readVector() {
    Vec3 v;
    for (int k = 0; k < 3; ++k) v[k] = in_.take<double>("the transform");
    return v;
  }

  void readTransform() {
    const std::string type = in_.text("the transform's type");
    Eigen::Matrix4d& m = volume_.toWorld;
    if (type == "AffineMap" || type == "UnitaryMap") {
      for (int row = 0; row < 4; ++row)  // of a matrix that is multiplied from the right
        for (int column = 0; column < 4; ++column) m(column, row) = in_.take<double>("the transform");
    } else if (type == "TranslationMap") {
      m.block<3, 1>(0, 3) = readVector();
    } else if (type == "ScaleMap" || type == "UniformScaleMap" || type == "ScaleTranslateMap" || type == "UniformScaleTranslateMap") {
      if (type.find("Translate") != std::string::npos) m.block<3, 1>(0, 3) = readVector();
      m.block<3, 3>(0, 0) = readVector().asDiagonal();
      in_.take(4 * sizeof(double) * 3, "the transform");  // what follows from the scale
    } else {
      in_.fail(fmt::format("a transform of type \"{}\"", type.substr(0, 60)), "a linear one");
    }
    if (!m.allFinite()) in_.fail("a transform that is not finite", "numbers");
    if (!(std::abs(m.block<3, 3>(0, 0).determinant()) > 0)) in_.fail("a transform that flattens space", "one that can be undone");
  }

  void readTree() {
    if (in_.take<std::int32_t>("the number of buffers") != 1) in_.fail("several buffers", "one");
    volume_.background = isFloat_ ? in_.take<float>("the background") : held(in_.take<double>("the background"));
    volume_.background = held(static_cast<double>(volume_.background));
    const auto tiles = in_.take<std::uint32_t>("the number of tiles"), children = in_.take<std::uint32_t>("the number of nodes");
    for (std::uint32_t i = 0; i < tiles; ++i) {
      const Cell low = readCorner();
      const float value = isFloat_ ? held(static_cast<double>(in_.take<float>("a tile"))) : held(in_.take<double>("a tile"));
      in_.take(1, "a tile");
      addTile(2, low, value);
    }
    for (std::uint32_t i = 0; i < children; ++i) readNode(readCorner(), 2);
  }

  Cell readCorner() {
    Cell c;
    for (std::int32_t& x : c) {
      x = in_.take<std::int32_t>("a node's corner");
      if (x % VdbVolume::kSides[2] != 0 || x < -kFarthest || x > kFarthest)
        in_.fail(fmt::format("a node at {}", x), fmt::format("a multiple of {} within +-{}", VdbVolume::kSides[2], kFarthest));
    }
    return c;
  }

  // A node of level 2 (32^3 of 128^3 voxels) or 1 (16^3 of 8^3), and all below it.
  void readNode(const Cell& low, std::size_t level) {
    const std::int32_t log = level == 2 ? 5 : 4, part = VdbVolume::kSides[level - 1];
    const std::size_t count = std::size_t{1} << 3 * log;
    const std::string_view children = in_.take(count / 8, "a node's mask"), active = in_.take(count / 8, "a node's mask");
    std::vector<float> values(count);
    readValues(active, count, values.data());
    spend(sizeof(Cell));
    volume_.divided[level - 1].push_back(low);
    const auto cornerOf = [&](std::size_t i) {
      const auto n = static_cast<std::int32_t>(i), most = (1 << log) - 1;
      return Cell{low[0] + part * (n >> 2 * log), low[1] + part * (n >> log & most), low[2] + part * (n & most)};
    };
    for (std::size_t i = 0; i < count; ++i)
      if (!isOn(children, i)) addTile(level - 1, cornerOf(i), values[i]);
    values = {};
    for (std::size_t i = 0; i < count; ++i) {
      if (!isOn(children, i)) continue;
      if (level == 2) readNode(cornerOf(i), 1);
      else addLeaf(cornerOf(i));
    }
  }

  void addTile(std::size_t level, const Cell& low, float value) {
    if (value == volume_.background) return;
    spend(sizeof(VdbVolume::Tile));
    volume_.tiles[level].push_back({low, value});
  }

  void addLeaf(const Cell& low) {
    in_.take(kBlockSize / 8, "a leaf's mask");
    spend(sizeof(Cell) + sizeof(std::uint32_t) + kBlockSize * sizeof(float));
    volume_.blocks.push_back(low);
    volume_.values.resize(volume_.values.size() + kBlockSize);
  }

  // A node's values, of which a file may leave the inactive ones away.
  void readValues(std::string_view active, std::size_t count, float* out) {
    constexpr std::uint32_t kByMask = 2;
    const auto kind = in_.take<std::uint8_t>("a node's kind");
    if (kind > AllStored) in_.fail(fmt::format("a node of kind {}", kind), "0 to 6");
    float inactive[2] = {kind == Background ? volume_.background : -volume_.background, volume_.background};
    if (kind == One || kind == MaskOfOne || kind == MaskOfTwo) inactive[0] = readNumber();
    if (kind == MaskOfTwo) inactive[1] = readNumber();
    std::string_view second;
    if (kind == MaskOfBackground || kind == MaskOfOne || kind == MaskOfTwo) second = in_.take(count / 8, "a node's mask");
    const bool byMask = (compression_ & kByMask) && kind != AllStored;
    const std::size_t stored = byMask ? countOn(active) : count;
    const std::size_t size = half_ ? 2 : isFloat_ ? 4 : 8;
    buffer_.resize(stored * size);
    if (!(half_ && stored == 0)) in_.decompress(compression_, buffer_);
    if (stored == count) {
      for (std::size_t i = 0; i < count; ++i) out[i] = number(i);
      return;
    }
    for (std::size_t i = 0, next = 0; i < count; ++i)
      out[i] = isOn(active, i) ? number(next++) : inactive[!second.empty() && isOn(second, i)];
  }

  float readNumber() {
    return isFloat_ ? held(static_cast<double>(in_.take<float>("a value"))) : held(in_.take<double>("a value"));
  }
  float number(std::size_t i) const {
    if (half_) return held(halfAt(buffer_.data() + 2 * i));
    if (isFloat_) return held(static_cast<double>(valueAt<float>(buffer_.data() + 4 * i)));
    return held(valueAt<double>(buffer_.data() + 8 * i));
  }
  // What is no number counts as far outside a level set, and as nothing in fog.
  float held(double v) const {
    if (std::isnan(v)) return volume_.fog ? 0 : kMost;
    return static_cast<float>(std::clamp(v, -static_cast<double>(kMost), static_cast<double>(kMost)));
  }

  void spend(std::size_t bytes) {
    left_ -= static_cast<double>(bytes);
    if (left_ < 0) throw IoError(in_.path(), fmt::format("the volume takes more than {:.4g} MB", megabytes_));
  }

  VdbBytes in_;
  double megabytes_, left_;
  std::uint32_t compression_ = 0;
  bool isFloat_ = true, half_ = false;
  std::string buffer_;
  VdbVolume volume_;
};

template <class T>
auto findCell(const std::vector<T>& sorted, const Cell& c, const auto& cellOf) {
  const auto at = std::lower_bound(sorted.begin(), sorted.end(), c, [&](const T& a, const Cell& b) { return cellOf(a) < b; });
  return at != sorted.end() && cellOf(*at) == c ? at : sorted.end();
}

}  // namespace

void VdbVolume::sort() {
  place.resize(blocks.size());
  for (std::size_t i = 0; i < place.size(); ++i) place[i] = static_cast<std::uint32_t>(i);
  // Of blocks and tiles that a file names twice, the first counts.
  std::sort(place.begin(), place.end(), [&](std::uint32_t a, std::uint32_t b) {
    return blocks[a] != blocks[b] ? blocks[a] < blocks[b] : a < b;
  });
  place.erase(std::unique(place.begin(), place.end(), [&](std::uint32_t a, std::uint32_t b) { return blocks[a] == blocks[b]; }),
              place.end());
  std::vector<Cell> sorted;
  for (const std::uint32_t i : place) sorted.push_back(blocks[i]);
  blocks = std::move(sorted);
  for (auto& nodes : divided) std::sort(nodes.begin(), nodes.end());
  for (auto& level : tiles)
    std::stable_sort(level.begin(), level.end(), [](const Tile& a, const Tile& b) { return a.low < b.low; });
}

const float* VdbVolume::block(const Cell& corner) const {
  const auto at = findCell(blocks, corner, [](const Cell& c) { return c; });
  return at == blocks.end() ? nullptr : values.data() + std::size_t{place[static_cast<std::size_t>(at - blocks.begin())]} * kBlockSize;
}

std::optional<float> VdbVolume::uniform(const Cell& low, std::size_t level) const {
  if (level == 0 ? block(low) != nullptr : findCell(divided[level - 1], low, [](const Cell& c) { return c; }) != divided[level - 1].end())
    return std::nullopt;
  const auto tile = findCell(tiles[level], low, [](const Tile& t) { return t.low; });
  if (tile != tiles[level].end()) return tile->value;
  if (level == 2) return background;
  Cell parent;
  for (std::size_t k = 0; k < 3; ++k) parent[k] = low[k] & ~(kSides[level + 1] - 1);
  const auto value = uniform(parent, level + 1);
  return value ? *value : background;  // a part of a divided cube that is neither stored nor a tile
}

VdbVolume readVdbVolume(std::string_view bytes, const std::filesystem::path& path, const std::string& grid, double maxMegabytes) {
  return Reader(bytes, path, maxMegabytes).read(grid);
}

}  // namespace fielddeform::field::detail
