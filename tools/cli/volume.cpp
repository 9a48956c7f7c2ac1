// fielddeform volume: a mesh is given a volume by a lattice around it.
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/lattice_io.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/topology.h>
#include <fielddeform/volume/curved_volume.h>
#include <fielddeform/volume/moments.h>
#include <fielddeform/volume/preserve.h>
#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

#include "command.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

using volume::Solver;

struct VolumeOptions {
  std::string mesh, output, target = "1x", nodesText = "4,4,4", lattice, saveLattice, report;
  std::array<int, 3> nodes{};
  map::BasisKind basis = map::BasisKind::Bernstein;
  volume::Springs springs = volume::Springs::All;
  volume::Options solve;
  std::vector<std::string> pins, pinnedText, levels;
  std::vector<std::array<int, 3>> pinnedNodes;
  bool smooth = false, components = false, keepCentre = false, keepInertia = false;
  double padding = 0.02;
  mesh::WriteOptions write;
};

const std::vector<std::string> kSides{"x-", "x+", "y-", "y+", "z-", "z+"};

std::array<int, 3> counts(const std::string& option, const std::string& text, double low, double high) {
  const auto numbers = parseNumbers(option, text, 3);
  std::array<int, 3> out{};
  for (std::size_t a = 0; a < 3; ++a) {
    if (!(numbers[a] >= low && numbers[a] <= high) || numbers[a] != std::floor(numbers[a]))
      throw CLI::ValidationError(option, fmt::format("{} is no whole number from {} to {}", numbers[a], low, high));
    out[a] = static_cast<int>(numbers[a]);
  }
  return out;
}

map::Lattice latticeOf(const VolumeOptions& o, const mesh::Mesh& mesh) {
  if (!o.lattice.empty()) return map::readLattice(o.lattice);
  map::Lattice lattice;
  lattice.box = map::fitBox(mesh.positions(), o.padding);
  for (std::size_t a = 0; a < 3; ++a)
    lattice.axis[a] = o.basis == map::BasisKind::Bernstein ? map::AxisBasis::bernstein(o.nodes[a]) : map::AxisBasis::bspline(o.nodes[a], 3, map::Border::Free);
  return lattice;
}

/// Sides of the lattice, the nodes that a lattice file has moved ("moved"), and single nodes.
std::vector<Index> pinnedOf(const VolumeOptions& o, const map::Lattice& lattice) {
  const auto n = lattice.nodes();
  std::vector<bool> pinned(lattice.nodeCount(), false);
  for (const std::string& pin : o.pins) {
    if (pin == "moved") {
      for (std::size_t i = 0; i < lattice.displacements.size(); ++i)
        if (lattice.displacements[i] != Vec3::Zero()) pinned[i] = true;
      continue;
    }
    const auto axis = static_cast<std::size_t>(pin[0] - 'x');
    const int layer = pin[1] == '-' ? 0 : n[axis] - 1;
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j)
        for (int i = 0; i < n[0]; ++i)
          if (std::array{i, j, k}[axis] == layer) pinned[lattice.index(i, j, k)] = true;
  }
  for (const auto& at : o.pinnedNodes) {
    for (std::size_t a = 0; a < 3; ++a)
      if (at[a] >= n[a])
        throw std::invalid_argument(fmt::format("--pin-node {},{},{}: the lattice has {} by {} by {} nodes, counted from 0", at[0], at[1], at[2], n[0], n[1], n[2]));
    pinned[lattice.index(at[0], at[1], at[2])] = true;
  }
  std::vector<Index> out;
  for (std::size_t i = 0; i < pinned.size(); ++i)
    if (pinned[i]) out.push_back(static_cast<Index>(i));
  return out;
}

