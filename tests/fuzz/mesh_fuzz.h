#pragma once

#include <fielddeform/core/error.h>
#include <fielddeform/mesh/io.h>

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <stdexcept>

#include "require.h"

/// What must hold for any bytes that a mesh reader is given.
namespace fielddeform::mesh {

/// Reads; if that succeeds, writes in every format, and the own format must come back as it was written.
inline int fuzzMesh(const std::uint8_t* data, std::size_t size, const char* name) {
  if (size == 0) return 0;
  const bool weld = data[size - 1] & 1;
  try {
    const std::span<const char> bytes(reinterpret_cast<const char*>(data), size);
    ReadReport report;
    const Mesh mesh = readMesh(bytes, name, {InvalidPoints::Keep, weld ? Weld::Exact : Weld::None}, &report);
    std::size_t invalid = 0;
    for (const Vec3& p : mesh.positions()) invalid += !p.allFinite();
    require(weld || report.invalidPoints == invalid, "invalid points are counted");
    for (const Format other : {Format::Ply, Format::Obj, Format::Stl, Format::Off}) try {
        (void)meshBytes(mesh, other);
      } catch (const std::invalid_argument&) {  // no floats for STL
      }
    const Format own = *formatOf(mesh);
    const std::string once = meshBytes(mesh, own);
    const Mesh again = readMesh(once, name, {InvalidPoints::Keep, Weld::None});
    require(again.faceCount() == mesh.faceCount(), "as many faces come back");
    require(own == Format::Stl || again.corners() == mesh.corners(), "the same corners come back");
    require(own == Format::Stl || again.vertexCount() == mesh.vertexCount(), "as many vertices come back");
    require(meshBytes(again, own) == once, "writing again gives the same bytes");
    Mesh copy = mesh;
    std::vector<Index> parents(mesh.faceCount());
    std::iota(parents.begin(), parents.end(), Index{0});
    copy.setLayout(mesh.layout()->refined(parents, mesh.vertexCount()));
    require(meshBytes(copy, own) == once, "a refinement that changes nothing changes nothing");
  } catch (const IoError&) {
  }
  return 0;
}

}  // namespace fielddeform::mesh
