// Bind and edit of a bumpy capsule in CPU-nanoseconds a vertex: a 100-segment line bent by 90 degrees, four lines twisted
// by 180 degrees, a mesh skeleton of 1000 triangles bent; a falloff, a corner, a thin object.
//   edit_bench [--vertices N] [--repeats N] [--peer NANOSECONDS] [--segments N] [--triangles N] [--threads N]
//              [--case line|mls|twist|mesh|exact|grid|falloff|corner|thin]
//   edit_bench --write FILE [--vertices N]    the capsule as a mesh file, and nothing else
// An edit is everything that a new pose of a bound mesh costs: frames, grid, prediction, correction, guard, statuses and
// residuals; counting folds and the retry that `deform` adds have rows of their own.
// The peer is Blender's lattice modifier on as many vertices; tests/bench/edit runs both and passes its figure.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/mesh/quality.h>
#include <fmt/format.h>
#include <tests/bench/bench.h>
#include <tests/support/cases.h>

#include <algorithm>
#include <cmath>
#include <numbers>

using namespace fielddeform;

namespace {

skeleton::Primitive primitive(std::string name, std::vector<Vec3> points, double radius) {
  skeleton::Primitive p;
  p.name = std::move(name);
  p.points = std::move(points);
  p.radius = radius;
  return p;
}

struct Edit {
  const char* name;
  skeleton::Skeleton rest, posed;
};

Edit lineBend(int segments) {
  const auto rest = tests::verticalLine(segments + 1, 2);
  return {"line bend", {{primitive("line", rest, 0.6)}, {}}, {{primitive("line", tests::bendMap(rest, std::numbers::pi / 2), 0.6)}, {}}};
}

Edit fourLineTwist() {
  Edit e{"four-line twist", {}, {}};
  for (int i = 0; i < 4; ++i) {
    const auto rest = tests::verticalLine(101, 2, i & 1 ? 0.12 : -0.12, i & 2 ? 0.12 : -0.12);
    const std::string name = "line" + std::to_string(i);
    e.rest.primitives.push_back(primitive(name, rest, 0.5));
    e.posed.primitives.push_back(primitive(name, tests::twistMap(rest, std::numbers::pi), 0.5));
  }
  return e;
}

// The upper half of the object alone, bent: the falloff joins it to the rest.
Edit upperBend() {
  auto rest = tests::verticalLine(51, 1);
  for (Vec3& p : rest) p[2] += 0.6;
  auto posed = rest;
  for (Vec3& p : posed) p[2] -= 0.1;
  posed = tests::bendMap(posed, std::numbers::pi / 4, 1);
  for (Vec3& p : posed) p[2] += 0.1;
  return {"falloff", {{primitive("line", rest, 0.6)}, {}}, {{primitive("line", posed, 0.6)}, {}}};
}

// Two straight limbs that a joint bends by 60 degrees.
Edit corner() {
  const std::vector<Vec3> rest{{0, 0, -1}, {0, 0, 0}, {0, 0, 1}}, posed{{0, 0, -1}, {0, 0, 0}, {std::sin(std::numbers::pi / 3), 0, 0.5}};
  return {"corner", {{primitive("line", rest, 0.6)}, {}}, {{primitive("line", posed, 0.6)}, {}}};
}

// About as many triangles; 1000 are 1012.
Edit cageBend(int triangles) {
  const int around = std::max(3, static_cast<int>(std::lround(std::sqrt(triangles / 2.0 * 22 / 23))));
  const int along = std::max(2, static_cast<int>(std::lround(triangles / 2.0 / around)));
  const mesh::Mesh inner = tests::makeCapsule({.radius = 0.12, .around = around, .along = along, .bump = 0});
  skeleton::Primitive p = primitive("shell", inner.positions(), 0.5);
  p.type = skeleton::PrimitiveType::Mesh;
  for (std::size_t f = 0; f < inner.faceCount(); ++f) p.faces.emplace_back(inner.face(f).begin(), inner.face(f).end());
  Edit e{"mesh bend", {{p}, {}}, {}};
  p.points = tests::bendMap(p.points, std::numbers::pi / 2);
  e.posed.primitives.push_back(p);
  return e;
}

class Bench {
 public:
  Bench(const mesh::Mesh& mesh, int repeats, double peer) : mesh_(mesh), repeats_(repeats), peer_(peer) {}

