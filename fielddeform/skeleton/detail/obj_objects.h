#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/skeleton/skeleton.h>

#include <filesystem>
#include <string>
#include <vector>

namespace fielddeform::skeleton::detail {

// One p, l or f statement.
struct ObjElement {
  char kind = 'p';
  std::uint64_t line = 0;
  std::vector<Index> vertices;  // 0-based, into the file's vertices
};

// What stands under one `o` statement.
struct ObjObject {
  std::string name;        // empty: what came before the first `o`
  std::uint64_t line = 0;
  Index firstVertex = 0;   // its own vertices: firstVertex .. vertexEnd-1
  Index vertexEnd = 0;
  std::vector<ObjElement> elements;
};

struct ObjFile {
  std::filesystem::path path;
  std::vector<Vec3> vertices;
  std::vector<ObjObject> objects;
};

ObjFile scanObj(std::string_view text, const std::filesystem::path& path);

// The primitives of one object: one, or one for each chain of its lines.
std::vector<Primitive> buildPrimitives(const ObjFile& file, const ObjObject& object);

}  // namespace fielddeform::skeleton::detail
