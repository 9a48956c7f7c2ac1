// fielddeform lattice: free-form deformation by one lattice made for the mesh, or by lattices from files.
#include <fielddeform/core/error.h>
#include <fielddeform/map/extended_lattice_io.h>
#include <fielddeform/map/lattice_io.h>
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "scene_options.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

struct LatticeOptions {
  BatchOptions batch;
  std::vector<std::string> files;
  std::string moved, save;
  bool fit = false;
  scene::LatticeRule rule;
  scene::Sculpt sculpt;
  std::vector<CLI::Option*> ofRule, ofFiles;  // the options that say nothing without --nodes, without --lattice
};

constexpr double kMostNodes = 65536;  // on one axis

int nodeNumber(const std::string& option, double x, double low, double high) {
  if (!(x >= low && x <= high && x == std::floor(x)))
    throw CLI::ConversionError(fmt::format("{}: {}, expected a whole number from {} to {}", option, x, low, high));
  return static_cast<int>(x);
}

void setNodes(scene::LatticeRule& rule, const std::string& text) {
  const auto n = parseNumbers("--nodes", text, 3);
  for (std::size_t a = 0; a < 3; ++a) rule.nodes[a] = nodeNumber("--nodes", n[a], 2, kMostNodes);
}

void setBox(scene::LatticeRule& rule, const std::string& text) {
  rule.box.reset();
  rule.oriented = text == "oriented";
  if (text == "auto" || text == "oriented") return;
  const auto n = parseNumbers("--box", text, 6);
  map::LatticeBox box;
  box.origin = Vec3(n[0], n[1], n[2]);
  box.axes = (Vec3(n[3], n[4], n[5]) - box.origin).asDiagonal();
  try {
    box.validate();
  } catch (const std::invalid_argument& problem) {
    throw CLI::ConversionError(fmt::format("--box: {}", problem.what()));
  }
  rule.box = box;
}

void save(const scene::LatticeStep& step, const std::filesystem::path& path) {
  if (const auto* lattice = std::get_if<map::Lattice>(&step.source)) return map::writeLattice(*lattice, path);
  if (path.extension() == ".obj") throw IoError(path, "an extended lattice is written as JSON, not as OBJ");
  map::writeExtendedLattice(std::get<map::ExtendedLattice>(step.source), path);
}

// "I,J,K=DX,DY,DZ", several times.
void addMoves(scene::LatticeRule& rule, const std::vector<std::string>& texts) {
  for (const std::string& text : texts) {
    const std::size_t sign = text.find('=');
    if (sign == std::string::npos) throw CLI::ConversionError(fmt::format("--move: \"{}\", expected I,J,K=DX,DY,DZ", text));
    const auto node = parseNumbers("--move", text.substr(0, sign), 3), by = parseNumbers("--move", text.substr(sign + 1), 3);
    scene::LatticeRule::Move move;
    for (std::size_t a = 0; a < 3; ++a) move.node[a] = nodeNumber("--move", node[a], 0, kMostNodes);
    move.by = Vec3(by[0], by[1], by[2]);
    rule.moves.push_back(move);
  }
}

void addFiles(CLI::App& command, LatticeOptions& o) {
  const char* group = "Lattice from files";
  command.add_option("--lattice", o.files, "Lattice (JSON or OBJ), extended lattices too (JSON); several are applied one after the other")
      ->type_name("FILE")->allow_extra_args(false)->group(group);
  o.ofFiles = {command.add_flag("--fit", o.fit, "Carry the lattice over to the box of each mesh, with its displacements")->group(group),
               command.add_option("--moved", o.moved, "The nodes of the one --lattice as a modeller wrote them")
                   ->type_name("OBJ")->group(group)};
}

