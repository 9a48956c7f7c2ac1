// What every command has in common: help, usage errors, the man page and the completions.
#include <gtest/gtest.h>

#include <sstream>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

// The commands that the help lists.
std::vector<std::string> commands() {
  const Result help = run(".", {"--help"});
  std::vector<std::string> names;
  std::istringstream lines(help.out);
  bool listed = false;
  for (std::string line; std::getline(lines, line);) {
    if (line == "Subcommands:") listed = true;
    else if (listed && line.starts_with("  ") && line.size() > 2 && line[2] != ' ')
      names.push_back(line.substr(2, line.find(' ', 2) - 2));
    else if (listed && line.empty()) break;
  }
  return names;
}

// The option names in a help text.
std::vector<std::string> optionsIn(const std::string& help) {
  std::vector<std::string> names;
  std::istringstream lines(help);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("  -")) continue;
    std::istringstream words(line.substr(0, 34));
    std::string names_;
    words >> names_;
    std::istringstream parts(names_);
    for (std::string name; std::getline(parts, name, ',');)
      if (name.starts_with("--")) names.push_back(name);
  }
  return names;
}

TEST(Usage, EveryHelpEndsWithAnExample) {
  const auto names = commands();
  ASSERT_FALSE(names.empty());
  for (const std::string& name : names) {
    const Result help = run(".", {name, "--help"});
    EXPECT_EQ(help.code, 0) << name;
    EXPECT_EQ(help.err, "") << name;
    EXPECT_NE(help.out.find("Example:\n  fielddeform " + name), std::string::npos) << help.out;
  }
}

TEST(Usage, MistakesEndWithTwoAndNameTheHelp) {
  const std::vector<std::vector<std::string>> mistakes{
      {}, {"bnd"}, {"info"}, {"info", "a.ply", "--jsno"}, {"info", "a.ply", "--threads", "0"},
      {"info", "a.ply", "--threads", "two"}, {"--nonsense"}, {"info", "a.ply", "b.ply"}};
  for (const auto& arguments : mistakes) {
    const Result result = run(".", arguments);
    EXPECT_EQ(result.code, 2) << result.err;
    EXPECT_EQ(result.out, "");
    EXPECT_TRUE(result.err.starts_with("fielddeform: ")) << result.err;
    EXPECT_NE(result.err.find("--help"), std::string::npos) << result.err;
  }
}

TEST(Usage, VersionIsPrinted) {
  const Result result = run(".", {"--version"});
  EXPECT_EQ(result.code, 0);
  EXPECT_TRUE(result.out.starts_with("fielddeform 0.")) << result.out;
}

TEST(Usage, EveryOptionIsDocumented) {
  const std::string page = readFile(FIELDDEFORM_SOURCE "/docs/cli.md");
  ASSERT_FALSE(page.empty());
  for (const std::string& name : commands()) {
    EXPECT_NE(page.find("## " + name), std::string::npos) << name;
    for (const std::string& option : optionsIn(run(".", {name, "--help"}).out))
      EXPECT_NE(page.find("`" + option), std::string::npos) << name << " " << option;
  }
}

TEST(Usage, ManPageAndCompletionsKnowEveryCommandAndOption) {
  const Scratch scratch;
  const std::vector<std::string> kinds{"man", "bash", "zsh", "fish"};
  for (const std::string& kind : kinds) {
    ASSERT_EQ(run(scratch.path(), {"_manual", kind, kind}).code, 0);
    std::string text = readFile(scratch / kind);
    std::erase(text, '\\');
    for (const std::string& name : commands()) {
      EXPECT_NE(text.find(name), std::string::npos) << kind << " " << name;
      for (const std::string& option : optionsIn(run(".", {name, "--help"}).out)) {
        const std::string_view word(option);  // fish lists long options without their dashes
        EXPECT_NE(text.find(kind == "fish" ? word.substr(2) : word), std::string::npos)
            << kind << " " << name << " " << option;
      }
    }
  }
}

}  // namespace
}  // namespace fielddeform::cli_test
