// fielddeform info: what a mesh or lattice file holds.
#include <fielddeform/core/angle.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/extended_lattice_io.h>
#include <fielddeform/map/lattice_io.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/mesh/summary.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "command.h"

namespace fielddeform::cli {
namespace {

using mesh::Summary;

constexpr std::array<std::string_view, 3> kElements{"vertex", "corner", "face"};
constexpr std::array<std::string_view, 8> kTypes{"int8",   "uint8", "int16",   "uint16",
                                                 "int32", "uint32", "float32", "float64"};

std::string_view nameOf(mesh::Element element) { return kElements[static_cast<std::size_t>(element)]; }
std::string_view nameOf(mesh::ScalarType type) { return kTypes[static_cast<std::size_t>(type)]; }

struct Defect {
  const char* key;
  const char* words;
  std::size_t count;
};

std::vector<Defect> defectsOf(const Summary& s, const mesh::ReadReport& read) {
  const auto& d = s.defects;
  return {{"invalid_points", "vertices with coordinates that are not finite", d.invalidPoints},
          {"duplicate_points", "vertices at the place of another", d.duplicatePoints},
          {"isolated_vertices", "vertices that nothing uses", d.isolatedVertices},
          {"degenerate_faces", "faces without area", d.degenerateFaces},
          {"duplicate_faces", "faces listed twice", d.duplicateFaces},
          {"short_faces", "faces of one or two corners", read.shortFaces},
          {"non_manifold_edges", "edges of more than two faces", d.nonManifoldEdges},
          {"non_manifold_vertices", "vertices where surfaces touch in a point", d.nonManifoldVertices},
          {"inconsistent_edges", "edges whose faces are turned against each other", d.inconsistentEdges},
          {"sharp_edges", "edges folded onto themselves", s.sharpEdges},
          {"trailing_bytes", "bytes after the last element", read.trailingBytes}};
}

void writeVolume(JsonWriter& json, const mesh::MaybeVolume& volume) {
  json.key("volume");
  if (volume.value) json.value(*volume.value);
  else json.null();
  if (!volume.reason.empty()) json.member("volume_reason", volume.reason);
}

void writeComponents(JsonWriter& json, const Summary& s) {
  json.key("components").beginArray();
  for (const auto& c : s.components) {
    json.beginObject(JsonLayout::Inline).member("faces", c.faces).member("closed", c.edges.closed());
    json.member("area", c.area);
    writeVolume(json, c.volume);
    json.end();
  }
  json.end();
}

void writeAttributes(JsonWriter& json, const Summary& s) {
  json.key("attributes").beginArray();
  for (const auto& a : s.attributes) {
    json.beginObject(JsonLayout::Inline).member("name", a.name).member("on", nameOf(a.on));
    json.member("type", nameOf(a.type)).member("width", a.width).member("values", a.values);
    json.member("indexed", a.indexed).member("list", a.list).end();
  }
  json.end();
}

std::string jsonText(const std::string& file, const Summary& s, const mesh::ReadReport& read) {
  JsonWriter json;
  json.beginObject().member("file", file).member("format", mesh::toString(read.format));
  json.member("encoding", read.encoding).member("vertices", s.vertices).member("faces", s.faces);
  json.member("triangles", s.triangles).member("quads", s.quads).member("polygons", s.polygons);
  json.member("edges", s.edges).member("corners", s.corners).member("lines", s.lines);
  json.member("loose_points", s.loosePoints).member("position_type", nameOf(s.positionType));
  json.key("bounds");
  if (s.bounds.isEmpty()) json.null();
  else json.beginObject(JsonLayout::Inline).member("min", Vec3(s.bounds.min())).member("max", Vec3(s.bounds.max())).end();
  json.member("size", s.size).member("closed", s.closed).member("oriented", s.oriented).member("manifold", s.manifold);
  json.member("boundary_edges", s.boundaryEdges).member("boundary_loops", s.boundaryLoops);
  json.member("area", s.moments.area).member("centroid", s.moments.centroid);
  writeVolume(json, s.volume);
  json.member("median_edge", s.medianEdge).member("min_angle_deg", s.minAngle * 180 / kPi);
  writeComponents(json, s);
  writeAttributes(json, s);
  json.key("defects").beginObject();
  for (const Defect& d : defectsOf(s, read)) json.member(d.key, d.count);
  json.end().end();
  return json.text();
}

std::string facesText(const Summary& s) {
  std::string text = fmt::format("{}", s.faces);
  if (s.faces == 0) return text;
  if (s.triangles == s.faces) return text + " triangles";
  return text + fmt::format(" ({} triangles, {} quads, {} larger)", s.triangles, s.quads, s.polygons);
}

std::string plainText(const std::string& file, const Summary& s, const mesh::ReadReport& read) {
  std::string out = fmt::format("{}: {}, {}\n", file, mesh::toString(read.format), read.encoding);
  const auto row = [&](std::string_view name, const std::string& value) { out += fmt::format("  {:<12}{}\n", name, value); };
  row("vertices", fmt::format("{} ({})", s.vertices, nameOf(s.positionType)));
  row("faces", facesText(s));
  if (s.lines + s.loosePoints > 0) row("other", fmt::format("{} lines, {} points", s.lines, s.loosePoints));
  if (!s.bounds.isEmpty()) {
    const Vec3 low = s.bounds.min(), high = s.bounds.max();
    row("bounds", fmt::format("({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g}), diagonal {:.6g}", low.x(), low.y(),
                              low.z(), high.x(), high.y(), high.z(), s.size));
  }
  if (s.faces > 0) {
    row("surface", fmt::format("{}, {}, {}; {} component{}", s.closed ? "closed" : "open",
                               s.oriented ? "oriented" : "not oriented", s.manifold ? "manifold" : "not manifold",
                               s.components.size(), s.components.size() == 1 ? "" : "s"));
    if (s.boundaryEdges > 0)
      row("boundary", fmt::format("{} edges in {} loop{}", s.boundaryEdges, s.boundaryLoops, s.boundaryLoops == 1 ? "" : "s"));
    row("area", fmt::format("{:.6g}", s.moments.area));
    row("volume", s.volume.value ? fmt::format("{:.6g}", *s.volume.value) : fmt::format("none: {}", s.volume.reason));
    row("edge length", fmt::format("{:.6g} (median)", s.medianEdge));
  }
  for (const auto& a : s.attributes)
    row("attribute", fmt::format("{} on each {}: {} {}{}{}", a.name, nameOf(a.on), a.width, nameOf(a.type),
                                 a.indexed ? ", indexed" : "", a.list ? ", list" : ""));
  bool any = false;
  for (const Defect& d : defectsOf(s, read)) {
    if (d.count == 0) continue;
    row(any ? "" : "defects", fmt::format("{} {}", d.count, d.words));
    any = true;
  }
  if (!any) row("defects", "none");
  return out;
}

struct Moved {
  std::size_t nodes = 0;
  double farthest = 0;
};
Moved movedOf(Points displacements) {
  Moved out;
  for (const Vec3& d : displacements) {
    out.nodes += d != Vec3::Zero();
    out.farthest = std::max(out.farthest, d.norm());
  }
  return out;
}

std::string latticeText(const std::string& file, const map::Lattice& lattice, bool asJson) {
  const Moved moved = movedOf(lattice.displacements);
  const Box bounds = [&] {
    Box box;
    for (int corner = 0; corner < 8; ++corner) box.extend(lattice.box.origin + lattice.box.axes * Vec3(corner & 1, corner >> 1 & 1, corner >> 2));
    return box;
  }();
  if (asJson) {
    JsonWriter json;
    json.beginObject().member("file", file).member("format", "fielddeform-lattice").member("nodes", lattice.nodeCount());
    json.member("moved_nodes", moved.nodes).member("largest_move", moved.farthest).member("outside", toString(lattice.outside));
    json.key("bounds").beginObject(JsonLayout::Inline).member("min", Vec3(bounds.min())).member("max", Vec3(bounds.max())).end();
    json.key("box");
    map::latticeBoxToJson(lattice.box, json);
    json.key("axes").beginArray();
    for (const map::AxisBasis& axis : lattice.axis)
      json.beginObject(JsonLayout::Inline).member("basis", toString(axis.kind())).member("nodes", axis.nodes()).member("degree", axis.degree()).end();
    json.end().end();
    return json.text();
  }
  std::string out = fmt::format("{}: lattice\n", file);
  const auto row = [&](std::string_view name, const std::string& value) { out += fmt::format("  {:<12}{}\n", name, value); };
  const auto n = lattice.nodes();
  row("nodes", fmt::format("{} x {} x {} = {}", n[0], n[1], n[2], lattice.nodeCount()));
  row("moved", moved.nodes == 0 ? std::string("none") : fmt::format("{}, by {:.6g} at most", moved.nodes, moved.farthest));
  for (std::size_t a = 0; a < 3; ++a)
    row(fmt::format("axis {}", "uvw"[a]), fmt::format("{} of degree {}, edge ({:.6g}, {:.6g}, {:.6g})", toString(lattice.axis[a].kind()), lattice.axis[a].degree(),
                                                     lattice.box.axes(0, static_cast<Eigen::Index>(a)), lattice.box.axes(1, static_cast<Eigen::Index>(a)),
                                                     lattice.box.axes(2, static_cast<Eigen::Index>(a))));
  const Vec3 low = bounds.min(), high = bounds.max();
  row("bounds", fmt::format("({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g})", low.x(), low.y(), low.z(), high.x(), high.y(), high.z()));
  row("outside", lattice.outside == map::Outside::Keep ? "left alone" : "carried along");
  return out;
}

/// How far the displacements are from C1 at the joints of cells, world.
double kinkOf(const map::ExtendedLattice& l, std::span<const map::Joint> joints) {
  double kink = 0;
  if (l.displacements.empty()) return kink;
  for (const map::Joint& j : joints)
    kink = std::max(kink, ((l.displacements[j.out] - l.displacements[j.face]) - j.ratio * (l.displacements[j.face] - l.displacements[j.in])).norm());
  return kink;
}

std::string latticeText(const std::string& file, const map::ExtendedLattice& lattice, bool asJson) {
  const Moved moved = movedOf(lattice.displacements);
  const std::vector<map::Joint> joints = map::jointsOf(lattice);
  const double kink = kinkOf(lattice, joints);
  Box bounds;
  for (const Vec3& p : lattice.nodes) bounds.extend(p);
  if (asJson) {
    JsonWriter json;
    json.beginObject().member("file", file).member("format", "fielddeform-extended-lattice").member("nodes", lattice.nodes.size());
    json.member("cells", lattice.cells.size()).member("moved_nodes", moved.nodes).member("largest_move", moved.farthest);
    json.member("joints", joints.size()).member("largest_kink", kink);
    json.key("bounds").beginObject(JsonLayout::Inline).member("min", Vec3(bounds.min())).member("max", Vec3(bounds.max())).end();
    json.end();
    return json.text();
  }
  std::string out = fmt::format("{}: extended lattice\n", file);
  const auto row = [&](std::string_view name, const std::string& value) { out += fmt::format("  {:<12}{}\n", name, value); };
  row("cells", fmt::format("{}, tricubic", lattice.cells.size()));
  row("nodes", fmt::format("{}", lattice.nodes.size()));
  row("moved", moved.nodes == 0 ? std::string("none") : fmt::format("{}, by {:.6g} at most", moved.nodes, moved.farthest));
  row("joints", fmt::format("{}, {}", joints.size(), kink <= 1e-9 * moved.farthest ? std::string("C1") : fmt::format("kinks up to {:.6g}", kink)));
  const Vec3 low = bounds.min(), high = bounds.max();
  row("bounds", fmt::format("({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g})", low.x(), low.y(), low.z(), high.x(), high.y(), high.z()));
  row("outside", "left alone");
  return out;
}

/// JSON is no mesh format, and an OBJ file that a lattice was written to says so in its first comment.
bool isLattice(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string start(256, '\0');
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(stream.gcount()));
  const std::size_t first = start.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) return false;
  return start[first] == '{' || start.compare(first, 21, "# fielddeform lattice") == 0;
}

}  // namespace

