// The table of methods: a new one is a row here, a maker in classic_maps.cpp and a line in docs/methods.md.
#include <fielddeform/scene/detail/classic.h>
#include <fielddeform/scene/methods.h>

#include <array>

namespace fielddeform::scene {
namespace {

constexpr std::uint32_t bit(MethodOption option) { return 1u << static_cast<unsigned>(option); }
constexpr std::uint32_t kZone = bit(MethodOption::Falloff) | bit(MethodOption::Potential);

struct Row {
  MethodInfo info;
  detail::MakeClassic make;
};

constexpr std::array kTable{
    Row{{MethodKind::Gffd, "gffd", "scalar field of the skeleton", kZone | bit(MethodOption::Tracking)}, nullptr},
    Row{{MethodKind::Lattice, "lattice", "lattice fitted to the skeleton's points", bit(MethodOption::Nodes)},
        detail::makeFittedLattice},
    Row{{MethodKind::Axial, "axial", "closest frame on a spline", kZone}, detail::makeAxial},
    Row{{MethodKind::Wires, "wires", "wires with a density", bit(MethodOption::WireBlend)}, detail::makeWires},
    Row{{MethodKind::Barr, "barr", "the nearest bend, twist, taper or scale", 0}, detail::makeBarr},
    Row{{MethodKind::Lbs, "lbs", "linear-blend skinning", kZone}, detail::makeLinearSkin},
    Row{{MethodKind::Dqs, "dqs", "dual-quaternion skinning", kZone}, detail::makeDualQuaternionSkin},
    Row{{MethodKind::Casteljau, "casteljau", "a curve with handles", 0}, detail::makeCasteljau},
    Row{{MethodKind::Rbf, "rbf", "interpolated displacements", 0}, detail::makeRbf},
};

constexpr auto kInfos = [] {
  std::array<MethodInfo, kTable.size()> infos{};
  for (std::size_t i = 0; i < infos.size(); ++i) infos[i] = kTable[i].info;
  return infos;
}();

constexpr bool inOrder() {
  for (std::size_t i = 0; i < kInfos.size(); ++i)
    if (static_cast<std::size_t>(kInfos[i].kind) != i) return false;
  return true;
}
static_assert(inOrder(), "rows stand in the order of MethodKind");

}  // namespace

std::span<const MethodInfo> methods() noexcept { return kInfos; }
const MethodInfo& methodInfo(MethodKind kind) noexcept { return kInfos[static_cast<std::size_t>(kind)]; }
std::string_view toString(MethodKind kind) noexcept { return methodInfo(kind).word; }

std::optional<MethodKind> methodFromString(std::string_view word) noexcept {
  for (const MethodInfo& info : kInfos)
    if (info.word == word) return info.kind;
  return std::nullopt;
}

bool takes(MethodKind kind, MethodOption option) noexcept { return (methodInfo(kind).options & bit(option)) != 0; }

namespace detail {

MakeClassic makerOf(MethodKind kind) noexcept { return kTable[static_cast<std::size_t>(kind)].make; }

}  // namespace detail

}  // namespace fielddeform::scene
