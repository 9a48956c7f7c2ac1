#include <fielddeform/core/parallel.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/mesh/normals.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <unordered_map>

namespace fielddeform::mesh {
namespace {

constexpr std::size_t kGrain = 1024;

/// A corner's contribution to the normal at its vertex, Max's weights. `unit` brings sides to about unit length.
Vec3 cornerNormal(const Vec3& at, const Vec3& next, const Vec3& previous, double unit) {
  const Vec3 a = (next - at) * unit, b = (previous - at) * unit;
  const double d = a.squaredNorm() * b.squaredNorm();
  const Vec3 n = a.cross(b);
  return d > 0 && n.allFinite() ? Vec3(n / d) : Vec3(Vec3::Zero());
}

/// Twice the area vector of a face's fan.
Vec3 faceVector(const Mesh& mesh, std::size_t f, Points x, double unit) {
  Vec3 sum = Vec3::Zero();
  mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
    sum += Vec3((x[j] - x[i]) * unit).cross(Vec3((x[k] - x[i]) * unit));
  });
  return sum;
}

struct CornerRing {
  Index vertex, next, previous;
};

/// The corners of faces, by corner index.
class Corners {
 public:
  explicit Corners(const Mesh& mesh) : mesh_(mesh) {
    if (mesh.allTriangles()) return;
    face_.resize(mesh.cornerCount());
    for (std::size_t f = 0; f < mesh.faceCount(); ++f)
      std::fill(face_.begin() + mesh.faceBegin(f), face_.begin() + mesh.faceBegin(f + 1), static_cast<Index>(f));
  }
  Index faceOf(Index corner) const { return face_.empty() ? corner / 3 : face_[corner]; }
  CornerRing ring(Index corner) const {
    const Index f = faceOf(corner), begin = mesh_.faceBegin(f), end = mesh_.faceBegin(f + 1);
    const auto& c = mesh_.corners();
    return {c[corner], c[corner + 1 < end ? corner + 1 : begin], c[corner > begin ? corner - 1 : end - 1]};
  }
  /// cornerNormal at a corner; a reflex corner of a polygon counts with its face's side.
  Vec3 normal(Index corner, Points x, double unit) const {
    const auto [v, next, previous] = ring(corner);
    const Vec3 n = cornerNormal(x[v], x[next], x[previous], unit);
    const Index f = faceOf(corner);
    return mesh_.face(f).size() > 3 && n.dot(faceVector(mesh_, f, x, unit)) < 0 ? Vec3(-n) : n;
  }
  Vec3 face(Index corner, Points x, double unit) const { return faceVector(mesh_, faceOf(corner), x, unit); }
  bool faceMoved(Index corner, Points rest, Points posed) const {
    for (const Index v : mesh_.face(faceOf(corner)))
      if (rest[v] != posed[v]) return true;
    return false;
  }

 private:
  const Mesh& mesh_;
  std::vector<Index> face_;
};

/// How the surface around some corners moved.
struct Turn {
  bool moved = false;
  Vec3 restNormal = Vec3::Zero(), posedNormal = Vec3::Zero();  ///< unit, or zero without area
  Quat tilt = Quat::Identity();                                ///< takes the first to the second
  double cosine = 1, sine = 0;                                 ///< of the spin about posedNormal after it

  Vec3 operator()(const Vec3& v) const {
    const Vec3 w = tilt * v;
    return cosine * w + sine * posedNormal.cross(w) + (1 - cosine) * posedNormal.dot(w) * posedNormal;
  }
};

/// Unit normal of a group of corners; zero without area.
Vec3 groupNormal(std::span<const Index> group, const Corners& corners, Points x, double unit) {
  Vec3 sum = Vec3::Zero();
  for (const Index c : group) sum += corners.normal(c, x, unit);
  if (sum.squaredNorm() == 0)  // corners on a straight side of their polygon
    for (const Index c : group) sum += corners.face(c, x, unit);
  const double length = sum.norm();
  return length > 0 && std::isfinite(length) ? Vec3(sum / length) : Vec3(Vec3::Zero());
}

Turn turnOf(std::span<const Index> group, const Corners& corners, Points rest, Points posed, double unit) {
  Turn turn;
  for (const Index c : group) turn.moved = turn.moved || corners.faceMoved(c, rest, posed);
  if (!turn.moved) return turn;
  turn.restNormal = groupNormal(group, corners, rest, unit);
  turn.posedNormal = groupNormal(group, corners, posed, unit);
  if (turn.restNormal.isZero(0) || turn.posedNormal.isZero(0)) {
    turn.moved = false;
    return turn;
  }
  turn.tilt = minimalRotation(turn.restNormal, turn.posedNormal);
  double along = 0, across = 0;
  for (const Index c : group) {
    const auto [v, next, previous] = corners.ring(c);
    for (const Index other : {next, previous}) {
      const Vec3 a = turn.tilt * Vec3((rest[other] - rest[v]) * unit), b = (posed[other] - posed[v]) * unit;
      const Vec3 flat = b - turn.posedNormal.dot(b) * turn.posedNormal;
      along += a.dot(flat), across += turn.posedNormal.dot(a.cross(flat));
    }
  }
  const double length = std::sqrt(along * along + across * across);
  if (length > 0 && std::isfinite(length)) turn.cosine = along / length, turn.sine = across / length;
  return turn;
}

