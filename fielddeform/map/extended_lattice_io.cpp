#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/detail/json_fields.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/extended_lattice_io.h>
#include <fielddeform/map/lattice_io.h>
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using fielddeform::detail::checked;
using fielddeform::detail::given;

constexpr std::string_view kFormatName = "fielddeform-extended-lattice";
constexpr std::size_t kMostMade = 4096;  // cells that a file asks for without listing them: bounds memory
constexpr double kKink = 1e-9;           // of the size: what pinned moves may leave of a joint

// A part of a lattice as it stands in a file, and how its nodes are counted: along three axes if it was made by a rule.
struct Part {
  std::string name;
  ExtendedLattice lattice;
  std::optional<std::array<int, 3>> grid;  // nodes along each axis
};

std::array<int, 3> cellNumbers(const JsonValue& cells, std::size_t& made) {
  std::array<int, 3> n{};
  std::size_t k = 0, product = 1;
  for (const JsonValue number : cells.array(3)) {
    n[k] = static_cast<int>(number.integer(1, 64));
    product *= static_cast<std::size_t>(n[k++]);
  }
  made += product;
  if (made > kMostMade) cells.fail(fmt::format("{} cells in all", made), fmt::format("at most {}, or \"nodes\" that are listed", kMostMade));
  return n;
}

void readBox(const JsonValue& box, const JsonValue& cells, std::size_t& made, Part& part) {
  const LatticeBox edges = latticeBoxFromJson(box);
  const std::array<int, 3> n = cellNumbers(cells, made);
  part.lattice = checked(cells, "cells of a box", [&] { return boxLattice(edges, n); });
  part.grid = {3 * n[0] + 1, 3 * n[1] + 1, 3 * n[2] + 1};
}

void readCylinder(const JsonValue& object, const JsonValue& cells, std::size_t& made, Part& part) {
  object.allowKeys({"origin", "axis", "inner", "outer"});
  CylinderLattice tube;
  tube.origin = object.require("origin").vec3();
  tube.axis = object.require("axis").vec3();
  tube.inner = object.require("inner").positive();
  tube.outer = object.require("outer").positive();
  tube.cells = cellNumbers(cells, made);
  if (tube.cells[1] < 3) cells.fail(fmt::format("{} cells around", tube.cells[1]), "at least 3: outwards, around, along");
  part.lattice = checked(object, "0 < inner < outer and an axis with a length", [&] { return cylinderLattice(tube); });
  part.grid = {3 * tube.cells[0] + 1, 3 * tube.cells[1], 3 * tube.cells[2] + 1};
}

void readListed(const JsonValue& nodes, const JsonValue& cells, Part& part) {
  for (const JsonValue p : nodes.array()) part.lattice.nodes.push_back(p.vec3());
  const std::size_t n = part.lattice.nodes.size();
  if (n == 0) nodes.fail("no nodes", "at least one");
  for (const JsonValue cell : cells.array()) {
    std::array<Index, 64> list{};
    std::size_t k = 0;
    for (const JsonValue number : cell.array(64)) list[k++] = static_cast<Index>(number.integer(0, n - 1));
    part.lattice.cells.push_back(list);
  }
  if (part.lattice.cells.empty()) cells.fail("no cells", "at least one");
}

// Nodes that a move names: a number, or three of a part by a rule, null for all along that axis.
std::vector<Index> namedNodes(const JsonValue& node, const Part& part) {
  if (!part.grid || node.kind() != JsonKind::Array)
    return {static_cast<Index>(node.integer(0, part.lattice.nodes.size() - 1))};
  const std::array<int, 3>& n = *part.grid;
  std::array<int, 3> first{}, last{};
  std::size_t k = 0;
  for (const JsonValue number : node.array(3)) {
    first[k] = number.isNull() ? 0 : static_cast<int>(number.integer(0, static_cast<std::uint64_t>(n[k] - 1)));
    last[k] = number.isNull() ? n[k] - 1 : first[k];
    ++k;
  }
  std::vector<Index> out;
  for (int c = first[2]; c <= last[2]; ++c)
    for (int b = first[1]; b <= last[1]; ++b)
      for (int a = first[0]; a <= last[0]; ++a) out.push_back(static_cast<Index>(a + n[0] * (b + n[1] * c)));
  return out;
}

void addTo(std::vector<Vec3>& values, Index at, const Vec3& by, const JsonValue& move) {
  values[at] += by;
  if (!values[at].allFinite()) move.fail("moves of one node that add up beyond double", "finite sums");
}

