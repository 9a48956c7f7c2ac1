#pragma once

#include <fielddeform/resample/refine.h>
#include <fielddeform/scene/detail/output.h>
#include <fielddeform/scene/report.h>
#include <fielddeform/scene/scene.h>

#include <memory>

namespace fielddeform::scene::detail {

/// One way of deforming one mesh: what a run needs of it, so that resampling, masks, frames, checks, reports and files serve
/// every method unchanged. Called in the order of the members; `mesh` is always at rest.
class Method {
 public:
  virtual ~Method() = default;

  /// The falloff's share at every vertex of the mesh that was tracked last (refined, if it was); empty if there is none.
  virtual std::vector<double> falloffWeights(const mesh::Mesh&) { return {}; }
  /// The field's residual of vertices that were moved after tracking; nothing for methods without a field.
  /// @param residual  #V, in: as tracked
  virtual void updateResiduals(const mesh::Mesh&, Points /*tracked*/, Points /*moved*/, std::span<float> /*residual*/) {}

  /// The stage's name of prepare(): "skeleton", "lattice".
  virtual std::string_view preparation() const noexcept = 0;
  /// Reads and fits what deforms the mesh.
  virtual void prepare(const mesh::Mesh& mesh) = 0;
  /// Makes the choices that look at the mesh, and binds it.
  virtual void bind(const mesh::Mesh& mesh) = 0;
  /// Binds another mesh in place of the bound one; the choices stay.
  virtual void rebind(const mesh::Mesh& mesh) = 0;
  /// #V: the share of each vertex that nodes carry which were moved; empty for methods without nodes.
  virtual std::vector<float> affected() const { return {}; }
  /// Deforms the bound mesh; forgets its binding.
  virtual Posed track(const mesh::Mesh& mesh, std::vector<std::string>& warnings, Progress& progress) = 0;
  /// Refines the mesh under the map.
  /// @param tracked  what track() gave
  /// @param edges    of the mesh
  virtual resample::Refined refine(mesh::Mesh mesh, mesh::EdgeTable edges, Posed tracked, const resample::Options& options,
                                   std::vector<std::string>& warnings, Progress& progress) = 0;
  /// The method's own entries of the report.
  virtual void describe(Report& report) const = 0;
  /// Puts every choice into the scene, so that it runs to the same bytes.
  virtual void resolve(Scene& scene) const = 0;
  virtual bool radiusWasAutomatic() const noexcept { return false; }
  /// What a picture shows beside the mesh; empty for nothing.
  virtual skeleton::SkeletonPair overlay() const { return {}; }
  /// The mesh at time t between input (0) and result (1), with the choices made for the result.
  virtual Posed poseAt(const mesh::Mesh& mesh, double t, Progress& progress) = 0;
};

/// @param scene  outlives the method
std::unique_ptr<Method> makeMethod(const Scene& scene);
std::unique_ptr<Method> makeGffdMethod(const Scene& scene);
std::unique_ptr<Method> makeLatticeMethod(const Scene& scene);
std::unique_ptr<Method> makeClassicMethod(const Scene& scene);

}  // namespace fielddeform::scene::detail
