// The hidden command _manual: man page and shell completions, made of the commands and options themselves.
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/version.h>
#include <fmt/format.h>

#include <sstream>
#include <vector>

#include "command.h"

namespace fielddeform::cli {
namespace {

std::vector<const CLI::App*> commandsOf(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

std::vector<const CLI::Option*> optionsOf(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) { return !option->get_group().empty(); });
}

// The words of an option that takes one of a fixed set: its type's name reads "turn|recompute|keep". Parts in capitals
// stand for values that cannot be listed.
std::vector<std::string> choicesOf(const CLI::Option& option) {
  std::vector<std::string> words;
  std::istringstream parts(option.get_type_name());
  for (std::string word; std::getline(parts, word, '|');)
    if (!word.empty() && word[0] >= 'a' && word[0] <= 'z') words.push_back(word);
  return words;
}

bool takesValue(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

std::vector<std::string> namesOf(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const auto& name : option.get_snames()) names.push_back("-" + name);
  for (const auto& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

std::string join(const std::vector<std::string>& words, std::string_view between) {
  return fmt::format("{}", fmt::join(words, between));
}

// Text for roff: backslashes and hyphens escaped, no line that begins with a control character.
std::string roff(std::string_view text) {
  std::string out;
  bool lineStart = true;
  for (const char c : text) {
    if (lineStart && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') out += "\\e";
    else if (c == '-') out += "\\-";
    else out += c;
    lineStart = c == '\n';
  }
  return out;
}

std::string manOptions(const CLI::App& app) {
  std::string out;
  for (const auto* option : optionsOf(app)) {
    std::string head;
    if (option->nonpositional()) {
      head = "\\fB" + roff(join(namesOf(*option), "\\fR, \\fB")) + "\\fR";
      for (std::size_t at; (at = head.find("\\ef")) != std::string::npos;) head.replace(at, 3, "\\f");
      if (takesValue(*option)) head += " \\fI" + roff(option->get_type_name()) + "\\fR";
    } else {
      head = "\\fI" + roff(option->get_name(true)) + "\\fR";
    }
    out += fmt::format(".TP\n{}\n{}\n", head, roff(option->get_description()));
  }
  return out;
}

std::string manPage(const CLI::App& app) {
  std::string out = fmt::format(".TH FIELDDEFORM 1 \"\" \"fielddeform {}\" \"User Commands\"\n", kVersion);
  out += fmt::format(".SH NAME\nfielddeform \\- {}\n", roff("deform 3D shapes by editing a skeleton"));
  out += ".SH SYNOPSIS\n.B fielddeform\n\\fICOMMAND\\fR [\\fIOPTION\\fR]...\n";
  out += ".SH OPTIONS\n" + manOptions(app) + ".SH COMMANDS\n";
  for (const auto* command : commandsOf(app)) {
    out += fmt::format(".SS {}\n{}\n", roff(command->get_name()), roff(command->get_description()));
    out += manOptions(*command);
    if (!command->get_footer().empty()) out += fmt::format(".PP\n.nf\n{}\n.fi\n", roff(command->get_footer()));
  }
  out += ".SH EXIT STATUS\n.TP\n0\ndone\n.TP\n1\nbad input, a file that cannot be read or written, no solution\n"
         ".TP\n2\nwrong usage\n.TP\n3\n\\-\\-check failed\n.TP\n130\ninterrupted; nothing is left half written\n";
  return out;
}

std::string bashCompletion(const CLI::App& app) {
  std::vector<std::string> commands;
  std::string words, choices;
  for (const auto* command : commandsOf(app)) {
    commands.push_back(command->get_name());
    std::vector<std::string> names;
    for (const auto* option : optionsOf(*command)) {
      for (const auto& name : namesOf(*option)) names.push_back(name);
      const auto values = choicesOf(*option);
      if (values.empty()) continue;
      for (const auto& name : namesOf(*option)) {
        choices += fmt::format("    \"{} {}\") words=\"{}\" ;;\n", command->get_name(), name, join(values, " "));
      }
    }
    words += fmt::format("      {}) words=\"{}\" ;;\n", command->get_name(), join(names, " "));
  }
  return fmt::format(R"(# bash completion for fielddeform, written by the program itself
_fielddeform() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD-1]}} command=${{COMP_WORDS[1]}} words=
  COMPREPLY=()
  if [ "$COMP_CWORD" -eq 1 ]; then
    mapfile -t COMPREPLY < <(compgen -W "{} --help --version" -- "$current")
    return
  fi
  case "$command $previous" in
{}  esac
  if [ -z "$words" ] && [[ $current == -* ]]; then
    case $command in
{}    esac
  fi
  if [ -n "$words" ]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
  fi
}}
complete -o filenames -F _fielddeform fielddeform
)",
                     join(commands, " "), choices, words);
}