Part readPart(const JsonValue& object, std::size_t& made) {
  Part part;
  const auto nodes = given(object, "nodes"), box = given(object, "box"), cylinder = given(object, "cylinder"), shape = given(object, "shape");
  const int kinds = (nodes ? 1 : 0) + (box ? 1 : 0) + (cylinder ? 1 : 0);
  if (kinds != 1) object.fail(kinds == 0 ? "none of \"nodes\", \"box\" and \"cylinder\"" : "two shapes in one", "one of \"nodes\", \"box\" and \"cylinder\"");
  const JsonValue cells = object.require("cells");
  if (nodes) readListed(*nodes, cells, part);
  else if (box) readBox(*box, cells, made, part);
  else readCylinder(*cylinder, cells, made, part);
  if (shape)
    for (const JsonValue move : shape->array()) {
      move.allowKeys({"node", "by"});
      const Vec3 by = move.require("by").vec3();
      for (const Index n : namedNodes(move.require("node"), part)) addTo(part.lattice.nodes, n, by, move);
    }
  return part;
}

std::vector<Part> readParts(const JsonValue& list) {
  std::vector<Part> parts;
  std::size_t made = 0;
  for (const JsonValue object : list.array()) {
    object.allowKeys({"name", "nodes", "cells", "box", "cylinder", "shape"});
    parts.push_back(readPart(object, made));
    const auto name = given(object, "name");
    if (!name) continue;
    parts.back().name = name->string();
    for (std::size_t p = 0; p + 1 < parts.size(); ++p)
      if (parts[p].name == parts.back().name) name->fail("a name given twice", "another");
  }
  if (parts.empty()) list.fail("no parts", "at least one");
  return parts;
}

std::size_t partOf(const JsonValue& move, const std::vector<Part>& parts) {
  const auto name = given(move, "part");
  if (!name) {
    if (parts.size() > 1) move.fail("no \"part\"", fmt::format("the name of one of {} parts, or its number", parts.size()));
    return 0;
  }
  if (name->kind() == JsonKind::Number) return static_cast<std::size_t>(name->integer(0, parts.size() - 1));
  std::vector<std::string_view> words;
  std::vector<std::size_t> at;
  for (std::size_t p = 0; p < parts.size(); ++p)
    if (!parts[p].name.empty()) words.push_back(parts[p].name), at.push_back(p);
  if (words.empty()) name->fail("", "a number: the parts have no names");
  return at[name->word(words)];
}

// Displacements by moves; returns the nodes that they name.
std::vector<Index> readMoves(const JsonValue& list, const std::vector<Part>& parts, const std::vector<std::vector<Index>>& nodeOf, ExtendedLattice& l) {
  l.displacements.assign(l.nodes.size(), Vec3::Zero());
  std::vector<Index> named;
  for (const JsonValue move : list.array()) {
    move.allowKeys({"part", "node", "by"});
    const std::size_t p = partOf(move, parts);
    const Vec3 by = move.require("by").vec3();
    std::vector<Index> at;
    for (const Index n : namedNodes(move.require("node"), parts[p])) at.push_back(nodeOf[p][n]);
    std::sort(at.begin(), at.end());
    at.erase(std::unique(at.begin(), at.end()), at.end());  // nodes of one part that are one
    for (const Index n : at) addTo(l.displacements, n, by, move);
    named.insert(named.end(), at.begin(), at.end());
  }
  return named;
}

void join(const JsonValue& joined, std::vector<Index> pinned, ExtendedLattice& l) {
  const std::size_t how = joined.word({"c1", "c1-nearest", "as-given"});
  if (how == 2) return;
  if (how == 1) pinned.clear();
  double kink = 0;
  l.displacements = joinSmoothly(l, pinned, &kink);
  double size = 0;
  for (const Vec3& d : l.displacements) size = std::max(size, d.norm());
  if (kink > kKink * size)
    joined.fail(fmt::format("moves that leave a kink of {:.3g} at a joint", kink), "moves that leave one node of every joint free, \"c1-nearest\" or \"as-given\"");
}

ExtendedLattice parseJson(std::string text, const std::filesystem::path& path) {
  const JsonDocument document = JsonDocument::parse(std::move(text), path);
  document.requireFormat(kFormatName, 1);
  if (const auto sculpt = document.root().find("sculpt")) sculpt->fail("", "no \"sculpt\": extended lattices do not follow points");
  return extendedLatticeFromJson(document.root());
}

}  // namespace

bool isExtendedLattice(const JsonValue& object) { return object.find("cells") || object.find("parts"); }

