// Runs a scene from file to file, which pulls in every layer: a missing header, symbol or dependency is noticed.
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/version.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/scene/run.h>

#include <cstdio>
#include <exception>

int main() try {
  using namespace fielddeform;
  writeTextFile("in.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
  scene::Scene scene;
  scene.inputs = {"in.obj"};
  scene.output.mesh = "out.obj";
  scene.rest = scene::AxisRest{};
  scene.edits = {{"", skeleton::Bend{.spine = {}, .angle = 1.0, .radius = {}, .about = {}}}};
  Progress progress;
  const scene::RunResult result = scene::run(scene, {}, progress);
  const mesh::Mesh mesh = mesh::readMesh("out.obj");
  std::printf("fielddeform %s: %zu vertices, %s\n", kVersion, mesh.vertexCount(), result.report.predictor.c_str());
  return mesh.vertexCount() == 4 && result.report.vertices == 4 ? 0 : 1;
} catch (const std::exception& problem) {
  std::fprintf(stderr, "consumer: %s\n", problem.what());
  return 1;
}
