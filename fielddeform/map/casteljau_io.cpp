#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/casteljau_io.h>
#include <fielddeform/map/lattice_io.h>
#include <fmt/format.h>

#include <stdexcept>

namespace fielddeform::map {
namespace {

constexpr std::string_view kFormatName = "fielddeform-casteljau";

using Levels = std::vector<std::vector<Vec3>>;

bool isVector(const JsonValue& value) {
  return value.kind() == JsonKind::Array && value.size() > 0 && (*value.array().begin()).kind() == JsonKind::Number;
}

/// A handle for all segments of a level, one a segment, or none.
std::vector<Vec3> levelFromJson(const JsonValue& value, std::size_t segments) {
  if (isVector(value)) return std::vector<Vec3>(segments, value.vec3());
  if (value.array().size() != 0 && value.size() != segments)
    value.fail(fmt::format("{} handles", value.size()), fmt::format("{}, one a segment of this level, or one for all", segments));
  std::vector<Vec3> out;
  for (const JsonValue h : value.array()) out.push_back(h.vec3());
  return out;
}

/// The handles of all levels, or one vector for all segments of level 1.
Levels handlesFromJson(const JsonValue& value, int degree) {
  const auto n = static_cast<std::size_t>(degree);
  if (isVector(value)) return {levelFromJson(value, n)};
  if (value.array().size() > n) value.fail(fmt::format("{} levels", value.size()), fmt::format("at most {}, the degree", n));
  Levels out;
  for (const JsonValue level : value.array()) out.push_back(levelFromJson(level, n - out.size()));
  return out;
}

CasteljauPiece pieceFromJson(const JsonValue& object) {
  object.allowKeys({"points", "s", "t", "length"});
  CasteljauPiece piece;
  const JsonValue points = object.require("points");
  if (points.array().size() < 2 || points.size() > kMaxCasteljauDegree + 1)
    points.fail(fmt::format("{} points", points.size()), fmt::format("2 to {}", kMaxCasteljauDegree + 1));
  for (const JsonValue p : points.array()) piece.points.push_back(p.vec3());
  if (const auto length = object.find("length")) piece.length = length->positive();
  piece.s = handlesFromJson(object.require("s"), piece.degree());
  piece.t = handlesFromJson(object.require("t"), piece.degree());
  return piece;
}

void handlesToJson(const char* key, const Levels& levels, JsonWriter& json) {
  json.key(key).beginArray(JsonLayout::Inline);
  for (const std::vector<Vec3>& level : levels) {
    json.beginArray();
    for (const Vec3& h : level) json.value(h);
    json.end();
  }
  json.end();
}

}  // namespace

bool CasteljauFile::operator==(const CasteljauFile& other) const {
  return formatCasteljau(*this) == formatCasteljau(other);
}

CasteljauFile parseCasteljau(std::string text, const std::filesystem::path& path) {
  const JsonDocument document = JsonDocument::parse(std::move(text), path);
  document.requireFormat(kFormatName, 1);
  const JsonValue root = document.root();
  root.allowKeys({"format", "version", "frame", "outside", "joined", "pieces"});
  CasteljauFile file;
  if (const auto frame = root.find("frame")) {
    if (frame->kind() == JsonKind::Object) file.frame = latticeBoxFromJson(*frame);
    else file.frame = static_cast<FrameAxis>(frame->word({"auto", "x", "y", "z", "oriented"}));
  }
  if (const auto outside = root.find("outside"))
    file.outside = outside->word({"extend", "keep"}) == 1 ? Outside::Keep : Outside::Extend;
  const JsonValue pieces = root.require("pieces");
  for (const JsonValue p : pieces.array()) file.curve.pieces.push_back(pieceFromJson(p));
  try {
    file.curve.validate();
    if (const auto joined = root.find("joined"))
      if (joined->word({"c1", "as-given"}) == 0) file.curve = joinC1(std::move(file.curve));
    file.curve.validate();  // means of numbers near the greatest may not be finite
  } catch (const std::invalid_argument& problem) {
    pieces.fail(problem.what(), "pieces of a curve");
  }
  return file;
}

CasteljauFile readCasteljau(const std::filesystem::path& path) { return parseCasteljau(readTextFile(path), path); }

std::string formatCasteljau(const CasteljauFile& file) {
  file.curve.validate();
  JsonWriter json;
  json.beginObject().member("format", kFormatName).member("version", 1);
  json.key("frame");
  if (const auto* box = std::get_if<LatticeBox>(&file.frame)) latticeBoxToJson(*box, json);
  else json.value(toString(std::get<FrameAxis>(file.frame)));
  json.member("outside", toString(file.outside));
  json.key("pieces").beginArray();
  for (const CasteljauPiece& p : file.curve.pieces) {
    json.beginObject().key("points").beginArray(JsonLayout::Inline);
    for (const Vec3& x : p.points) json.value(x);
    json.end();
    handlesToJson("s", p.s, json);
    handlesToJson("t", p.t, json);
    json.member("length", p.length).end();
  }
  return json.end().end().text();
}

void writeCasteljau(const CasteljauFile& file, const std::filesystem::path& path) { writeTextFile(path, formatCasteljau(file)); }

}  // namespace fielddeform::map
