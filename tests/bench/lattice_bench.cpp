// CPU time of lattices a vertex, by dispatch level, on one thread: lattice_bench [--vertices N] [--repeats N]
// [--peer NANOSECONDS --idle NANOSECONDS], the latter two Blender's (tests/bench/lattice measures and passes them).
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/random.h>
#include <fielddeform/map/lattice.h>
#include <fmt/format.h>
#include <tests/bench/bench.h>

#include <cmath>
#include <numbers>

using namespace fielddeform;
using fielddeform::detail::SimdLevel;

namespace {

// The torus that tests/bench/blender_lattice.py makes, its vertices ring by ring.
std::vector<Vec3> torus(std::size_t vertices) {
  const auto around = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(vertices) / 1.6)));
  const std::size_t along = vertices / around;
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < along; ++i)
    for (std::size_t j = 0; j < around; ++j) {
      const double u = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(along);
      const double v = 2 * std::numbers::pi * static_cast<double>(j) / static_cast<double>(around);
      const double ring = 1 + 0.35 * std::cos(v);
      points.push_back(Vec3(ring * std::cos(u), ring * std::sin(u), 0.35 * std::sin(v)));
    }
  return points;
}

map::LatticeMap shaken(const map::AxisBasis& axis, const std::vector<Vec3>& points) {
  map::Lattice l;
  l.box = map::fitBox(points, 0.02);
  l.axis = {axis, axis, axis};
  for (std::size_t i = 0; i < l.nodeCount(); ++i)
    l.displacements.push_back(Vec3(uniform01(1, 3 * i), uniform01(1, 3 * i + 1), uniform01(1, 3 * i + 2)) * 0.05);
  return map::LatticeMap(std::move(l));
}

struct Run {
  const std::vector<Vec3>& points;
  int repeats;
  double nanoseconds(const std::function<void()>& call) const {
    return 1e9 * bench::measure(repeats, call).cpu / static_cast<double>(points.size());
  }
};

double report(const Run& run, const char* name, const map::AxisBasis& axis) {
  const map::LatticeMap lattice = shaken(axis, run.points);
  std::shared_ptr<const map::Binding> binding;
  const double bind = run.nanoseconds([&] { binding = lattice.bind(run.points); });
  std::vector<Vec3> out(run.points.size()), nodes(lattice.nodeCount());
  Progress progress;
  double avx2 = 0;
  std::string line = fmt::format("{:<22} bind {:6.1f}; apply", name, bind);
  for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512}) {
    if (level > fielddeform::detail::supportedSimdLevel()) break;
    const fielddeform::detail::SimdLimit limit(level);
    const double ns = run.nanoseconds([&] { lattice.apply(*binding, {out, {}, {}, {}}, progress); });
    if (level == SimdLevel::Avx2 || avx2 == 0) avx2 = ns;
    line += fmt::format(" {} {:6.1f}", toString(level), ns);
  }
  const double gather = run.nanoseconds([&] { lattice.gather(*binding, run.points, nodes); });
  std::printf("%s; gather %6.1f CPU-ns a vertex\n", line.c_str(), gather);
  return avx2;
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = bench::quick();
  const std::size_t vertices = std::stoul(bench::option(argc, argv, "--vertices", quick ? "20000" : "1000000"));
  const int repeats = std::stoi(bench::option(argc, argv, "--repeats", quick ? "1" : "7"));
  const double peer = std::stod(bench::option(argc, argv, "--peer", "0"));
  const double idle = std::stod(bench::option(argc, argv, "--idle", "0"));
  const ThreadLimit one(1);
  bench::printMachine(repeats);
  const std::vector<Vec3> points = torus(vertices);
  const Run run{points, repeats};
  std::printf("%zu vertices\n", points.size());
  const double first = report(run, "Bernstein 4x4x4", map::AxisBasis::bernstein(4));
  report(run, "Bernstein 5x5x5", map::AxisBasis::bernstein(5));
  report(run, "B-spline 4x4x4", map::AxisBasis::bspline(4, 3, map::Border::Coincident));
  report(run, "B-spline 16x16x16", map::AxisBasis::bspline(16, 3, map::Border::Coincident));
  report(run, "B-spline 128x128x128", map::AxisBasis::bspline(quick ? 32 : 128, 3, map::Border::Coincident));
  if (!quick) {
    const std::vector<Vec3> few(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(points.size() / 20));
    report(Run{few, repeats}, "Bernstein 16x16x16", map::AxisBasis::bernstein(16));
  }
  std::vector<Vec3> copy(points.size());
  const double stream = run.nanoseconds([&] { std::copy(points.begin(), points.end(), copy.begin()); });
  std::printf("streaming (a copy of the vertices): %.1f CPU-ns a vertex, %.1f GB/s read and written\n", stream, 48 / stream);
  std::printf("Bernstein 4x4x4 with %s: %.1f CPU-ns a vertex (bar 25), %.1f x the streaming\n",
              std::string(toString(std::min(SimdLevel::Avx2, fielddeform::detail::supportedSimdLevel()))).c_str(), first, first / stream);
  if (peer > 0)
    std::printf("Blender's lattice 4x4x4: whole evaluation %.1f CPU-ns a vertex, %.1f x ours; above an idle stack (%.1f) %.1f, %.1f x ours\n",
                peer, peer / first, idle, peer - idle, (peer - idle) / first);
  return 0;
}
