// fielddeform field: the scalar field of a skeleton as a volume, as isosurfaces, or as pictures of slices.
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/version.h>
#include <fielddeform/field/potential.h>
#include <fielddeform/field/vdb.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/render/color_map.h>
#include <fielddeform/scene/report.h>
#include <fielddeform/skeleton/edit.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "command.h"
#include "scene_options.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

struct Slice {
  int axis = 2;
  std::optional<double> at;  // world; absent: through the middle
};

struct FieldCommand {
  std::string skeleton, grid;
  std::vector<std::string> outputs;
  field::VdbWriteOptions write;
  field::FieldOptions field;
  std::optional<double> radius;
  std::string report;
  std::vector<double> isovalues;
  std::optional<Slice> slice;
  bool curve = false;
  int width = 900;
};

std::vector<double> parseList(const std::string& option, const std::string& text) {
  return parseNumbers(option, text, 1 + static_cast<std::size_t>(std::count(text.begin(), text.end(), ',')));
}

Slice parseSlice(const std::string& text) {
  const std::string word = "xyz";
  if (text.empty() || word.find(text[0]) == std::string::npos || (text.size() > 1 && text[1] != '='))
    throw CLI::ConversionError(fmt::format("--slice: \"{}\", expected x, y or z, or z=NUMBER", text));
  Slice slice{static_cast<int>(word.find(text[0])), {}};
  if (text.size() > 1) slice.at = parseNumbers("--slice", text.substr(2), 1)[0];
  return slice;
}

std::string extensionOf(const std::string& path) {
  std::string e = std::filesystem::path(path).extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return e;
}

std::string describeGrid(const field::DistanceReport& r) {
  std::string bounds;
  if (r.smoothError) bounds += fmt::format("error at most {:.4g}, ", *r.smoothError);
  if (r.kinkError) bounds += fmt::format("at kinks at most {:.4g}, ", *r.kinkError);
  return fmt::format("grid of {} voxels of {:.4g}, {:.4g} MB; exact within {:.4g}; {}measured at most {:.4g}", r.voxels, r.voxel,
                     r.megabytes, r.exactWithin, bounds, r.measuredError);
}

void describe(const field::Field& field, const skeleton::Skeleton& skeleton, Terminal& terminal) {
  if (field.blendReport()) terminal.print("whole field: " + describeGrid(*field.blendReport()));
  for (std::size_t i = 0; i < field.primitiveCount(); ++i) {
    const field::DistanceReport& r = field.distanceReport(i);
    const std::string name = fmt::format("{} \"{}\"", skeleton::toString(skeleton.primitives[i].type), skeleton.primitives[i].name);
    if (r.kind == field::Distance::Grid)
      terminal.print(name + ": " + describeGrid(r));
    else if (r.kind == field::Distance::Variational)
      terminal.print(fmt::format("{}: variational, {} centres{}, residual {:.4g}", name, r.centres,
                                 r.levels ? fmt::format(" in {} levels", r.levels) : "", r.residual));
  }
}

std::string reportOf(const field::Field& field, const skeleton::Skeleton& skeleton, const FieldCommand& o) {
  std::vector<gffd::NamedDistance> distances;
  if (field.blendReport()) distances.push_back({"rest", {}, *field.blendReport()});
  for (std::size_t i = 0; i < field.primitiveCount(); ++i)
    if (field.distanceReport(i).kind != field::Distance::Exact)
      distances.push_back({"rest", skeleton.primitives[i].name, field.distanceReport(i)});
  JsonWriter json;
  json.beginObject().member("format", "fielddeform-field-report").member("version", kVersion);
  json.member("primitives", field.primitiveCount()).member("radius", field.referenceRadius());
  scene::writeDistances(json, distances, o.field.distance.grid);
  json.end();
  return json.text();
}

// All isosurfaces in one mesh; the attribute "isovalue" tells them apart.
mesh::Mesh surfaces(const field::Field& field, const FieldCommand& o, Terminal& terminal) {
  std::vector<Vec3> positions;
  std::vector<Index> corners;
  std::vector<double> values;
  for (const double value : o.isovalues) {
    terminal.beginStage("isosurface");
    const mesh::Mesh m = field::isosurface(field, value, o.write.samples, terminal);
    if (m.faceCount() == 0) terminal.note(fmt::format("fielddeform: the field does not take the value {}", value));
    for (const Index c : m.corners()) corners.push_back(c + static_cast<Index>(positions.size()));
    positions.insert(positions.end(), m.positions().begin(), m.positions().end());
    values.resize(positions.size(), value);
  }
  mesh::Mesh all(std::move(positions), std::move(corners));
  all.attributes().push_back({"isovalue", mesh::Element::Vertex, 1, mesh::Interpolation::Linear, std::move(values), {}, {}});
  return all;
}

