// fielddeform deform and run: scenes from skeleton files, and from scene files.
#include "scene_options.h"

namespace fielddeform::cli {

void addDeform(CLI::App& app, Session& session) {
  struct Options {
    BatchOptions batch;
    std::string rest, posed;
    std::vector<std::string> pairs;
  };
  const auto options = optionsOf<Options>();
  auto* command = app.add_subcommand("deform", "Deform a mesh by a skeleton at rest and posed");
  command->add_option("--rest", options->rest, "Skeleton as it lies in the mesh (JSON or OBJ)")->required()->type_name("SKEL");
  command->add_option("--posed", options->posed, "The same skeleton as it is to be")->required()->type_name("SKEL");
  command->add_option("--grid", options->batch.scene.volumeGrid, "Skeletons that are volumes (.vdb): the grid's name (default: the first of numbers)")
      ->type_name("NAME");
  command->add_option("--pair", options->pairs, "Primitives that belong together under different names; may be repeated")
      ->type_name("REST=POSED")->allow_extra_args(false)->group("Editing");
  addBatchOptions(*command, session, options->batch, true);
  command->footer("Example:\n  fielddeform deform horse.obj --rest leg.json --posed leg-up.json -o horse-up.obj");
  command->callback([&session, options] {
    requireUsable(options->batch);
    scene::Scene& scene = options->batch.scene;
    scene.rest = std::filesystem::path(options->rest);
    scene.posed = std::filesystem::path(options->posed);
    for (const std::string& pair : options->pairs) {
      const auto sign = pair.find('=');
      if (sign == std::string::npos || sign == 0 || sign + 1 == pair.size())
        throw CLI::ConversionError("--pair: \"" + pair + "\", expected REST=POSED");
      scene.pairs.push_back({pair.substr(0, sign), pair.substr(sign + 1)});
    }
    session.run = [options](Terminal& terminal) { return runBatch(options->batch, terminal); };
  });
}

void addRun(CLI::App& app, Session& session) {
  struct Options {
    std::string scene, saveScene;
  };
  const auto options = optionsOf<Options>();
  auto* command = app.add_subcommand("run", "Run a scene file: one deformation with all its options as data");
  command->add_option("SCENE", options->scene, "Scene file (JSON)")->required()->type_name("");
  command->add_option("--save-scene", options->saveScene, "Write the scene with every choice made")->type_name("FILE");
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform run bend.json");
  command->callback([&session, options] {
    session.run = [options](Terminal& terminal) {
      std::optional<std::filesystem::path> save;
      if (!options->saveScene.empty()) save = options->saveScene;
      return runScene(scene::readScene(options->scene), save, terminal);
    };
  });
}

}  // namespace fielddeform::cli
