// Bind and edit of a bumpy capsule by a 100-segment line bent by 90 degrees, exact field, in CPU-nanoseconds a vertex.
//   edit_bench [--vertices N] [--repeats N] [--peer NANOSECONDS]
// The peer is Blender's lattice modifier on as many vertices; tests/bench/edit runs both and passes its figure.
#include <fielddeform/gffd/deform.h>
#include <fmt/format.h>
#include <tests/bench/bench.h>
#include <tests/support/cases.h>

#include <cmath>
#include <numbers>

using namespace fielddeform;

namespace {

skeleton::Skeleton line(std::vector<Vec3> points) {
  skeleton::Primitive p;
  p.name = "line";
  p.points = std::move(points);
  p.radius = 0.6;
  return {{p}, {}};
}

void row(const char* name, const bench::Times& t, double vertices, double peer) {
  fmt::print("{:22} {:9.1f} CPU-ns a vertex {:9.1f} ns wall", name, 1e9 * t.cpu / vertices, 1e9 * t.wall / vertices);
  if (peer > 0) fmt::print("   {:6.2f} x Blender's lattice", 1e9 * t.cpu / vertices / peer);
  fmt::print("\n");
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = bench::quick();
  const double wanted = std::stod(bench::option(argc, argv, "--vertices", quick ? "20000" : "1000000"));
  const int repeats = std::stoi(bench::option(argc, argv, "--repeats", quick ? "1" : "5"));
  const double peer = std::stod(bench::option(argc, argv, "--peer", "0"));
  const int around = static_cast<int>(std::sqrt(wanted / 1.5));
  const mesh::Mesh mesh = tests::makeCapsule({.around = around, .along = static_cast<int>(wanted / around)});
  const double n = static_cast<double>(mesh.vertexCount());
  const auto rest = tests::verticalLine(101, 2);
  const auto pair = skeleton::pairSkeletons(line(rest), line(tests::bendMap(rest, std::numbers::pi / 2)));
  bench::printMachine(repeats);
  fmt::print("{} vertices, {} triangles, line of 100 segments, R = 0.6, bend 90 degrees\n", mesh.vertexCount(), mesh.faceCount());
  Progress silent;
  for (const gffd::Predictor predictor : {gffd::Predictor::Mls, gffd::Predictor::Axial}) {
    const gffd::GffdMap map(gffd::resolve({.predictor = predictor, .falloff = gffd::Falloff::Off}, mesh, pair));
    std::shared_ptr<const map::Binding> binding;
    const bench::Times bind = bench::measure(repeats, [&] { binding = map.bind(mesh.positions()); });
    std::size_t converged = 0;
    const bench::Times edit = bench::measure(repeats, [&] {
      const gffd::Deformed d = gffd::deform(mesh, map, *binding, silent);
      converged = countStatuses(d.status)[static_cast<std::size_t>(Status::Converged)];
    });
    row(fmt::format("{} bind", gffd::toString(predictor)).c_str(), bind, n, peer);
    row(fmt::format("{} edit", gffd::toString(predictor)).c_str(), edit, n, peer);
    fmt::print("{:22} {:9.4f} % of the vertices\n", "  converged", 100.0 * static_cast<double>(converged) / n);
  }
  fmt::print("peak memory {:.0f} MB\n", bench::peakMegabytes());
}
