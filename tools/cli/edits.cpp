// fielddeform bend, twist, taper, stretch: one edit along a spine, on one or many meshes.
#include <fielddeform/core/angle.h>
#include <fmt/format.h>

#include "scene_options.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

struct EditOptions {
  BatchOptions batch;
  skeleton::Spine spine;
  std::optional<Vec3> about;
  std::optional<double> angle, arcRadius;
  double factor = 1;
  std::string rest, primitive;
};

CLI::Option* addAngle(CLI::App& command, std::optional<double>& angle, const std::string& help) {
  // A thousand turns either way, as far as the sine of an angle holds digits of it.
  return addDegrees(command, "--angle", angle, help)->check(within(-360000, 360000))->group("Edit");
}

CLI::Option* addFactor(CLI::App& command, double& factor, const std::string& help) {
  return command.add_option("--factor", factor, help)->type_name("FACTOR")->required()->check(within(1e-6, 1e6))->group("Edit");
}

void addSpine(CLI::App& command, EditOptions& options) {
  const char* group = "Edit";
  addAxis(command, "--axis", options.spine.axis, "Direction of the spine (default: auto, the mesh's longest extent)")->group(group);
  addVec3(command, "--pivot", options.spine.pivot, "Point that stays where it is (default: on the spine, at --from)")->group(group);
  command.add_option("--from", options.spine.from, "Begin of the range that changes, along the spine (default: 0)")
      ->type_name("T")->check(within(0, 1))->group(group);
  command.add_option("--to", options.spine.to, "End of the range; beyond it all moves rigidly (default: 1)")
      ->type_name("T")->check(within(0, 1))->group(group);
  command.add_option("--rest", options.rest, "Skeleton to edit (default: a spine through the mesh's slices)")
      ->type_name("SKEL")->group(group);
  command.add_option("--grid", options.batch.scene.volumeGrid, "A volume (.vdb) as --rest: the grid's name (default: the first of numbers)")
      ->type_name("NAME")->group(group);
  command.add_option("--primitive", options.primitive, "Edit this primitive of --rest alone")->type_name("NAME")->group(group);
}

template <class Operation>
void finish(EditOptions& options, Operation operation) {
  if (!(options.spine.from < options.spine.to))
    throw CLI::ValidationError(fmt::format("--from: {}, expected less than --to {}", options.spine.from, options.spine.to));
  scene::Scene& scene = options.batch.scene;
  if (options.rest.empty()) scene.rest = scene::AxisRest{options.spine.axis};
  else scene.rest = std::filesystem::path(options.rest);
  scene.edits.push_back({options.primitive, std::move(operation)});
}

// Adds a command: its own options, those of the spine and of every deforming command. `make` builds the operation.
template <class AddOwn, class Make>
void addEdit(CLI::App& app, Session& session, const char* name, const char* help, const char* example, AddOwn&& addOwn,
             Make make) {
  const auto options = optionsOf<EditOptions>();
  auto* command = app.add_subcommand(name, help);
  addOwn(*command, *options);
  addSpine(*command, *options);
  addBatchOptions(*command, session, options->batch, true);
  command->footer(std::string("Example:\n  ") + example);
  command->callback([&session, options, make] {
    requireUsable(options->batch);
    finish(*options, make(*options));
    session.run = [options](Terminal& terminal) { return runBatch(options->batch, terminal); };
  });
}

skeleton::Bend makeBend(const EditOptions& o) {
  if (o.angle.has_value() == o.arcRadius.has_value()) throw CLI::ValidationError("expected either --angle or --arc-radius");
  if (o.arcRadius && *o.arcRadius == 0) throw CLI::ValidationError("--arc-radius: 0, expected another number");
  if (o.about && o.spine.axis && !(o.about->normalized().cross(o.spine.axis->normalized()).norm() > 1e-6))
    throw CLI::ValidationError("--about: lies along --axis, expected a direction across it");
  return {.spine = o.spine, .angle = o.angle, .radius = o.arcRadius, .about = o.about};
}

}  // namespace

void addEdits(CLI::App& app, Session& session) {
  addEdit(app, session, "bend", "Bend meshes: the spine becomes an arc",
          "fielddeform bend scan.ply -o bent.ply --angle 90",
          [](CLI::App& command, EditOptions& o) {
            addAngle(command, o.angle, "Angle between the ends of the range");
            addNumber(command, "--arc-radius", o.arcRadius, "Radius of the arc instead of an angle, model units; negative: the other way")
                ->group("Edit");
            addAxis(command, "--about", o.about, "Axis that it turns about (default: auto, the second longest extent)")->group("Edit");
          },
          makeBend);
  addEdit(app, session, "twist", "Twist meshes about their spine",
          "fielddeform twist scan.ply -o twisted.ply --angle 180 --from 0.2 --to 0.8",
          [](CLI::App& command, EditOptions& o) { addAngle(command, o.angle, "Angle between the ends of the range")->required(); },
          [](const EditOptions& o) { return skeleton::Twist{o.spine, *o.angle}; });
  addEdit(app, session, "taper", "Taper meshes: sections shrink or grow along the spine",
          "fielddeform taper scan.ply -o tapered.ply --factor 0.5",
          [](CLI::App& command, EditOptions& o) { addFactor(command, o.factor, "Size of the sections at the end of the range, 1 at its begin"); },
          [](const EditOptions& o) { return skeleton::Taper{o.spine, o.factor}; });
  addEdit(app, session, "stretch", "Stretch meshes along their spine; sections keep their size",
          "fielddeform stretch *.ply -o stretched/ --factor 1.5",
          [](CLI::App& command, EditOptions& o) { addFactor(command, o.factor, "How many times as long the range becomes"); },
          [](const EditOptions& o) { return skeleton::Stretch{o.spine, o.factor}; });
}

}  // namespace fielddeform::cli
