// Compares the combinations of the volume pass on eight edits (docs/volume-pass.md): strain added (99th percentile over the edges of
// what moved), largest turn of a face normal by the pass, faces turned by more than 90 degrees, deviation, share undone, time.
// Two of the edits are on homer.obj, from the folder of FIELDDEFORM_TEST_MESHES; without it they are left out.
// Usage: local_volume_bench [--edit NAME] [--only COMBINATION] [--million]    --million: times of the pass on 1M vertices instead
#include <fielddeform/core/error.h>
#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/skeleton/edit.h>
#include <fielddeform/volume/local.h>
#include <fmt/format.h>
#include <tests/bench/bench.h>
#include <tests/support/cases.h>
#include <tests/support/marching_tetrahedra.h>

#include <numbers>
#include <optional>

using namespace fielddeform;

namespace {

constexpr double kPi = std::numbers::pi;

struct EditCase {
  std::string name;
  mesh::Mesh mesh;
  std::vector<Vec3> posed;
  std::vector<double> weight;
};

skeleton::Skeleton line(const Vec3& from, const Vec3& to, double radius) {
  skeleton::Primitive p;
  p.name = "line";
  for (int i = 0; i <= 48; ++i) p.points.push_back(from + (to - from) * i / 48.0);
  p.radius = radius;
  return {{p}, {}};
}

EditCase tracked(std::string name, mesh::Mesh mesh, const skeleton::Skeleton& rest, skeleton::Edit edit) {
  const auto posed = skeleton::applyEdits(rest, std::vector{std::move(edit)});
  const gffd::GffdMap map(gffd::resolve({}, mesh, skeleton::pairSkeletons(rest, posed)));
  Progress silent;
  const auto binding = map.bind(mesh.positions());
  gffd::Deformed d = gffd::deform(mesh, map, *binding, silent);
  auto weight = d.map.falloffWeights(*binding);
  return {std::move(name), std::move(mesh), std::move(d.position), std::move(weight)};
}

skeleton::Edit stretch(const Vec3& axis, double factor, double from, double to) {
  return {"", skeleton::Stretch{{.axis = axis, .pivot = {}, .from = from, .to = to}, factor}};
}

// Four fingers on a palm, about 2 units long.
mesh::Mesh hand() {
  const auto capsule = [](const Vec3& p, const Vec3& a, const Vec3& b, double r) {
    const double t = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    return (p - a - t * (b - a)).norm() - r;
  };
  const auto value = [&](const Vec3& p) {
    double d = (p - Vec3(0, 0, -0.5)).cwiseQuotient(Vec3(1.3, 0.5, 1.2)).norm() - 0.5;
    d *= 0.5;
    double soft = std::exp(-20 * d);
    for (int k = 0; k < 4; ++k) {
      const double x = -0.36 + 0.24 * k;
      soft += std::exp(-20 * capsule(p, Vec3(x, 0, -0.2), Vec3(1.15 * x, 0, 0.9), 0.085));
    }
    return -std::log(soft) / 20;
  };
  return tests::marchingTetrahedra(Box(Vec3(-0.9, -0.5, -1.3), Vec3(0.9, 0.5, 1.2)), 90, value);
}

/// Pulled out along x, or blown up along its normals: then it is nothing but the volume it adds.
EditCase bump(bool pulled) {
  EditCase c{pulled ? "bump pulled out of a sphere" : "bump blown up on a sphere", tests::makeCapsule({.length = 1e-9, .radius = 1, .around = 128, .along = 96, .bump = 0}), {}, {}};
  for (const Vec3& p : c.mesh.positions()) {
    const double t = std::clamp(1 - (p - Vec3(1, 0, 0)).norm() / 1.5, 0.0, 1.0), w = t * t * (3 - 2 * t);
    c.weight.push_back(w);
    c.posed.push_back(p + 0.35 * w * (pulled ? Vec3(1.2, 0, 0) : Vec3(p.normalized())));
  }
  return c;
}

std::vector<EditCase> edits() {
  std::vector<EditCase> out;
  const mesh::Mesh capsule = tests::makeCapsule();
  const auto spine = line({0, 0, -1}, {0, 0, 1}, 0.6);
  out.push_back(tracked("capsule bent 90", capsule, spine, {"", skeleton::Bend{{}, kPi / 2, {}, Vec3(0, 1, 0)}}));
  out.push_back(tracked("capsule twisted 180", tests::makeCapsule({.square = 0.1}), spine, {"", skeleton::Twist{{}, kPi}}));
  out.push_back(tracked("hinge 90", capsule, spine,
                        {"", skeleton::Bend{{.axis = {}, .pivot = {}, .from = 0.45, .to = 0.55}, kPi / 2, {}, Vec3(0, 1, 0)}}));
  out.push_back(tracked("half capsule x1.5", capsule, spine, stretch(Vec3::UnitZ(), 1.5, 0.5, 1)));
  if (const char* folder = std::getenv("FIELDDEFORM_TEST_MESHES")) {
    const mesh::Mesh homer = mesh::readMesh(std::filesystem::path(folder) / "homer.obj");
    out.push_back(tracked("head x1.7", homer, line({0.5, 0.70, 0.49}, {0.5, 0.98, 0.47}, 0.2), stretch(Vec3::UnitY(), 1.7, 0, 1)));
    out.push_back(tracked("arm x1.6", homer, line({0.62, 0.66, 0.5}, {0.72, 0.60, 0.53}, 0.12), stretch(Vec3(0.1, -0.06, 0.03), 1.6, 0, 1)));
  }
  out.push_back(tracked("finger x1.5", hand(), line({-0.12, 0, 0.25}, {-0.14, 0, 0.98}, 0.16), stretch(Vec3(-0.02, 0, 0.73), 1.5, 0, 1)));
  out.push_back(bump(true));
  out.push_back(bump(false));
  return out;
}

struct Measures {
  double strain = 0, turn = 0;
  std::size_t turned = 0, folds = 0;
  double deviation = 0;
};

Measures compare(const EditCase& c, Points after) {
  Measures m;
  const mesh::EdgeTable edges(c.mesh);
  std::vector<double> strain;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto [a, b] = edges.vertices(e);
    const double l = (c.posed[a] - c.posed[b]).norm();
    if (l > 0 && (after[a] != c.posed[a] || after[b] != c.posed[b])) strain.push_back(std::abs((after[a] - after[b]).norm() / l - 1));
  }
  if (!strain.empty()) {
    const auto at = strain.begin() + static_cast<std::ptrdiff_t>((strain.size() * 99) / 100);
    std::nth_element(strain.begin(), at, strain.end());
    m.strain = *at;
  }
  for (std::size_t f = 0; f < c.mesh.faceCount(); ++f)
    c.mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
      const Vec3 n = (c.posed[j] - c.posed[i]).cross(c.posed[k] - c.posed[i]), o = (after[j] - after[i]).cross(after[k] - after[i]);
      if (!(n.norm() > 0 && o.norm() > 0)) return;
      const double turn = std::atan2(n.cross(o).norm(), n.dot(o)) * 180 / kPi;
      m.turn = std::max(m.turn, turn);
      m.turned += turn > 90;
    });
  m.folds = mesh::countFolds(c.mesh, c.posed, after);
  const double rest = *mesh::volume(c.mesh, c.mesh.positions()).value;
  m.deviation = std::abs(*mesh::volume(c.mesh, after).value / rest - 1);
  return m;
}

