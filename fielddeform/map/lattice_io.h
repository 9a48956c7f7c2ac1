#pragma once

#include <fielddeform/map/lattice.h>

#include <filesystem>
#include <string>

namespace fielddeform {
class JsonValue;
class JsonWriter;
}  // namespace fielddeform

/// Lattice files: JSON ("fielddeform-lattice", complete) and Wavefront OBJ (the nodes where they stand, joined by lines, for
/// modellers; what OBJ cannot say stands in comments). docs/lattice.md has every key and rule. JSON keeps every bit; OBJ keeps
/// those of the nodes, and the displacement of a node that stands at rest is exactly 0.
namespace fielddeform::map {

enum class LatticeFormat : std::uint8_t { Json, Obj };

/// Reads a lattice; the content tells the format (JSON begins with a brace).
/// @throw IoError with line and element: unreadable, malformed, not finite, out of range, unknown key
Lattice readLattice(const std::filesystem::path& path);
/// The same from memory. @param path only named in errors
Lattice parseLattice(std::string text, const std::filesystem::path& path);

/// The lattice with its nodes where an OBJ file has its vertices, one a node in node order; comments are not needed, as
/// modellers drop them. Nodes that only the modeller's rounding moved (to float, to the decimals that it writes) have the
/// displacement 0.
/// @throw IoError if the count differs, or for a vertex that is not finite
Lattice readMovedNodes(Lattice rest, const std::filesystem::path& obj);
Lattice parseMovedNodes(Lattice rest, std::string_view text, const std::filesystem::path& path);

/// Writes atomically; OBJ if the extension is .obj, else JSON.
/// @throw std::invalid_argument if the lattice is not valid; IoError if it cannot be written
void writeLattice(const Lattice& lattice, const std::filesystem::path& path);
/// The text of a lattice file. @throw std::invalid_argument if the lattice is not valid
std::string formatLattice(const Lattice& lattice, LatticeFormat format);

/// A lattice as a JSON object without "format" and "version", as it stands in scenes (where "sculpt" may stand beside it).
/// @throw IoError naming the place of the mistake
Lattice latticeFromJson(const JsonValue& object);
/// The members of such an object, into one that is open.
void latticeToJson(const Lattice& lattice, JsonWriter& json);

/// A box as a JSON object {"origin": [x, y, z], "edges": [[x, y, z], ...]}.
LatticeBox latticeBoxFromJson(const JsonValue& object);
void latticeBoxToJson(const LatticeBox& box, JsonWriter& json);

namespace detail {
Lattice parseLatticeObj(std::string_view text, const std::filesystem::path& path);
std::string formatLatticeObj(const Lattice& lattice);
}  // namespace detail

}  // namespace fielddeform::map
