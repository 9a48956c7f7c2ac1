#pragma once

#include <fielddeform/solid/solve.h>

#include <filesystem>
#include <string>

/// Files of objects ("fielddeform-solids", JSON), with what is to become of them: docs/solids.md has every key.
namespace fielddeform::solid {

struct ConstraintSpec {
  enum class Kind : std::uint8_t { Fix, Attach, Difference, FixSide } kind = Kind::Fix;
  PointRef a, b;                 ///< Fix: a
  FaceRef side;                  ///< FixSide
  std::optional<Vec3> value{};   ///< Fix: where to, Difference: b - a; none: as after the moves
};
struct MoveSpec {
  PointRef point;                ///< a control point
  Vec3 by = Vec3::Zero();
};
/// A solid's target.
struct SizeSpec {
  enum class Kind : std::uint8_t { Keep, Free, Factor, Value } kind = Kind::Keep;
  double number = 1;             ///< of the rest's size, or cubic units
};

struct SolidFile {
  Object object;
  std::vector<MoveSpec> moves;
  std::vector<ConstraintSpec> constraints;
  std::vector<SizeSpec> sizes;   ///< a solid
  Objective objective;
  Problem::Inner inner = Problem::Inner::Free;
};

/// The problem that a file poses: wanted = rest + moves.
/// @throw std::invalid_argument
Problem problemOf(const SolidFile& file);

/// @throw IoError with line and element: unreadable, malformed, out of range, unknown key
SolidFile readSolids(const std::filesystem::path& path);
/// The same from memory. @param path only named in errors
SolidFile parseSolids(std::string text, const std::filesystem::path& path);
/// Keeps every bit. @throw std::invalid_argument if the object is not valid; IoError if it cannot be written
void writeSolids(const SolidFile& file, const std::filesystem::path& path);
std::string formatSolids(const SolidFile& file);

/// "body.u0" @throw std::invalid_argument
FaceRef parseFace(const Object& object, std::string_view text);

}  // namespace fielddeform::solid
