#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/core/status.h>
#include <fielddeform/render/image.h>
#include <fielddeform/scene/scene.h>

namespace fielddeform::scene::detail {

/// A mesh's vertices after the map and whatever came behind it. #V each.
struct Posed {
  std::vector<Vec3> position;
  std::vector<Status> status;
  std::vector<float> residual;
};

/// Updates normals and the wanted attributes, then writes the mesh as posed.
/// @param mesh  in: at rest; out: as it was written
/// @return what the file's format cannot hold, a phrase each
std::vector<std::string> writeOutput(mesh::Mesh& mesh, Posed posed, const Output& output,
                                     const std::filesystem::path& path, Progress& progress);

/// A picture of a mesh with its skeleton before and after.
/// @throw std::runtime_error if this build cannot draw
render::Image drawBeforeAfter(const mesh::Mesh& mesh, const std::vector<Vec3>& posed,
                              const skeleton::SkeletonPair& skeletons, Progress& progress);

/// File of frame k of n: "out_0007.ply" for "out.ply".
std::filesystem::path framePath(const std::filesystem::path& path, int k, int n);

}  // namespace fielddeform::scene::detail