ExtendedLattice extendedLatticeFromJson(const JsonValue& object) {
  object.allowKeys({"format", "version", "parts", "nodes", "cells", "box", "cylinder", "shape", "joined", "displacements", "moves", "sculpt"});
  const auto list = given(object, "parts");
  std::vector<Part> parts;
  if (list) {
    for (const std::string_view key : {"nodes", "cells", "box", "cylinder", "shape"})
      if (const auto beside = given(object, key)) beside->fail(fmt::format("\"{}\" besides \"parts\"", key), "one of them");
    parts = readParts(*list);
  } else {
    std::size_t made = 0;
    parts.push_back(readPart(object, made));
  }
  ExtendedLattice l;
  std::vector<std::vector<Index>> nodeOf(1);
  if (parts.size() == 1) {
    l = parts[0].lattice;
    for (Index n = 0; n < l.nodes.size(); ++n) nodeOf[0].push_back(n);
  } else {
    std::vector<ExtendedLattice> pieces;
    for (const Part& p : parts) pieces.push_back(p.lattice);
    l = checked(*list, "parts within double", [&] { return weld(pieces, 1e-9, &nodeOf); });
  }
  const JsonValue shapes = list ? *list : object;
  if (const Index cell = checked(shapes, "nodes within double", [&] { return foldedCell(l); }); cell != kNoIndex)
    shapes.fail(fmt::format("cell {} turned inside out, or flat", cell), "cells in which every point has one place");
  const auto listed = given(object, "displacements"), moves = given(object, "moves"), joined = given(object, "joined");
  if (listed && moves) moves->fail("\"moves\" besides \"displacements\"", "one of them");
  std::vector<Index> pinned;
  if (moves) pinned = readMoves(*moves, parts, nodeOf, l);
  if (listed) {
    if (listed->array().size() != l.nodes.size())
      listed->fail(fmt::format("{} displacements", listed->size()), fmt::format("{}, one a node", l.nodes.size()));
    for (const JsonValue d : listed->array()) l.displacements.push_back(d.vec3());
  }
  if (joined) checked(*joined, "displacements that can be joined", [&] { return join(*joined, pinned, l), 0; });
  if (std::all_of(l.displacements.begin(), l.displacements.end(), [](const Vec3& d) { return d.isZero(0); })) l.displacements.clear();
  return l;
}

void extendedLatticeToJson(const ExtendedLattice& l, JsonWriter& json) {
  l.validate();
  json.key("nodes").beginArray();
  for (const Vec3& p : l.nodes) json.value(p);
  json.end().key("cells").beginArray();
  for (const auto& cell : l.cells) {
    json.beginArray(JsonLayout::Inline);
    for (const Index n : cell) json.value(n);
    json.end();
  }
  json.end();
  const auto moved = static_cast<std::size_t>(std::count_if(l.displacements.begin(), l.displacements.end(), [](const Vec3& d) { return d != Vec3::Zero(); }));
  if (moved == 0) return;
  if (moved * 4 < l.displacements.size()) {
    json.key("moves").beginArray();
    for (std::size_t n = 0; n < l.nodes.size(); ++n)
      if (l.displacements[n] != Vec3::Zero()) json.beginObject(JsonLayout::Inline).member("node", n).member("by", l.displacements[n]).end();
    json.end();
    return;
  }
  json.key("displacements").beginArray();
  for (const Vec3& d : l.displacements) json.value(d);
  json.end();
}

ExtendedLattice readExtendedLattice(const std::filesystem::path& path) { return parseJson(readTextFile(path), path); }
ExtendedLattice parseExtendedLattice(std::string text, const std::filesystem::path& path) { return parseJson(std::move(text), path); }

std::string formatExtendedLattice(const ExtendedLattice& lattice) {
  JsonWriter json;
  json.beginObject().member("format", kFormatName).member("version", 1);
  extendedLatticeToJson(lattice, json);
  return json.end().text();
}

void writeExtendedLattice(const ExtendedLattice& lattice, const std::filesystem::path& path) {
  writeTextFile(path, formatExtendedLattice(lattice));
}

std::variant<Lattice, ExtendedLattice> readAnyLattice(const std::filesystem::path& path) {
  std::string text = readTextFile(path);
  if (text.find(kFormatName) != std::string::npos && text.find('{') != std::string::npos) {
    const JsonDocument document = JsonDocument::parse(text, path);
    const auto format = document.root().find("format");
    if (format && format->kind() == JsonKind::String && format->string() == kFormatName) return parseJson(std::move(text), path);
  }
  return parseLattice(std::move(text), path);
}

}  // namespace fielddeform::map
