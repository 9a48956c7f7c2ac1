#include <fielddeform/mesh/io.h>
#include <fielddeform/volume/cubic_form.h>
#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "tests/bench/bench.h"
#include "tests/support/volume_cases.h"

/// Hirota's Tables 1 and 2 and Figures 5 to 8, with the paper's numbers beside, and the speed of what they rest on:
///   volume_bench [--curves FOLDER]       FIELDDEFORM_TEST_MESHES names the folder of cow.obj
namespace fielddeform {
namespace {

using namespace volume;
using tests::VolumeCase;

struct PaperRow {
  double single, multi;  // CPU ms, 195 MHz R10000
  int ratio, triangles;
  double deviation;      // percent
};

Options paperOptions(bool multiLevel, Minimiser minimiser) {
  Options o;
  o.solver = Solver::AugmentedLagrangian;
  o.augmentedLagrangian.minimiser = minimiser;
  o.augmentedLagrangian.multiLevel = multiLevel;
  return o;
}

/// All levels, as in Table 1, whose N are those of the finest meshes; else they end when nothing changes any more.
Options toTheFinest(Options o) {
  o.augmentedLagrangian.levelChange = 1e-30;
  return o;
}

struct Row {
  std::string name;
  Options options;
  Result result;
  double milliseconds = 0;
};

Result run(const Prepared& prepared, const Options& options) {
  Progress progress;
  return preserve(prepared, options, progress);
}

std::vector<Row> measureCase(const Prepared& prepared, int repeats) {
  std::vector<Row> rows{{"single-level", paperOptions(false, Minimiser::ConjugateGradients), {}, 0},
                        {"multi-level", toTheFinest(paperOptions(true, Minimiser::ConjugateGradients)), {}, 0},
                        {"multi-level, early", paperOptions(true, Minimiser::ConjugateGradients), {}, 0},
                        {"single-level, L-BFGS", paperOptions(false, Minimiser::Lbfgs), {}, 0},
                        {"multi-level, L-BFGS", toTheFinest(paperOptions(true, Minimiser::Lbfgs)), {}, 0},
                        {"exact, fine form", {.exact = {.grids = Grids::Fine}}, {}, 0},
                        {"exact, two-grid", {.exact = {.grids = Grids::Two}}, {}, 0},
                        {"exact, default", {}, {}, 0}};
  for (Row& row : rows) row.milliseconds = 1e3 * bench::measure(repeats, [&] { row.result = run(prepared, row.options); }).cpu;
  return rows;
}

/// |dV/V| that the method itself left, before the last projection.
double ownDeviation(const Report& r) { return r.levels.empty() ? std::abs(r.volumes[0].deviation()) : r.levels.back().deviation; }
int allEvaluations(const Report& r) {
  int sum = 0;
  for (const LevelReport& l : r.levels) sum += l.evaluations;
  return r.levels.empty() ? r.meshEvaluations : sum;
}

void printCase(const VolumeCase& c, const PaperRow& paper, const std::vector<Row>& rows, const Prepared& prepared) {
  const double single = rows[0].milliseconds, multi = rows[1].milliseconds, early = rows[2].milliseconds, exact = rows.back().milliseconds;
  fmt::print("\n{} ({} triangles, {} nodes, {} free)\n", c.name, c.mesh.faceCount(), c.lattice.nodeCount(),
             c.lattice.nodeCount() - c.problem.constraints.pinned.size());
  fmt::print("  {:<22} {:>10} {:>7} {:>7} {:>12} {:>10} {:>10} {:>9} {:>8}\n", "method", "CPU ms", "steps", "evals", "energy", "|dV/V|", "after", "1-lev/t", "n-lev/t");
  for (const Row& row : rows) {
    const Report& r = row.result.report;
    fmt::print("  {:<22} {:>10.3f} {:>7} {:>7} {:>12.6f} {:>10.1e} {:>10.1e} {:>9.1f} {:>8.2f}{}\n", row.name, row.milliseconds, r.iterations, allEvaluations(r),
               r.energy, ownDeviation(r), std::abs(r.volumes[0].deviation()), single / row.milliseconds, multi / row.milliseconds,
               r.saddles ? fmt::format("  {} saddle left", r.saddles) : "");
  }
  const Result starts = run(prepared, {.exact = {.grids = Grids::Fine, .starts = 8}});
  double best = 1e300;
  for (const StartReport& s : starts.report.starts) best = std::min(best, s.energy);
  const double energy = rows.back().result.report.energy;
  fmt::print("  Table 1          T1 {:.1f} ms  T2 {:.2f} ms  T1/T2 {:.1f}  N {}  dV/V {:.3f} %\n", single, multi, single / multi,
             rows[1].result.report.levels.back().triangles, 100 * rows[1].result.report.levels.back().deviation);
  if (paper.single > 0)
    fmt::print("  the paper's      T1 {:.0f} ms  T2 {:.0f} ms  T1/T2 {}  N {}  dV/V {:.2f} %\n", paper.single, paper.multi, paper.ratio, paper.triangles, paper.deviation);
  fmt::print("  ended early      T2 {:.2f} ms  T1/T2 {:.1f}  N {}\n", early, single / early, rows[2].result.report.levels.back().triangles);
  fmt::print("  bars: multi >= 5x single: {:.1f} {}; default >= 1.5x multi: {:.2f} {}; >= 15x single: {:.1f} {}; energy {:+.3f} % of the best of 8 starts {}\n",
             single / multi, single >= 5 * multi ? "met" : "MISSED", multi / exact, multi >= 1.5 * exact ? "met" : "MISSED", single / exact,
             single >= 15 * exact ? "met" : "MISSED", 100 * (energy / best - 1), energy <= 1.01 * best ? "met" : "another minimum");
}

void printTable2(const Report& r) {
  fmt::print("\nTable 2, torus compression, level by level (the paper: N 16, 64, .. 4096; 90 steps at the first, 15 at the second, after which no\n"
             "node moves more than 3.7 %; dV/V 0.05 % at the end)\n");
  fmt::print("  {:>3} {:>8} {:>9} {:>7} {:>7} {:>10} {:>9} {:>10} {:>10} {:>9} {:>9}\n", "k", "N_tri", "dX %", "N_step", "evals", "energy", "dV/V %", "lambda", "mu", "T ms", "Tc ms");
  double total = 0;
  for (std::size_t k = 0; k < r.levels.size(); ++k) {
    const LevelReport& l = r.levels[k];
    total += l.seconds;
    fmt::print("  {:>3} {:>8} {:>9.3f} {:>7} {:>7} {:>10.5f} {:>9.4f} {:>10.4f} {:>10.4f} {:>9.3f} {:>9.3f}\n", k + 1, l.triangles, 100 * l.change, l.steps, l.evaluations, l.energy,
               100 * l.deviation, l.multiplier, l.penalty, 1e3 * l.seconds, 1e3 * total);
  }
  fmt::print("  estimated volume error C/N of the finest mesh: {:.4f} %\n", 100 * r.errorEstimate);
}

/// A line of a convergence curve: cumulative CPU time against the largest distance of a node from its last place / size.
struct Curve {
  std::string name;
  std::vector<std::array<double, 2>> points;
};

Curve curveOf(const Prepared& prepared, const std::string& name, Options options) {
  std::vector<std::vector<Vec3>> poses;
  std::vector<double> time;
  const double start = bench::cpuSeconds();
  options.onStep = [&](const Step& s) {
    time.push_back(bench::cpuSeconds() - start);
    poses.emplace_back(s.displacements.begin(), s.displacements.end());
  };
  const Result r = run(prepared, options);
  Curve curve{name, {}};
  for (std::size_t k = 0; k < poses.size(); ++k) {
    double far = 0;
    for (std::size_t i = 0; i < poses[k].size(); ++i) far = std::max(far, (poses[k][i] - r.displacements[i]).norm());
    curve.points.push_back({1e3 * time[k], std::max(far / r.report.size, 1e-12)});
  }
  return curve;
}

void writeCurves(const std::filesystem::path& folder, const std::string& figure, const std::string& title, const std::vector<Curve>& curves) {
  std::ofstream csv(folder / (figure + ".csv")), svg(folder / (figure + ".svg"));
  csv << "method,cpu_ms,node_error\n";
  double t0 = 1e300, t1 = 0;
  for (const Curve& c : curves)
    for (const auto& p : c.points) csv << fmt::format("{},{:.6g},{:.6g}\n", c.name, p[0], p[1]), t0 = std::min(t0, std::max(p[0], 1e-3)), t1 = std::max(t1, p[0]);
  const double w = 640, h = 400, left = 70, right = 20, top = 40, bottom = 50, low = -8, high = 0.5;
  const double x0 = std::floor(std::log10(t0)), x1 = std::ceil(std::log10(std::max(t1, 10 * t0)));
  const auto x = [&](double t) { return left + (std::log10(t) - x0) / (x1 - x0) * (w - left - right); };
  const auto y = [&](double e) { return top + (high - std::clamp(std::log10(e), low, high)) / (high - low) * (h - top - bottom); };
  svg << fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" font-family=\"sans-serif\" font-size=\"12\">\n", w, h);
  svg << fmt::format("<rect width=\"{}\" height=\"{}\" fill=\"white\"/><text x=\"{}\" y=\"22\" font-size=\"15\">{}</text>\n", w, h, left, title);
  for (int e = static_cast<int>(low); e <= 0; e += 2)
    svg << fmt::format("<path d=\"M{0} {1}H{2}\" stroke=\"#ddd\"/><text x=\"{3}\" y=\"{4}\" text-anchor=\"end\">1e{5}</text>\n", left, y(std::pow(10, e)), w - right, left - 6, y(std::pow(10, e)) + 4, e);
  for (int e = static_cast<int>(x0); e <= static_cast<int>(x1); ++e)
    svg << fmt::format("<path d=\"M{0} {1}V{2}\" stroke=\"#ddd\"/><text x=\"{0}\" y=\"{3}\" text-anchor=\"middle\">1e{4}</text>\n", x(std::pow(10, e)), top, h - bottom, h - bottom + 16, e);
  svg << fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">cumulative CPU time (ms)</text>\n", (left + w - right) / 2, h - 10);
  svg << fmt::format("<text x=\"16\" y=\"{0}\" transform=\"rotate(-90 16 {0})\" text-anchor=\"middle\">node error / size</text>\n", h / 2);
  const char* colour[] = {"#1f77b4", "#d62728", "#2ca02c", "#9467bd"};
  for (std::size_t k = 0; k < curves.size(); ++k) {
    std::string path;
    for (const auto& p : curves[k].points) path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x(std::max(p[0], t0)), y(p[1]));
    svg << fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/><text x=\"{}\" y=\"{}\" fill=\"{}\">{}</text>\n", path, colour[k % 4], w - right - 130, top + 16 + 16 * static_cast<double>(k), colour[k % 4], curves[k].name);
  }
  svg << "</svg>\n";
}

