#include <tests/support/volume_cases.h>

#include <array>
#include <cmath>
#include <map>
#include <numbers>

namespace fielddeform::tests {
namespace {

map::Lattice latticeAround(const mesh::Mesh& mesh, std::array<int, 3> nodes) {
  map::Lattice lattice;
  lattice.box = map::fitBox(mesh.positions(), 0.02);
  for (std::size_t a = 0; a < 3; ++a) lattice.axis[a] = map::AxisBasis::bernstein(nodes[a]);
  return lattice;
}

/// A case without its pose: every node at rest and free.
VolumeCase atRest(std::string name, map::Lattice lattice, mesh::Mesh mesh, const std::vector<mesh::Mesh>& coarser, volume::Springs springs) {
  VolumeCase out{std::move(name), std::move(lattice), std::move(mesh), {}};
  volume::Problem& p = out.problem;
  p.map = std::make_shared<map::LatticeMap>(out.lattice);
  p.surface = volume::makeSurface(*p.map, out.mesh);
  for (const mesh::Mesh& m : coarser) p.coarser.push_back(volume::makeSurface(*p.map, m));
  p.energy = std::make_shared<volume::SpringNetwork>(out.lattice, springs);
  p.start.assign(out.lattice.nodeCount(), Vec3::Zero());
  return out;
}

/// Moves every node to move(i, j, k, rest) and pins those of the layers that pinned(i, j, k) says.
template <class Move, class Pinned>
void pose(VolumeCase& c, Move&& move, Pinned&& pinned) {
  const auto n = c.lattice.nodes();
  const auto rest = c.lattice.restNodes();
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i) {
        const Index at = c.lattice.index(i, j, k);
        c.problem.start[at] = Vec3(move(i, j, k, rest[at])) - rest[at];
        if (pinned(i, j, k)) c.problem.constraints.pinned.push_back(at);
      }
}

/// Bends the x axis of a box to an arc in the xy plane, its middle fixed.
void bend(VolumeCase& c, double degrees) {
  const Box box = [&] {
    Box b;
    for (const Vec3& p : c.lattice.restNodes()) b.extend(p);
    return b;
  }();
  const double angle = degrees * std::numbers::pi / 180, length = box.sizes().x(), radius = length / angle;
  const Vec3 middle = box.center();
  pose(
      c,
      [&](int, int, int, const Vec3& p) {
        const double t = (p.x() - middle.x()) / radius, r = radius - (p.y() - middle.y());
        return Vec3(middle.x() + r * std::sin(t), middle.y() + radius - r * std::cos(t), p.z());
      },
      [](int i, int, int) { return i == 0 || i == 4; });
}

std::vector<mesh::Mesh> torusLevels(int triangles) {
  std::vector<mesh::Mesh> out{makeTorus(3, 3)};
  for (int around = 8; around * around < triangles; around *= 2) out.push_back(makeTorus(around, around / 2));
  return out;
}
mesh::Mesh torusOf(int triangles) {
  const int around = static_cast<int>(std::lround(std::sqrt(triangles)));
  return makeTorus(around, around / 2);
}
/// Turned from lying around z to standing around y.
mesh::Mesh standing(mesh::Mesh torus) {
  for (Vec3& p : torus.mutablePositions()) p = Vec3(p.x(), -p.z(), p.y());
  return torus;
}
std::vector<mesh::Mesh> clubLevels(int rounds) {
  std::vector<mesh::Mesh> out;
  for (int r = 0; r < rounds; ++r) out.push_back(makeClub(r));
  return out;
}

}  // namespace

mesh::Mesh makeTorus(int around, int tube, double minor) {
  std::vector<Vec3> p;
  std::vector<Index> c;
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < tube; ++j) {
      const double a = 2 * std::numbers::pi * i / around, b = 2 * std::numbers::pi * j / tube, r = 1 + minor * std::cos(b);
      p.emplace_back(r * std::cos(a), r * std::sin(a), minor * std::sin(b));
    }
  const auto at = [&](int i, int j) { return static_cast<Index>((i % around) * tube + j % tube); };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < tube; ++j)
      c.insert(c.end(), {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)});
  return mesh::Mesh(std::move(p), std::move(c));
}