  void run(const Edit& edit, gffd::Predictor predictor, gffd::Evaluation evaluation, gffd::Falloff falloff = gffd::Falloff::Off) const {
    const gffd::GffdMap map(gffd::resolve({.predictor = predictor, .evaluation = evaluation, .falloff = falloff}, mesh_,
                                          skeleton::pairSkeletons(edit.rest, edit.posed)));
    const std::string name = fmt::format("{}, {}, {}", edit.name, gffd::toString(predictor), map.usesGrid() ? "grid" : "exact");
    std::shared_ptr<const map::Binding> binding;
    row(name + ": bind", bench::measure(repeats_, [&] { binding = map.bind(mesh_.positions()); }));
    const std::size_t n = mesh_.vertexCount();
    std::vector<Vec3> position(n), safe(n);
    std::vector<Status> status(n);
    std::vector<float> residual(n);
    gffd::EvaluationCounts counts;
    gffd::GuardReport guarded;
    double tracking = 0;
    Progress silent;
    const bench::Times whole = bench::measure(repeats_, [&] {
      const double before = bench::cpuSeconds();
      const gffd::GffdMap posed = map.withPose(edit.posed);
      counts = posed.applyCounted(*binding, {.position = position, .safe = safe, .status = status, .residual = residual}, silent);
      tracking = bench::cpuSeconds() - before;
      guarded = gffd::guard(mesh_, safe, position, status);
    });
    row(name + ": edit", whole);
    const StatusCounts outcome = countStatuses(status);
    fmt::print("    tracking {:.0f} of it; {} of {} vertices from the grid, {} corrected singly, {} converged, {} limited\n",
               1e9 * tracking / static_cast<double>(n), counts.grid, counts.grid + counts.exact, counts.singly,
               outcome[static_cast<std::size_t>(Status::Converged)], outcome[static_cast<std::size_t>(Status::Limited)]);
  }

  void folds(const Edit& edit) const {
    const auto posed = tests::bendMap(mesh_.positions(), std::numbers::pi / 2);
    row(fmt::format("{}: counting folds", edit.name), bench::measure(repeats_, [&] { mesh::countFolds(mesh_, mesh_.positions(), posed); }));
  }

 private:
  void row(const std::string& name, const bench::Times& t) const {
    const double n = static_cast<double>(mesh_.vertexCount());
    fmt::print("{:36} {:8.1f} CPU-ns a vertex {:8.1f} ns wall", name, 1e9 * t.cpu / n, 1e9 * t.wall / n);
    if (peer_ > 0) fmt::print("   {:5.2f} x Blender's lattice", 1e9 * t.cpu / n / peer_);
    fmt::print("\n");
    std::fflush(stdout);
  }

  const mesh::Mesh& mesh_;
  int repeats_;
  double peer_;
};

}  // namespace

int main(int argc, char** argv) {
  const bool quick = bench::quick();
  const double wanted = std::stod(bench::option(argc, argv, "--vertices", quick ? "20000" : "1000000"));
  const int repeats = std::stoi(bench::option(argc, argv, "--repeats", quick ? "1" : "7"));
  const double peer = std::stod(bench::option(argc, argv, "--peer", "0"));
  const std::string only = bench::option(argc, argv, "--case", "");
  const int segments = std::stoi(bench::option(argc, argv, "--segments", "100"));
  const int triangles = std::stoi(bench::option(argc, argv, "--triangles", "1000"));
  const int around = static_cast<int>(std::sqrt(wanted / 1.5));
  const mesh::Mesh mesh = tests::makeCapsule({.around = around, .along = static_cast<int>(wanted / around)});
  if (const std::string file = bench::option(argc, argv, "--write", ""); !file.empty()) {
    mesh::Mesh stored = mesh;
    stored.setPositionType(mesh::ScalarType::Float32);
    mesh::writeMesh(stored, file);
    return 0;
  }
  const ThreadLimit limit(std::stoi(bench::option(argc, argv, "--threads", "0")));
  bench::printMachine(repeats);
  fmt::print("{}; {} vertices, {} triangles; line of {} segments, R = 0.6\n",
             fielddeform::detail::toString(fielddeform::detail::simdLevel()), mesh.vertexCount(), mesh.faceCount(), segments);
  const Bench bench(mesh, repeats, peer);
  const auto wants = [&](const std::string& word) { return only.empty() || only == word; };
  using enum gffd::Predictor;
  const Edit line = lineBend(segments);
  if (wants("line")) bench.run(line, Axial, gffd::Evaluation::Auto);
  if (wants("mls")) bench.run(line, Mls, gffd::Evaluation::Auto);
  if (wants("twist")) bench.run(fourLineTwist(), Axial, gffd::Evaluation::Auto);
  if (wants("mesh")) bench.run(cageBend(triangles), Axial, gffd::Evaluation::Auto);
  if (wants("grid"))  // whatever auto would take
    for (const auto predictor : {Axial, Mls}) bench.run(line, predictor, gffd::Evaluation::Grid);
  if (wants("falloff"))
    for (const auto predictor : {Axial, Mls}) bench.run(upperBend(), predictor, gffd::Evaluation::Auto, gffd::Falloff::On);
  if (wants("corner"))
    for (const auto predictor : {Axial, Mls}) bench.run(corner(), predictor, gffd::Evaluation::Auto);
  if (wants("thin")) {
    // A tenth of the influence radius thick.
    const mesh::Mesh thin = tests::makeCapsule({.radius = 0.06, .around = around / 2, .along = static_cast<int>(wanted / (around / 2))});
    const Bench thinly(thin, repeats, peer);
    Edit edit = line;
    edit.name = "thin object";
    for (const auto predictor : {Axial, Mls}) thinly.run(edit, predictor, gffd::Evaluation::Auto);
  }
  if (wants("exact")) {
    bench.run(line, Axial, gffd::Evaluation::Exact);
    bench.run(line, Mls, gffd::Evaluation::Exact);
    bench.folds(line);
  }
  fmt::print("peak memory {:.0f} MB\n", bench::peakMegabytes());
}
