#pragma once

#include <fielddeform/core/types.h>

#include <CLI/App.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// Option values that CLI11 does not know. Whatever does not parse is a usage error that names the option.
namespace fielddeform::cli {

/// Numbers between commas, all finite. @throw CLI::ConversionError
std::vector<double> parseNumbers(const std::string& option, const std::string& text, std::size_t count);

/// "X,Y,Z"
CLI::Option* addVec3(CLI::App& command, const std::string& name, std::optional<Vec3>& value, const std::string& help);
/// A direction: "auto" (none), "x", "y", "z" or "X,Y,Z".
CLI::Option* addAxis(CLI::App& command, const std::string& name, std::optional<Vec3>& axis, const std::string& help);
/// A finite number.
CLI::Option* addNumber(CLI::App& command, const std::string& name, std::optional<double>& value, const std::string& help);
CLI::Option* addNumber(CLI::App& command, const std::string& name, double& value, const std::string& help);
/// Degrees on the command line, radians in the program.
CLI::Option* addDegrees(CLI::App& command, const std::string& name, std::optional<double>& radians,
                        const std::string& help);
/// One of a set of words; index into them.
CLI::Option* addWord(CLI::App& command, const std::string& name, std::vector<std::string> words,
                     std::function<void(std::size_t)> set, const std::string& help);

/// Checks that say nothing in the help; the type's name does.
CLI::Validator oneOf(const std::vector<std::string>& words);
CLI::Validator within(double low, double high);
CLI::Validator positive();  ///< a finite number > 0
CLI::Validator direction();  ///< X,Y,Z, not all 0
/// A name that ends in one of these extensions; devices and pipes may have any.
CLI::Validator endingIn(std::vector<std::string> extensions);

/// Says what is wrong with the name of a file to be written; empty if its extension is one of these, or it is a device or
/// a pipe. Upper case is as good.
std::string extensionProblem(const std::filesystem::path& path, const std::vector<std::string>& extensions);

/// Pairs of points, a line each: X Y Z of the point and X Y Z of where it goes. Blank lines and lines that begin with #
/// are left out. @throw IoError naming the line
std::vector<std::pair<Vec3, Vec3>> readPairs(const std::filesystem::path& path);

/// "out/pic.png" for ("out/mesh.ply", "", ".png").
std::filesystem::path withSuffix(const std::filesystem::path& path, std::string_view suffix, std::string_view extension);

}  // namespace fielddeform::cli
