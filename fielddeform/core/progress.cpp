#include <fielddeform/core/error.h>
#include <fielddeform/core/progress.h>

namespace fielddeform {

void Progress::beginStage(std::string_view) {}
void Progress::advance(double) {}

void Progress::throwIfCancelled() const {
  if (cancelled()) throw Cancelled();
}

}  // namespace fielddeform