std::optional<double> wholeNumber(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

/// "1.2x" and "120%" are factors, a number is a volume, all else a mesh file.
std::vector<double> targetsOf(const VolumeOptions& o, const std::vector<double>& base, Terminal& terminal) {
  const auto scaled = [&](double factor) {
    std::vector<double> out(base);
    for (double& v : out) v *= factor;
    return out;
  };
  const std::string_view text = o.target;
  double total = 0;
  for (const double v : base) total += v;
  if (text.ends_with("x"))
    if (const auto factor = wholeNumber(text.substr(0, text.size() - 1))) return scaled(*factor);
  if (text.ends_with("%"))
    if (const auto percent = wholeNumber(text.substr(0, text.size() - 1))) return scaled(*percent / 100);
  if (const auto value = wholeNumber(text)) return base.size() == 1 ? std::vector{*value} : scaled(*value / total);
  const mesh::Mesh other = mesh::readMesh(o.target, {}, nullptr, &terminal);
  const auto wanted = mesh::volume(other, other.positions());
  if (!wanted.value) throw InfeasibleError(fmt::format("{} has no volume: {}", o.target, wanted.reason));
  return base.size() == 1 ? std::vector{*wanted.value} : scaled(*wanted.value / total);
}

/// Every component with edges is a region; else all faces are one.
std::vector<Index> regionsOf(const VolumeOptions& o, const mesh::Mesh& mesh) {
  if (!o.components) return {};
  return mesh::components(mesh::EdgeTable(mesh), mesh.faceCount()).ofFace;
}

volume::Problem problemOf(const VolumeOptions& o, const mesh::Mesh& mesh, const map::Lattice& lattice, Terminal& terminal) {
  volume::Problem p;
  p.map = std::make_shared<map::LatticeMap>(lattice);
  const std::vector<Index> region = regionsOf(o, mesh);
  p.surface = volume::makeSurface(*p.map, mesh, region);
  p.energy = std::make_shared<volume::SpringNetwork>(lattice, o.springs);
  p.start = lattice.displacements;
  p.constraints.pinned = pinnedOf(o, lattice);
  const volume::SurfaceVolume surface(p.surface.base, p.surface.triangles, p.surface.region);
  p.constraints.volume = targetsOf(o, surface.values(p.surface.base), terminal);
  if (o.keepCentre || o.keepInertia)
    for (std::size_t r = 0; r < surface.regionCount(); ++r) {
      const auto moments = volume::solidMoments(surface, p.surface.base, r);
      volume::MomentTarget target{.region = r};
      if (o.keepCentre) target.centre = moments.centre;
      // A solid of another volume keeps its inertia per mass in proportion to its size.
      if (o.keepInertia) target.spread = moments.spread * std::cbrt(std::pow(p.constraints.volume[r] / moments.volume, 2));
      p.constraints.moments.push_back(target);
    }
  for (const std::string& level : o.levels) p.coarser.push_back(volume::makeSurface(*p.map, mesh::readMesh(level, {}, nullptr, &terminal)));
  if (o.solve.solver == Solver::AugmentedLagrangian && o.levels.empty()) p.coarser = volume::makeLevels(*p.map, mesh, {}, region);
  return p;
}

/// Of the image of the whole solid inside the mesh, before and after; the mesh's own differs by its triangulation.
struct SmoothVolume {
  double before = 0, after = 0;
};
std::optional<SmoothVolume> smoothVolume(const VolumeOptions& o, const map::Lattice& lattice, const mesh::Mesh& mesh, Points displacements) {
  if (!o.smooth) return {};
  for (const map::AxisBasis& axis : lattice.axis)
    if (axis.kind() != map::BasisKind::Bernstein) throw std::invalid_argument("--smooth-volume: the lattice is no polynomial one (--basis bernstein)");
  const volume::CubicForm form = volume::curvedForm(lattice, mesh.positions(), mesh.triangles());
  std::vector<Vec3> nodes = lattice.restNodes();
  SmoothVolume out{form.value(nodes), 0};
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i] += displacements[i];
  out.after = form.value(nodes);
  return out;
}

