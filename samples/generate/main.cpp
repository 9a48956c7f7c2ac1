#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "samples.h"

/// fielddeform-samples NAME -o FILE, or --all DIR: generates the shapes that samples, demo and documentation use.
int main(int argc, char** argv) {
  using fielddeform::samples::samples;
  CLI::App app("Generates the sample meshes and skeletons of fielddeform.", "fielddeform-samples");
  std::string name, folder;
  std::filesystem::path output;
  bool list = false;
  auto* nameOption = app.add_option("NAME", name, "What to generate (see --list)");
  app.add_option("-o,--output", output,
                 "File to write; its extension chooses the format (default: the sample's own name)")
      ->needs(nameOption);
  app.add_option("--all", folder, "Write every sample into this folder")->type_name("DIR")->excludes(nameOption);
  app.add_flag("--list", list, "List the samples");
  app.footer("Example: fielddeform-samples otter -o scan.ply");
  try {
    app.parse(argc, argv);
    if (!list && name.empty() && folder.empty()) throw CLI::CallForHelp();
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  try {
    bool found = list || !folder.empty();
    if (!folder.empty()) std::filesystem::create_directories(folder);
    for (const auto& sample : samples()) {
      if (list) std::printf("%-18s %s\n", sample.name.c_str(), sample.description.c_str());
      if (!folder.empty()) sample.write(std::filesystem::path(folder) / sample.file);
      if (sample.name == name) found = true, sample.write(output.empty() ? std::filesystem::path(sample.file) : output);
    }
    if (found) return 0;
    std::fprintf(stderr, "fielddeform-samples: no sample is named '%s' (see --list)\n", name.c_str());
    return 2;
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "fielddeform-samples: %s\n", problem.what());
    return 1;
  }
}
