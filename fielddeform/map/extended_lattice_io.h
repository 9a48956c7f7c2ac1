#pragma once

#include <fielddeform/map/extended_lattice.h>

#include <filesystem>
#include <string>
#include <variant>

namespace fielddeform {
class JsonValue;
class JsonWriter;
}  // namespace fielddeform

/// Files of extended lattices: JSON ("fielddeform-extended-lattice"). They list nodes and cells, or name the boxes and tubes that the
/// lattice is put together from; docs/lattice.md has every key and rule. Every bit is kept.
namespace fielddeform::map {

/// @throw IoError with line and place: unreadable, malformed, not finite, out of range, unknown key, a cell turned inside out, moves
///        that no smooth lattice has
ExtendedLattice readExtendedLattice(const std::filesystem::path& path);
/// The same from memory. @param path only named in errors
ExtendedLattice parseExtendedLattice(std::string text, const std::filesystem::path& path);

/// Writes nodes, cells and displacements, atomically. @throw std::invalid_argument, IoError
void writeExtendedLattice(const ExtendedLattice& lattice, const std::filesystem::path& path);
std::string formatExtendedLattice(const ExtendedLattice& lattice);

/// An extended lattice as a JSON object without "format" and "version", as it stands in scenes.
ExtendedLattice extendedLatticeFromJson(const JsonValue& object);
/// The members of such an object, into one that is open.
void extendedLatticeToJson(const ExtendedLattice& lattice, JsonWriter& json);
/// Whether an object is an extended lattice, by its keys.
bool isExtendedLattice(const JsonValue& object);

/// A lattice of either kind, told by the file's "format". @throw IoError
std::variant<Lattice, ExtendedLattice> readAnyLattice(const std::filesystem::path& path);

}  // namespace fielddeform::map
