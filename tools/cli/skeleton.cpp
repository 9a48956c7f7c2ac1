// fielddeform skeleton: a skeleton made from a mesh.
#include <fielddeform/field/vdb.h>
#include <fielddeform/mesh/io.h>
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
  skeleton::LodFitOptions lod;
  field::VdbReadOptions volume;
};

skeleton::Skeleton fit(SkeletonOptions& o, const mesh::Mesh& mesh, Terminal& terminal) {
  switch (o.kind) {
    case Kind::Axis: {
      if (o.count) o.spine.points = *o.count;
      return skeleton::fitSpine(mesh, o.spine).skeleton;
    }
    case Kind::Lod: {
      skeleton::LodFit lod = skeleton::fitLod(mesh, o.lod);
      if (!lod.message.empty()) terminal.note("fielddeform: " + lod.message);
      return std::move(lod.skeleton);
    }
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
  const mesh::Mesh mesh = field::isVdb(o.mesh) ? field::readVdbSurface(o.mesh, o.volume)
                                               : mesh::readMesh(o.mesh, read, nullptr, &terminal);
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
  command->add_option("MESH", options->mesh, "Mesh (PLY, OBJ, STL, OFF), or a volume (VDB), whose surface is taken")
      ->required()->type_name("");
  command->add_option("-o,--output", options->output, "Skeleton to write (JSON, or OBJ for a modeller)")
      ->required()->type_name("FILE")->check(endingIn({".json", ".obj"}));
  addWord(*command, "--kind", {"axis", "lod", "points"}, [options](std::size_t i) { options->kind = static_cast<Kind>(i); },
          "A spine through the mesh's slices (default), the mesh itself simplified, or points on it");
  addAxis(*command, "--axis", options->spine.axis, "axis: direction of the spine (default: auto, the longest extent)");
  command->add_flag_callback("--straight", [options] { options->spine.shape = skeleton::SpineShape::Straight; },
                             "axis: a straight spine through the centroid");
  command->add_option("--points", options->count, "axis, points: how many points (default: 33 and 64)")
      ->type_name("N")->check(within(1, 100000));
  command->add_option("--faces", options->lod.faces, "lod: at most this many faces (default: 500)")
      ->type_name("N")->check(within(4, 1e9));
  command->add_option("--seed", options->points.seed, "points: another choice of points (default: 0)")
      ->type_name("N")->check(within(0, 9007199254740992.0));
  command->add_option("--grid", options->volume.grid, "volume: the grid's name (default: the first of numbers)")->type_name("NAME");
  addNumber(*command, "--isovalue", options->volume.isovalue,
            "volume: where its surface is (default: 0 of a level set, 0.5 of a fog volume)");
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform skeleton scan.ply -o spine.json --kind axis");
  command->callback([&session, options] {
    if (options->kind == Kind::Axis && options->count && !(*options->count >= 2 && *options->count <= 1000))
      throw CLI::ValidationError(fmt::format("--points: {}, expected 2..1000 for --kind axis", *options->count));
    session.run = [options](Terminal& terminal) { return run(*options, terminal); };
  });
}

}  // namespace fielddeform::cli
