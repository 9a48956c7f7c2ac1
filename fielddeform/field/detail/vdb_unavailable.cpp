#include <fielddeform/field/detail/distance_source.h>
#include <fielddeform/field/detail/vdb_grid.h>

#include <stdexcept>
#include <string>

/// What a build without OpenVDB has in place of grids.
namespace fielddeform::field {

bool gridsAvailable() noexcept { return false; }

namespace detail {
namespace {
[[noreturn]] void refuse(const char* what) {
  throw std::runtime_error(std::string("this build has no ") + what + ": configure it with FIELDDEFORM_WITH_OPENVDB=ON");
}
}  // namespace

struct VdbGrid::Impl {};

VdbGrid::VdbGrid(const Lattice&, const std::vector<Cell>&, float) { refuse("distance grids"); }
VdbGrid::~VdbGrid() = default;
VdbGrid::VdbGrid(VdbGrid&&) noexcept = default;
float* VdbGrid::values(std::size_t) { return nullptr; }
std::size_t VdbGrid::voxelCount() const noexcept { return 0; }
double VdbGrid::megabytesOf(const std::vector<Cell>&) { return 0; }
void VdbGrid::switchOff(std::size_t, std::size_t) {}
double VdbGrid::megabytes() const { return 0; }
bool VdbGrid::sample(const Vec3&, Sampling, double&, Vec3&, bool*) const { return false; }
void VdbGrid::describe(const std::string&, const MetaData&, VdbClass) {}

void writeVdbFile(std::span<const VdbGrid>, const std::filesystem::path&) { refuse("writer of .vdb files"); }

}  // namespace detail
}  // namespace fielddeform::field