CLI::Option* addRule(CLI::App& command, LatticeOptions& o) {
  const char* group = "Lattice by number";
  scene::LatticeRule& rule = o.rule;
  auto* nodes = command.add_option_function<std::string>(
      "--nodes", [&rule](const std::string& text) { setNodes(rule, text); }, "Nodes on each axis, at least 2");
  nodes->type_name("NX,NY,NZ")->group(group);
  const auto own = [&](CLI::Option* option) { o.ofRule.push_back(option->group(group)); };
  own(command.add_option_function<std::vector<std::string>>(
                 "--move", [&rule](const std::vector<std::string>& texts) { addMoves(rule, texts); },
                 "Move a node, counted from 0 along the box's edges; may be repeated")
          ->type_name("I,J,K=DX,DY,DZ")->allow_extra_args(false));
  own(addWord(command, "--basis", {"bernstein", "bspline"},
              [&rule](std::size_t i) { rule.basis = static_cast<map::BasisKind>(i); },
              "One polynomial over all nodes, or pieces with local reach (default: bernstein)"));
  own(command.add_option("--degree", rule.degree, "Degree of a bspline (default: 3)")->type_name("N")->check(within(1, 3)));
  own(addWord(command, "--border", {"coincident", "free"}, [&rule](std::size_t i) { rule.border = static_cast<map::Border>(i); },
              "Outer nodes of a bspline: on the box, or outside it (default: coincident)"));
  own(command.add_option_function<std::string>("--box", [&rule](const std::string& text) { setBox(rule, text); },
                                               "Where the lattice lies (default: auto, the mesh's box)")
          ->type_name("auto|oriented|X0,Y0,Z0,X1,Y1,Z1"));
  own(command.add_option("--padding", rule.padding, "Room around a fitted box, share of its longest edge (default: 0)")
          ->type_name("SHARE")->check(within(0, 1e6)));
  own(addWord(command, "--outside", {"extend", "keep"}, [&rule](std::size_t i) { rule.outside = static_cast<map::Outside>(i); },
              "Points outside the box: carried smoothly, or left alone (default: extend)"));
  return nodes;
}

// "X,Y,Z,..." of a tool.
std::vector<double> toolNumbers(const std::string& option, const std::string& text, std::size_t count, std::size_t radiusAt) {
  auto n = parseNumbers(option, text, count);
  if (!(n[radiusAt] > 0)) throw CLI::ConversionError(fmt::format("{}: the radius {}, expected one > 0", option, n[radiusAt]));
  return n;
}

void requireDirection(const std::string& option, const Vec3& v) {
  if (!(v.stableNorm() > 0)) throw CLI::ConversionError(fmt::format("{}: expected a direction that is not all 0", option));
}

map::MoveSpec magnetOf(const std::string& text) {
  const auto n = toolNumbers("--magnet", text, 7, 3);
  return map::Magnet{.centre = Vec3(n[0], n[1], n[2]), .radius = n[3], .by = Vec3(n[4], n[5], n[6])};
}

map::MoveSpec cupOf(const std::string& text) {
  const auto n = toolNumbers("--suction", text, 10, 6);
  const Vec3 axis(n[3], n[4], n[5]);
  requireDirection("--suction", axis);
  return map::SuctionCup{.centre = Vec3(n[0], n[1], n[2]), .axis = axis, .radius = n[6], .by = Vec3(n[7], n[8], n[9])};
}

// "plane=X,Y,Z,NX,NY,NZ" or a mesh file.
map::MoveSpec pressOf(const std::string& text) {
  constexpr std::string_view kPlane = "plane=";
  if (!text.starts_with(kPlane)) return map::PressFile{text};
  const auto n = parseNumbers("--press", text.substr(kPlane.size()), 6);
  const Vec3 normal(n[3], n[4], n[5]);
  requireDirection("--press", normal);
  return map::PressPlane{Vec3(n[0], n[1], n[2]), normal};
}