void benchCases(int repeats, const std::string& folder) {
  struct Entry {
    VolumeCase c;
    PaperRow paper;
    std::string figure;
  };
  const bool quick = bench::quick();
  std::vector<Entry> entries;
  entries.push_back({tests::torusCompression(quick ? 1024 : 4096), {21000, 1760, 12, 4096, 0.05}, "figure5"});
  entries.push_back({tests::torusCompression(quick ? 1024 : 4096, Springs::All, 0.2), {21000, 1760, 12, 4096, 0.05}, "figure5-harder"});
  entries.back().c.name += ", twice as far";
  entries.push_back({tests::torusStretch(quick ? 1024 : 65536), {677400, 11080, 61, 65536, 0.08}, "figure6"});
  entries.push_back({tests::clubCompression(quick ? 3 : 5), {40990, 3530, 12, 16384, 0.07}, "figure7"});
  if (const char* meshes = std::getenv("FIELDDEFORM_TEST_MESHES"))
    entries.push_back({tests::bending("cow bending", mesh::readMesh(std::filesystem::path(meshes) / "cow.obj"), 60), {15810, 2240, 7, 5804, 0.07}, "figure8"});
  else
    fmt::print("cow bending is left out: FIELDDEFORM_TEST_MESHES is not set\n");
  entries.push_back({tests::clubBent(170, quick ? 3 : 5), {0, 0, 0, 0, 0}, "plate7"});
  fmt::print("Levels, bases and edge checks are prepared before; forms, merging and the last projection are in every time.\n");
  for (const Entry& e : entries) {
    const Prepared prepared(e.c.problem);
    const auto rows = measureCase(prepared, repeats);
    printCase(e.c, e.paper, rows, prepared);
    if (e.figure == "figure5") printTable2(rows[1].result.report);
    if (folder.empty()) continue;
    std::filesystem::create_directories(folder);
    std::vector<Curve> curves;
    for (const std::size_t k : {std::size_t{1}, std::size_t{0}, rows.size() - 1}) curves.push_back(curveOf(prepared, rows[k].name, rows[k].options));
    writeCurves(folder, e.figure, e.c.name, curves);
  }
}

