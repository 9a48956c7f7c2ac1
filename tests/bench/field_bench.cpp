// Closest points, winding numbers, field values and the numeric kernels beneath them.
//   field_bench [--repeats N] [--threads N]
// Bars (one thread): 500,000 closest points a second on 1000 segments, 100,000 near 500,000 triangles. Exit code 3 if one
// is missed.
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/field/field.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/numeric/rbf.h>
#include <fielddeform/numeric/rotation.h>
#include <fielddeform/spatial/closest_tree.h>
#include <fielddeform/spatial/winding.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

namespace {

using namespace fielddeform;

struct Soup {
  std::vector<Vec3> points;
  std::vector<std::array<Index, 3>> triangles;
};

Soup sphere(int rows) {
  Soup s;
  const int cols = 2 * rows;
  const double pi = 3.14159265358979323846;
  for (int i = 0; i <= rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const double a = pi * i / rows, b = 2 * pi * j / cols;
      s.points.push_back(Vec3(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)));
    }
  const auto at = [&](int i, int j) { return static_cast<Index>(i * cols + j % cols); };
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      s.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      s.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return s;
}

skeleton::Primitive helix(const std::string& name, int segments, double turn) {
  skeleton::Primitive p;
  p.name = name;
  p.radius = 0.6;
  for (int i = 0; i <= segments; ++i) {
    const double u = 6.0 * i / segments;
    p.points.push_back(Vec3(std::cos(u + turn), std::sin(u + turn), 0.1 * u));
  }
  return p;
}

// Points within 0.5 of the helix's circle; in the order of a surface (coherent) or shuffled by the hash.
std::vector<Vec3> around(std::size_t count) {
  std::vector<Vec3> p(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double u = 6 * uniform01(1, 4 * i);
    p[i] = Vec3(std::cos(u), std::sin(u), 0.1 * u) +
           0.5 * Vec3(uniform01(1, 4 * i + 1) - 0.5, uniform01(1, 4 * i + 2) - 0.5, uniform01(1, 4 * i + 3) - 0.5);
  }
  return p;
}

int repeats = 5;
bool missed = false;
double sink = 0;  // keeps results alive

