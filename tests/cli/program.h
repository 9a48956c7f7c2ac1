#pragma once

#include <filesystem>
#include <string>
#include <vector>

/// Runs the program that was built, as a user would.
namespace fielddeform::cli_test {

struct Result {
  int code = -1;      ///< exit code; 128 + signal if it was killed
  std::string out, err;
};

/// An empty folder of the running test's own, removed when it ends.
class Scratch {
 public:
  Scratch();
  ~Scratch();
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  std::vector<std::string> files() const;  ///< names within, sorted, folders recursively

 private:
  std::filesystem::path path_;
};

/// Runs the program in a folder. Paths in the arguments are relative to it.
Result run(const std::filesystem::path& folder, const std::vector<std::string>& arguments);

/// A program that runs in the background.
class Background {
 public:
  Background(const std::filesystem::path& folder, const std::vector<std::string>& arguments);
  ~Background();
  /// Sends a signal. @return the exit code
  int interrupt(int signal);
  /// Waits until it ends by itself. @return the exit code
  int wait();

 private:
  int pid_ = -1;
  int code_ = -1;
};

std::string readFile(const std::filesystem::path& path);
void writeFile(const std::filesystem::path& path, const std::string& text);

/// A closed bar along z, `segments` long, as ASCII PLY: 4 (segments + 1) vertices. Float coordinates, one colour a vertex.
std::string barPly(int segments);

}  // namespace fielddeform::cli_test