void benchForms(int repeats) {
  fmt::print("\nThe cubic form: built from the mesh, and V + dV by it\n  {:>7} {:>10} {:>10} {:>12}\n", "nodes", "triangles", "build ms", "V+dV us");
  for (const std::array<int, 3> n : {std::array{5, 2, 2}, std::array{3, 3, 3}, std::array{4, 4, 4}}) {
    for (const int around : bench::quick() ? std::vector{32} : std::vector{64, 256}) {
      const mesh::Mesh torus = tests::makeTorus(around, around / 2);
      map::Lattice lattice;
      lattice.box = map::fitBox(torus.positions(), 0.02);
      for (std::size_t a = 0; a < 3; ++a) lattice.axis[a] = map::AxisBasis::bernstein(n[a]);
      const map::LatticeMap map(lattice);
      const auto rows = map.basis(*map.bind(torus.positions()));
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> basis;
      basis.setZero(static_cast<Eigen::Index>(rows.rows()), static_cast<Eigen::Index>(rows.columns));
      for (std::size_t r = 0; r < rows.rows(); ++r)
        for (std::size_t k = rows.start[r]; k < rows.start[r + 1]; ++k) basis(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(rows.column[k])) = rows.value[k];
      const auto triangles = torus.triangles();
      std::optional<CubicForm> form;
      const double build = bench::measure(repeats, [&] { form = CubicForm::ofMesh(basis, triangles); }).cpu;
      const auto nodes = map.restNodes();
      std::vector<Vec3> gradient(nodes.size()), at(nodes.begin(), nodes.end());
      const int times = bench::quick() ? 100 : 2000;
      const double one = bench::measure(repeats, [&] {
        for (int i = 0; i < times; ++i) form->gradient(at, gradient);
      }).cpu / times;
      fmt::print("  {:>7} {:>10} {:>10.2f} {:>12.2f}{}\n", fmt::format("{}x{}x{}", n[0], n[1], n[2]), torus.faceCount(), 1e3 * build, 1e6 * one,
                 n[0] == 3 ? fmt::format("   bar 10 us: {}", one <= 1e-5 ? "met" : "MISSED") : "");
    }
  }
}

