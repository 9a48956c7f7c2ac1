#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/version.h>
#include <fmt/format.h>

#include <new>

#include "command.h"
#include "values.h"

namespace fielddeform::cli {

std::unique_ptr<CLI::App> makeApp(Session& session) {
  auto app = std::make_unique<CLI::App>("Deform 3D shapes by editing a skeleton.", "fielddeform");
  app->set_version_flag("--version", fmt::format("fielddeform {}", kVersion), "Print the version");
  app->set_help_flag("-h,--help", "Print this help");
  app->require_subcommand(1);
  app->get_formatter()->column_width(34);
  app->get_formatter()->label("REQUIRED", "");
  app->footer("Each command has its own help: fielddeform COMMAND --help");
  addDeform(*app, session);
  addEdits(*app, session);
  addLattice(*app, session);
  addCasteljau(*app, session);
  addRun(*app, session);
  addWatch(*app, session);
  addSkeleton(*app, session);
  addField(*app, session);
  addInfo(*app, session);
  addRender(*app, session);
  addSolid(*app, session);
  addVolume(*app, session);
  addManual(*app, session);
  return app;
}

void addThreads(CLI::App& command, Session& session) {
  command.add_option("--threads", session.threads, "Threads to use (default: all); the result is the same on any number")
      ->type_name("N")
      ->check(within(1, 4096));
}

namespace {

int runCommand(Session& session) {
  Terminal terminal;
  try {
    std::unique_ptr<ThreadLimit> limit;
    if (session.threads > 0) limit = std::make_unique<ThreadLimit>(session.threads);
    return session.run(terminal);
  } catch (const Cancelled&) {
    terminal.error("interrupted");
    return kInterrupted;
  } catch (const std::bad_alloc&) {
    terminal.error("not enough memory");
  } catch (const std::exception& problem) {
    terminal.error(problem.what());
  }
  return kFailed;
}

int run(int argc, char** argv) {
  Session session;
  const auto app = makeApp(session);
  try {
    app->parse(argc, argv);
  } catch (const CLI::Success& help) {  // --help, --version
    return app->exit(help);
  } catch (const CLI::ParseError& problem) {
    fmt::print(stderr, "fielddeform: {}\n", problem.what());
    const auto chosen = app->get_subcommands();
    fmt::print(stderr, "Try: fielddeform {}--help\n", chosen.empty() ? "" : chosen.front()->get_name() + " ");
    return kUsage;
  }
  return runCommand(session);
}

}  // namespace
}  // namespace fielddeform::cli

int main(int argc, char** argv) { return fielddeform::cli::run(argc, argv); }