// Median time of one item; `call` handles `items` of them.
void report(const char* name, std::size_t items, const std::function<void()>& call, double atLeastPerSecond = 0) {
  std::vector<double> seconds;
  for (int r = 0; r <= repeats; ++r) {
    const auto start = std::chrono::steady_clock::now();
    call();
    if (r > 0) seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(seconds.begin(), seconds.end());
  const double each = seconds[seconds.size() / 2] / static_cast<double>(items);
  std::printf("%-52s %10.1f ns  %12.0f /s", name, each * 1e9, 1 / each);
  if (atLeastPerSecond > 0) {
    const bool ok = 1 / each >= atLeastPerSecond;
    std::printf("  bar %.0f /s: %s", atLeastPerSecond, ok ? "met" : "MISSED");
    missed = missed || !ok;
  }
  std::printf("\n");
}

std::string machine() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

void closestPoints() {
  const std::vector<Vec3> points = around(100000);
  for (const int n : {100, 1000, 10000}) {
    const skeleton::Primitive line = helix("line", n, 0);
    std::vector<std::array<Index, 2>> segments;
    for (Index i = 0; i < static_cast<Index>(n); ++i) segments.push_back({i, i + 1});
    const auto tree = spatial::ClosestTree::ofSegments(line.points, segments);
    report(("closest point, " + std::to_string(n) + " segments").c_str(), points.size(),
           [&] { for (const Vec3& p : points) sink += tree.closest(p).distance; }, n == 1000 ? 500000 : 0);
  }
  const Soup s = sphere(354);
  report("tree of 501,264 triangles, each", s.triangles.size(),
         [&] { sink += static_cast<double>(spatial::ClosestTree::ofTriangles(s.points, s.triangles).size()); });
  const auto tree = spatial::ClosestTree::ofTriangles(s.points, s.triangles);
  std::vector<Vec3> near(100000);
  for (std::size_t i = 0; i < near.size(); ++i)
    near[i] = (points[i] - Vec3(0, 0, 0.3)).normalized() * (1 + 0.02 * (uniform01(2, i) - 0.5));
  report("closest point near 501,264 triangles", near.size(),
         [&] { for (const Vec3& p : near) sink += tree.closest(p).distance; }, 100000);
  const spatial::WindingNumber winding(s.points, s.triangles);
  report("winding number near 501,264 triangles", near.size(), [&] { for (const Vec3& p : near) sink += winding.at(p); });
}

void fields() {
  const std::vector<Vec3> points = around(100000);
  const auto one = [&](const char* name, std::vector<skeleton::Primitive> primitives) {
    skeleton::Skeleton s;
    s.primitives = std::move(primitives);
    const field::Field field(s);
    report(name, points.size(), [&] { for (const Vec3& p : points) sink += field.evaluate(p).pseudoDistance; });
    return s;
  };
  const auto line = one("field, 1 polyline of 100 segments", {helix("a", 100, 0)});
  one("field, 4 polylines of 100 segments", {helix("a", 100, 0), helix("b", 100, 0.1), helix("c", 100, 0.2), helix("d", 100, 0.3)});
  skeleton::Primitive solid;
  solid.name = "solid";
  solid.type = skeleton::PrimitiveType::Mesh;
  solid.closed = true;
  solid.radius = 0.5;
  const Soup s = sphere(16);
  solid.points = s.points;
  for (const auto& t : s.triangles) solid.faces.push_back({t[0], t[1], t[2]});
  one("field, closed mesh of 1024 triangles", {solid});
  const field::Field field(line);
  std::vector<field::FieldValue> out(points.size());
  report("field, 1 polyline of 100 segments, batch", points.size(), [&] { field.evaluate(points, out); });
}

void numerics() {
  std::vector<Mat3> c(1000);
  std::vector<Quat> start;
  for (std::size_t i = 0; i < c.size(); ++i) {
    for (std::size_t k = 0; k < 9; ++k) c[i].data()[k] = uniform01(i, k) - 0.5 + (k % 4 == 0 ? 1 : 0);
    start.push_back(Quat(Eigen::AngleAxisd(0.05, Vec3::UnitX())) * numeric::kabschQuaternion(c[i]));
  }
  report("best rotation", c.size(), [&] { for (const Mat3& m : c) sink += numeric::kabschQuaternion(m).w(); });
  report("best rotation, refined from 0.05 rad", c.size(),
         [&] { for (std::size_t i = 0; i < c.size(); ++i) sink += numeric::polarRefine(c[i], start[i]).w(); });
  std::vector<double> x(4096), y(4096);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = -8 * uniform01(3, i);
  report("exp", x.size(), [&] { for (std::size_t i = 0; i < x.size(); ++i) y[i] = numeric::exp(x[i]); });
  report("log", x.size(), [&] { for (std::size_t i = 0; i < x.size(); ++i) x[i] = numeric::log(y[i]); });
  const std::vector<Vec3> centres = around(500), values = around(500);
  report("interpolant of 500 centres, solved", 1, [&] { sink += numeric::Rbf(centres, values).report().residual; });
  const numeric::Rbf rbf(centres, values);
  report("interpolant of 500 centres, evaluated", 500, [&] { for (const Vec3& p : values) sink += rbf.evaluate(p).x(); });
}

}  // namespace

int main(int argc, char** argv) {
  int threads = 1;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--repeats") == 0) repeats = std::max(1, std::atoi(argv[i + 1]));
    if (std::strcmp(argv[i], "--threads") == 0) threads = std::atoi(argv[i + 1]);
  }
  const ThreadLimit limit(threads);
  std::printf("%s, %d thread(s), median of %d\n", machine().c_str(), threadCount(), repeats);
  closestPoints();
  fields();
  numerics();
  std::printf("(checksum %g)\n", sink);
  return missed ? 3 : 0;
}
