#pragma once

#include <fielddeform/core/progress.h>

#include <chrono>
#include <string>
#include <string_view>

namespace fielddeform::cli {

/// What the program says: results to stdout, notes and errors to stderr, and a progress bar with an estimate of the
/// time left, drawn only if stderr is a terminal. Ctrl-C cancels it.
class Terminal : public Progress {
 public:
  Terminal();
  ~Terminal() override;

  /// Results, to stdout.
  void print(std::string_view line);
  /// "fielddeform: MESSAGE", to stderr; takes the bar away first.
  void error(std::string_view message);
  /// A remark, to stderr.
  void note(std::string_view line);

  /// Several jobs share one bar: job `index` of `count`, shown by its name.
  void beginJob(std::size_t index, std::size_t count, std::string name);
  void beginStage(std::string_view name) override;
  void advance(double fraction) override;
  /// Takes the bar away.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;
  void draw(bool always);

  bool isTerminal_;
  bool shown_ = false;
  std::size_t job_ = 0, jobs_ = 1;
  std::string jobName_;
  std::string stage_;
  double before_ = 0;    // share of the job done before this stage
  double weight_ = 0;    // share of the job that this stage is
  double fraction_ = 0;  // of the stage
  Clock::time_point start_ = Clock::now();
  Clock::time_point drawn_{};
};

}  // namespace fielddeform::cli
