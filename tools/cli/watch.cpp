// fielddeform watch: runs a scene again whenever one of its files is saved.
#include <fielddeform/core/error.h>
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <map>
#include <thread>

#include "scene_options.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

struct WatchOptions {
  std::string scene;
  bool picture = true;
  int runs = 0;        // stop after so many; 0: never
  int interval = 200;  // milliseconds between two looks
};

// What a file looks like from outside; a file that is not there has size -1.
struct Stamp {
  fs::file_time_type time{};
  std::intmax_t size = -1;
  bool operator==(const Stamp&) const = default;
};

Stamp stampOf(const fs::path& file) {
  std::error_code problem;
  Stamp stamp{fs::last_write_time(file, problem), -1};
  if (problem) return {};
  const auto size = fs::file_size(file, problem);
  if (problem) return {};
  stamp.size = static_cast<std::intmax_t>(size);
  return stamp;
}

using Stamps = std::map<fs::path, Stamp>;

Stamps stampsOf(const std::vector<fs::path>& files) {
  Stamps stamps;
  for (const fs::path& file : files) stamps[file] = stampOf(file);
  return stamps;
}

std::vector<fs::path> filesOf(const fs::path& sceneFile, const scene::Scene& scene) {
  std::vector<fs::path> files = scene.inputs;
  files.push_back(sceneFile);
  for (const scene::LatticeStep& step : scene.lattices)
    if (const auto* path = std::get_if<fs::path>(&step.source)) files.push_back(*path);
  if (const auto* path = std::get_if<fs::path>(&scene.rest); path && !path->empty()) files.push_back(*path);
  if (scene.posed)
    if (const auto* path = std::get_if<fs::path>(&*scene.posed)) files.push_back(*path);
  if (scene.mask && !scene.mask->file.empty()) files.push_back(scene.mask->file);
  if (scene.volume && scene.volume->mask && !scene.volume->mask->file.empty()) files.push_back(scene.volume->mask->file);
  return files;
}

class Watcher {
 public:
  Watcher(const WatchOptions& options, Terminal& terminal)
      : options_(options), terminal_(terminal), files_{options.scene} {}

  int run() {
    int code = kDone;
    for (int n = 1;; ++n) {
      code = runOnce();
      if (options_.runs > 0 && n >= options_.runs) return code;
      waitForChange();
    }
  }

 private:
  // A scene that cannot be read (half saved, mistyped) is reported, and watched on.
  int runOnce() {
    seen_ = stampsOf(files_);
    try {
      scene::Scene scene = scene::readScene(options_.scene);
      files_ = filesOf(options_.scene, scene);
      const Stamps now = stampsOf(files_);
      for (const auto& [file, stamp] : now) seen_.try_emplace(file, stamp);
      if (options_.picture && !scene.output.picture)
        scene.output.picture = scene.inputs.size() > 1 || !scene.output.mesh.has_filename()
                                   ? scene.output.mesh
                                   : withSuffix(scene.output.mesh, "", ".png");
      const auto start = std::chrono::steady_clock::now();
      const int code = runScene(scene, std::nullopt, terminal_);
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
      terminal_.note(fmt::format("{:%H:%M:%S} {} in {:.2f} s; watching", fmt::localtime(std::time(nullptr)),
                                 code == kFailed ? "failed" : "done", took.count()));
      return code;
    } catch (const Cancelled&) {
      throw;
    } catch (const std::exception& problem) {
      terminal_.error(problem.what());
      terminal_.note("watching");
      return kFailed;
    }
  }

  // Returns when a file differs from what the last run saw and has stopped changing.
  void waitForChange() {
    const auto pause = [&] {
      terminal_.throwIfCancelled();
      std::this_thread::sleep_for(std::chrono::milliseconds(options_.interval));
      terminal_.throwIfCancelled();
    };
    Stamps now = stampsOf(files_);
    while (now == only(seen_)) {
      pause();
      now = stampsOf(files_);
    }
    for (Stamps later; true; now = later) {
      pause();
      later = stampsOf(files_);
      const bool whole = std::none_of(later.begin(), later.end(), [](const auto& s) { return s.second.size <= 0; });
      if (later == now && whole) return;
    }
  }

  // Of what was seen, the files that are watched now.
  Stamps only(const Stamps& stamps) const {
    Stamps out;
    for (const fs::path& file : files_) {
      const auto found = stamps.find(file);
      if (found != stamps.end()) out.insert(*found);
    }
    return out;
  }

  const WatchOptions& options_;
  Terminal& terminal_;
  std::vector<fs::path> files_;
  Stamps seen_;
};

}  // namespace

void addWatch(CLI::App& app, Session& session) {
  const auto options = std::make_shared<WatchOptions>();
  auto* command = app.add_subcommand("watch", "Run a scene again whenever its mesh, skeleton or scene file is saved");
  command->add_option("SCENE", options->scene, "Scene file")->required()->type_name("");
  command->add_flag_callback("--no-picture", [options] { options->picture = false; },
                             "No picture beside the output if the scene names none");
  command->add_option("--runs", options->runs, "Stop after N runs (default: Ctrl-C stops)")->type_name("N")
      ->check(within(1, 1000000));
  command->add_option("--interval", options->interval, "Milliseconds between two looks at the files (default: 200)")
      ->type_name("MS")->check(within(10, 60000));
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform watch arm.json      # then move the skeleton in any modeller and save");
  command->callback([&session, options] {
    session.run = [options](Terminal& terminal) { return Watcher(*options, terminal).run(); };
  });
}

}  // namespace fielddeform::cli
