// fielddeform render: a picture of meshes side by side.
#include <fielddeform/mesh/io.h>
#include <fielddeform/render/render.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "command.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

struct RenderOptions {
  std::vector<std::string> meshes, skeletons, labels;
  std::string output, attribute;
  std::optional<render::Color> color;
  render::Picture picture;
  std::optional<double> crease;
  double edges = 0;
  bool flat = false;
  bool noLabels = false;
};

render::Color colorOf(const std::string& option, const std::string& text) {
  const auto color = render::parseColor(text);
  if (!color) throw CLI::ConversionError(fmt::format("{}: \"{}\", expected #rrggbb or a colour's name", option, text));
  return *color;
}

void setSize(render::Picture& picture, const std::string& text) {
  const auto x = text.find('x');
  const auto number = [&](const std::string& part) {
    const double value = parseNumbers("--size", part, 1)[0];
    if (!(value >= 16 && value <= 16384) || value != std::floor(value))
      throw CLI::ConversionError(fmt::format("--size: \"{}\", expected whole pixels in 16..16384", text));
    return static_cast<int>(value);
  };
  picture.width = number(text.substr(0, x));
  if (x != std::string::npos) picture.height = number(text.substr(x + 1));
}

// Scalars of a vertex attribute (or one on faces) by name.
std::vector<double> scalarsOf(const mesh::Mesh& mesh, const std::string& name, const std::string& file) {
  for (const auto on : {mesh::Element::Vertex, mesh::Element::Face}) {
    const auto* attribute = mesh.find(on, name);
    if (attribute && attribute->indices.empty() && attribute->listOffsets.empty()) return render::scalarsOf(*attribute);
  }
  throw std::runtime_error(fmt::format("{}: there is no attribute \"{}\" on its vertices or faces", file, name));
}

render::View viewOf(const RenderOptions& options, std::size_t i, Progress& progress) {
  const std::string& file = options.meshes[i];
  mesh::ReadOptions read;
  read.invalid = mesh::InvalidPoints::Keep;
  render::Body body;
  const auto mesh = std::make_shared<const mesh::Mesh>(mesh::readMesh(file, read, nullptr, &progress));
  body.mesh = mesh;
  body.color = options.color;
  if (!options.attribute.empty()) body.scalars = scalarsOf(*mesh, options.attribute, file);
  if (options.flat) body.creaseAngle = 0;
  else if (options.crease) body.creaseAngle = *options.crease;
  body.edgeWidth = options.edges;
  render::View view;
  view.bodies.push_back(std::move(body));
  // One skeleton is drawn over every mesh; of several, each over its own.
  if (!options.skeletons.empty()) {
    const std::string& skeleton = options.skeletons.size() == 1 ? options.skeletons[0] : options.skeletons[i];
    view.overlays.push_back({skeleton::readSkeleton(skeleton)});
  }
  if (i < options.labels.size()) view.label = options.labels[i];
  else if (!options.noLabels && options.meshes.size() > 1) view.label = std::filesystem::path(file).filename().string();
  return view;
}

int runRender(RenderOptions& options, Terminal& terminal) {
  render::Picture& picture = options.picture;
  for (std::size_t i = 0; i < options.meshes.size(); ++i) picture.views.push_back(viewOf(options, i, terminal));
  picture.scalars.label = options.attribute;
  const render::Image image = render::render(picture, terminal);
  render::writePng(image, options.output);
  return kDone;
}

void addCamera(CLI::App& command, RenderOptions& options) {
  render::Camera& camera = options.picture.camera;
  addVec3(command, "--direction", camera.direction, "Look along this direction (default: along the shortest extent)")
      ->check(direction())->group("Camera");
  addVec3(command, "--up", camera.up, "What is up in the picture (default: y)")->check(direction())->group("Camera");
  addDegrees(command, "--azimuth", camera.azimuth, "Walk around the object, counter-clockwise from above")->group("Camera");
  addDegrees(command, "--elevation", camera.elevation, "Look down from this height")->group("Camera");
  addNumber(command, "--zoom", camera.zoom, "More than 1 comes closer")->check(within(1e-3, 1e3))->group("Camera");
  addWord(command, "--projection", {"perspective", "orthographic"},
          [&camera](std::size_t i) { camera.projection = static_cast<render::Projection>(i); }, "How depth is drawn")
      ->group("Camera");
  addWord(command, "--framing", {"same-scale", "same-camera", "each"},
          [&camera](std::size_t i) { camera.framing = static_cast<render::Framing>(i); },
          "How several meshes share the camera: all at one scale (default), one camera for all, each filling its view")
      ->group("Camera");
}

