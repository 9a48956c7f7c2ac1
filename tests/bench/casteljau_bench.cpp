// CPU time of the generalised de Casteljau map a point, beside the tricubic lattice, on one thread: casteljau_bench
// [--points N] [--repeats N]
#include <fielddeform/core/random.h>
#include <fielddeform/map/casteljau.h>
#include <fmt/format.h>
#include <tests/bench/bench.h>

using namespace fielddeform;

namespace {

Vec3 random(std::uint64_t seed, std::uint64_t i) { return {uniform01(seed, 3 * i), uniform01(seed, 3 * i + 1), uniform01(seed, 3 * i + 2)}; }

map::CasteljauCurve shaken(int degree) {
  map::CasteljauCurve curve = map::straightCurve({}, degree);
  std::uint64_t i = 0;
  for (Vec3& p : curve.pieces[0].points) p += 0.1 * random(1, i++);
  for (auto* handles : {&curve.pieces[0].s, &curve.pieces[0].t}) {
    handles->resize(static_cast<std::size_t>(degree));
    for (int j = 0; j < degree; ++j) {
      (*handles)[static_cast<std::size_t>(j)].resize(static_cast<std::size_t>(degree - j), Vec3::Zero());
      for (Vec3& h : (*handles)[static_cast<std::size_t>(j)]) h += 0.1 * random(1, i++);
    }
  }
  return curve;
}

}  // namespace

int main(int argc, char** argv) {
  const auto count = static_cast<std::size_t>(std::stoul(bench::option(argc, argv, "--points", bench::quick() ? "10000" : "1000000")));
  const int repeats = std::stoi(bench::option(argc, argv, "--repeats", bench::quick() ? "1" : "5"));
  const ThreadLimit one(1);
  bench::printMachine(repeats);
  std::vector<Vec3> points(count), out(count);
  for (std::size_t i = 0; i < count; ++i) points[i] = random(2, i);
  Progress silent;
  const auto perPoint = [&](const std::function<void()>& call) { return 1e9 * bench::measure(repeats, call).cpu / static_cast<double>(count); };
  const auto line = [&](const std::string& name, const map::SpaceMap& map) {
    std::shared_ptr<const map::Binding> binding;
    const double bind = perPoint([&] { binding = map.bind(points); });
    const double apply = perPoint([&] { map.apply(*binding, {.position = out, .safe = {}, .status = {}, .residual = {}}, silent); });
    fmt::print("{:<38} bind {:6.1f} ns, apply {:6.1f} ns a point\n", name, bind, apply);
    return apply;
  };
  double cubic = 0;
  for (const int degree : {1, 2, 3, 5, 8}) {
    const map::CasteljauMap map(shaken(degree), map::LatticeBox{});
    const double apply = line(fmt::format("de Casteljau, degree {}", degree), map);
    if (degree == 3) cubic = apply;
    if (degree > 3) continue;
    const auto binding = map.bind(points);
    const double levels = perPoint([&] { map.level(*binding, degree, 0, out); });
    fmt::print("{:<38} {:26.1f} ns a point\n", fmt::format("  by the recurrence (allocating), {}", degree), levels);
  }
  map::Lattice lattice;
  for (auto& axis : lattice.axis) axis = map::AxisBasis::bernstein(4);
  for (std::size_t i = 0; i < lattice.nodeCount(); ++i) lattice.displacements.push_back(0.1 * random(3, i));
  const double tricubic = line("Bernstein lattice 4x4x4 (tricubic)", map::LatticeMap(lattice));
  fmt::print("the lattice costs {:.2f} times the cubic curve\n", tricubic / cubic);
}