void addInfo(CLI::App& app, Session& session) {
  struct Options {
    std::string file;
    bool json = false, weld = false;
  };
  const auto options = optionsOf<Options>();
  auto* command = app.add_subcommand("info", "Say what a mesh or lattice file holds: counts, bounds, volume, attributes, defects");
  command->add_option("FILE", options->file, "Mesh to read (PLY, OBJ, STL, OFF), or lattice (JSON, OBJ)")->required()->type_name("");
  command->add_flag("--json", options->json, "Print JSON, with every count");
  command->add_flag("--weld", options->weld, "STL: join the facets' equal corners first");
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform info scan.ply");
  command->callback([&session, options] {
    session.run = [options](Terminal& terminal) {
      if (isLattice(options->file)) {
        std::string text = std::visit([&](const auto& lattice) { return latticeText(options->file, lattice, options->json); },
                                      map::readAnyLattice(options->file));
        text.pop_back();
        terminal.print(text);
        return kDone;
      }
      mesh::ReadOptions read;
      read.invalid = mesh::InvalidPoints::Keep;
      if (options->weld) read.weld = mesh::Weld::Exact;
      mesh::ReadReport report;
      const mesh::Mesh mesh = mesh::readMesh(options->file, read, &report, &terminal);
      terminal.beginStage("measure");
      const Summary summary = mesh::summarize(mesh);
      std::string text = options->json ? jsonText(options->file, summary, report) : plainText(options->file, summary, report);
      text.pop_back();
      terminal.print(text);
      return kDone;
    };
  });
}

}  // namespace fielddeform::cli