void addSurface(CLI::App& command, RenderOptions& options) {
  command.add_option_function<std::string>(
      "--color", [&options](const std::string& text) { options.color = colorOf("--color", text); },
      "One colour for all (default: the vertices' own)")->type_name("COLOR")->group("Surface");
  command.add_option("--attribute", options.attribute, "Show the numbers of this vertex or face attribute as colours")
      ->type_name("NAME")->group("Surface");
  addWord(command, "--color-map", {"viridis", "heat", "diverging"},
          [&options](std::size_t i) { options.picture.scalars.map = static_cast<render::ColorMap>(i); },
          "Colours for --attribute")->group("Surface");
  command.add_option_function<std::string>(
      "--range",
      [&options](const std::string& text) {
        const auto range = parseNumbers("--range", text, 2);
        if (!(range[0] <= range[1]))
          throw CLI::ConversionError(fmt::format("--range: \"{}\", expected LOW at most HIGH", text));
        options.picture.scalars.low = range[0];
        options.picture.scalars.high = range[1];
      },
      "Values at the ends of the colour map")->type_name("LOW,HIGH")->group("Surface");
  addDegrees(command, "--crease", options.crease, "Edges that turn by more look sharp (default: 40)")
      ->check(within(0, 180))->group("Surface");
  command.add_flag("--flat", options.flat, "No smooth shading")->group("Surface");
  addNumber(command, "--edges", options.edges, "Draw the faces' edges this wide, in thousandths of the view")
      ->check(within(0, 1000))->group("Surface");
}

void addPage(CLI::App& command, RenderOptions& options) {
  render::Picture& picture = options.picture;
  command.add_option_function<std::string>(
      "--size", [&picture](const std::string& text) { setSize(picture, text); },
      "Pixels of the whole picture (default: 1200 wide, as high as needed)")->type_name("W[xH]")->group("Page");
  command.add_option_function<int>(
      "--columns", [&picture](const int& n) { picture.columns = n; }, "Views in a row")->type_name("N")
      ->check(within(1, 1000))->group("Page");
  command.add_option("--label", options.labels, "Text under a view, once a mesh (default: the file's name)")
      ->type_name("TEXT")->allow_extra_args(false)->group("Page");
  command.add_flag("--no-labels", options.noLabels, "No text under the views")->group("Page");
  command.add_option_function<std::string>(
      "--background", [&picture](const std::string& text) { picture.background = colorOf("--background", text); },
      "Colour behind the objects")->type_name("COLOR")->group("Page");
  addWord(command, "--quality", {"draft", "normal", "fine"},
          [&picture](std::size_t i) {
            if (i == 0) picture.quality = {.samples = 1, .ambient = 4, .shadows = 1, .smooth = true};
            if (i == 2) picture.quality = {.samples = 16, .ambient = 16, .shadows = 4, .smooth = true};
          },
          "Rays a pixel")->group("Page");
}

}  // namespace

void addRender(CLI::App& app, Session& session) {
  const auto options = std::make_shared<RenderOptions>();
  auto* command = app.add_subcommand("render", "Draw meshes side by side, without a display");
  command->add_option("MESH", options->meshes, "Meshes to draw (PLY, OBJ, STL, OFF)")->required()->type_name("");
  command->add_option("-o,--output", options->output, "Picture to write (PNG)")
      ->required()->type_name("FILE")->check(endingIn({".png"}));
  command->add_option("--skeleton", options->skeletons, "Skeleton drawn over the meshes: one for all, or one a mesh")
      ->type_name("FILE")->allow_extra_args(false);
  addCamera(*command, *options);
  addSurface(*command, *options);
  addPage(*command, *options);
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform render scan.ply bent.ply -o compare.png --size 1600x900 --azimuth 30");
  command->callback([&session, options] {
    if (options->skeletons.size() > 1 && options->skeletons.size() != options->meshes.size())
      throw CLI::ValidationError(fmt::format("--skeleton: {} files for {} meshes, expected one, or one a mesh",
                                             options->skeletons.size(), options->meshes.size()));
    session.run = [options](Terminal& terminal) { return runRender(*options, terminal); };
  });
}

}  // namespace fielddeform::cli
