#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <functional>
#include <memory>

#include "terminal.h"

/// The program's commands: each file adds one (or one family) to the app, and leaves what it does in Session::run.
namespace fielddeform::cli {

enum ExitCode : int {
  kDone = 0,
  kFailed = 1,         ///< bad input, I/O, infeasible
  kUsage = 2,
  kCheckFailed = 3,
  kInterrupted = 130,
};

/// What one invocation of the program shares between parsing and running.
struct Session {
  int threads = 0;                        ///< 0: all of the machine
  std::function<int(Terminal&)> run;      ///< the chosen command; returns an ExitCode
};

/// A command's option values: alive as long as the callbacks that refer to them.
template <class Options>
std::shared_ptr<Options> optionsOf() {
  return std::make_shared<Options>();
}

/// The app with every command. Options' storage lives in the app's callbacks.
std::unique_ptr<CLI::App> makeApp(Session& session);

/// Adds "--threads N", which every computing command has.
void addThreads(CLI::App& command, Session& session);

void addDeform(CLI::App& app, Session& session);
void addEdits(CLI::App& app, Session& session);  ///< bend, twist, taper, stretch
void addLattice(CLI::App& app, Session& session);
void addCasteljau(CLI::App& app, Session& session);
void addRun(CLI::App& app, Session& session);
void addWatch(CLI::App& app, Session& session);
void addSkeleton(CLI::App& app, Session& session);
void addField(CLI::App& app, Session& session);
void addInfo(CLI::App& app, Session& session);
void addRender(CLI::App& app, Session& session);
void addSolid(CLI::App& app, Session& session);
void addVolume(CLI::App& app, Session& session);
void addManual(CLI::App& app, Session& session);

}  // namespace fielddeform::cli