std::string reportText(const VolumeOptions& o, const volume::Report& r, const mesh::MaybeVolume& written, const std::optional<SmoothVolume>& smooth) {
  JsonWriter json;
  json.beginObject().member("mesh", o.mesh).member("solver", toString(o.solve.solver)).member("outcome", toString(r.outcome));
  if (!r.message.empty()) json.member("message", r.message);
  json.key("volumes").beginArray();
  for (const auto& v : r.volumes) {
    json.beginObject(JsonLayout::Inline).member("before", v.base).member("start", v.start).member("target", v.target);
    json.member("after", v.after).member("deviation", v.deviation()).end();
  }
  json.end().key("as_written");
  if (written.value) json.value(*written.value);
  else json.null();
  if (smooth) json.key("smooth_volume").beginObject(JsonLayout::Inline).member("before", smooth->before).member("after", smooth->after).end();
  json.member("energy_before", r.energyBefore).member("energy", r.energy).member("iterations", r.iterations);
  json.member("mesh_evaluations", r.meshEvaluations).member("saddles_left", r.saddles).member("last_projection", r.projection);
  json.member("moment_residual", r.momentResidual);
  json.key("starts").beginArray();
  for (const auto& s : r.starts)
    json.beginObject(JsonLayout::Inline).member("energy", s.energy).member("iterations", s.iterations).member("outcome", toString(s.outcome)).end();
  json.end().key("levels").beginArray();
  for (const auto& l : r.levels) {
    json.beginObject(JsonLayout::Inline).member("triangles", l.triangles).member("change", l.change).member("steps", l.steps);
    json.member("evaluations", l.evaluations).member("energy", l.energy).member("deviation", l.deviation);
    json.member("multiplier", l.multiplier).member("penalty", l.penalty).end();
  }
  json.end();
  json.key("error_estimate");
  if (std::isfinite(r.errorEstimate)) json.value(r.errorEstimate);
  else json.null();
  json.end();
  return json.text();
}

int run(const VolumeOptions& o, Terminal& terminal) {
  mesh::Mesh mesh = mesh::readMesh(o.mesh, {}, nullptr, &terminal);
  map::Lattice lattice = latticeOf(o, mesh);
  const volume::Problem problem = problemOf(o, mesh, lattice, terminal);
  terminal.beginStage("volume");
  const volume::Result result = volume::preserve(problem, o.solve, terminal);
  if (result.report.outcome == volume::Outcome::Unmet) throw InfeasibleError(result.report.message);
  const auto smooth = smoothVolume(o, lattice, mesh, result.displacements);
  mesh.setPositions(result.positions);
  const mesh::EdgeCounts edges = mesh::countEdges(mesh::EdgeTable(mesh));
  const mesh::MaybeVolume written = o.write.precision == mesh::Precision::Double ? mesh::volume(mesh, mesh.positions(), edges)
                                                                                : mesh::volumeAsWritten(mesh, mesh.positions(), edges);
  mesh::writeMesh(mesh, o.output, o.write, &terminal);
  if (!o.saveLattice.empty()) {
    lattice.displacements = result.displacements;
    map::writeLattice(lattice, o.saveLattice);
  }
  if (!o.report.empty()) writeTextFile(o.report, reportText(o, result.report, written, smooth));
  if (!result.report.message.empty()) terminal.note("fielddeform: " + result.report.message);
  for (std::size_t i = 0; i < result.report.volumes.size(); ++i) {
    const auto& v = result.report.volumes[i];
    const std::string name = result.report.volumes.size() > 1 ? fmt::format("{}, component {}", o.output, i) : o.output;
    terminal.print(fmt::format("{}: volume {:.9g} (before {:.9g}, target {:.9g}, off by {:.1e})", name, v.after, v.base, v.target, std::abs(v.deviation())));
  }
  if (smooth) terminal.print(fmt::format("{}: volume of the smooth solid {:.9g} (before {:.9g})", o.output, smooth->after, smooth->before));
  if (written.value) terminal.print(fmt::format("{}: volume as written {}", o.output, shortestNumber(*written.value)));
  terminal.print(fmt::format("{}: energy {:.6g}, {} iterations, {}", o.output, result.report.energy, result.report.iterations, toString(result.report.outcome)));
  return kDone;
}

}  // namespace

