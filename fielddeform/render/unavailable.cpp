#include <fielddeform/render/render.h>

#include <stdexcept>

/// What a build without Embree has in place of pictures.
namespace fielddeform::render {
namespace {
[[noreturn]] void refuse() {
  throw std::runtime_error("this build cannot draw pictures: configure it with FIELDDEFORM_WITH_EMBREE=ON");
}
}  // namespace

bool available() noexcept { return false; }
Image render(const Picture& picture, Progress&) {
  picture.validate();
  refuse();
}
std::vector<std::uint8_t> encodePng(const Image&) { refuse(); }
void writePng(const Image&, const std::filesystem::path&) { refuse(); }

}  // namespace fielddeform::render
