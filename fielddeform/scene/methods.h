#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

/// The methods that deform a mesh by a skeleton at rest and posed. A study swaps the method and nothing else.
namespace fielddeform::scene {

enum class MethodKind : std::uint8_t { Gffd, Lattice, Axial, Wires, Barr, Lbs, Dqs, Casteljau, Rbf };

/// Options that some methods take and others do not.
enum class MethodOption : std::uint8_t {
  Tracking,   ///< predictor, corrector, tolerance, guard, substeps: what works with the field's values
  Falloff,    ///< where the influence ends
  Potential,  ///< potential and sharpness
  Nodes,      ///< of the fitted lattice
  WireBlend,  ///< how several wires share a point
};

struct MethodInfo {
  MethodKind kind;
  std::string_view word;      ///< of the command line and of scene files
  std::string_view what;      ///< a few words for listings
  std::uint32_t options = 0;  ///< bit i: takes MethodOption i
};

/// All methods, in the order of MethodKind.
std::span<const MethodInfo> methods() noexcept;
const MethodInfo& methodInfo(MethodKind kind) noexcept;
std::string_view toString(MethodKind kind) noexcept;
std::optional<MethodKind> methodFromString(std::string_view word) noexcept;
bool takes(MethodKind kind, MethodOption option) noexcept;

}  // namespace fielddeform::scene
