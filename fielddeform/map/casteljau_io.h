#pragma once

#include <fielddeform/map/casteljau.h>

#include <filesystem>
#include <string>
#include <variant>

/// Files of curves with handles ("fielddeform-casteljau", JSON): docs/casteljau.md has every key.
namespace fielddeform::map {

struct CasteljauFile {
  CasteljauCurve curve;
  std::variant<FrameAxis, LatticeBox> frame = FrameAxis::Auto;  ///< fitted to each object, or given
  Outside outside = Outside::Extend;

  bool operator==(const CasteljauFile& other) const;
};

/// @throw IoError with line and element: unreadable, malformed, out of range, unknown key
CasteljauFile readCasteljau(const std::filesystem::path& path);
/// The same from memory. @param path only named in errors
CasteljauFile parseCasteljau(std::string text, const std::filesystem::path& path);

/// Keeps every bit. @throw std::invalid_argument if the curve is not valid; IoError if it cannot be written
void writeCasteljau(const CasteljauFile& file, const std::filesystem::path& path);
std::string formatCasteljau(const CasteljauFile& file);

}  // namespace fielddeform::map