void addTools(CLI::App& command, LatticeOptions& o) {
  const char* group = "Moving points";
  scene::Sculpt& s = o.sculpt;
  // One option after the other in the order of the command line is not kept by the parser: targets, magnets, cups, presses.
  const auto add = [&](const char* name, const char* type, const char* help, map::MoveSpec (*make)(const std::string&)) {
    command.add_option_function<std::vector<std::string>>(
               name, [&s, make](const std::vector<std::string>& texts) { for (const auto& t : texts) s.moves.push_back(make(t)); }, help)
        ->type_name(type)->allow_extra_args(false)->group(group);
  };
  add("--targets", "CSV", "Points and where they go, a row each: x,y,z,tx,ty,tz or vertex,tx,ty,tz, and a weight if wanted; may be repeated",
      [](const std::string& t) -> map::MoveSpec { return map::TargetsFile{t}; });
  add("--magnet", "X,Y,Z,R,DX,DY,DZ", "Pull what lies within R of a point, most at its middle; may be repeated", magnetOf);
  add("--suction", "X,Y,Z,NX,NY,NZ,R,DX,DY,DZ", "Move a disc of radius R as one piece; may be repeated", cupOf);
  add("--press", "plane=X,Y,Z,NX,NY,NZ|MESH", "Push the object out of a half space or a closed mesh; may be repeated", pressOf);
  command.add_option("--pins", s.pins, "Points that may not move, a row each: x,y,z or a vertex")->type_name("CSV")->group(group);
  command.add_option("--refine", s.maxNodes, "Add nodes where points miss their targets, up to N in all (default: 0, none)")
      ->type_name("N")->check(within(0, 16777216))->group(group);
  command.add_option("--target-tolerance", s.tolerance, "What a target may miss, share of the lattice's size (default: 1e-9)")
      ->type_name("SHARE")->check(within(1e-15, 1))->group(group);
}

void finish(LatticeOptions& o, bool byRule) {
  scene::Scene& scene = o.batch.scene;
  for (const CLI::Option* option : byRule ? o.ofFiles : o.ofRule)
    if (option->count() > 0)
      throw CLI::ValidationError(fmt::format("{}: expected only with {}", option->get_name(), byRule ? "--lattice" : "--nodes"));
  if (byRule == !o.files.empty()) throw CLI::ValidationError("expected either --nodes or --lattice");
  if (!o.moved.empty() && o.files.size() != 1) throw CLI::ValidationError("--moved: expected one --lattice");
  if (!o.save.empty() && o.batch.meshes.size() != 1) throw CLI::ValidationError("--save-lattice: expected one mesh");
  if (!o.save.empty() && o.files.size() > 1) throw CLI::ValidationError("--save-lattice: expected one lattice");
  if (byRule) scene.lattices.push_back({o.rule, false, {}});
  for (const std::string& file : o.files) scene.lattices.push_back({std::filesystem::path(file), o.fit, {}});
  if (o.sculpt.moves.empty() && (!o.sculpt.pins.empty() || o.sculpt.maxNodes > 0))
    throw CLI::ValidationError("--pins, --refine: expected only with --targets, --magnet, --suction or --press");
  scene.lattices.back().sculpt = o.sculpt;
  if (!o.save.empty())
    o.batch.done = [&o](const scene::RunResult& result) {
      save(result.resolved.lattices.at(0), o.save);
    };
}

int runLattice(LatticeOptions& o, Terminal& terminal) {
  if (!o.moved.empty() && std::holds_alternative<map::ExtendedLattice>(map::readAnyLattice(o.files[0])))
    throw IoError(o.files[0], "is an extended lattice: --moved expects one of rows of nodes");
  if (!o.moved.empty()) o.batch.scene.lattices[0].source = map::readMovedNodes(map::readLattice(o.files[0]), o.moved);
  return runBatch(o.batch, terminal);
}

}  // namespace

void addLattice(CLI::App& app, Session& session) {
  const auto options = optionsOf<LatticeOptions>();
  auto* command = app.add_subcommand("lattice", "Deform meshes by a lattice of nodes around them");
  CLI::Option* nodes = addRule(*command, *options);
  addFiles(*command, *options);
  addTools(*command, *options);
  command->add_option("--save-lattice", options->save, "Write the lattice, to be moved in a modeller (.obj) or used again")
      ->type_name("FILE")->group("Output");
  addBatchOptions(*command, session, options->batch, true, Method::Lattice);
  command->footer("Example:\n  fielddeform lattice scan.ply --nodes 3,3,3 --move 1,1,2=0,0,0.5 -o bulged.ply");
  command->callback([&session, options, nodes] {
    finish(*options, nodes->count() > 0);
    session.run = [options](Terminal& terminal) { return runLattice(*options, terminal); };
  });
}

}  // namespace fielddeform::cli
