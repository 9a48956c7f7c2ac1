#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/random.h>
#include <fielddeform/field/detail/vdb_grid.h>
#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>

namespace fielddeform::field {

bool gridsAvailable() noexcept { return true; }

namespace detail {
namespace {

using Tree = openvdb::FloatTree;
using Leaf = Tree::LeafNodeType;
using openvdb::Coord;

constexpr double kFarthest = 1 << 28;  // voxels: indices and their neighbours fit into 32 bits

void initialize() {
  static const bool done = [] {
    openvdb::initialize();
    return true;
  }();
  static_cast<void>(done);
}

Coord coordOf(const Cell& c) { return {c[0], c[1], c[2]}; }

// The values of a cube of N^3 voxels, z fastest; false if one is in no leaf.
template <int N>
bool stencil(const Tree& tree, const Coord& low, double* out, bool* allOn) {
  const openvdb::Int32 x = low.x() & 7, y = low.y() & 7, z = low.z() & 7;
  if (x + N <= 8 && y + N <= 8 && z + N <= 8) {
    const Leaf* leaf = tree.probeConstLeaf(low);
    if (!leaf) return false;
    const openvdb::Index first = static_cast<openvdb::Index>(x << 6 | y << 3 | z);
    const float* v = leaf->buffer().data() + first;
    const bool ask = allOn && !leaf->isDense();
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j)
        for (int k = 0; k < N; ++k) {
          const int at = i << 6 | j << 3 | k;
          *out++ = static_cast<double>(v[at]);
          if (ask && !leaf->isValueOn(first + static_cast<openvdb::Index>(at))) *allOn = false;
        }
    return true;
  }
  const openvdb::tree::ValueAccessor<const Tree, false> accessor(tree);
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j)
      for (int k = 0; k < N; ++k) {
        const Coord at = low.offsetBy(i, j, k);
        const Leaf* leaf = accessor.probeConstLeaf(at);
        if (!leaf) return false;
        *out++ = static_cast<double>(leaf->getValue(at));
        if (allOn && !leaf->isValueOn(at)) *allOn = false;
      }
  return true;
}

// Weights of N samples along an axis and their derivatives, at t in [0, 1) of the way.
void linear(double t, double* w, double* d) {
  w[0] = 1 - t, w[1] = t;
  d[0] = -1, d[1] = 1;
}
void quadratic(double t, double* w, double* d) {  // the parabola through -1, 0, 1
  w[0] = 0.5 * t * (t - 1), w[1] = (1 - t) * (1 + t), w[2] = 0.5 * t * (t + 1);
  d[0] = t - 0.5, d[1] = -2 * t, d[2] = t + 0.5;
}

template <int N>
void interpolate(const double* v, const double (*w)[3], const double (*d)[3], double& value, Vec3& gradient) {
  value = 0;
  gradient.setZero();
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) {
      double alongZ = 0, slopeZ = 0;
      for (int k = 0; k < N; ++k, ++v) {
        alongZ += w[2][k] * *v;
        slopeZ += d[2][k] * *v;
      }
      value += w[0][i] * w[1][j] * alongZ;
      gradient += Vec3(d[0][i] * w[1][j] * alongZ, w[0][i] * d[1][j] * alongZ, w[0][i] * w[1][j] * slopeZ);
    }
}

}  // namespace

struct VdbGrid::Impl {
  Lattice lattice;
  openvdb::FloatGrid::Ptr grid;
  std::vector<Leaf*> leaves;
};

double VdbGrid::megabytesOf(const std::vector<Cell>& corners) {
  using Middle = openvdb::FloatTree::RootNodeType::ChildNodeType::ChildNodeType;
  using Upper = openvdb::FloatTree::RootNodeType::ChildNodeType;
  // Nodes of a side of 2^shift voxels above the leaves.
  const auto nodes = [&](std::int32_t shift) {
    std::vector<Cell> keys;
    for (const Cell& c : corners) {
      const Cell key{c[0] >> shift, c[1] >> shift, c[2] >> shift};
      if (keys.empty() || keys.back() != key) keys.push_back(key);
    }
    std::sort(keys.begin(), keys.end());
    return static_cast<double>(std::unique(keys.begin(), keys.end()) - keys.begin());
  };
  const double leaf = sizeof(Leaf) + sizeof(float) * static_cast<double>(kBlockSize);
  return 1e-6 * (static_cast<double>(corners.size()) * leaf + nodes(Middle::TOTAL) * static_cast<double>(sizeof(Middle)) +
                 nodes(Upper::TOTAL) * static_cast<double>(sizeof(Upper)));
}

