#include <fielddeform/core/atomic_file.h>
#include <fielddeform/render/image.h>
#include <fmt/format.h>
#include <png.h>

#include <stdexcept>
#include <string>

namespace fielddeform::render {

std::vector<std::uint8_t> encodePng(const Image& image) {
  const std::size_t wanted =
      3 * static_cast<std::size_t>(std::max(image.width, 0)) * static_cast<std::size_t>(std::max(image.height, 0));
  if (wanted == 0 || image.rgb.size() != wanted) {
    throw std::invalid_argument(fmt::format("image: {} by {} pixels with {} bytes, expected {} (and not 0)",
                                            image.width, image.height, image.rgb.size(), wanted));
  }
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::vector<std::uint8_t> out(size);
  if (png_image_write_to_memory(&png, out.data(), &size, 0, image.rgb.data(), 0, nullptr) == 0) {
    const std::string message = png.message;
    png_image_free(&png);
    throw std::runtime_error("PNG: " + message);
  }
  out.resize(size);
  return out;
}

void writePng(const Image& image, const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = encodePng(image);
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

}  // namespace fielddeform::render
