#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/detail/json_fields.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/lattice_io.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using fielddeform::detail::checked;
using fielddeform::detail::given;

constexpr std::string_view kFormatName = "fielddeform-lattice";
constexpr std::size_t kUnlisted = std::size_t{1} << 22;  // nodes of a lattice whose file does not list them: bounds memory

AxisBasis axisFromJson(const JsonValue& object) {
  object.allowKeys({"basis", "nodes", "degree", "border", "knots", "at"});
  const bool spline = object.require("basis").word({"bernstein", "bspline"}) == 1;
  const auto nodes = given(object, "nodes"), degree = given(object, "degree"), border = given(object, "border"),
             knots = given(object, "knots"), at = given(object, "at");
  for (const auto& value : {degree, border, knots, at})
    if (value && !spline) value->fail("", "none: only a bspline has it");
  const int p = degree ? static_cast<int>(degree->integer(1, 3)) : 3;
  if (knots) {
    if (nodes) nodes->fail("\"nodes\" besides \"knots\"", "one of them");
    if (border) border->fail("\"border\" besides \"knots\"", "one of them");
    std::vector<double> numbers;
    for (const JsonValue k : knots->array()) numbers.push_back(k.number());
    if (at) {
      std::vector<double> rest;
      for (const JsonValue u : at->array()) rest.push_back(u.number());
      return checked(*at, "knots and nodes of a spline with coincident borders",
                     [&] { return AxisBasis::coincident(p, std::move(numbers), std::move(rest)); });
    }
    return checked(*knots, "knots of a spline", [&] { return AxisBasis::withKnots(p, std::move(numbers)); });
  }
  if (at) at->fail("\"at\" without \"knots\"", "both");
  const int n = static_cast<int>(object.require("nodes").integer(2, 0x7FFFFFFF));
  if (!spline) return AxisBasis::bernstein(n);
  return AxisBasis::bspline(n, p, border && border->word({"coincident", "free"}) == 1 ? Border::Free : Border::Coincident);
}

void axisToJson(const AxisBasis& axis, JsonWriter& json) {
  json.beginObject(JsonLayout::Inline).member("basis", toString(axis.kind()));
  if (axis.uniform()) json.member("nodes", axis.nodes());
  if (axis.kind() == BasisKind::BSpline) {
    json.member("degree", axis.degree());
    if (!axis.uniform()) {
      json.key("knots").beginArray();
      for (const double k : axis.knots()) json.value(k);
      json.end();
      if (axis.border() == Border::Coincident) {
        json.key("at").beginArray();
        for (int i = 0; i < axis.nodes(); ++i) json.value(axis.restNode(i));
        json.end();
      }
    } else {
      json.member("border", toString(axis.border()));
    }
  }
  json.end();
}

void readMoves(const JsonValue& list, Lattice& l) {
  l.displacements.assign(l.nodeCount(), Vec3::Zero());
  const auto nodes = l.nodes();
  for (const JsonValue move : list.array()) {
    move.allowKeys({"node", "by"});
    std::array<int, 3> at{};
    std::size_t a = 0;
    for (const JsonValue i : move.require("node").array(3)) {
      at[a] = static_cast<int>(i.integer(0, static_cast<std::uint64_t>(nodes[a] - 1)));
      ++a;
    }
    Vec3& d = l.displacements[l.index(at[0], at[1], at[2])];
    d += move.require("by").vec3();
    if (!d.allFinite()) move.fail("moves of one node that add up beyond double", "finite sums");
  }
}

// Moves instead of displacements, where most nodes stand still.
bool isSparse(const Lattice& l) {
  if (l.nodeCount() > kUnlisted) return false;
  const auto moved = std::count_if(l.displacements.begin(), l.displacements.end(), [](const Vec3& d) { return d != Vec3::Zero(); });
  return static_cast<std::size_t>(moved) * 4 < l.displacements.size();
}

void movesToJson(const Lattice& l, JsonWriter& json) {
  const auto [n0, n1, n2] = l.nodes();
  json.key("moves").beginArray();
  for (int k = 0; k < n2; ++k)
    for (int j = 0; j < n1; ++j)
      for (int i = 0; i < n0; ++i) {
        const Vec3& d = l.displacements[l.index(i, j, k)];
        if (d == Vec3::Zero()) continue;
        json.beginObject(JsonLayout::Inline).key("node").beginArray().value(i).value(j).value(k).end().member("by", d).end();
      }
  json.end();
}

