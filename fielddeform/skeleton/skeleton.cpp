#include <fielddeform/core/error.h>
#include <fielddeform/skeleton/skeleton.h>
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <set>
#include <stdexcept>
#include <unordered_map>

namespace fielddeform::skeleton {
namespace {

constexpr std::array<std::string_view, 3> kTypeNames = {"points", "polyline", "mesh"};
constexpr std::array<std::string_view, 4> kPotentialNames = {"exponential", "gaussian", "metaball", "soft-object"};
constexpr std::array<std::string_view, 4> kPairNames = {"matched", "replaced", "removed", "added"};

[[noreturn]] void refuse(const Primitive& p, const std::string& what) {
  throw std::invalid_argument(fmt::format("skeleton primitive \"{}\": {}", p.name, what));
}

void checkPoints(const Primitive& p) {
  const std::size_t least = leastPoints(p.type, p.closed);
  if (p.points.size() < least)
    refuse(p, fmt::format("{} points, a {}{} needs at least {}", p.points.size(), p.closed ? "closed " : "",
                          toString(p.type), least));
  if (p.points.size() >= kNoIndex) refuse(p, fmt::format("{} points are too many", p.points.size()));
  for (std::size_t i = 0; i < p.points.size(); ++i)
    if (!p.points[i].allFinite())
      refuse(p, fmt::format("point {} is ({}, {}, {}), must be finite", i, p.points[i].x(), p.points[i].y(),
                            p.points[i].z()));
  if (p.closed && p.type == PrimitiveType::Points) refuse(p, "closed, but only polylines and meshes can be");
}

void checkFaces(const Primitive& p) {
  if (p.type != PrimitiveType::Mesh) {
    if (!p.faces.empty()) refuse(p, fmt::format("{} faces, but only a mesh has faces", p.faces.size()));
    return;
  }
  if (p.faces.empty()) refuse(p, "no faces, a mesh needs at least 1");
  for (std::size_t f = 0; f < p.faces.size(); ++f) {
    if (p.faces[f].size() < 3) refuse(p, fmt::format("face {} has {} corners, needs at least 3", f, p.faces[f].size()));
    for (const Index i : p.faces[f])
      if (i >= p.points.size())
        refuse(p, fmt::format("face {} uses point {}, the last one is {}", f, i, p.points.size() - 1));
  }
}

void checkValues(const Primitive& p) {
  const auto positive = [](double x) { return std::isfinite(x) && x > 0; };
  if (p.radius && !positive(*p.radius)) refuse(p, fmt::format("radius is {}, must be finite and > 0", *p.radius));
  if (!p.pointRadius.empty() && p.pointRadius.size() != p.points.size())
    refuse(p, fmt::format("{} point radii for {} points", p.pointRadius.size(), p.points.size()));
  for (std::size_t i = 0; i < p.pointRadius.size(); ++i)
    if (!positive(p.pointRadius[i]))
      refuse(p, fmt::format("radius of point {} is {}, must be finite and > 0", i, p.pointRadius[i]));
  if (!p.roll.empty() && p.type != PrimitiveType::Polyline) refuse(p, "roll, but only polylines have roll");
  if (!p.roll.empty() && p.roll.size() != p.points.size())
    refuse(p, fmt::format("{} roll angles for {} points", p.roll.size(), p.points.size()));
  for (std::size_t i = 0; i < p.roll.size(); ++i)
    if (!std::isfinite(p.roll[i])) refuse(p, fmt::format("roll of point {} is {}, must be finite", i, p.roll[i]));
  if (!std::isfinite(p.weight) || !(p.weight >= 0))
    refuse(p, fmt::format("weight is {}, must be finite and >= 0", p.weight));
  if (!p.rotation) return;
  if (p.type != PrimitiveType::Points) refuse(p, "rotation, but only point sets have one");
  const double norm = p.rotation->norm();
  // Readers normalise; what is further from unit length was meant otherwise.
  if (!(std::abs(norm - 1) <= 1e-9)) refuse(p, fmt::format("rotation has length {}, must be a unit quaternion", norm));
}

using NameIndex = std::unordered_map<std::string_view, Index>;

NameIndex indexByName(const Skeleton& skeleton) {
  NameIndex index;
  for (Index i = 0; i < skeleton.primitives.size(); ++i) index.emplace(skeleton.primitives[i].name, i);
  return index;
}

Index explicitIndex(const NameIndex& index, const std::string& name, const char* side) {
  const auto found = index.find(name);
  if (found == index.end())
    throw std::invalid_argument(fmt::format("pairs: the {} skeleton has no primitive \"{}\"", side, name));
  return found->second;
}

PairKind kindOf(const Primitive& rest, const Primitive& posed) {
  // Faces may be listed in another order (modellers do that on export): the vertices alone decide.
  const bool same = rest.type == posed.type && rest.points.size() == posed.points.size();
  return same ? PairKind::Matched : PairKind::Replaced;
}

}  // namespace

const Primitive* Skeleton::find(std::string_view name) const noexcept {
  for (const Primitive& p : primitives)
    if (p.name == name) return &p;
  return nullptr;
}

std::size_t leastPoints(PrimitiveType type, bool closed) noexcept {
  if (type == PrimitiveType::Points) return 1;
  return type == PrimitiveType::Polyline && !closed ? 2 : 3;
}

SkeletonPair pairSkeletons(Skeleton rest, Skeleton posed, std::span<const NamedPair> explicitPairs) {
  const NameIndex restIndex = indexByName(rest), posedIndex = indexByName(posed);
  std::vector<Index> partner(rest.primitives.size(), kNoIndex);
  std::vector<bool> taken(posed.primitives.size(), false);
  for (const NamedPair& pair : explicitPairs) {
    const Index r = explicitIndex(restIndex, pair.rest, "rest");
    const Index p = explicitIndex(posedIndex, pair.posed, "posed");
    if (partner[r] != kNoIndex) throw std::invalid_argument(fmt::format("pairs: rest \"{}\" is used twice", pair.rest));
    if (taken[p]) throw std::invalid_argument(fmt::format("pairs: posed \"{}\" is used twice", pair.posed));
    partner[r] = p;
    taken[p] = true;
  }
  SkeletonPair result;
  for (Index r = 0; r < rest.primitives.size(); ++r) {
    if (partner[r] == kNoIndex) {
      const auto found = posedIndex.find(rest.primitives[r].name);
      if (found != posedIndex.end() && !taken[found->second]) {
        partner[r] = found->second;
        taken[found->second] = true;
      }
    }
    const Index p = partner[r];
    result.pairs.push_back(
        {p == kNoIndex ? PairKind::Removed : kindOf(rest.primitives[r], posed.primitives[p]), r, p});
  }
  for (Index p = 0; p < posed.primitives.size(); ++p)
    if (!taken[p]) result.pairs.push_back({PairKind::Added, kNoIndex, p});
  result.rest = std::move(rest);
  result.posed = std::move(posed);
  return result;
}

void validate(const Skeleton& skeleton) {
  if (skeleton.primitives.empty()) throw std::invalid_argument("skeleton: no primitives, needs at least 1");
  std::set<std::string_view> names;
  for (std::size_t i = 0; i < skeleton.primitives.size(); ++i) {
    const Primitive& p = skeleton.primitives[i];
    if (p.name.empty()) throw std::invalid_argument(fmt::format("skeleton: primitive {} has no name", i));
    if (!names.insert(p.name).second) refuse(p, "the name is used twice");
    checkPoints(p);
    checkFaces(p);
    checkValues(p);
  }
}

std::string_view toString(PrimitiveType type) noexcept { return kTypeNames[static_cast<std::size_t>(type)]; }
std::string_view toString(Potential potential) noexcept { return kPotentialNames[static_cast<std::size_t>(potential)]; }
std::string_view toString(PairKind kind) noexcept { return kPairNames[static_cast<std::size_t>(kind)]; }

std::optional<Potential> potentialFromString(std::string_view word) noexcept {
  for (std::size_t i = 0; i < kPotentialNames.size(); ++i)
    if (kPotentialNames[i] == word) return static_cast<Potential>(i);
  return std::nullopt;
}

}  // namespace fielddeform::skeleton