// Colours by D / R; a line at every eighth of R, and grey where nothing reaches.
render::Image picture(const field::Field& field, const FieldCommand& o, Terminal& terminal) {
  const double R = field.referenceRadius();
  const Box box = field.bounds();
  const Slice slice = o.slice.value_or(Slice{});
  const int u = slice.axis == 0 ? 1 : 0, v = slice.axis == 2 ? 1 : 2;
  const double margin = 1.15 * R, width = box.sizes()[u] + 2 * margin, height = box.sizes()[v] + 2 * margin;
  render::Image image;
  image.width = o.width;
  image.height = std::clamp(static_cast<int>(std::lround(o.width * height / width)), 1, 20 * o.width);
  image.rgb.resize(3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  const double pixel = width / image.width;
  std::vector<Vec3> row(static_cast<std::size_t>(image.width));
  std::vector<field::FieldValue> values(row.size());
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      Vec3& p = row[static_cast<std::size_t>(x)];
      p[slice.axis] = slice.at.value_or(box.center()[slice.axis]);
      p[u] = box.min()[u] - margin + (x + 0.5) * pixel;
      p[v] = box.max()[v] + margin - (y + 0.5) * pixel;
    }
    field.evaluate(row, values);
    for (int x = 0; x < image.width; ++x) {
      const field::FieldValue& f = values[static_cast<std::size_t>(x)];
      const double t = f.pseudoDistance / R, step = 8 * t, slope = 8 / R * pixel * f.gradient.norm();
      render::Color c = t < 1 ? render::mapColor(render::ColorMap::Viridis, 1 - t) : render::Color{0.85f, 0.85f, 0.85f};
      const double line = std::abs(step - std::round(step)) / std::max(slope, 1e-9);
      if (t < 1.01 && line < 1) c = {0.1f, 0.1f, 0.1f};
      const float rgb[3] = {c.r, c.g, c.b};
      for (int k = 0; k < 3; ++k) image.pixel(x, y)[k] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(rgb[k], 0.0f, 1.0f)));
    }
    terminal.advance((y + 1.0) / image.height);
    terminal.throwIfCancelled();
  }
  return image;
}

// E over d / r from -0.25 to 1.25 for the four potentials at the field's sharpness, each over its E(0); axes at d = 0, d = r
// and E = 0.
render::Image curves(const field::Field& field, const FieldCommand& o) {
  constexpr double kLow = -0.25, kHigh = 1.25, kTop = 1.3, kBottom = -0.1;
  constexpr render::Color kColors[] = {{0.85f, 0.2f, 0.15f}, {0.15f, 0.4f, 0.8f}, {0.2f, 0.6f, 0.25f}, {0.6f, 0.35f, 0.7f}};
  render::Image image{o.width, o.width * 2 / 3, {}};
  image.rgb.assign(3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), 255);
  const auto dot = [&](double px, double py, const render::Color& c, int size) {
    for (int y = static_cast<int>(py) - size; y <= static_cast<int>(py) + size; ++y)
      for (int x = static_cast<int>(px) - size; x <= static_cast<int>(px) + size; ++x) {
        if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
        const float rgb[3] = {c.r, c.g, c.b};
        for (int k = 0; k < 3; ++k) image.pixel(x, y)[k] = static_cast<std::uint8_t>(std::lround(255 * rgb[k]));
      }
  };
  const auto column = [&](double u) { return (u - kLow) / (kHigh - kLow) * image.width; };
  const auto line = [&](double e) { return (kTop - e) / (kTop - kBottom) * image.height; };
  for (int x = 0; x < image.width; ++x) dot(x, line(0), {0.6f, 0.6f, 0.6f}, 0);
  for (const double u : {0.0, 1.0})
    for (int y = 0; y < image.height; ++y) dot(column(u), y, {0.6f, 0.6f, 0.6f}, 0);
  const double k = field.options().sharpness;
  for (int which = 3; which >= 0; --which) {
    const field::Kernel kernel(static_cast<skeleton::Potential>(which), k);
    for (int i = 0; i < 8 * image.width; ++i) {
      const double u = kLow + (kHigh - kLow) * i / (8 * image.width);
      dot(column(u), line(kernel.value(k * u) / kernel.atZero()), kColors[which], 1);
    }
  }
  return image;
}

void writeOne(const std::string& path, const field::Field& field, const skeleton::Skeleton& skeleton, const FieldCommand& o,
              Terminal& terminal) {
  const std::string extension = extensionOf(path);
  if (extension == ".vdb") {
    terminal.beginStage("sample");
    for (const auto& g : field::writeVdb(field, skeleton, path, o.write, terminal))
      terminal.print(fmt::format("{}: grid \"{}\", {} voxels of {:.4g}, {:.4g} MB", path, g.name, g.voxels, g.voxel, g.megabytes));
  } else if (extension == ".png" && o.curve) {
    render::writePng(curves(field, o), path);
    terminal.print(fmt::format("{}: potentials over d / r from -0.25 to 1.25: exponential red, gaussian blue, metaball green, "
                               "soft-object violet", path));
  } else if (extension == ".png") {
    terminal.beginStage("slice");
    render::writePng(picture(field, o, terminal), path);
    terminal.print(fmt::format("{}: D from its least value to R = {:.4g}, a line every {:.4g}", path, field.referenceRadius(),
                               field.referenceRadius() / 8));
  } else {
    const mesh::Mesh m = surfaces(field, o, terminal);
    mesh::writeMesh(m, path);
    terminal.print(fmt::format("{}: {} vertices, {} faces", path, m.vertexCount(), m.faceCount()));
  }
}