void benchDrag(int repeats) {
  fmt::print("\nWarm drag frames (solver time, the session's form kept)\n");
  for (const VolumeCase& c : {tests::clubBent(60, bench::quick() ? 3 : 5), tests::torusCompression(bench::quick() ? 1024 : 4096)}) {
    const Prepared prepared(c.problem);
    std::vector<Vec3> start = c.problem.start;
    Session session(prepared, {});
    session.solve(start);
    int frames = 0, iterations = 0;
    const double time = bench::measure(repeats, [&] {
      for (int f = 0; f < 20; ++f) {
        const double t = 1 + 0.005 * std::sin(0.3 * ++frames);
        for (const Index i : c.problem.constraints.pinned) start[i] = t * c.problem.start[i];
        session.solve(start);
        iterations += session.report().iterations;
      }
    }).cpu / 20;
    fmt::print("  {:<22} {} nodes: {:.3f} ms a frame, {:.1f} iterations   bar 0.5 ms: {}\n", c.name, c.lattice.nodeCount(), 1e3 * time,
               static_cast<double>(iterations) / frames, time <= 5e-4 ? "met" : "MISSED");
  }
}

void benchPlainFix(int repeats) {
  const mesh::Mesh torus = bench::quick() ? tests::makeTorus(64, 32) : tests::makeTorus(452, 226);
  map::Lattice lattice;
  lattice.box = map::fitBox(torus.positions(), 0.02);
  for (auto& a : lattice.axis) a = map::AxisBasis::bernstein(6);
  Problem p;
  p.map = std::make_shared<map::LatticeMap>(lattice);
  p.energy = std::make_shared<SpringNetwork>(lattice);
  p.surface = makeSurface(*p.map, torus);
  p.start.assign(lattice.nodeCount(), Vec3::Zero());
  const auto rest = lattice.restNodes();
  for (std::size_t i = 0; i < rest.size(); ++i) p.start[i] = Vec3(0.2 * rest[i].x(), 0.1 * std::sin(3 * rest[i].x()), -0.05 * rest[i].y());
  fmt::print("\nA plain volume fix, {} vertices, 6x6x6 (PyGeM: 207 s)\n", torus.vertexCount());
  const bench::Times prepare = bench::measure(repeats, [&] { const Prepared prepared(p); });
  const Prepared prepared(p);
  for (const Solver solver : {Solver::Projection, Solver::Exact}) {
    Result r;
    const bench::Times t = bench::measure(solver == Solver::Exact ? 1 : repeats, [&] { r = run(prepared, {.solver = solver}); });
    fmt::print("  {:<12} {:.3f} s CPU, {:.3f} s wall (preparing {:.3f} s CPU once), {} mesh evaluations, {} iterations, |dV/V| {:.1e}, from {:+.1f} %, {}{}\n", toString(solver), t.cpu, t.wall,
               prepare.cpu, r.report.meshEvaluations, r.report.iterations, std::abs(r.report.volumes[0].deviation()), 100 * (r.report.volumes[0].start / r.report.volumes[0].base - 1), toString(r.report.outcome),
               solver == Solver::Projection ? fmt::format("   bar 0.1 s CPU: {}", t.cpu <= 0.1 ? "met" : "MISSED") : "");
  }
}

}  // namespace
}  // namespace fielddeform

int main(int argc, char** argv) {
  using namespace fielddeform;
  const int repeats = bench::quick() ? 1 : 15;
  const ThreadLimit one(1);  // as the paper; and waiting threads are no work
  bench::printMachine(repeats);
  benchCases(repeats, bench::option(argc, argv, "--curves", ""));
  benchForms(repeats);
  benchDrag(repeats);
  benchPlainFix(repeats);
}