// Text within single quotes of zsh's _arguments, or fish's -d.
std::string quoted(std::string_view text, std::string_view escaped) {
  std::string out;
  for (const char c : text) {
    if (c == '\'') out += "'\\''";
    else if (escaped.find(c) != std::string_view::npos) (out += '\\') += c;
    else out += c;
  }
  return out;
}

std::string zshCompletion(const CLI::App& app) {
  std::string commands, cases;
  for (const auto* command : commandsOf(app)) {
    commands += fmt::format("    '{}:{}'\n", command->get_name(), quoted(command->get_description(), ":"));
    cases += fmt::format("    {})\n      _arguments \\\n", command->get_name());
    for (const auto* option : optionsOf(*command)) {
      const auto values = choicesOf(*option);
      const std::string action = values.empty() ? "_files" : "(" + join(values, " ") + ")";
      for (const auto& name : namesOf(*option)) {
        cases += fmt::format("        '{}[{}]{}' \\\n", name, quoted(option->get_description(), "[]:"),
                             takesValue(*option) ? ":value:" + action : "");
      }
    }
    cases += "        '*:file:_files' ;;\n";
  }
  return fmt::format(R"(#compdef fielddeform
# zsh completion for fielddeform, written by the program itself
_fielddeform() {{
  local -a commands
  commands=(
{}  )
  if (( CURRENT == 2 )); then
    _describe command commands
    return
  fi
  local command=$words[2]
  shift words
  (( CURRENT-- ))
  case $command in
{}  esac
}}
_fielddeform "$@"
)",
                     commands, cases);
}

std::string fishCompletion(const CLI::App& app) {
  std::string out = "# fish completion for fielddeform, written by the program itself\n";
  for (const auto* command : commandsOf(app)) {
    out += fmt::format("complete -c fielddeform -n __fish_use_subcommand -a {} -d '{}'\n", command->get_name(),
                       quoted(command->get_description(), ""));
    for (const auto* option : optionsOf(*command)) {
      if (!option->nonpositional()) continue;
      out += fmt::format("complete -c fielddeform -n '__fish_seen_subcommand_from {}'", command->get_name());
      for (const auto& name : option->get_snames()) out += " -s " + name;
      for (const auto& name : option->get_lnames()) out += " -l " + name;
      const auto values = choicesOf(*option);
      if (!values.empty()) out += fmt::format(" -x -a '{}'", join(values, " "));
      else if (takesValue(*option)) out += " -r";
      out += fmt::format(" -d '{}'\n", quoted(option->get_description(), ""));
    }
  }
  return out;
}

}  // namespace

void addManual(CLI::App& app, Session& session) {
  struct Options {
    std::string kind, file;
  };
  const auto options = cli::optionsOf<Options>();
  auto* command = app.add_subcommand("_manual", "Write the man page or a shell completion")->group("");
  command->add_option("KIND", options->kind)->required()->check(CLI::IsMember({"man", "bash", "zsh", "fish"}));
  command->add_option("FILE", options->file)->required();
  command->callback([&app, &session, options] {
    session.run = [&app, options](Terminal&) {
      const std::string text = options->kind == "man"    ? manPage(app)
                               : options->kind == "bash" ? bashCompletion(app)
                               : options->kind == "zsh"  ? zshCompletion(app)
                                                         : fishCompletion(app);
      writeTextFile(options->file, text);
      return kDone;
    };
  });
}

}  // namespace fielddeform::cli