int run(FieldCommand& o, Terminal& terminal) {
  if (!o.grid.empty() && !field::isVdb(o.skeleton))
    throw std::invalid_argument(fmt::format("--grid: \"{}\", but {} is no volume (.vdb)", o.grid, o.skeleton));
  skeleton::Skeleton skeleton = field::readSkeletonOrVolume(o.skeleton, o.grid);
  if (o.radius) skeleton::fillRadius(skeleton, *o.radius);
  for (const auto& p : skeleton.primitives)
    if (!p.radius && p.pointRadius.empty())
      throw std::invalid_argument(fmt::format("primitive \"{}\" has no radius: give --radius", p.name));
  o.write.samples.voxel = o.field.distance.grid.voxel;
  o.write.samples.maxMegabytes = o.field.distance.grid.maxMegabytes;
  if (o.field.distance.kind != field::Distance::Exact) terminal.beginStage("distance");
  const field::Field field(skeleton, o.field);
  describe(field, skeleton, terminal);
  for (const std::string& path : o.outputs) writeOne(path, field, skeleton, o, terminal);
  if (!o.report.empty()) writeTextFile(o.report, reportOf(field, skeleton, o));
  return kDone;
}

void checkOutputs(const FieldCommand& o) {
  for (const std::string& path : o.outputs) {
    const std::string e = extensionOf(path);
    const bool isMesh = e == ".ply" || e == ".obj" || e == ".stl" || e == ".off";
    if (e != ".vdb" && e != ".png" && !isMesh)
      throw CLI::ValidationError("--output", fmt::format("{}: expected .vdb, .png, or a mesh (.ply .obj .stl .off)", path));
    if (isMesh && o.isovalues.empty()) throw CLI::ValidationError("--output", fmt::format("{}: a mesh needs --isosurface V[,V...]", path));
  }
}

}  // namespace

void addField(CLI::App& app, Session& session) {
  const auto options = optionsOf<FieldCommand>();
  auto* command = app.add_subcommand("field", "Write a skeleton's field as a volume, as isosurfaces, or as slices");
  command->add_option("SKEL", options->skeleton, "Skeleton (JSON, OBJ), or a volume (VDB)")->required()->type_name("");
  command->add_option("-o,--output", options->outputs, "Volume (.vdb), isosurfaces (.ply .obj .stl .off), slice (.png); may be repeated")
      ->required()->type_name("FILE")->allow_extra_args(false);
  command->add_option("--grid", options->grid, "A volume as SKEL: the grid's name (default: the first of numbers)")->type_name("NAME");
  command->add_option_function<std::string>(
      "--isosurface", [options](const std::string& text) { options->isovalues = parseList("--isosurface", text); },
      "Pseudo-distances whose surfaces go into the mesh, model units")->type_name("V[,V...]");
  command->add_option_function<std::string>(
      "--slice", [options](const std::string& text) { options->slice = parseSlice(text); },
      "The slice's plane, x, y or z, and where (default: z, through the middle)")->type_name("AXIS[=AT]");
  command->add_flag("--curve", options->curve, "Picture: the four potentials over the distance instead of a slice");
  command->add_option("--width", options->width, "Pixels of a slice (default: 900)")->type_name("N")->check(within(16, 20000));
  command->add_flag("--primitives", options->write.primitives, "Volume: also a grid of each primitive's own distance");
  command->add_option("--units", options->write.units, "Volume: units that the file names (default: model units)")->type_name("TEXT");
  command->add_option("--report", options->report, "Write a JSON report: grids with voxels, memory and error bounds")->type_name("FILE");
  addNumber(*command, "--radius", options->radius, "Influence radius of primitives that name none, model units");
  addWord(*command, "--potential", {"exponential", "gaussian", "metaball", "soft-object"},
          [options](std::size_t i) { options->field.potential = static_cast<skeleton::Potential>(i); },
          "Potential of primitives that name none (default: exponential)");
  command->add_option("--sharpness", options->field.sharpness, "Falloff lengths in a radius (default: 4)")->type_name("NUMBER");
  addDistance(*command, options->field.distance);
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform field spine.json -o field.vdb -o tube.ply --isosurface 0.1,0.2");
  command->callback([&session, options] {
    checkOutputs(*options);
    session.run = [options](Terminal& terminal) { return run(*options, terminal); };
  });
}

}  // namespace fielddeform::cli
