// Free-form solids on one thread: size and gradient by the exact form; iterations of Uzawa's method beside the paper's; frames of dragging a
// telephone handset. solid_bench [--frames N]
#include <fielddeform/solid/size.h>
#include <fielddeform/solid/solve.h>
#include <fmt/format.h>
#include <samples/generate/rappoport.h>
#include <tests/bench/bench.h>
#include <tests/solid/solids.h>

#include <algorithm>

using namespace fielddeform;

namespace {

/// "A typical movement of a single control point": a corner of the unit cube pulled out by half its side.
solid::Problem pulledCorner(int degree, const solid::Objective& objective) {
  solid::Problem p;
  p.object = test::boxObject({degree, degree, degree});
  p.objective = objective;
  p.wanted = p.object.points;
  p.wanted.back() += Vec3::Constant(0.5);
  return p;
}

void study(const char* name, int degree, const solid::Objective& objective, const char* paper) {
  const solid::Problem p = pulledCorner(degree, objective);
  Progress silent;
  std::string line = fmt::format("{:<28}", name);
  for (const double rho : {0.25, 0.4, 0.6, 1.0, 1.4}) {
    solid::Options o{.method = solid::Method::Uzawa};
    o.uzawa.rho1 = rho;
    const solid::Result r = solid::solve(p, o, silent);
    line += fmt::format(" {:>4}/{:<5}", r.report.iterations, r.report.inner);
  }
  const solid::Result exact = solid::solve(p, {}, silent);
  const double ms = 1e3 * bench::measure(bench::quick() ? 1 : 5, [&] { solid::solve(p, {}, silent); }).wall;
  fmt::print("{} | exact {} iterations to {:.0e}, {:.2f} ms | paper: {}\n", line, exact.report.iterations, std::max(exact.report.deviation, 1e-16), ms, paper);
}

void drag(const char* name, solid::Problem p, int frames, solid::Effort effort) {
  const std::vector<Vec3> start = p.object.points, end = p.wanted;
  std::vector<Vec3> valuesEnd, valuesStart;
  for (const solid::Row& row : p.rows) {
    Vec3 a = Vec3::Zero();
    for (const auto& [i, c] : row.terms) a += c * start[i];
    valuesStart.push_back(a);
    valuesEnd.push_back(row.value);
  }
  for (std::size_t r = 0; r < p.rows.size(); ++r) p.rows[r].value = valuesStart[r];
  p.wanted = start;
  const double before = bench::cpuSeconds();
  solid::Session session(p, {});
  const double setUp = bench::cpuSeconds() - before;
  std::vector<double> ms;
  double deviation = 0;
  int iterations = 0;
  for (int k = 1; k <= frames; ++k) {
    const double t = static_cast<double>(k) / frames;
    std::vector<Vec3> wanted(start.size()), values(valuesStart.size());
    for (std::size_t i = 0; i < wanted.size(); ++i) wanted[i] = (1 - t) * start[i] + t * end[i];
    for (std::size_t r = 0; r < values.size(); ++r) values[r] = (1 - t) * valuesStart[r] + t * valuesEnd[r];
    const auto from = std::chrono::steady_clock::now();
    session.setWanted(wanted);
    session.setValues(values);
    session.solve(effort);
    ms.push_back(1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - from).count());
    deviation = std::max(deviation, session.report().deviation);
    iterations = std::max(iterations, session.report().iterations);
  }
  std::sort(ms.begin(), ms.end());
  fmt::print("{:<34} {} points; set up {:.0f} ms; a frame: median {:.2f} ms, 95 % {:.2f} ms, longest {:.2f} ms; at most {} iterations, sizes to {:.0e}\n", name,
             start.size(), 1e3 * setUp, ms[ms.size() / 2], ms[ms.size() * 95 / 100], ms.back(), iterations, std::max(deviation, 1e-16));
}

}  // namespace

int main(int argc, char** argv) {
  const int frames = std::stoi(bench::option(argc, argv, "--frames", bench::quick() ? "5" : "60"));
  const ThreadLimit one(1);
  bench::printMachine(5);
  for (const int degree : {2, 3, 5}) {
    const solid::Object object = test::boxObject({degree, degree, degree}, .1);
    const solid::Sizes sizes(object);
    std::vector<Vec3> g(object.points.size(), Vec3::Zero());
    constexpr int kCalls = 1000;
    const double us = 1e6 / kCalls * bench::measure(5, [&] { for (int k = 0; k < kCalls; ++k) sizes.addGradient(0, object.points, 1e-9, g); }).cpu;
    fmt::print("size and gradient, degree {}: {:.2f} us\n", degree, us);
  }
  fmt::print("\nUzawa's method to 1e-4 of the size and 1e-3 of distance: outer/inner iterations for rho1 = 0.25, 0.4, 0.6, 1, 1.4 (1: Newton's step)\n");
  study("triquadratic, least squares", 2, solid::Objective::leastSquaresOnly(), "15 outer, 12 (1-2?) inner");
  study("triquadratic, energy", 2, {.1, 1, .1, .1}, "");
  study("tricubic, least squares", 3, solid::Objective::leastSquaresOnly(), "25-30 outer, one inner");
  study("tricubic, energy", 3, {.1, 1, .1, .1}, "");
  fmt::print("\n");
  const solid::Problem phone = solid::problemOf(samples::telephone());
  drag("telephone, dragging", phone, frames, solid::Effort::Drag);
  drag("telephone, tight", phone, frames, solid::Effort::Release);
  drag("telephone, rows alone", phone, frames, solid::Effort::Edit);
  drag("tricubic cube, dragging a corner", pulledCorner(3, {}), frames, solid::Effort::Drag);
  return 0;
}