void addVolume(CLI::App& app, Session& session) {
  const auto o = optionsOf<VolumeOptions>();
  auto* command = app.add_subcommand("volume", "Give a mesh a volume: by a lattice, with the least deformation");
  command->add_option("MESH", o->mesh, "Closed mesh (PLY, OBJ, STL, OFF)")->required()->type_name("");
  command->add_option("-o,--output", o->output, "Mesh to write")->required()->type_name("FILE");
  command->add_option("--target", o->target, "Volume wanted: a factor (1.2x, 120%), a number, or a mesh that has it (default: 1x, its own)")
      ->type_name("MESH|VALUE|FACTOR");
  command->add_option("--nodes", o->nodesText, "Lattice nodes per axis (default: 4,4,4)")->type_name("NX,NY,NZ");
  addWord(*command, "--basis", {"bernstein", "bspline"}, [o](std::size_t i) { o->basis = i ? map::BasisKind::BSpline : map::BasisKind::Bernstein; },
          "One polynomial (default), or cubic pieces of local support");
  addNumber(*command, "--padding", o->padding, "Room around the mesh, share of its longest side (default: 0.02)")->check(within(0, 10));
  command->add_option("--lattice", o->lattice, "A lattice file instead, possibly deformed: where to start from")->type_name("FILE");
  command->add_option("--save-lattice", o->saveLattice, "Write the lattice as it ends")->type_name("FILE");
  std::vector<std::string> words = kSides;
  words.push_back("moved");
  command->add_option("--pin", o->pins, "Nodes that stay: a side of the lattice, or all that the lattice file moved; may be repeated")
      ->type_name("x-|x+|y-|y+|z-|z+|moved")->check(oneOf(words))->take_all();
  command->add_option("--pin-node", o->pinnedText, "One node that stays, counted from 0; may be repeated")->type_name("I,J,K")->take_all();
  addWord(*command, "--solver", {"exact", "augmented-lagrangian", "projection"}, [o](std::size_t i) { o->solve.solver = static_cast<Solver>(i); },
          "The exact form (default), the paper's multi-level method, or the shortest move of the nodes without an energy");
  addWord(*command, "--minimiser", {"conjugate-gradients", "l-bfgs"}, [o](std::size_t i) { o->solve.augmentedLagrangian.minimiser = static_cast<volume::Minimiser>(i); },
          "augmented-lagrangian: inner minimiser (default: conjugate-gradients)");
  addWord(*command, "--springs", {"26", "14", "6+8"}, [o](std::size_t i) { o->springs = std::array{volume::Springs::All, volume::Springs::Kuhn, volume::Springs::AxesAndDiagonals}[i]; },
          "Neighbours of a node that springs lead to (default: 26)");
  command->add_option("--level", o->levels, "A coarser tessellation of the same surface, coarsest first, may be repeated (default: by decimation)")
      ->type_name("FILE")->take_all();
  command->add_flag("--smooth-volume", o->smooth, "Also say the volume of the smoothly deformed solid, not of its triangles");
  command->add_flag("--components", o->components, "Every connected component keeps (or scales) its own volume");
  command->add_flag("--keep-centre", o->keepCentre, "The centre of mass stays, too");
  command->add_flag("--keep-inertia", o->keepInertia, "So does the inertia tensor, in proportion to the size");
  command->add_option("--starts", o->solve.exact.starts, "exact: also from N - 1 jittered starts; the least energy wins (default: 1)")->type_name("N")->check(within(1, 10000));
  command->add_option("--seed", o->solve.exact.seed, "Another choice of jittered starts (default: 0)")->type_name("N");
  command->add_option_function<int>("--max-saddles", [o](const int& n) { o->solve.exact.maxSaddles = o->solve.augmentedLagrangian.maxSaddles = n; },
                                    "Saddles that are left along a direction of descent; 0: as the paper (default: 5)")->type_name("N")->check(within(0, 10000));
  command->add_option("--load-steps", o->solve.exact.loadSteps, "exact: move the pinned nodes, and change the volume, in N parts (default: 1)")->type_name("N")->check(within(1, 10000));
  addWord(*command, "--precision", {"keep", "double"}, [o](std::size_t i) { o->write.precision = static_cast<mesh::Precision>(i); },
          "Type of coordinates in the output: the input's (default), or double");
  command->add_option("--report", o->report, "Write a report (JSON)")->type_name("FILE");
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform volume scan.ply --target 1.2x --nodes 3,3,3 -o swollen.ply");
  command->callback([&session, o] {
    if (o->components && !o->levels.empty()) throw CLI::ValidationError("--level", "cannot be told apart into --components");
    o->nodes = counts("--nodes", o->nodesText, 2, 128);
    for (const std::string& text : o->pinnedText) o->pinnedNodes.push_back(counts("--pin-node", text, 0, 127));
    session.run = [o](Terminal& terminal) { return run(*o, terminal); };
  });
}

}  // namespace fielddeform::cli
