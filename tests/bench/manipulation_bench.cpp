// Direct manipulation: N targets on a sphere, displaced by a smooth wave, solved densely and by LSQR, over B-spline and
// Bernstein lattices. Prints time, rank or iterations, and the largest miss; the bound between the methods
// (MinNormOptions::denseWork) comes from here.
//   manipulation_bench [--repeats N]
#include <fielddeform/core/random.h>
#include <fielddeform/map/direct_manipulation.h>
#include <fmt/format.h>
#include <tests/bench/bench.h>

#include <cmath>
#include <numbers>

using namespace fielddeform;

namespace {

map::Targets waves(std::size_t count, double frequency) {
  map::Targets t;
  for (std::size_t i = 0; i < count; ++i) {  // Fibonacci points: even over the sphere
    const double z = 1 - (2.0 * static_cast<double>(i) + 1) / static_cast<double>(count), r = std::sqrt(1 - z * z);
    const double a = static_cast<double>(i) * std::numbers::pi * (3 - std::sqrt(5.0));
    const Vec3 p(r * std::cos(a), r * std::sin(a), z);
    t.points.push_back({p, p * (1 + 0.05 * std::sin(frequency * p.x()) * std::cos(frequency * p.y())), 1});
  }
  return t;
}

map::Lattice lattice(int nodes, map::BasisKind kind) {
  map::Lattice l;
  l.box.origin = Vec3::Constant(-1.05);
  l.box.axes = 2.1 * Mat3::Identity();
  l.axis.fill(kind == map::BasisKind::BSpline ? map::AxisBasis::bspline(nodes, 3, map::Border::Coincident) : map::AxisBasis::bernstein(nodes));
  return l;
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = bench::quick();
  const int repeats = std::stoi(bench::option(argc, argv, "--repeats", quick ? "1" : "3"));
  bench::printMachine(repeats);
  fmt::print("{:>10} {:>6} {:>8} {:>7} {:>8} {:>6} {:>11} {:>10} {:>10} {:>10}\n", "basis", "nodes", "targets", "method", "columns",
             "rank", "iterations", "wall ms", "CPU ms", "miss");
  struct Case {
    map::BasisKind kind;
    int nodes;
    std::size_t targets;
  };
  std::vector<Case> cases;
  for (const std::size_t n : {1u, 10u, 100u, 300u, 1000u, 3000u}) cases.push_back({map::BasisKind::BSpline, 20, n});
  for (const std::size_t n : {10u, 100u, 1000u, 10000u, 50000u}) cases.push_back({map::BasisKind::BSpline, 128, n});
  for (const std::size_t n : {10u, 100u, 1000u}) cases.push_back({map::BasisKind::Bernstein, 6, n});
  for (const Case& c : cases) {
    if (quick && c.targets > 100) continue;
    const map::LatticeMap map(lattice(c.nodes, c.kind));
    const map::Targets targets = waves(c.targets, c.nodes > 100 ? 40 : 6);
    for (const bool dense : {true, false}) {
      if (dense && c.targets > 300) continue;  // minutes
      map::ManipulationOptions options;
      options.solver.denseWork = dense ? 1e13 : 0;
      options.solver.fallbackWork = 0;
      map::Manipulated m;
      const bench::Times t = bench::measure(repeats, [&] { m = map::moveTargets(map, targets, options); });
      const auto& s = m.report.solver;
      fmt::print("{:>10} {:>6} {:>8} {:>7} {:>8} {:>6} {:>11} {:10.2f} {:10.2f} {:10.1e}{}\n",
                 c.kind == map::BasisKind::BSpline ? "bspline" : "bernstein", c.nodes, c.targets,
                 s.method == numeric::MinNormMethod::Dense ? "dense" : "lsqr", s.columns, s.rank, s.iterations, 1e3 * t.wall, 1e3 * t.cpu,
                 m.report.largestMiss, s.converged ? "" : " (stopped)");
      std::fflush(stdout);
    }
  }
  fmt::print("peak memory {:.0f} MB\n", bench::peakMegabytes());
}
