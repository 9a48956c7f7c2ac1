// Distance grids of a mesh beside OpenVDB's own: its mesh-to-level-set conversion and its samplers, in the same run on the
// same work.
//   vdb_bench [--rows N] [--resolution N] [--band VOXELS] [--points N] [--threads N]
// OpenVDB's values are signed near the surface by its own scan conversion, and hold to the triangles that a voxel meets; ours
// are exact closest points with the sign of the winding number, in whole leaves, and every sample comes with its gradient.
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/field/field.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tests/support/mesh_sphere.h>

#include <tbb/global_control.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <memory>
#include <vector>

namespace {

using namespace fielddeform;

double sink = 0;

struct Time {
  double wall, cpu;
};

Time timed(const std::function<void()>& call) {
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  call();
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
          static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC};
}

// A bumpy sphere of 4 rows^2 triangles, radius about 1.
skeleton::Primitive bumpySphere(int rows) {
  skeleton::Primitive p = test::meshSphere(rows, [](double a, double b) {
    return 1 + 0.08 * std::sin(5 * b) * std::sin(4 * a) + 0.03 * std::sin(11 * b + 2) * std::sin(9 * a);
  });
  std::vector<std::vector<Index>> triangles;
  for (const auto& f : p.faces)
    for (std::size_t k = 2; k < f.size(); ++k) triangles.push_back({f[0], f[k - 1], f[k]});
  p.faces = std::move(triangles);
  return p;
}

void line(const char* what, const Time& t, double items, const char* unit) {
  std::printf("%-58s %8.2f s wall %8.2f s CPU %10.1f ns CPU a %s\n", what, t.wall, t.cpu, t.cpu / items * 1e9, unit);
}

openvdb::FloatGrid::Ptr convert(const skeleton::Primitive& p, double voxel, double band) {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  for (const Vec3& x : p.points) points.emplace_back(static_cast<float>(x.x()), static_cast<float>(x.y()), static_cast<float>(x.z()));
  for (const auto& f : p.faces) triangles.emplace_back(f[0], f[1], f[2]);
  openvdb::FloatGrid::Ptr grid;
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  const Time t = timed([&] { grid = openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*transform, points, triangles, static_cast<float>(band)); });
  const auto active = static_cast<double>(grid->activeVoxelCount());
  line("OpenVDB meshToLevelSet", t, active, "voxel");
  std::printf("%-58s %8.2f million active voxels, %.1f MB\n", "", active * 1e-6, static_cast<double>(grid->memUsage()) * 1e-6);
  return grid;
}

template <class Sampler>
void sampleOpenVdb(const char* what, const openvdb::FloatGrid& grid, const std::vector<Vec3>& points) {
  std::vector<float> out(points.size());
  line(what, timed([&] {
         parallelFor(points.size(), 4096, [&](std::size_t begin, std::size_t end) {
           const auto accessor = grid.getConstAccessor();
           for (std::size_t i = begin; i < end; ++i)
             out[i] = Sampler::sample(accessor, grid.transform().worldToIndex(openvdb::Vec3d(points[i].x(), points[i].y(), points[i].z())));
         });
       }), static_cast<double>(points.size()), "point");
  for (const float v : out) sink += static_cast<double>(v);
}

void sampleOurs(const char* what, const field::Field& field, const std::vector<Vec3>& points) {
  std::vector<field::FieldValue> out(points.size());
  line(what, timed([&] { field.evaluate(points, out); }), static_cast<double>(points.size()), "point");
  for (const auto& v : out) sink += v.pseudoDistance;
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = std::getenv("FIELDDEFORM_BENCH_QUICK") != nullptr;
  int rows = quick ? 40 : 500, resolution = quick ? 48 : 256, threads = 1;
  double band = quick ? 4 : 10;
  std::size_t count = quick ? 10000 : 1000000;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--rows") == 0) rows = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--resolution") == 0) resolution = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--band") == 0) band = std::atof(argv[i + 1]);
    if (std::strcmp(argv[i], "--points") == 0) count = static_cast<std::size_t>(std::atoll(argv[i + 1]));
    if (std::strcmp(argv[i], "--threads") == 0) threads = std::atoi(argv[i + 1]);
  }
  openvdb::initialize();
  const ThreadLimit limit(threads);
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  skeleton::Skeleton s;
  s.primitives = {bumpySphere(rows)};
  skeleton::Primitive& p = s.primitives[0];
  const double voxel = 2.2 / resolution;
  p.radius = band * voxel;
  std::printf("%zu triangles, voxel 2.2 / %d, band of %g voxels on both sides, %d thread(s), OpenVDB %s\n", p.faces.size(), resolution, band,
              threads, OPENVDB_LIBRARY_VERSION_STRING);
  // Along the surface, between 6 and 9 voxels from it, in the order of the triangles.
  std::vector<Vec3> points(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& f = p.faces[i * p.faces.size() / count];
    const Vec3 x = (p.points[f[0]] + p.points[f[1]] + p.points[f[2]]) / 3;
    points[i] = x + x.normalized() * voxel * (6 + 3 * uniform01(5, i)) * (i % 2 ? 1 : -1);
  }
  const auto grid = convert(p, voxel, band);
  field::FieldOptions o;
  o.distance.kind = field::Distance::Grid;
  o.distance.grid.voxel = voxel;
  o.distance.grid.maxMegabytes = 8192;
  for (const bool near : {true, false}) {
    std::unique_ptr<field::Field> ours;
    const Time t = timed([&] { ours = std::make_unique<field::Field>(s, o, near ? Points(points) : Points()); });
    const field::DistanceReport r = ours->distanceReport(0);
    line(near ? "grid near the points, trees included" : "grid of the whole influence, trees included", t, static_cast<double>(r.voxels), "voxel");
    std::printf("%-58s %8.2f million voxels, %.1f MB, error measured %.2g voxels\n", "", static_cast<double>(r.voxels) * 1e-6, r.megabytes,
                r.measuredError / voxel);
    if (!near) continue;
    sampleOpenVdb<openvdb::tools::BoxSampler>("OpenVDB BoxSampler, value", *grid, points);
    sampleOurs("trilinear, value and gradient", *ours, points);
    o.distance.grid.sampling = field::Sampling::Quadratic;
    const field::Field quadratic(s, o, points);
    o.distance.grid.sampling = field::Sampling::Trilinear;
    sampleOpenVdb<openvdb::tools::QuadraticSampler>("OpenVDB QuadraticSampler, value", *grid, points);
    sampleOurs("quadratic, value and gradient", quadratic, points);
    sampleOurs("exact, value and gradient", field::Field(s), points);
  }
  std::printf("(checksum %g)\n", sink);
  return 0;
}
