#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/scene/mask.h>
#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace fielddeform::scene {
namespace {

[[noreturn]] void refuse(const std::string& name, const std::string& why) {
  throw std::invalid_argument(fmt::format("mask \"{}\": {}", name, why));
}

std::vector<double> fromAttribute(const std::string& name, const mesh::Mesh& mesh) {
  const mesh::Attribute* attribute = mesh.find(mesh::Element::Vertex, name);
  if (!attribute) refuse(name, "the mesh has no such vertex attribute");
  if (attribute->width != 1 || !attribute->indices.empty() || !attribute->listOffsets.empty())
    refuse(name, fmt::format("has {} numbers a vertex, must be one", attribute->width));
  std::vector<double> values(mesh.vertexCount());
  for (std::size_t v = 0; v < values.size(); ++v) {
    values[v] = attribute->get(v);
    if (!std::isfinite(values[v])) refuse(name, fmt::format("is {} at vertex {}, must be finite", values[v], v));
  }
  return values;
}

std::vector<double> fromFile(const std::filesystem::path& path, std::size_t count) {
  const std::string text = readTextFile(path);
  std::vector<double> values;
  std::uint64_t line = 1;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto fail = [&](const std::string& found, const std::string& expected) {
    throw IoError(path, {line, {}, {}}, fmt::format("number {}", values.size()), found, expected);
  };
  while (true) {
    for (; at != end && (*at == ' ' || *at == '\t' || *at == '\r' || *at == '\n' || *at == ','); ++at)
      if (*at == '\n') ++line;
    if (at == end) break;
    if (values.size() == count) fail("more numbers", fmt::format("one a vertex, {}", count));
    double value = 0;
    const auto [stop, error] = std::from_chars(at, end, value);
    if (error != std::errc() || !std::isfinite(value))
      fail(fmt::format("\"{}\"", std::string(at, std::min<std::ptrdiff_t>(end - at, 20))), "a finite number");
    values.push_back(value);
    at = stop;
  }
  if (values.size() != count) fail("the end of the file", fmt::format("{} numbers, one a vertex", count));
  return values;
}

}  // namespace

std::vector<double> readMask(const Mask& mask, const mesh::Mesh& mesh) {
  return mask.attribute.empty() ? fromFile(mask.file, mesh.vertexCount()) : fromAttribute(mask.attribute, mesh);
}

void applyMask(std::span<const double> mask, Points rest, std::span<Vec3> position, std::span<Status> status,
               std::span<float> residual) {
  parallelFor(mask.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      if (mask[v] == 1 || status[v] == Status::Invalid) continue;
      if (mask[v] == 0) {
        position[v] = rest[v];
        status[v] = Status::Fixed;
        if (!residual.empty()) residual[v] = 0;
      } else {
        position[v] = rest[v] + mask[v] * (position[v] - rest[v]);
      }
    }
  });
}

}  // namespace fielddeform::scene
