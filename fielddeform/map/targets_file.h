#pragma once

#include <fielddeform/map/direct_manipulation.h>

#include <filesystem>
#include <string_view>

namespace fielddeform::map {

/// Reads a text file of targets: a row each, numbers separated by commas (blanks around them are ignored),
///   x,y,z,tx,ty,tz            a point of space at rest and where it is to go
///   vertex,tx,ty,tz           the same for a vertex, counted from 0
/// each with an optional last column, the weight (> 0). All rows of a file are of one kind. One header line that names the
/// columns in this order may come first; empty lines and what follows a # are ignored.
/// @param vertices  #V by 3, world, at rest: what vertex numbers refer to
/// @throw IoError naming file, line, what was found and what was expected; also for a file without a row
std::vector<PointTarget> readTargets(const std::filesystem::path& path, Points vertices);
/// @param path  for messages
std::vector<PointTarget> parseTargets(std::string_view text, const std::filesystem::path& path, Points vertices);

/// Reads the points that may not move, rows of x,y,z or of one vertex number; the rest as above.
std::vector<Vec3> readPins(const std::filesystem::path& path, Points vertices);
std::vector<Vec3> parsePins(std::string_view text, const std::filesystem::path& path, Points vertices);

}  // namespace fielddeform::map