VdbGrid::VdbGrid(const Lattice& lattice, const std::vector<Cell>& corners, float background)
    : impl_(std::make_unique<Impl>()) {
  initialize();
  impl_->lattice = lattice;
  impl_->grid = openvdb::FloatGrid::create(background);
  auto transform = openvdb::math::Transform::createLinearTransform(lattice.voxel);
  transform->postTranslate(openvdb::Vec3d(lattice.origin.x(), lattice.origin.y(), lattice.origin.z()));
  impl_->grid->setTransform(transform);
  impl_->leaves.reserve(corners.size());
  for (const Cell& c : corners) {
    impl_->leaves.push_back(new Leaf(coordOf(c), background, true));
    impl_->grid->tree().addLeaf(impl_->leaves.back());  // owns it
  }
}
VdbGrid::~VdbGrid() = default;
VdbGrid::VdbGrid(VdbGrid&&) noexcept = default;

float* VdbGrid::values(std::size_t block) { return impl_->leaves[block]->buffer().data(); }
void VdbGrid::switchOff(std::size_t block, std::size_t voxel) {
  impl_->leaves[block]->setValueOff(static_cast<openvdb::Index>(voxel));
}
std::size_t VdbGrid::voxelCount() const noexcept { return impl_->leaves.size() * kBlockSize; }
double VdbGrid::megabytes() const { return 1e-6 * static_cast<double>(impl_->grid->tree().memUsage()); }

bool VdbGrid::sample(const Vec3& point, Sampling sampling, double& value, Vec3& gradient, bool* allOn) const {
  const Vec3 u = impl_->lattice.local(point);
  if (!(u.array().abs() < kFarthest).all()) return false;  // one by one: a maximum may leave a NaN out
  const Vec3 low(std::floor(u.x()), std::floor(u.y()), std::floor(u.z())), t = u - low;
  const Coord at(static_cast<openvdb::Int32>(low.x()), static_cast<openvdb::Int32>(low.y()),
                 static_cast<openvdb::Int32>(low.z()));
  const Tree& tree = impl_->grid->tree();
  double v[27], w[3][3], d[3][3];
  if (sampling == Sampling::Quadratic) {
    if (!stencil<3>(tree, at.offsetBy(-1), v, allOn)) return false;
    for (int k = 0; k < 3; ++k) quadratic(t[k], w[k], d[k]);
    interpolate<3>(v, w, d, value, gradient);
  } else {
    if (!stencil<2>(tree, at, v, allOn)) return false;
    for (int k = 0; k < 3; ++k) linear(t[k], w[k], d[k]);
    interpolate<2>(v, w, d, value, gradient);
  }
  gradient /= impl_->lattice.voxel;
  return true;
}

void VdbGrid::describe(const std::string& name, const MetaData& meta, VdbClass what) {
  openvdb::FloatGrid& grid = *impl_->grid;
  grid.setName(name);
  grid.setGridClass(what == VdbClass::LevelSet ? openvdb::GRID_LEVEL_SET
                    : what == VdbClass::Fog ? openvdb::GRID_FOG_VOLUME : openvdb::GRID_UNKNOWN);
  for (const auto& [key, value] : meta) {
    if (const auto* text = std::get_if<std::string>(&value)) grid.insertMeta(key, openvdb::StringMetadata(*text));
    else grid.insertMeta(key, openvdb::DoubleMetadata(std::get<double>(value)));
  }
}

namespace {

class MemoryArchive : public openvdb::io::Archive {
 public:
  using openvdb::io::Archive::write;
};

// OpenVDB puts a random identifier into every file: here it is a hash of what follows, so that equal grids are equal
// files. Magic number 8 bytes, versions 12, whether there are offsets 1; then the text.
void replaceIdentifier(std::string& bytes) {
  constexpr std::size_t kAt = 21, kLength = 36;
  if (bytes.size() < kAt + kLength || bytes[kAt + 8] != '-') return;
  std::uint64_t a = 0, b = 1;
  for (std::size_t i = kAt + kLength; i < bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, std::min<std::size_t>(8, bytes.size() - i));
    a = splitmix64(a, word);
    b = splitmix64(b, ~word);
  }
  const std::string id = fmt::format("{:08x}-{:04x}-{:04x}-{:04x}-{:012x}", a >> 32, a >> 16 & 0xFFFF, a & 0xFFFF, b >> 48,
                                     b & 0xFFFFFFFFFFFF);
  bytes.replace(kAt, kLength, id);
}

}  // namespace

void writeVdbFile(std::span<const VdbGrid> grids, const std::filesystem::path& path) {
  AtomicFile file(path);  // says at once if the folder is missing
  openvdb::GridCPtrVec list;
  for (const VdbGrid& g : grids) list.push_back(g.impl_->grid);
  std::ostringstream stream(std::ios::binary);
  try {
    MemoryArchive().write(stream, list, true);
  } catch (const openvdb::Exception& problem) {
    throw IoError(path, fmt::format("OpenVDB: {}", problem.what()));
  }
  std::string bytes = std::move(stream).str();
  replaceIdentifier(bytes);
  file.write(bytes);
  file.commit();
}

}  // namespace detail
}  // namespace fielddeform::field
