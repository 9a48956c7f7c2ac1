#include "terminal.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>

namespace fielddeform::cli {
namespace {

// The one thing that a signal handler can reach: whom to cancel. Atomic, lock-free.
std::atomic<Progress*> interrupted{nullptr};

void onSignal(int) {
  if (Progress* progress = interrupted.load()) progress->cancel();
}

void handleSignals() {
  struct sigaction action {};
  action.sa_handler = onSignal;
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // a second Ctrl-C ends the program at once
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(signal, &action, nullptr);
}

// Usual shares of a run, for the bar alone.
double stageShare(std::string_view name) {
  static constexpr std::array<std::pair<std::string_view, double>, 9> shares{{{"read", .1},
                                                                             {"bind", .3},
                                                                             {"predict", .2},
                                                                             {"deform", .2},
                                                                             {"correct", .1},
                                                                             {"guard", .1},
                                                                             {"resample", .1},
                                                                             {"report", .05},
                                                                             {"write", .1}}};
  for (const auto& [stage, share] : shares) {
    if (stage == name) return share;
  }
  return .1;
}

}  // namespace

Terminal::Terminal() : isTerminal_(::isatty(STDERR_FILENO) == 1) {
  interrupted.store(this);
  handleSignals();
}

Terminal::~Terminal() {
  clear();
  interrupted.store(nullptr);
}

void Terminal::print(std::string_view line) {
  clear();
  fmt::print("{}\n", line);
}

void Terminal::error(std::string_view message) {
  clear();
  std::fflush(stdout);
  fmt::print(stderr, "fielddeform: {}\n", message);
}

void Terminal::note(std::string_view line) {
  clear();
  std::fflush(stdout);
  fmt::print(stderr, "{}\n", line);
}

void Terminal::beginJob(std::size_t index, std::size_t count, std::string name) {
  job_ = index;
  jobs_ = std::max<std::size_t>(count, 1);
  jobName_ = std::move(name);
  before_ = weight_ = fraction_ = 0;
  if (index == 0) start_ = Clock::now();
}

void Terminal::beginStage(std::string_view name) {
  before_ = std::min(before_ + weight_, .98);
  weight_ = std::min(stageShare(name), .98 - before_);
  fraction_ = 0;
  stage_ = name;
  draw(true);
}

void Terminal::advance(double fraction) {
  fraction_ = std::clamp(fraction, 0.0, 1.0);
  draw(false);
}

void Terminal::draw(bool always) {
  if (!isTerminal_) return;
  const auto now = Clock::now();
  if (!always && now - drawn_ < std::chrono::milliseconds(100)) return;
  drawn_ = now;
  const double share = (static_cast<double>(job_) + before_ + weight_ * fraction_) / static_cast<double>(jobs_);
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  constexpr int width = 30;
  const int full = static_cast<int>(share * width);
  std::string line = fmt::format("\r\033[K[{:#<{}}{:.<{}}] {:3.0f} %  ", "", full, "", width - full, 100 * share);
  if (share > .05 && elapsed > 1) line += fmt::format("{:.0f} s left  ", elapsed * (1 - share) / share);
  line += jobs_ > 1 ? fmt::format("{}/{} {}  {}", job_ + 1, jobs_, jobName_, stage_) : stage_;
  fmt::print(stderr, "{}", line);
  std::fflush(stderr);
  shown_ = true;
}

void Terminal::clear() {
  if (!shown_) return;
  fmt::print(stderr, "\r\033[K");
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace fielddeform::cli
