#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/render/picture.h>

namespace fielddeform::render {

/// Whether this build can draw (FIELDDEFORM_WITH_EMBREE). Without it render(), encodePng() and writePng() throw
/// std::runtime_error saying so.
bool available() noexcept;

/// Draws a picture by casting rays: soft key light, ambient occlusion, smooth shading. Needs no display.
/// The same bytes on any number of threads. Objects of any size and anywhere: coordinates are centred in double
/// precision before they become floats. No views, empty meshes and non-finite vertices give what can be drawn.
/// Memory: about 250 bytes a triangle of the largest view.
/// @throw std::invalid_argument as Picture::validate; Cancelled
Image render(const Picture& picture, Progress& progress);

}  // namespace fielddeform::render