Lattice parseJson(std::string text, const std::filesystem::path& path) {
  const JsonDocument document = JsonDocument::parse(std::move(text), path);
  document.requireFormat(kFormatName, 1);
  if (const auto sculpt = document.root().find("sculpt")) sculpt->fail("", "no \"sculpt\" in a lattice file, only in a scene");
  return latticeFromJson(document.root());
}

std::string formatJson(const Lattice& lattice) {
  JsonWriter json;
  json.beginObject().member("format", kFormatName).member("version", 1);
  latticeToJson(lattice, json);
  return json.end().text();
}

}  // namespace

LatticeBox latticeBoxFromJson(const JsonValue& object) {
  object.allowKeys({"origin", "edges"});
  LatticeBox box;
  box.origin = object.require("origin").vec3();
  int k = 0;
  for (const JsonValue edge : object.require("edges").array(3)) box.axes.col(k++) = edge.vec3();
  return checked(object, "three edges that span a volume", [&] {
    box.validate();
    return box;
  });
}

void latticeBoxToJson(const LatticeBox& box, JsonWriter& json) {
  json.beginObject(JsonLayout::Inline).member("origin", box.origin).key("edges").beginArray();
  for (int k = 0; k < 3; ++k) json.value(Vec3(box.axes.col(k)));
  json.end().end();
}

Lattice latticeFromJson(const JsonValue& object) {
  object.allowKeys({"format", "version", "box", "axes", "outside", "displacements", "moves", "sculpt"});
  Lattice l;
  if (const auto box = given(object, "box")) l.box = latticeBoxFromJson(*box);
  const JsonValue axes = object.require("axes");
  std::size_t a = 0;
  for (const JsonValue axis : axes.array(3)) l.axis[a++] = axisFromJson(axis);
  if (const auto outside = given(object, "outside"))
    l.outside = outside->word({"extend", "keep"}) == 1 ? Outside::Keep : Outside::Extend;
  checked(axes, "fewer nodes", [&] {
    l.validate();
    return 0;
  });
  const auto list = given(object, "displacements"), moves = given(object, "moves");
  if (list && moves) moves->fail("\"moves\" besides \"displacements\"", "one of them");
  if (list) {
    if (list->array().size() != l.nodeCount())
      list->fail(fmt::format("{} displacements", list->size()), fmt::format("{}, one a node", l.nodeCount()));
    l.displacements.reserve(l.nodeCount());
    for (const JsonValue d : list->array()) l.displacements.push_back(d.vec3());
    return l;
  }
  if (l.nodeCount() > kUnlisted)
    axes.fail(fmt::format("{} nodes", l.nodeCount()), fmt::format("at most {}, or \"displacements\" that list them", kUnlisted));
  if (moves) readMoves(*moves, l);
  return l;
}

void latticeToJson(const Lattice& l, JsonWriter& json) {
  json.key("box");
  latticeBoxToJson(l.box, json);
  json.key("axes").beginArray();
  for (const AxisBasis& axis : l.axis) axisToJson(axis, json);
  json.end().member("outside", toString(l.outside));
  if (l.displacements.empty() && l.nodeCount() <= kUnlisted) return;
  if (isSparse(l)) return movesToJson(l, json);
  json.key("displacements").beginArray();
  for (std::size_t i = 0; i < l.nodeCount(); ++i) json.value(l.displacements.empty() ? Vec3(Vec3::Zero()) : l.displacements[i]);
  json.end();
}

Lattice readLattice(const std::filesystem::path& path) { return parseLattice(readTextFile(path), path); }

Lattice parseLattice(std::string text, const std::filesystem::path& path) {
  std::size_t begin = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  begin = text.find_first_not_of(" \t\r\n", begin);
  if (begin == std::string::npos) throw IoError(path, "is empty, expected a lattice (JSON or OBJ)");
  const bool json = text[begin] == '{' || text[begin] == '[';
  return json ? parseJson(std::move(text), path) : detail::parseLatticeObj(text, path);
}

Lattice readMovedNodes(Lattice rest, const std::filesystem::path& obj) {
  return parseMovedNodes(std::move(rest), readTextFile(obj), obj);
}

std::string formatLattice(const Lattice& lattice, LatticeFormat format) {
  lattice.validate();
  return format == LatticeFormat::Json ? formatJson(lattice) : detail::formatLatticeObj(lattice);
}

void writeLattice(const Lattice& lattice, const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  writeTextFile(path, formatLattice(lattice, extension == ".obj" ? LatticeFormat::Obj : LatticeFormat::Json));
}

}  // namespace fielddeform::map
