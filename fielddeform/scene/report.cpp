#include <fielddeform/core/version.h>
#include <fielddeform/scene/detail/volume_pass.h>
#include <fielddeform/scene/report.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::scene {
namespace {

void writeNumber(JsonWriter& json, std::string_view key, const std::optional<double>& value) {
  json.key(key);
  if (value && std::isfinite(*value)) json.value(*value);
  else json.null();
}

// JSON text as the value of a member: indented by one level, without the newline at its end.
std::string nested(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\n' && i + 1 == text.size()) break;
    out += text[i];
    if (text[i] == '\n') out += "  ";
  }
  return out.empty() ? "{}" : out;
}

void writeMaxAndP99(JsonWriter& json, const MaxAndP99& value) {
  writeNumber(json, "max", value.max);
  writeNumber(json, "p99", value.p99);
}

void writeVolume(JsonWriter& json, const VolumeReport& volume) {
  json.key("volume").beginObject();
  writeNumber(json, "before", volume.before);
  writeNumber(json, "after", volume.after);
  writeNumber(json, "relative_change", volume.relativeChange());
  writeNumber(json, "as_written", volume.asWritten);
  if (!volume.reason.empty()) json.member("reason", volume.reason);
  if (volume.pass) detail::writeVolumePassReport(json, *volume.pass);
  json.end();
}

void writeRun(JsonWriter& json, const RunFacts& run) {
  json.key("run").beginObject();
  json.key("seconds").beginObject(JsonLayout::Inline);
  for (const auto& [stage, seconds] : run.seconds) json.member(stage, std::round(seconds * 1e6) / 1e6);
  json.end();
  json.member("threads", run.threads);
  json.member("peak_memory_mb", std::round(run.peakMemoryMb * 10) / 10);
  json.key("paths").beginObject();
  for (const auto& [role, path] : run.paths) json.member(role, path);
  json.end().end();
}

}  // namespace

std::optional<double> VolumeReport::relativeChange() const {
  if (!before || !after || *before == 0) return std::nullopt;
  return (*after - *before) / *before;
}

MaxAndP99 maxAndP99(std::vector<float> values) {
  std::erase_if(values, [](float v) { return std::isnan(v); });
  if (values.empty()) return {};
  // Nearest rank: the smallest value that at least 99 % of the values do not exceed.
  const std::size_t rank = values.size() - values.size() / 100;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::nth_element(values.begin(), at, values.end());
  return {*std::max_element(at, values.end()), *at};
}

namespace {

// Targets that are missed, the first thousand of a move: a file of millions is read by nobody.
void writeMissed(JsonWriter& json, const std::vector<map::TargetState>& states, std::string_view key) {
  constexpr int kMost = 1000;
  int written = 0;
  json.key(key).beginArray();
  for (std::size_t i = 0; i < states.size() && written < kMost; ++i) {
    if (states[i].outcome == map::TargetOutcome::Met) continue;
    json.beginObject(JsonLayout::Inline).member("target", i);
    json.member("outcome", states[i].outcome == map::TargetOutcome::Unmet ? "unmet" : "outside").member("miss", states[i].miss).end();
    ++written;
  }
  json.end();
}

void writeMoves(JsonWriter& json, const std::vector<map::MoveReport>& moves) {
  if (moves.empty()) return;
  json.key("moves").beginArray();
  for (const map::MoveReport& m : moves) {
    json.beginObject().member("op", m.kind).member("vertices", m.vertices);
    json.key("nodes").beginArray(JsonLayout::Inline);
    for (const int n : m.nodes) json.value(n);
    json.end().member("refinements", m.refinements);
    if (m.kind == "press") {
      json.member("rounds", m.rounds).member("deepest_before", m.deepestBefore).member("deepest_after", m.deepestAfter);
      json.member("penetrating", m.penetrating).member("penetrating_faces", m.penetratingFaces);
    } else {
      json.member("met", m.solve.met).member("unmet", m.solve.unmet).member("outside", m.solve.outside);
      json.member("largest_miss", m.solve.largestMiss).member("largest_pin_shift", m.solve.largestPinShift);
    }
    json.member("change", m.solve.change).member("advice", m.advice);
    if (m.kind == "targets") {
      writeMissed(json, m.solve.points, "missed");
      writeMissed(json, m.solve.directions, "missed_directions");
    }
    json.end();
  }
  json.end();
}

void writePredictor(JsonWriter& json, const Report& report) {
  json.beginObject().member("used", report.predictor).member("reason", report.predictorReason);
  json.key("evaluation").beginObject(JsonLayout::Inline).member("used", report.evaluation);
  json.member("from_grid", report.evaluated.grid).member("exact", report.evaluated.exact);
  json.member("corrected_singly", report.evaluated.singly).end().end();
}

}  // namespace

