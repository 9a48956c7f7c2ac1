// Radial interpolants: solving, and evaluating at many points. The same surface as SciPy's RBFInterpolator is timed on
// elsewhere: a torus, three smooth displacement components.
//   rbf_bench [--points N] [--repeats N]
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/field/field.h>
#include <fielddeform/numeric/compact_rbf.h>
#include <fielddeform/numeric/rbf.h>

#include <cmath>
#include <numbers>

#include "bench.h"

using namespace fielddeform;

namespace {

std::vector<Vec3> torus(std::size_t n, std::uint64_t seed) {
  std::vector<Vec3> out(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double u = 2 * std::numbers::pi * uniform01(seed, 2 * i), v = 2 * std::numbers::pi * uniform01(seed, 2 * i + 1);
    const double r = 1 + 0.35 * std::cos(v);
    out[i] = Vec3(r * std::cos(u), r * std::sin(u), 0.35 * std::sin(v));
  }
  return out;
}

void print(const char* name, std::size_t centres, double fit, const bench::Times& t, std::size_t points, double residual) {
  std::printf("%-34s %7zu centres: fit %7.2f s; %7.3f s, %7.3f CPU s, %6.0f CPU-ns a point; residual %.1e; peak %.0f MB\n", name, centres,
              fit, t.wall, t.cpu, t.cpu / static_cast<double>(points) * 1e9, residual, bench::peakMegabytes());
}

double seconds(const std::function<void()>& call) {
  const auto start = std::chrono::steady_clock::now();
  call();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

int main(int argc, char** argv) {
  const std::size_t n = bench::quick() ? 2000 : std::stoul(bench::option(argc, argv, "--points", "1000000"));
  const int repeats = bench::quick() ? 1 : std::stoi(bench::option(argc, argv, "--repeats", "3"));
  bench::printMachine(repeats);
  const std::vector<Vec3> points = torus(n, 7);
  std::vector<Vec3> out(n);
  {
    const std::vector<Vec3> centres = torus(1000, 3);
    std::vector<Vec3> values;
    for (const Vec3& c : centres) values.push_back(0.1 * Vec3(std::sin(3 * c.x()), std::cos(2 * c.y()), c.x() * c.y()));
    std::optional<numeric::Rbf> f;
    const double fit = seconds([&] { f.emplace(centres, values); });
    print("r^3, three components", 1000, fit, bench::measure(repeats, [&] { f->evaluate(points, out); }), n, f->report().residual);
    const auto scalar = [&] {
      parallelFor(n, 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) out[i].x() += f->first(points[i], out[i]);
      });
    };
    print("r^3, value and gradient", 1000, fit, bench::measure(repeats, scalar), n, f->report().residual);
  }
  for (const std::size_t count : {1000, 10000, 100000}) {
    if (bench::quick() && count > 1000) continue;
    const std::vector<Vec3> centres = torus(count, 3);
    std::vector<double> values;
    for (const Vec3& c : centres) values.push_back(0.1 * std::sin(3 * c.x()) + 0.1 * c.x() * c.y());
    std::optional<numeric::CompactRbf> f;
    const double fit = seconds([&] { f.emplace(centres, values); });
    const auto all = [&] {
      parallelFor(n, 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) out[i].x() += f->evaluate(points[i], out[i]);
      });
    };
    print("compact support, value and gradient", count, fit, bench::measure(repeats, all), n, f->report().residual);
    std::printf("    %d levels, %zu kernels, %d iterations\n", f->report().levels, f->report().terms, f->report().iterations);
  }
}
