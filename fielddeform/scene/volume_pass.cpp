#include <fielddeform/core/detail/json_fields.h>
#include <fielddeform/scene/detail/volume_pass.h>

#include <cmath>

namespace fielddeform::scene::detail {
namespace {

using fielddeform::detail::given;

namespace fs = std::filesystem;

void readMaskChoice(const JsonValue& value, const fs::path& folder, VolumePass& pass) {
  if (value.kind() == JsonKind::String) {
    pass.options.mask = static_cast<volume::MaskKind>(value.word({"auto", "none", "rest"}));
    return;
  }
  if (value.kind() != JsonKind::Object)
    value.fail("", "\"auto\", \"none\", \"rest\", {\"file\": PATH} or {\"attribute\": NAME}");
  value.allowKeys({"attribute", "file"});
  const auto attribute = given(value, "attribute"), file = given(value, "file");
  if (attribute.has_value() == file.has_value()) value.fail("", "either \"attribute\" or \"file\"");
  Mask mask;
  const std::string text = (attribute ? *attribute : *file).string();
  if (text.empty()) (attribute ? *attribute : *file).fail("", attribute ? "a name" : "a file");
  if (text.find('\0') != std::string::npos) value.fail("a path with a zero byte", "a file");
  if (attribute) mask.attribute = text;
  else mask.file = (folder / fs::path(text)).lexically_normal();
  pass.options.mask = volume::MaskKind::Given;
  pass.mask = std::move(mask);
}

void readLattice(const JsonValue& value, volume::LocalOptions& options) {
  if (value.kind() == JsonKind::String) {
    value.word({"auto"});
    return;
  }
  if (value.array().size() != 3) value.fail("", "\"auto\", or the number of nodes along x, y and z");
  auto& nodes = options.nodes.emplace();
  std::size_t k = 0;
  for (const JsonValue n : value.array()) nodes[k++] = static_cast<int>(n.integer(4, 64));
}

void writeFinite(JsonWriter& json, std::string_view key, double value) {
  json.key(key);
  if (std::isfinite(value)) json.value(value);
  else json.null();
}

void writeMaxAndP99(JsonWriter& json, std::string_view key, const MaxAndP99& value) {
  json.key(key).beginObject(JsonLayout::Inline);
  writeFinite(json, "max", value.max);
  writeFinite(json, "p99", value.p99);
  json.end();
}

}  // namespace

VolumePass readVolumePass(const JsonValue& object, const fs::path& folder) {
  if (object.kind() != JsonKind::Object) object.fail("", "null or an object");
  object.allowKeys({"mask", "lattice", "energy", "solver"});
  VolumePass pass;
  if (const auto mask = given(object, "mask")) readMaskChoice(*mask, folder, pass);
  if (const auto lattice = given(object, "lattice")) readLattice(*lattice, pass.options);
  if (const auto word = given(object, "energy"))
    pass.options.energy = static_cast<volume::LocalEnergy>(word->word({"surface", "springs"}));
  if (const auto word = given(object, "solver"))
    pass.options.solver = static_cast<volume::LocalSolver>(word->word({"exact", "augmented-lagrangian"}));
  return pass;
}

void writeVolumePass(JsonWriter& json, const VolumePass& pass, const std::function<std::string(const fs::path&)>& pathText) {
  json.beginObject(JsonLayout::Inline).key("mask");
  if (!pass.mask) {
    json.value(toString(pass.options.mask));
  } else {
    json.beginObject(JsonLayout::Inline);
    if (!pass.mask->attribute.empty()) json.member("attribute", pass.mask->attribute);
    else if (pathText) json.member("file", pathText(pass.mask->file));
    json.end();
  }
  json.key("lattice");
  if (!pass.options.nodes) {
    json.value("auto");
  } else {
    json.beginArray(JsonLayout::Inline);
    for (const int n : *pass.options.nodes) json.value(n);
    json.end();
  }
  json.member("energy", toString(pass.options.energy)).member("solver", toString(pass.options.solver)).end();
}

void writeVolumePassReport(JsonWriter& json, const VolumePassReport& report) {
  const volume::LocalReport& r = report.result;
  json.key("pass").beginObject();
  json.member("mask", toString(report.options.mask)).member("from_falloff", r.fromFalloff);
  json.member("energy", toString(report.options.energy)).member("solver", toString(report.options.solver));
  json.member("needed", r.needed);
  json.key("lattice").beginObject(JsonLayout::Inline).key("nodes").beginArray(JsonLayout::Inline);
  for (const int n : r.nodes) json.value(n);
  json.end().member("free", r.freeNodes);
  writeFinite(json, "cell", r.cell);
  json.end();
  writeFinite(json, "length", r.length);
  json.member("moved_vertices", r.moved).member("components", r.components).member("iterations", r.iterations);
  writeFinite(json, "change_before", r.change);
  writeFinite(json, "deviation", r.deviation);
  writeFinite(json, "tau", r.tau);
  writeFinite(json, "undone", r.undone);
  json.key("displacement").beginObject(JsonLayout::Inline);
  writeFinite(json, "max", r.largest);
  writeFinite(json, "rms", r.rms);
  json.end();
  json.key("folds").beginObject(JsonLayout::Inline);
  json.member("before", report.foldsBefore).member("after", report.foldsAfter).end();
  json.key("residual").beginObject(JsonLayout::Inline);
  writeMaxAndP99(json, "before", report.residualBefore);
  writeMaxAndP99(json, "after", report.residualAfter);
  json.end().end();
}

}  // namespace fielddeform::scene::detail
