// Radial interpolants: solving, and evaluating at many points. The same surface as SciPy's RBFInterpolator is timed on
// elsewhere: a torus, three smooth displacement components.
//   rbf_bench [--points N] [--repeats N] [--threads N]
//   rbf_bench --accuracy: the table of docs/field.md, errors of variational distances
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/field/field.h>
#include <fielddeform/numeric/compact_rbf.h>
#include <fielddeform/numeric/rbf.h>

#include <cmath>
#include <numbers>
#include <tests/field/skeletons.h>

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
  std::printf("%-36s %7zu centres: fit %7.2f s; %7.3f s, %7.3f CPU s, %6.0f CPU-ns a point; residual %.1e; peak %.0f MB\n", name, centres,
              fit, t.wall, t.cpu, t.cpu / static_cast<double>(points) * 1e9, residual, bench::peakMegabytes());
}

double seconds(const std::function<void()>& call) {
  const auto start = std::chrono::steady_clock::now();
  call();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Mean and worst error in radii, within 0.8 of them.
void accuracy(const skeleton::Primitive& primitive, std::size_t centres) {
  field::FieldOptions options;
  options.distance.kind = field::Distance::Variational;
  options.distance.variational.centres = centres;
  skeleton::Skeleton skeleton;
  skeleton.primitives = {primitive};
  const field::Field exact(skeleton);
  std::optional<field::Field> fitted;
  const double fit = seconds([&] { fitted.emplace(skeleton, options); });
  double sum = 0, worst = 0, used = 0;
  for (std::uint64_t i = 0; i < 10000; ++i) {
    const Vec3 x = field::randomPoint(31, i, 1.3);
    const double wanted = exact.evaluate(x).pseudoDistance, radius = *primitive.radius;
    if (wanted > 0.8 * radius) continue;
    const double error = std::abs(fitted->evaluate(x).pseudoDistance - wanted) / radius;
    sum += error;
    worst = std::max(worst, error);
    ++used;
  }
  std::printf("%-20s at most %6zu centres: %6zu, sampled and fitted in %6.2f s; mean error %.4f %%, worst %.3f %%\n", primitive.name.c_str(), centres,
              fitted->distanceReport(0).centres, fit, 100 * sum / used, 100 * worst);
}

void accuracyTable() {
  for (const std::size_t centres : {1000, 4000, 30000, 100000}) {
    if (bench::quick() && centres > 1000) continue;
    accuracy(field::pointSet("two points", {{0.1, 0, 0}, {-0.6, 0.1, 0.2}}, 0.5), centres);
    accuracy(field::polyline("curve of 12 segments", field::wavyLine(12), 0.5), centres);
    accuracy(field::patch("patch of 4 x 4", 4, 0.5), centres);
    accuracy(field::cube("cube", 0.6, 0.5), centres);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::size_t n = bench::quick() ? 2000 : std::stoul(bench::option(argc, argv, "--points", "1000000"));
  const int repeats = bench::quick() ? 1 : std::stoi(bench::option(argc, argv, "--repeats", "3"));
  const ThreadLimit limit(std::stoi(bench::option(argc, argv, "--threads", "0")));
  bench::printMachine(repeats);
  if (argc > 1 && std::string(argv[1]) == "--accuracy") {
    accuracyTable();
    return 0;
  }
  const std::vector<Vec3> points = torus(n, 7);
  std::vector<Vec3> out(n);
  {
    const std::vector<Vec3> centres = torus(1000, 3);
    std::vector<Vec3> values;
    for (const Vec3& c : centres) values.push_back(0.1 * Vec3(std::sin(3 * c.x()), std::cos(2 * c.y()), c.x() * c.y()));
    std::optional<numeric::Rbf> f;
    const double fit = seconds([&] { f.emplace(centres, values); });
    const auto row = [&](const char* name, const std::function<void()>& call) {
      print(name, 1000, fit, bench::measure(repeats, call), n, f->report().residual);
    };
    std::vector<double> value(n);
    row("r^3, three components", [&] { f->evaluate(points, out); });
    row("r^3, value and gradient", [&] { f->first(points, value, out); });
    double valueError = 0, gradientError = 0;
    for (std::size_t i = 0; i < n; i += 97) {
      Vec3 gradient;
      valueError = std::max(valueError, std::abs(f->first(points[i], gradient) - value[i]));
      gradientError = std::max(gradientError, (gradient - out[i]).norm());
    }
    std::printf("    differs from the plain sums by at most %.1e, gradient %.1e\n", valueError, gradientError);
    row("r^3, value and gradient, plain sums", [&] {
      parallelFor(n, 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) value[i] = f->first(points[i], out[i]);
      });
    });
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