mesh::Mesh makeIcosphere(int rounds) {
  const double g = std::numbers::phi;
  std::vector<Vec3> p{{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0}, {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g}, {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
  for (Vec3& v : p) v.normalize();
  std::vector<Index> c{0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1, 8,
                       3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1};
  for (int r = 0; r < rounds; ++r) {
    std::map<std::pair<Index, Index>, Index> middle;
    const auto between = [&](Index a, Index b) {
      const auto [it, isNew] = middle.try_emplace({std::min(a, b), std::max(a, b)}, static_cast<Index>(p.size()));
      if (isNew) p.push_back((p[a] + p[b]).normalized());
      return it->second;
    };
    std::vector<Index> next;
    for (std::size_t t = 0; t < c.size(); t += 3) {
      const Index a = c[t], b = c[t + 1], d = c[t + 2], ab = between(a, b), bd = between(b, d), da = between(d, a);
      next.insert(next.end(), {a, ab, da, ab, b, bd, da, bd, d, ab, bd, da});
    }
    c = std::move(next);
  }
  return mesh::Mesh(std::move(p), std::move(c));
}

mesh::Mesh makeClub(int rounds) {
  mesh::Mesh out = makeIcosphere(rounds);
  for (Vec3& p : out.mutablePositions()) {
    const double thick = 0.45 + 0.15 * p.x();
    p = Vec3(2 * p.x(), thick * p.y(), thick * p.z());
  }
  return out;
}

VolumeCase torusCompression(int triangles, volume::Springs springs, double share) {
  const mesh::Mesh finest = standing(torusOf(triangles));
  std::vector<mesh::Mesh> levels;
  for (const mesh::Mesh& m : torusLevels(triangles)) levels.push_back(standing(m));
  VolumeCase c = atRest("torus compression", latticeAround(finest, {3, 3, 3}), finest, levels, springs);
  const double in = share * c.lattice.box.axes.col(2).norm();
  pose(
      c, [&](int, int, int k, const Vec3& p) { return Vec3(p + Vec3(0, 0, in * (1 - k))); }, [](int, int, int k) { return k != 1; });
  return c;
}

VolumeCase torusStretch(int triangles, volume::Springs springs) {
  const mesh::Mesh finest = torusOf(triangles);
  VolumeCase c = atRest("torus stretch", latticeAround(finest, {5, 2, 2}), finest, torusLevels(triangles), springs);
  const double out = 0.5 * c.lattice.box.axes.col(0).norm();
  pose(
      c, [&](int i, int, int, const Vec3& p) { return Vec3(p + Vec3(i < 2 ? -out : i > 2 ? out : 0, 0, 0)); },
      [](int i, int, int) { return i != 2; });
  return c;
}

VolumeCase clubCompression(int rounds, volume::Springs springs) {
  const mesh::Mesh finest = makeClub(rounds);
  VolumeCase c = atRest("club partial compression", latticeAround(finest, {5, 2, 2}), finest, clubLevels(rounds), springs);
  pose(
      c, [&](int i, int, int, const Vec3& p) { return i < 2 ? Vec3(p.x(), 0.5 * p.y(), 0.5 * p.z()) : p; },
      [](int i, int, int) { return i < 2; });
  return c;
}

VolumeCase clubBent(double degrees, int rounds, volume::Springs springs) {
  const mesh::Mesh finest = makeClub(rounds);
  VolumeCase c = atRest("club bent", latticeAround(finest, {5, 2, 2}), finest, clubLevels(rounds), springs);
  bend(c, degrees);
  return c;
}

VolumeCase bending(const std::string& name, const mesh::Mesh& mesh, double degrees, volume::Springs springs) {
  VolumeCase c = atRest(name, latticeAround(mesh, {5, 2, 2}), mesh, {}, springs);
  c.problem.coarser = volume::makeLevels(*c.problem.map, mesh, {.coarsest = 64});
  bend(c, degrees);
  return c;
}

}  // namespace fielddeform::tests