/// The new normal, or the old one's bits if there is nothing to do. Returns whether it was changed.
bool renew(const Turn& turn, NormalUpdate update, Vec3& n) {
  const double length = n.norm();
  if (!turn.moved || !(length > 0) || !std::isfinite(length)) return false;
  if (update == NormalUpdate::Recompute) {
    n = turn.posedNormal * length;
  } else {
    const Vec3 turned = turn(n);
    n = turned * (length / turned.norm());
  }
  return true;
}

Vec3 read(const Attribute& a, std::size_t value) { return {a.get(value, 0), a.get(value, 1), a.get(value, 2)}; }
void write(Attribute& a, std::size_t value, const Vec3& n) {
  for (int k = 0; k < 3; ++k) a.set(value, k, n[k]);
}

/// Corners in the order of their keys; groups are runs of one key.
struct Groups {
  std::vector<Index> corners;
  std::vector<Index> first;  ///< #groups + 1

  Groups(const std::vector<std::uint64_t>& keys, std::uint64_t skip) : corners(sortedOrder(keys)) {
    std::size_t end = corners.size();
    while (end > 0 && keys[corners[end - 1]] == skip) --end;
    corners.resize(end);
    for (std::size_t i = 0; i < end; ++i)
      if (i == 0 || keys[corners[i]] != keys[corners[i - 1]]) first.push_back(static_cast<Index>(i));
    first.push_back(static_cast<Index>(end));
  }
  std::size_t size() const { return first.size() - 1; }
  std::span<const Index> operator[](std::size_t g) const {
    return {corners.data() + first[g], first[g + 1] - first[g]};
  }
};

constexpr std::uint64_t kNoKey = ~std::uint64_t{0};

void count(NormalReport& report, const std::vector<std::uint8_t>& changed) {
  const auto turned = static_cast<std::size_t>(std::count(changed.begin(), changed.end(), 1));
  report.turned += turned, report.kept += changed.size() - turned;
}

struct Work {
  const Mesh& mesh;
  const Corners& corners;
  Points rest, posed;
  NormalUpdate update;
  double unit;  ///< power of two that brings sides to about unit length

  Turn turn(std::span<const Index> group) const { return turnOf(group, corners, rest, posed, unit); }
};

/// One value an element; groups of corners share a value.
void updateDirect(const Work& work, Attribute& a, NormalReport& report) {
  std::vector<std::uint64_t> keys(work.mesh.cornerCount(), kNoKey);
  for (std::size_t c = 0; c < keys.size(); ++c)
    keys[c] = a.on == Element::Vertex ? work.mesh.corners()[c] : work.corners.faceOf(static_cast<Index>(c));
  const Groups groups(keys, kNoKey);
  std::vector<std::uint8_t> changed(groups.size(), 0);
  parallelFor(groups.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      const std::size_t value = keys[groups[g][0]];
      Vec3 n = read(a, value);
      changed[g] = renew(work.turn(groups[g]), work.update, n);
      if (changed[g]) write(a, value, n);
    }
  });
  count(report, changed);
}

/// Each corner owns its value; corners of one vertex with equal values turn together.
void updateCorners(const Work& work, Attribute& a, NormalReport& report) {
  std::vector<std::uint64_t> keys(work.mesh.corners().begin(), work.mesh.corners().end());
  Groups groups(keys, kNoKey);
  std::vector<std::uint8_t> changed(work.mesh.cornerCount(), 0);
  const auto less = [&](Index i, Index j) {
    for (int k = 0; k < 3; ++k)
      if (a.get(i, k) != a.get(j, k)) return a.get(i, k) < a.get(j, k);
    return i < j;
  };
  parallelFor(groups.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      std::vector<Index> around(groups[g].begin(), groups[g].end());
      std::erase_if(around, [&](Index c) { return !read(a, c).allFinite(); });  // would break the order below
      std::sort(around.begin(), around.end(), less);
      for (std::size_t i = 0, j = 0; i < around.size(); i = j) {
        Vec3 n = read(a, around[i]);
        for (j = i + 1; j < around.size() && read(a, around[j]) == n;) ++j;
        if (!renew(work.turn({around.data() + i, j - i}), work.update, n)) continue;
        for (std::size_t k = i; k < j; ++k) write(a, around[k], n), changed[around[k]] = 1;
      }
    }
  });
  count(report, changed);
}

