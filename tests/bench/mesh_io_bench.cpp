// Reading and writing of large meshes, beside what the machine needs for the bytes alone.
//   mesh_io_bench [--repeats N] [--folder DIR]
// Bars: binary PLY of 1M vertices and 2M triangles within 3x of fread plus conversion of the same bytes to double
// positions and 32-bit indices; OBJ at 150 MB/s or more on one core. Exit code 3 if one is missed.
#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/io.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <functional>
#include <memory>
#include <string>

namespace {

namespace fs = std::filesystem;
using namespace fielddeform;
using namespace fielddeform::mesh;

// A wavy sheet of side * side vertices.
Mesh sheet(std::size_t side) {
  std::vector<Vec3> positions;
  positions.reserve(side * side);
  for (std::size_t i = 0; i < side * side; ++i) {
    const double x = static_cast<double>(i % side) / 100, y = static_cast<double>(i / side) / 100;
    positions.emplace_back(x + 0.001 * std::sin(3 * y), y, std::sin(x) * std::cos(y));
  }
  std::vector<Index> corners;
  corners.reserve(6 * (side - 1) * (side - 1));
  for (std::size_t j = 0; j + 1 < side; ++j)
    for (std::size_t i = 0; i + 1 < side; ++i) {
      const auto a = static_cast<Index>(j * side + i), b = static_cast<Index>(a + 1), c = static_cast<Index>(a + side),
                 d = c + 1;
      corners.insert(corners.end(), {a, b, d, a, d, c});
    }
  Mesh mesh(std::move(positions), std::move(corners));
  mesh.setPositionType(ScalarType::Float32);
  return mesh;
}

// CPU seconds, not those on the wall: what else runs on the machine does not count.
double cpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double median(int repeats, const std::function<void()>& call) {
  std::vector<double> seconds;
  for (int r = 0; r <= repeats; ++r) {
    const double start = cpuSeconds();
    call();
    if (r > 0) seconds.push_back(cpuSeconds() - start);
  }
  std::sort(seconds.begin(), seconds.end());
  return seconds[seconds.size() / 2];
}

// What any reader has to do: take the bytes, make doubles and indices.
void freadAndConvert(const fs::path& path, std::size_t header, std::size_t vertices, std::size_t triangles) {
  const std::size_t size = fs::file_size(path);
  const std::unique_ptr<char[]> bytes(new char[size]);
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (!file || std::fread(bytes.get(), 1, size, file) != size) std::abort();
  std::fclose(file);
  std::vector<double> positions(3 * vertices);
  std::vector<Index> corners(3 * triangles);
  const char* p = bytes.get() + header;
  for (double& x : positions) {
    float f;
    std::memcpy(&f, p, 4);
    x = static_cast<double>(f);
    p += 4;
  }
  for (std::size_t t = 0; t < triangles; ++t, p += 13) std::memcpy(&corners[3 * t], p + 1, 12);
  volatile double sink = positions.back() + corners.back();
  (void)sink;
}

std::string machine() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

double peakMegabytes() {
  struct rusage usage {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace

int main(int argc, char** argv) {
  int repeats = 7;
  fs::path folder = fs::temp_directory_path();
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::string(argv[i]) == "--repeats") repeats = std::max(1, std::atoi(argv[i + 1]));
    if (std::string(argv[i]) == "--folder") folder = argv[i + 1];
  }
  // Set in CI: each part once, on little data, without the bars.
  const bool quick = std::getenv("FIELDDEFORM_BENCH_QUICK") != nullptr;
  if (quick) repeats = 1;
  const ThreadLimit one(1);
  std::printf("%s; 1 thread; CPU time, median of %d\n", machine().c_str(), repeats);
  const fs::path base = folder / ("mesh_io_bench_" + std::to_string(::getpid()));
  const fs::path ply = base.string() + ".ply", obj = base.string() + ".obj", out = base.string() + ".out";

  const std::size_t side = quick ? 101 : 1001;
  std::size_t vertices = 0, triangles = 0;
  {
    const Mesh mesh = sheet(side);
    vertices = mesh.vertexCount(), triangles = mesh.faceCount();
    (void)writeMesh(mesh, ply);
  }
  const std::size_t header = fs::file_size(ply) - 12 * vertices - 13 * triangles;
  {
    (void)readMesh(ply);
    std::printf("peak memory of reading PLY and of making it: %.0f MB (%.0f bytes a vertex)\n", peakMegabytes(),
                peakMegabytes() * 1048576 / static_cast<double>(vertices));
  }
  const double floor = median(repeats, [&] { freadAndConvert(ply, header, vertices, triangles); });
  const double plyRead = median(repeats, [&] { (void)readMesh(ply); });
  const Mesh mesh = readMesh(ply);
  const double plyWrite = median(repeats, [&] { (void)writeMesh(mesh, out, {Precision::Keep, Format::Ply}); });
  (void)writeMesh(mesh, obj);
  const double objRead = median(repeats, [&] { (void)readMesh(obj); });
  const double objWrite = median(repeats, [&] { (void)writeMesh(mesh, out, {Precision::Keep, Format::Obj}); });
  const double plyMega = static_cast<double>(fs::file_size(ply)) / 1e6,
               objMega = static_cast<double>(fs::file_size(obj)) / 1e6;
  const double ratio = plyRead / floor, objSpeed = objMega / objRead;
  std::printf("%zu vertices, %zu triangles\n", vertices, triangles);
  std::printf("fread and convert %8.1f ms %8.0f MB/s\n", floor * 1e3, plyMega / floor);
  std::printf("PLY read          %8.1f ms %8.0f MB/s   %.2f x of fread and convert (bar: 3)\n", plyRead * 1e3,
              plyMega / plyRead, ratio);
  std::printf("PLY write         %8.1f ms %8.0f MB/s\n", plyWrite * 1e3, plyMega / plyWrite);
  std::printf("OBJ read          %8.1f ms %8.0f MB/s   (bar: 150)\n", objRead * 1e3, objSpeed);
  std::printf("OBJ write         %8.1f ms %8.0f MB/s\n", objWrite * 1e3, objMega / objWrite);
  for (const fs::path& p : {ply, obj, out}) fs::remove(p);
  return quick || (ratio <= 3 && objSpeed >= 150) ? 0 : 3;
}