void writeDistances(JsonWriter& json, const std::vector<gffd::NamedDistance>& distances, const field::GridOptions& grid) {
  if (distances.empty()) return;
  const bool isGrid = distances[0].report.kind == field::Distance::Grid;
  json.key("distance").beginObject().member("used", field::toString(distances[0].report.kind));
  if (isGrid) {
    double megabytes = 0;
    for (const auto& d : distances) megabytes += d.report.megabytes;
    json.member("of", field::toString(grid.of)).member("sampling", field::toString(grid.sampling));
    json.member("memory_mb", megabytes).member("memory_limit_mb", grid.maxMegabytes);
  }
  json.key(isGrid ? "grids" : "fits").beginArray();
  for (const auto& d : distances) {
    const field::DistanceReport& r = d.report;
    json.beginObject(JsonLayout::Inline).member("pose", d.pose).key("primitive");
    if (d.primitive.empty()) json.null();
    else json.value(d.primitive);
    if (isGrid) {
      json.member("voxel", r.voxel).member("voxels", r.voxels).member("memory_mb", r.megabytes).member("exact_within", r.exactWithin);
      writeNumber(json, "error_bound", r.smoothError);
      writeNumber(json, "error_bound_at_kinks", r.kinkError);
      json.member("error_measured", r.measuredError);
    } else {
      json.member("centres", r.centres).member("levels", r.levels).member("residual", r.residual);
    }
    json.end();
  }
  json.end().end();
}

std::string toJson(const Report& report) {
  JsonWriter json;
  json.beginObject();
  json.member("format", "fielddeform-report").member("version", kVersion);
  json.key("options").raw(nested(report.options));
  json.member("method", report.method).key("predictor");
  if (report.predictor.empty()) json.null();
  else writePredictor(json, report);
  writeDistances(json, report.distances, report.gridOptions);
  if (report.fit) {
    json.key("fit").beginObject(JsonLayout::Inline).member("found", report.fit->found).member("pairs", report.fit->pairs);
    writeNumber(json, "rms", report.fit->rms);
    writeNumber(json, "max", report.fit->max);
    json.end();
  }
  json.member("vertices", report.vertices).member("faces", report.faces);
  json.key("status").beginObject(JsonLayout::Inline);
  for (std::size_t s = 0; s < kStatusCount; ++s) json.member(toString(static_cast<Status>(s)), report.status[s]);
  json.end();
  json.key("residual").beginObject(JsonLayout::Inline);
  writeMaxAndP99(json, report.residual);
  json.member("tolerance", report.tolerance).member("radius", report.referenceRadius).end();
  json.key("folds").beginObject(JsonLayout::Inline);
  json.member("before", report.foldsBefore).member("after", report.foldsAfter).end();
  json.member("flipped", report.flipped);
  writeVolume(json, report.volume);
  json.member("inserted_vertices", report.insertedVertices);
  json.key("stretch").beginObject(JsonLayout::Inline);
  writeMaxAndP99(json, report.stretch);
  json.end();
  writeMoves(json, report.moves);
  json.key("warnings").beginArray();
  for (const std::string& warning : report.warnings) json.value(warning);
  json.end();
  writeRun(json, report.run);
  json.end();
  return json.text();
}

}  // namespace fielddeform::scene
