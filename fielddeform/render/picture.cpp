#include <fielddeform/core/error.h>
#include <fielddeform/render/picture.h>
#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace fielddeform::render {
namespace {

void requireColor(const char* name, const Color& c) {
  for (const float channel : {c.r, c.g, c.b}) requireInRange(name, channel, 0, 1);
}

void requireDirection(const char* name, const std::optional<Vec3>& v) {
  if (v && !(v->allFinite() && v->cwiseAbs().maxCoeff() > 0)) {
    throw std::invalid_argument(
        fmt::format("{}: is ({}, {}, {}), expected a finite vector other than zero", name, v->x(), v->y(), v->z()));
  }
}

void validateBody(const Body& body) {
  if (!body.mesh) throw std::invalid_argument("body.mesh: is null, expected a mesh");
  const std::size_t vertices = body.mesh->vertexCount(), faces = body.mesh->faceCount();
  if (!body.positions.empty() && body.positions.size() != vertices) {
    throw std::invalid_argument(
        fmt::format("body.positions: {} points, expected none or the mesh's {}", body.positions.size(), vertices));
  }
  if (!body.scalars.empty() && body.scalars.size() != vertices && body.scalars.size() != faces) {
    throw std::invalid_argument(fmt::format("body.scalars: {} numbers, expected one a vertex ({}) or a face ({})",
                                            body.scalars.size(), vertices, faces));
  }
  if (body.color) requireColor("body.color", *body.color);
  requireInRange("body.creaseAngle", body.creaseAngle, 0, std::numbers::pi);
  requireInRange("body.edgeWidth", body.edgeWidth, 0, 1000);
}

void validateOverlay(const Overlay& overlay) {
  skeleton::validate(overlay.skeleton);
  requireColor("overlay.color", overlay.color);
  requirePositive("overlay.thickness", overlay.thickness);
  requireInRange("overlay.hidden", overlay.hidden, 0, 1);
}

void validateCamera(const Camera& camera) {
  requireDirection("camera.direction", camera.direction);
  requireDirection("camera.up", camera.up);
  if (camera.azimuth) requireFinite("camera.azimuth", *camera.azimuth);
  if (camera.elevation) requireFinite("camera.elevation", *camera.elevation);
  requireInRange("camera.zoom", camera.zoom, 1e-3, 1e3);
  requireInRange("camera.fieldOfView", camera.fieldOfView, 1e-3, 3);
}

}  // namespace

void Picture::validate() const {
  requireInRange("picture.width", width, 16, 16384);
  if (height) requireInRange("picture.height", *height, 16, 16384);
  if (columns) requireInRange("picture.columns", *columns, 1, 1e6);
  requireColor("picture.background", background);
  validateCamera(camera);
  if (scalars.low) requireFinite("scalars.low", *scalars.low);
  if (scalars.high) requireFinite("scalars.high", *scalars.high);
  if (scalars.low && scalars.high && !(*scalars.low <= *scalars.high)) {
    throw std::invalid_argument(
        fmt::format("scalars.low: is {}, expected at most scalars.high ({})", *scalars.low, *scalars.high));
  }
  requireInRange("quality.samples", quality.samples, 1, 64);
  requireInRange("quality.ambient", quality.ambient, 0, 256);
  requireInRange("quality.shadows", quality.shadows, 0, 64);
  for (const View& view : views) {
    for (const Body& body : view.bodies) validateBody(body);
    for (const Overlay& overlay : view.overlays) validateOverlay(overlay);
  }
}

}  // namespace fielddeform::render
