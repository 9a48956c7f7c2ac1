// The commands that the documentation shows run as they stand.
#include <gtest/gtest.h>

#include <cstdlib>
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

void makeSamples(const std::string& page, const Scratch& folder);

void runAll(const std::string& page, std::size_t least) {
  const Scratch folder;
  makeSamples(page, folder);
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

// `fielddeform-samples NAME -o FILE` of a page's blocks, several on a line with semicolons between.
void makeSamples(const std::string& page, const Scratch& folder) {
  const std::string text = readFile(std::string(FIELDDEFORM_SOURCE) + page), word = "fielddeform-samples ";
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) {
    const std::string rest = text.substr(at + word.size(), text.find_first_of(";\n`", at) - at - word.size());
    const std::string command = "cd '" + folder.path().string() + "' && '" FIELDDEFORM_SAMPLES_PROGRAM "' " + rest;
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
  }
}

TEST(DocsSlow, TheGuidesCommandsRun) { runAll("/docs/guide.md", 9); }
TEST(DocsSlow, TheLatticePagesCommandsRun) { runAll("/docs/lattice.md", 6); }
TEST(DocsSlow, TheCasteljauPagesCommandsRun) { runAll("/docs/casteljau.md", 3); }
TEST(DocsSlow, TheSolidsPagesCommandsRun) { runAll("/docs/solids.md", 3); }
TEST(DocsSlow, TheMethodsPagesCommandsRun) { runAll("/docs/methods.md", 5); }
TEST(DocsSlow, TheReadmesCommandsRun) { runAll("/README.md", 1); }

// The JSON files that the pages show, each read by the command that takes it.
std::vector<std::string> filesIn(const std::string& page, const std::string& format) {
  const std::string text = readFile(std::string(FIELDDEFORM_SOURCE) + page);
  std::vector<std::string> out;
  for (std::size_t at = text.find("```json\n"); at != std::string::npos; at = text.find("```json\n", at + 1)) {
    const std::string block = text.substr(at + 8, text.find("```", at + 8) - at - 8);
    if (block.find("\"" + format + "\"") != std::string::npos) out.push_back(block);
  }
  return out;
}

TEST(Docs, TheExampleFilesAreRead) {
  const Scratch folder;
  writeFile(folder / "bar.ply", barPly(8));
  const auto passes = [&](const std::string& page, const std::string& format, std::vector<std::string> arguments) {
    const std::vector<std::string> files = filesIn(page, format);
    ASSERT_EQ(files.size(), 1u) << page << " " << format;
    writeFile(folder / "file.json", files[0]);
    const Result result = run(folder.path(), arguments);
    EXPECT_EQ(result.code, 0) << page << " " << format << "\n" << result.err;
  };
  passes("/docs/lattice.md", "fielddeform-extended-lattice", {"info", "file.json"});
  passes("/docs/casteljau.md", "fielddeform-casteljau", {"casteljau", "bar.ply", "--curve", "file.json", "-o", "out.ply"});
  passes("/docs/solids.md", "fielddeform-solids", {"solid", "file.json", "-o", "out.ply"});
}

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
