// The commands that the documentation shows run as they stand.
#include <gtest/gtest.h>

#include <sstream>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

// Lines of the ```sh blocks of a page that begin with the program's name.
std::vector<std::vector<std::string>> commandsIn(const std::string& page) {
  std::vector<std::vector<std::string>> commands;
  std::istringstream lines(page);
  bool inside = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("```")) inside = line == "```sh";
    if (!inside || !line.starts_with("fielddeform ")) continue;
    std::istringstream words(line.substr(0, line.find('#')));
    commands.emplace_back();
    std::string program;
    words >> program;
    for (std::string word; words >> word;) commands.back().push_back(word);
  }
  return commands;
}

void runAll(const std::string& page, std::size_t least) {
  const Scratch folder;
  writeFile(folder / "scan.ply", barPly(24));
  const auto commands = commandsIn(readFile(std::string(FIELDDEFORM_SOURCE) + page));
  EXPECT_GE(commands.size(), least);
  for (const auto& arguments : commands) {
    const Result result = run(folder.path(), arguments);
    std::string line;
    for (const auto& a : arguments) line += " " + a;
    EXPECT_EQ(result.code, 0) << line << "\n" << result.err;
  }
}

TEST(DocsSlow, TheGuidesCommandsRun) { runAll("/docs/guide.md", 9); }
TEST(DocsSlow, TheLatticePagesCommandsRun) { runAll("/docs/lattice.md", 6); }
TEST(DocsSlow, TheCasteljauPagesCommandsRun) { runAll("/docs/casteljau.md", 3); }
TEST(DocsSlow, TheReadmesCommandsRun) { runAll("/README.md", 1); }

TEST(Docs, TheExampleSceneIsRead) {
  // The page shows it in one block; what it names is not there, which is the first thing found wrong with it.
  const std::string page = readFile(FIELDDEFORM_SOURCE "/docs/scene.md");
  const auto begin = page.find("```json\n") + 8;
  const Scratch folder;
  writeFile(folder / "scene.json", page.substr(begin, page.find("```", begin) - begin));
  const Result result = run(folder.path(), {"run", "scene.json"});
  EXPECT_EQ(result.code, 1);
  EXPECT_TRUE(result.err.starts_with("fielddeform: scan.ply: ")) << result.err;
}

}  // namespace
}  // namespace fielddeform::cli_test
