// fielddeform skeleton: a skeleton made from a mesh.
#include <fielddeform/core/error.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/mesh/lod.h>
#include <fielddeform/skeleton/fit.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

#include "command.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

enum class Kind { Axis, Lod, Points };

struct SkeletonOptions {
  std::string mesh, output;
  Kind kind = Kind::Axis;
  skeleton::SpineFitOptions spine;
  skeleton::PointFitOptions points;
  std::optional<std::size_t> count;
  std::size_t faces = 500;
};

// The object's own simplified model. Its radius reaches over three of its edges, so that neighbours blend.
skeleton::Skeleton fitLod(const mesh::Mesh& mesh, std::size_t faces, Terminal& terminal) {
  const mesh::Lod lod = mesh::simplify(mesh, faces);
  if (!lod.message.empty()) terminal.note("fielddeform: " + lod.message);
  skeleton::Primitive p;
  p.name = "lod";
  p.type = skeleton::PrimitiveType::Mesh;
  p.points = lod.mesh.positions();
  double length = 0;
  for (std::size_t f = 0; f < lod.mesh.faceCount(); ++f) {
    const auto c = lod.mesh.face(f);
    p.faces.emplace_back(c.begin(), c.end());
    for (std::size_t k = 0; k < c.size(); ++k) length += (p.points[c[(k + 1) % c.size()]] - p.points[c[k]]).norm();
  }
  if (p.faces.empty()) throw InfeasibleError("the mesh has no faces to simplify");
  p.closed = skeleton::boundsSolid(p.faces);
  skeleton::Skeleton skeleton{{p}, ""};
  const double reach = skeleton::kFitRadiusFactor * skeleton::greatestDistance(mesh.positions(), skeleton);
  skeleton.primitives[0].radius = std::max(reach, length / static_cast<double>(lod.mesh.cornerCount()) * 3);
  skeleton::validate(skeleton);
  return skeleton;
}

skeleton::Skeleton fit(SkeletonOptions& o, const mesh::Mesh& mesh, Terminal& terminal) {
  switch (o.kind) {
    case Kind::Axis: {
      if (o.count) o.spine.points = *o.count;
      return skeleton::fitSpine(mesh, o.spine).skeleton;
    }
    case Kind::Lod: return fitLod(mesh, o.faces, terminal);
    case Kind::Points: {
      if (o.count) o.points.points = *o.count;
      return skeleton::fitPoints(mesh, o.points);
    }
  }
  return {};
}

int run(SkeletonOptions& o, Terminal& terminal) {
  mesh::ReadOptions read;
  read.invalid = mesh::InvalidPoints::Keep;
  const mesh::Mesh mesh = mesh::readMesh(o.mesh, read, nullptr, &terminal);
  terminal.beginStage("skeleton");
  const skeleton::Skeleton skeleton = fit(o, mesh, terminal);
  skeleton::writeSkeleton(skeleton, o.output);
  for (const auto& p : skeleton.primitives)
    terminal.print(fmt::format("{}: {} \"{}\" of {} points{}{}", o.output, skeleton::toString(p.type), p.name, p.points.size(),
                               p.faces.empty() ? "" : fmt::format(" and {} faces", p.faces.size()),
                               p.radius ? fmt::format(", radius {:.6g}", *p.radius) : ""));
  return kDone;
}

}  // namespace

void addSkeleton(CLI::App& app, Session& session) {
  const auto options = optionsOf<SkeletonOptions>();
  auto* command = app.add_subcommand("skeleton", "Make a skeleton from a mesh");
  command->add_option("MESH", options->mesh, "Mesh (PLY, OBJ, STL, OFF)")->required()->type_name("");
  command->add_option("-o,--output", options->output, "Skeleton to write (JSON, or OBJ for a modeller)")
      ->required()->type_name("FILE")->check(endingIn({".json", ".obj"}));
  addWord(*command, "--kind", {"axis", "lod", "points"}, [options](std::size_t i) { options->kind = static_cast<Kind>(i); },
          "A spine through the mesh's slices (default), the mesh itself simplified, or points on it");
  addAxis(*command, "--axis", options->spine.axis, "axis: direction of the spine (default: auto, the longest extent)");
  command->add_flag_callback("--straight", [options] { options->spine.shape = skeleton::SpineShape::Straight; },
                             "axis: a straight spine through the centroid");
  command->add_option("--points", options->count, "axis, points: how many points (default: 33 and 64)")
      ->type_name("N")->check(within(1, 100000));
  command->add_option("--faces", options->faces, "lod: at most this many faces (default: 500)")
      ->type_name("N")->check(within(4, 1e9));
  command->add_option("--seed", options->points.seed, "points: another choice of points (default: 0)")
      ->type_name("N")->check(within(0, 9007199254740992.0));
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform skeleton scan.ply -o spine.json --kind axis");
  command->callback([&session, options] {
    if (options->kind == Kind::Axis && options->count && !(*options->count >= 2 && *options->count <= 1000))
      throw CLI::ValidationError(fmt::format("--points: {}, expected 2..1000 for --kind axis", *options->count));
    session.run = [options](Terminal& terminal) { return run(*options, terminal); };
  });
}

}  // namespace fielddeform::cli