struct Combination {
  std::string name;
  volume::LocalOptions options;
};

std::vector<Combination> combinations() {
  using namespace volume;
  std::vector<Combination> out;
  for (const auto energy : {LocalEnergy::Surface, LocalEnergy::Springs})
    for (const auto solver : {LocalSolver::Exact, LocalSolver::AugmentedLagrangian})
      for (const auto mask : {MaskKind::Auto, MaskKind::None, MaskKind::Rest})
        out.push_back({fmt::format("{}/{}/{}", toString(mask), toString(energy), toString(solver)),
                       {.mask = mask, .energy = energy, .solver = solver}});
  return out;
}

void row(const EditCase& c, const Combination& combination) {
  volume::LocalResult result;
  Progress silent;
  try {
    const bench::Times t = bench::measure(bench::quick() ? 1 : 3, [&] {
      result = volume::preserveLocally({.rest = c.mesh, .posed = c.posed, .weight = c.weight}, combination.options, silent);
    });
    const Measures m = compare(c, result.position);
    const auto& r = result.report;
    fmt::print("  {:34} {:6.3f} / {:5.1f} / {:4}  folds {:3} dV/V {:8.1e} tau {:4.2f} undone {:5.1f} % moves {:.4f} it {:3} nodes {}x{}x{} ({}) {:6.3f} CPU-s\n",
               combination.name, m.strain, m.turn, m.turned, m.folds, m.deviation, r.tau, 100 * r.undone, r.largest, r.iterations,
               r.nodes[0], r.nodes[1], r.nodes[2], r.freeNodes, t.cpu);
  } catch (const InfeasibleError& error) {
    fmt::print("  {:34} refused: {}\n", combination.name, error.what());
  }
  std::fflush(stdout);
}

// Half a capsule of a million vertices stretched, and all of it bent: the time of the pass alone.
void million() {
  const mesh::Mesh mesh = tests::makeCapsule({.around = 1000, .along = 1000});
  std::vector<Vec3> stretched = mesh.positions();
  for (Vec3& p : stretched) p.z() += 0.5 * std::max(0.0, p.z());
  const std::vector<Vec3> bent = tests::bendMap(mesh.positions(), kPi / 2);
  for (const bool half : {true, false}) {
    const std::vector<Vec3>& posed = half ? stretched : bent;
    Progress silent;
    volume::LocalReport report;
    const bench::Times t = bench::measure(bench::quick() ? 1 : 3, [&] {
      report = volume::preserveLocally({.rest = mesh, .posed = posed}, {}, silent).report;
    });
    fmt::print("{} vertices {}: {:.2f} s wall, {:.2f} s CPU, {} iterations, {} free nodes, dV/V {:.1e}\n", mesh.vertexCount(), half ? "half stretched" : "bent",
               t.wall, t.cpu, report.iterations, report.freeNodes, report.deviation);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string edit = bench::option(argc, argv, "--edit", ""), only = bench::option(argc, argv, "--only", bench::quick() ? "auto/surface" : "");
  bench::printMachine(bench::quick() ? 1 : 3);
  for (int i = 1; i < argc; ++i)
    if (std::string(argv[i]) == "--million") return million(), 0;
  for (const EditCase& c : edits()) {
    if (!edit.empty() && c.name.find(edit) == std::string::npos) continue;
    const double before = *mesh::volume(c.mesh, c.mesh.positions()).value, after = *mesh::volume(c.mesh, c.posed).value;
    fmt::print("{}: {} vertices, dV/V {:+.3f} %{}\n", c.name, c.mesh.vertexCount(), 100 * (after / before - 1),
               c.weight.empty() ? "" : ", falloff");
    for (const Combination& combination : combinations())
      if (only.empty() || combination.name.find(only) != std::string::npos) row(c, combination);
  }
}
