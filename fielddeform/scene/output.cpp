#include <fielddeform/mesh/normals.h>
#include <fielddeform/render/render.h>
#include <fielddeform/scene/detail/output.h>
#include <fmt/format.h>

namespace fielddeform::scene::detail {
namespace {

// Whether an attribute is one of ours from an earlier run; PLY splits a vector into NAME_0, NAME_1, ...
bool isEarlier(const mesh::Attribute& attribute, std::string_view name, int width) {
  if (attribute.on != mesh::Element::Vertex) return false;
  if (attribute.name == name) return true;
  for (int c = 0; c < width && width > 1; ++c)
    if (attribute.name == fmt::format("{}_{}", name, c)) return true;
  return false;
}

// Fills a vertex attribute; one of that name gives way.
template <class Value>
void putAttribute(mesh::Mesh& mesh, std::string_view name, mesh::ScalarType type, int width, Value&& value) {
  std::erase_if(mesh.attributes(), [&](const mesh::Attribute& a) { return isEarlier(a, name, width); });
  mesh::Attribute attribute;
  attribute.name = name;
  attribute.width = width;
  if (type == mesh::ScalarType::UInt8) attribute.onSplit = mesh::Interpolation::Nearest;
  attribute.data = mesh::makeData(type, mesh.vertexCount() * static_cast<std::size_t>(width));
  for (std::size_t v = 0; v < mesh.vertexCount(); ++v)
    for (int c = 0; c < width; ++c) attribute.set(v, c, value(v, c));
  mesh.attributes().push_back(std::move(attribute));
}

void putAttributes(mesh::Mesh& mesh, const Posed& posed, const Output& output) {
  using mesh::ScalarType;
  if (output.statusAttribute)
    putAttribute(mesh, "status", ScalarType::UInt8, 1,
                 [&](std::size_t v, int) { return static_cast<double>(posed.status[v]); });
  if (output.residualAttribute)
    putAttribute(mesh, "residual", ScalarType::Float32, 1,
                 [&](std::size_t v, int) { return static_cast<double>(posed.residual[v]); });
  if (output.displacementAttribute)
    putAttribute(mesh, "displacement", ScalarType::Float32, 3, [&](std::size_t v, int c) {
      // Invalid vertices have no displacement; NaN would not survive every format.
      return posed.status[v] == Status::Invalid ? 0.0 : posed.position[v][c] - mesh.positions()[v][c];
    });
}

}  // namespace

std::vector<std::string> writeOutput(mesh::Mesh& mesh, Posed posed, const Output& output,
                                     const std::filesystem::path& path, Progress& progress) {
  if (output.normals != Normals::Keep)
    mesh::updateNormals(mesh, mesh.positions(), posed.position,
                        output.normals == Normals::Turn ? mesh::NormalUpdate::Turn : mesh::NormalUpdate::Recompute);
  putAttributes(mesh, posed, output);
  mesh.setPositions(std::move(posed.position));
  posed = {};
  mesh::WriteOptions options;
  options.precision = output.precision;
  return mesh::writeMesh(mesh, path, options, &progress).dropped;
}

render::Image drawBeforeAfter(const mesh::Mesh& mesh, const std::vector<Vec3>& posed,
                              const skeleton::SkeletonPair& skeletons, Progress& progress) {
  // Not owned: the picture is drawn before this function ends.
  const std::shared_ptr<const mesh::Mesh> shared(&mesh, [](const mesh::Mesh*) {});
  const auto view = [&](std::vector<Vec3> positions, const skeleton::Skeleton& skeleton, std::string label) {
    render::View v;
    render::Body body;
    body.mesh = shared;
    body.positions = std::move(positions);
    v.bodies.push_back(std::move(body));
    if (!skeleton.primitives.empty()) {
      render::Overlay overlay;
      overlay.skeleton = skeleton;
      v.overlays.push_back(std::move(overlay));
    }
    v.label = std::move(label);
    return v;
  };
  render::Picture picture;
  picture.views.push_back(view({}, skeletons.rest, "before"));
  picture.views.push_back(view(posed, skeletons.posed, "after"));
  return render::render(picture, progress);
}

std::filesystem::path framePath(const std::filesystem::path& path, int k, int n) {
  const int digits = std::max<int>(4, static_cast<int>(fmt::formatted_size("{}", n - 1)));
  return path.parent_path() / fmt::format("{}_{:0{}}{}", path.stem().string(), k, digits, path.extension().string());
}

}  // namespace fielddeform::scene::detail
