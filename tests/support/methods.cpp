#include <fielddeform/core/angle.h>
#include <fielddeform/core/random.h>
#include <fielddeform/gffd/deform.h>
#include <fielddeform/map/axial.h>
#include <fielddeform/map/barr_fit.h>
#include <fielddeform/map/casteljau_skeleton.h>
#include <fielddeform/map/fitted_lattice.h>
#include <fielddeform/map/rbf_warp.h>
#include <fielddeform/map/skinning.h>
#include <fielddeform/map/wires.h>
#include <fielddeform/mesh/mesh.h>
#include <tests/support/cases.h>
#include <tests/support/methods.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace fielddeform::tests {
namespace {

using scene::MethodKind;
using skeleton::Edit;
using skeleton::Skeleton;

constexpr double kRadius = 0.7;  // about twice the distance from the line to the mesh, as the automatic radius

std::vector<Vec3> through(const map::SpaceMap& map, Points points) {
  std::vector<Vec3> out(points.size());
  Progress silent;
  map.apply(*map.bind(points), {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
  return out;
}

Skeleton lineSkeleton(int points, double length) {
  Skeleton s;
  skeleton::Primitive line;
  line.name = "spine";
  line.points = verticalLine(points, length);
  line.radius = kRadius;
  s.primitives.push_back(std::move(line));
  return s;
}

// A box of n x n squares a side, two triangles each: its shell, or every `step`-th plane of its grid.
skeleton::Primitive box(const Vec3& half, int n, double radius, int step) {
  skeleton::Primitive p;
  p.name = "box";
  p.type = skeleton::PrimitiveType::Mesh;
  p.closed = step == n;
  p.radius = radius;
  std::vector<int> number(static_cast<std::size_t>((n + 1) * (n + 1) * (n + 1)), -1);
  const auto at = [&](int i, int j, int k) {
    int& index = number[static_cast<std::size_t>((i * (n + 1) + j) * (n + 1) + k)];
    if (index < 0) {
      index = static_cast<int>(p.points.size());
      p.points.push_back(half.cwiseProduct(Vec3(2.0 * i / n - 1, 2.0 * j / n - 1, 2.0 * k / n - 1)));
    }
    return static_cast<Index>(index);
  };
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side <= n; side += step)
      for (int u = 0; u < n; ++u)
        for (int v = 0; v < n; ++v) {
          const auto corner = [&](int du, int dv) {
            std::array<int, 3> c{};
            c[static_cast<std::size_t>(axis)] = side;
            c[static_cast<std::size_t>((axis + 1) % 3)] = u + du;
            c[static_cast<std::size_t>((axis + 2) % 3)] = v + dv;
            return at(c[0], c[1], c[2]);
          };
          const Index a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
          if (side == n) p.faces.insert(p.faces.end(), {{a, b, c}, {a, c, d}});
          else p.faces.insert(p.faces.end(), {{a, c, b}, {a, d, c}});
        }
  return p;
}

Claim byEdit(std::string name, const mesh::Mesh& mesh, const Edit& edit, double length) {
  Claim c{std::move(name), "a line of 65 points", mesh, lineSkeleton(65, length), {}, {}};
  c.posed = skeleton::applyEdits(c.rest, std::vector<Edit>{edit});
  c.ideal = through(map::BarrMap(*map::barrEditOf(c.rest, edit)), mesh.positions());
  return c;
}

Claim alongAnS(const mesh::Mesh& mesh, double length) {
  Claim c{"axial, an S", "a line of 65 points", mesh, lineSkeleton(65, length), lineSkeleton(65, length), {}};
  for (Vec3& p : c.posed.primitives[0].points) p.x() += 0.25 * std::sin(2.2 * p.z());
  c.ideal = through(map::AxialMap(map::motionOf(skeleton::pairSkeletons(c.rest, c.posed), "axial")), mesh.positions());
  return c;
}

// Nodes inside go with the mean of their neighbours.
void followNeighbours(map::Lattice& lattice) {
  for (int round = 0; round < 200; ++round)
    for (int k = 1; k < 3; ++k)
      for (int j = 1; j < 3; ++j)
        for (int i = 1; i < 3; ++i) {
          Vec3 sum = Vec3::Zero();
          for (const auto& [a, b, c] : {std::array{i - 1, j, k}, {i + 1, j, k}, {i, j - 1, k}, {i, j + 1, k}, {i, j, k - 1}, {i, j, k + 1}})
            sum += lattice.displacements[lattice.index(a, b, c)];
          lattice.displacements[lattice.index(i, j, k)] = sum / 6;
        }
}

enum class Nodes : std::uint8_t { Bent, OuterAtRandom, AllAtRandom };

// The skeleton is the box's shell, or planes of its grid.
Claim byLattice(const mesh::Mesh& mesh, std::string name, Nodes nodes, bool planes) {
  const int n = planes ? 12 : 8, step = planes ? 3 : n;
  const double radius = planes ? 0.2 : 0.5;
  Claim c{std::move(name), planes ? "five planes each way of a box" : "the shell of a box", mesh, {}, {}, {}};
  map::Lattice lattice;
  lattice.box = map::fitBox(mesh.positions(), 0.1);
  lattice.axis = {map::AxisBasis::bernstein(4), map::AxisBasis::bernstein(4), map::AxisBasis::bernstein(4)};
  const std::vector<Vec3> rest = lattice.restNodes(), bent = bendMap(rest, kPi / 3, 2);
  for (std::size_t i = 0; i < lattice.nodeCount(); ++i)
    lattice.displacements.push_back(
        nodes == Nodes::Bent ? Vec3(bent[i] - rest[i]) :
        Vec3(0.25 * (2 * uniform01(3, 3 * i) - 1), 0.25 * (2 * uniform01(3, 3 * i + 1) - 1), 0.4 * (2 * uniform01(3, 3 * i + 2) - 1)));
  if (nodes == Nodes::OuterAtRandom) followNeighbours(lattice);
  const map::LatticeMap map(lattice);
  c.rest.primitives.push_back(box(0.5 * lattice.box.axes.diagonal(), n, radius, step));
  const Vec3 centre = lattice.box.origin + 0.5 * lattice.box.axes.diagonal();
  for (Vec3& p : c.rest.primitives[0].points) p += centre;
  c.posed = c.rest;
  c.posed.primitives[0].points = through(map, c.rest.primitives[0].points);
  c.ideal = through(map, mesh.positions());
  return c;
}

std::vector<Vec3> byField(const mesh::Mesh& mesh, const skeleton::SkeletonPair& pair) {
  const gffd::GffdMap map(gffd::resolve({.falloff = gffd::Falloff::Off}, mesh, pair));
  Progress silent;
  return gffd::deform(mesh, map, *map.bind(mesh.positions()), silent).position;
}

}  // namespace

std::vector<Vec3> deformBy(MethodKind method, const mesh::Mesh& mesh, const Skeleton& rest, const Skeleton& posed) {
  const skeleton::SkeletonPair pair = skeleton::pairSkeletons(rest, posed);
  const auto& points = mesh.positions();
  if (method == MethodKind::Gffd) return byField(mesh, pair);
  const map::SkeletonMotion motion = map::motionOf(pair, scene::toString(method));
  switch (method) {
    case MethodKind::Gffd: break;
    case MethodKind::Lattice: return through(map::LatticeMap(map::fitLattice(motion, points).lattice), points);
    case MethodKind::Axial: return through(map::AxialMap(motion), points);
    case MethodKind::Wires: return through(map::WireMap(motion), points);
    case MethodKind::Barr: return through(map::fitBarr(motion).map(), points);
    case MethodKind::Lbs: return through(map::SkinningMap(motion), points);
    case MethodKind::Dqs: return through(map::SkinningMap(motion, {.blend = map::SkinBlend::DualQuaternion}), points);
    case MethodKind::Casteljau: return through(*map::casteljauBy(motion), points);
    case MethodKind::Rbf: break;
  }
  const map::PointPairs pairs = map::pointPairs(motion, {.offset = 0.6, .rings = 2});
  return through(map::RbfWarp(pairs.rest, pairs.posed), points);
}

std::vector<Claim> claims(int around, int along) {
  const mesh::Mesh mesh = makeCapsule({.length = 1.6, .around = around, .along = along});
  const skeleton::Spine z{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()};
  const double length = 2.2;  // a little longer than the mesh
  const auto bend = [&](double degrees) { return Edit{"", skeleton::Bend{.spine = z, .angle = radiansFromDegrees(degrees), .about = Vec3(0, 1, 0)}}; };
  return {byEdit("Barr bend 90", mesh, bend(90), length),
          byEdit("Barr bend 180", mesh, bend(180), length),
          byEdit("Barr twist 180", mesh, {"", skeleton::Twist{z, kPi}}, length),
          byEdit("Barr taper 0.5", mesh, {"", skeleton::Taper{z, 0.5}}, length),
          byEdit("Barr stretch 1.5", mesh, {"", skeleton::Stretch{z, 1.5}}, length),
          alongAnS(mesh, length),
          byLattice(mesh, "FFD, bent nodes", Nodes::Bent, false),
          byLattice(mesh, "FFD, outer nodes", Nodes::OuterAtRandom, false),
          byLattice(mesh, "FFD, all, shell", Nodes::AllAtRandom, false),
          byLattice(mesh, "FFD, all, planes", Nodes::AllAtRandom, true)};
}

Misses missesOf(const Claim& claim, Points found) {
  Misses m;
  const double size = mesh::objectSize(claim.mesh.positions());
  for (std::size_t v = 0; v < found.size(); ++v) {
    const double miss = (found[v] - claim.ideal[v]).norm() / size;
    m.mean += miss / static_cast<double>(found.size());
    m.max = std::max(m.max, miss);
  }
  return m;
}

Claim candyWrapper(bool twoBones, int around, int along) {
  std::vector<Vec3> points;
  std::vector<Index> corners;
  for (int j = 0; j < along; ++j)
    for (int i = 0; i < around; ++i)
      points.emplace_back(0.25 * std::cos(2 * kPi * i / around), 0.25 * std::sin(2 * kPi * i / around), 2.0 * j / (along - 1) - 1);
  for (int j = 0; j + 1 < along; ++j)
    for (int i = 0; i < around; ++i) {
      const auto a = static_cast<Index>(j * around + i), b = static_cast<Index>(j * around + (i + 1) % around), n = static_cast<Index>(around);
      corners.insert(corners.end(), {a, b, b + n, a, b + n, a + n});
    }
  Claim c{twoBones ? "half a turn at one joint" : "half a turn over the length", "", mesh::Mesh(points, corners), {}, {}, {}};
  if (twoBones) {
    for (const bool upper : {false, true}) {
      skeleton::Primitive bone;
      bone.name = upper ? "upper" : "lower";
      bone.points = {Vec3(0, 0, upper ? 0 : -1), Vec3(0, 0, upper ? 1 : 0)};
      bone.radius = 0.5;
      c.rest.primitives.push_back(bone);
    }
    c.posed = c.rest;
    c.posed.primitives[1].roll = {kPi, kPi};
  } else {
    c.rest = lineSkeleton(65, 2);
    c.rest.primitives[0].radius = 0.5;
    c.posed = skeleton::applyEdits(c.rest, std::vector<Edit>{{"", skeleton::Twist{{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, kPi}}});
  }
  return c;
}

double waist(const Claim&, Points found) {
  double least = 1e300;
  for (const Vec3& p : found) least = std::min(least, p.head<2>().norm());
  return least / 0.25;
}

}  // namespace fielddeform::tests
