#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/cover.h>
#include <fielddeform/field/detail/polygonise.h>
#include <fielddeform/field/detail/vdb_grid.h>
#include <fielddeform/field/detail/vdb_surface.h>
#include <fielddeform/field/detail/voxel_distances.h>
#include <fielddeform/field/vdb.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::field {
namespace {

constexpr double kBorder = 3;  // voxels beyond the radius, for any sampler
constexpr double kSamplesARadius = 16;

detail::VdbGrid sampleField(const Field& field, double voxel, double megabytes, const std::string& what, Progress& progress) {
  const detail::Lattice lattice = detail::latticeOf(field, voxel);
  const std::vector<detail::Cell> corners =
      detail::coverField(field, lattice, 1, kBorder, {megabytes, detail::VdbGrid::kBytesEach, what});
  detail::requireBudget({megabytes, detail::VdbGrid::kBytesEach, what}, voxel, detail::VdbGrid::megabytesOf(corners));
  detail::VdbGrid grid(lattice, corners, static_cast<float>(field.referenceRadius()));
  parallelFor(corners.size(), 16, progress, [&](std::size_t begin, std::size_t end) {
    std::array<Vec3, detail::kCube> points;
    std::array<FieldValue, detail::kCube> values;
    SearchHints hints;
    for (std::size_t b = begin; b < end; ++b)
      for (std::size_t first = 0; first < detail::kBlockSize; first += detail::kCube) {
        for (std::size_t i = 0; i < detail::kCube; ++i) points[i] = lattice.point(detail::pointOf(corners[b], detail::nearOrder(first + i)));
        field.evaluateTogether(points, values, hints);
        for (std::size_t i = 0; i < detail::kCube; ++i)
          grid.values(b)[detail::nearOrder(first + i)] = static_cast<float>(std::min(values[i].pseudoDistance, 1e30));
      }
  });
  return grid;
}

detail::MetaData metaData(const Field& field, skeleton::Potential potential, double radius, const std::string& quantity,
                          const VdbWriteOptions& options) {
  return {{"units", options.units},
          {"quantity", quantity},
          {"radius", radius},
          {"potential", std::string(skeleton::toString(potential))},
          {"sharpness", field.options().sharpness},
          {"distance", std::string(toString(field.options().distance.kind))},
          {"creator", std::string("fielddeform")}};
}

}  // namespace

std::vector<VdbGridReport> writeVdb(const Field& field, const skeleton::Skeleton& skeleton, const std::filesystem::path& path,
                                    const VdbWriteOptions& options, Progress& progress) {
  options.samples.validate();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < field.primitiveCount(); ++i)
    if (field.weight(i) > 0) least = std::min(least, field.radius(i));
  if (!std::isfinite(least)) throw std::invalid_argument("every primitive has weight 0: there is no field to write");
  const double voxel = options.samples.voxel.value_or(least / kSamplesARadius);
  std::vector<detail::VdbGrid> grids;
  std::vector<VdbGridReport> reports;
  double megabytes = options.samples.maxMegabytes;
  const auto add = [&](const Field& f, const std::string& name, detail::MetaData meta) {
    grids.push_back(sampleField(f, voxel, megabytes, fmt::format("grid \"{}\"", name), progress));
    grids.back().describe(name, meta, detail::VdbClass::Unknown);
    reports.push_back({name, voxel, grids.back().voxelCount(), grids.back().megabytes()});
    megabytes = std::max(1e-6, megabytes - reports.back().megabytes);
  };
  add(field, "pseudo_distance", metaData(field, field.options().potential, field.referenceRadius(), "pseudo-distance", options));
  if (options.primitives)
    for (const auto& p : skeleton.primitives) {
      skeleton::Skeleton one;
      one.primitives = {p};
      one.primitives[0].weight = 1;
      FieldOptions alone = field.options();
      alone.referenceRadius.reset();
      const Field f(one, alone);
      detail::MetaData meta = metaData(f, p.potential.value_or(alone.potential), f.radius(0), "distance", options);
      meta["weight"] = p.weight;
      add(f, "distance " + p.name, std::move(meta));
    }
  detail::writeVdbFile(grids, path);
  return reports;
}

namespace {

mesh::Mesh surfaceOf(const detail::VdbContent& content, double megabytes) {
  const Mat3 linear = content.toWorld.block<3, 3>(0, 0);
  const Vec3 origin = content.toWorld.block<3, 1>(0, 3);
  const mesh::Mesh surface = detail::polygonise(
      content.corners, content.values, megabytes, [&](const detail::Cell& a, const detail::Cell& b, double va, double vb) -> Vec3 {
        const double t = detail::betweenEnds(va / (va - vb));
        const Vec3 from(a[0], a[1], a[2]), to(b[0], b[1], b[2]);
        return origin + linear * (from + t * (to - from));
      });
  if (!(linear.determinant() < 0)) return surface;
  std::vector<Index> corners = surface.corners();  // a mirrored grid
  for (std::size_t f = 0; f + 2 < corners.size(); f += 3) std::swap(corners[f + 1], corners[f + 2]);
  return {surface.positions(), std::move(corners)};
}

}  // namespace

mesh::Mesh parseVdbSurface(std::string_view bytes, const std::filesystem::path& path, const VdbReadOptions& options) {
  requireInRange("memory (MB)", options.maxMegabytes, 1e-3, 1e9);
  if (options.isovalue) requireFinite("isovalue", *options.isovalue);
  const detail::VdbContent content = detail::readVdbContent(bytes, path, options.grid, options.isovalue, options.maxMegabytes);
  mesh::Mesh surface;
  try {
    surface = surfaceOf(content, options.maxMegabytes);
  } catch (const std::length_error&) {
    throw IoError(path, fmt::format("the surface of grid \"{}\" takes more than {:.4g} MB", content.name, options.maxMegabytes));
  }
  if (surface.faceCount() == 0)
    throw IoError(path, fmt::format("grid \"{}\" does not take the value {} anywhere", content.name,
                                    options.isovalue.value_or(content.fog ? 0.5 : 0)));
  for (const Vec3& p : surface.positions())
    if (!p.allFinite()) throw IoError(path, "the grid's transform leads beyond the numbers");
  return surface;
}

mesh::Mesh readVdbSurface(const std::filesystem::path& path, const VdbReadOptions& options) {
  std::error_code unknown;  // a pipe, or no file: said by what follows
  const std::uintmax_t size = std::filesystem::file_size(path, unknown);
  if (!unknown && static_cast<double>(size) > options.maxMegabytes * 1e6)
    throw IoError(path, fmt::format("{:.4g} MB, must be <= {:.4g} MB", 1e-6 * static_cast<double>(size), options.maxMegabytes));
  return parseVdbSurface(readTextFile(path), path, options);
}

bool isVdb(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".vdb";
}

skeleton::Skeleton readSkeletonOrVolume(const std::filesystem::path& path, const std::string& grid) {
  if (!isVdb(path)) return skeleton::readSkeleton(path);
  const mesh::Mesh surface = readVdbSurface(path, {.grid = grid});
  skeleton::Primitive p;
  p.name = path.stem().string();
  if (p.name.empty()) p.name = "volume";
  p.type = skeleton::PrimitiveType::Mesh;
  p.points = surface.positions();
  for (std::size_t f = 0; f < surface.faceCount(); ++f) {
    const auto c = surface.face(f);
    p.faces.emplace_back(c.begin(), c.end());
  }
  p.closed = skeleton::boundsSolid(p.faces);
  return {{std::move(p)}, ""};
}

}  // namespace fielddeform::field
