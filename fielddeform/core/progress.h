#pragma once

#include <atomic>
#include <string_view>

namespace fielddeform {

/// Reports on long work and lets it be stopped. The base class is silent; a program derives its own display.
/// Calls come from one thread at a time; cancel() may be called from any thread or a signal handler.
class Progress {
 public:
  Progress() = default;
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  virtual ~Progress() = default;

  /// A new stage begins ("read", "bind", "predict", "correct", "guard", "resample", "write").
  virtual void beginStage(std::string_view name);
  /// Share of the current stage that is done, in [0, 1].
  virtual void advance(double fraction);

  void cancel() noexcept { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const noexcept { return cancelled_.load(std::memory_order_relaxed); }
  /// @throw Cancelled if cancel() was called.
  void throwIfCancelled() const;

 private:
  std::atomic<bool> cancelled_{false};
};

}  // namespace fielddeform
