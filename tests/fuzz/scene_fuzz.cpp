#include <fielddeform/core/error.h>
#include <fielddeform/scene/scene.h>

#include <cstddef>
#include <cstdint>

#include "require.h"

/// What must hold for any bytes that the scene reader is given: an IoError, or a scene whose file reads back to the same
/// file.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fielddeform;
  scene::Scene scene;
  try {
    scene = scene::parseScene(std::string(reinterpret_cast<const char*>(data), size), "folder/scene.json");
  } catch (const IoError&) {
    return 0;
  }
  const std::string text = scene::formatScene(scene, "folder");
  const std::string again = scene::formatScene(scene::parseScene(text, "folder/scene.json"), "folder");
  require(text == again, "writing again gives the same bytes", text + "\n" + again + "\n");
  return 0;
}
