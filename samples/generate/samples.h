#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fielddeform::samples {

/// A generated file: its name says what it is, its extension whether it is a mesh (.ply, .obj) or a skeleton (.json).
struct Sample {
  std::string name;         ///< "otter"
  std::string file;         ///< "otter.ply"
  std::string description;  ///< one line
  void (*write)(const std::filesystem::path&);
};

/// All samples, in the order of the listing.
const std::vector<Sample>& samples();

}  // namespace fielddeform::samples