/// A direction on a grid of 1e-6, 21 bits a coordinate: values of one cell stay shared.
std::uint64_t cellOf(const Vec3& n) {
  const Vec3 u = n / n.norm();
  std::uint64_t key = 0;
  for (int k = 0; k < 3; ++k) key = key << 21 | static_cast<std::uint64_t>(std::llround(u[k] * 1e6) + (1 << 20));
  return key;
}

/// Corners name their value. A group is the corners of one vertex that name the same.
void updateIndexed(const Work& work, Attribute& a, NormalReport& report) {
  std::vector<std::uint64_t> keys(work.mesh.cornerCount(), kNoKey);
  for (std::size_t c = 0; c < keys.size(); ++c)
    if (a.indices[c] != kNoIndex) keys[c] = std::uint64_t{a.indices[c]} << 32 | work.mesh.corners()[c];
  const Groups groups(keys, kNoKey);
  std::vector<std::uint8_t> changed(groups.size(), 0);
  std::vector<Vec3> normal(groups.size());
  parallelFor(groups.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      normal[g] = read(a, keys[groups[g][0]] >> 32);
      changed[g] = renew(work.turn(groups[g]), work.update, normal[g]);
    }
  });
  count(report, changed);
  // Groups come sorted by value, so the groups of one value are a run. An unmoved group keeps the value's place, else the
  // first group takes it; other directions get new values.
  const std::size_t oldCount = a.valueCount();
  std::vector<Vec3> added;
  std::unordered_map<std::uint64_t, Index> slots;
  for (std::size_t begin = 0, end = 0; begin < groups.size(); begin = end) {
    const auto value = static_cast<Index>(keys[groups[begin][0]] >> 32);
    std::size_t keeper = begin;
    for (end = begin; end < groups.size() && keys[groups[end][0]] >> 32 == value; ++end)
      if (!changed[end] && changed[keeper]) keeper = end;
    if (changed[keeper]) write(a, value, normal[keeper]);
    slots.clear();
    if (changed[keeper]) slots[cellOf(normal[keeper])] = value;
    for (std::size_t g = begin; g < end; ++g) {
      if (!changed[g]) continue;
      const auto [slot, fresh] = slots.try_emplace(cellOf(normal[g]), static_cast<Index>(oldCount + added.size()));
      if (fresh) added.push_back(normal[g]);
      for (const Index c : groups[g]) a.indices[c] = slot->second;
    }
  }
  std::visit([&](auto& data) { data.resize(3 * (oldCount + added.size())); }, a.data);
  for (std::size_t i = 0; i < added.size(); ++i) write(a, oldCount + i, added[i]);
  report.added += added.size();
}

double unitOf(Points positions) {
  const double size = objectSize(positions);
  return size > 0 && std::isfinite(size) ? std::ldexp(1.0, std::clamp(-std::ilogb(size), -1000, 1000)) : 1.0;
}

}  // namespace

NormalReport updateNormals(Mesh& mesh, Points rest, Points posed, NormalUpdate update) {
  for (const std::size_t n : {rest.size(), posed.size()})
    if (n != mesh.vertexCount()) throw std::invalid_argument(fmt::format("{} positions, expected {}", n, mesh.vertexCount()));
  NormalReport report;
  const auto isNormal = [](const Attribute& a) {
    return a.name == "normal" && a.width == 3 && a.listOffsets.empty() &&
           (a.type() == ScalarType::Float32 || a.type() == ScalarType::Float64);
  };
  if (std::none_of(mesh.attributes().begin(), mesh.attributes().end(), isNormal)) return report;
  const Corners corners(mesh);
  const Work work{mesh, corners, rest, posed, update, unitOf(rest)};
  for (Attribute& a : mesh.attributes()) {
    if (!isNormal(a)) continue;
    if (a.on != Element::Corner) updateDirect(work, a, report);
    else if (a.indices.empty()) updateCorners(work, a, report);
    else updateIndexed(work, a, report);
  }
  return report;
}

std::vector<Vec3> vertexNormals(const Mesh& mesh, Points positions) {
  if (positions.size() != mesh.vertexCount())
    throw std::invalid_argument(fmt::format("{} positions, expected {}", positions.size(), mesh.vertexCount()));
  const double unit = unitOf(positions);
  std::vector<Vec3> normals(mesh.vertexCount(), Vec3::Zero());
  const Corners corners(mesh);
  for (std::size_t c = 0; c < mesh.cornerCount(); ++c)
    normals[mesh.corners()[c]] += corners.normal(static_cast<Index>(c), positions, unit);
  for (Vec3& n : normals) {
    const double length = n.norm();
    n = length > 0 && std::isfinite(length) ? Vec3(n / length) : Vec3(Vec3::Zero());
  }
  return normals;
}

}  // namespace fielddeform::mesh
