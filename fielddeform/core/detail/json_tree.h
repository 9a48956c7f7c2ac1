#pragma once

#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>

#include <string>
#include <vector>

namespace fielddeform::detail {

// The document in reading order, one node a value or key. A container's `value` is (member count, index after its
// subtree), a string's is (begin, length) in the pool, a number's its bits.
struct JsonNode {
  std::uint64_t value = 0;
  std::uint32_t offset = 0;  // first byte in the text
  JsonKind kind = JsonKind::Null;
  bool isKey = false;
  bool isMember = false;

  Index high() const { return static_cast<Index>(value >> 32); }
  Index low() const { return static_cast<Index>(value & 0xFFFFFFFFu); }
  bool isContainer() const { return kind == JsonKind::Array || kind == JsonKind::Object; }
};

struct JsonTree {
  std::string text;
  std::filesystem::path path;
  std::vector<JsonNode> nodes;
  std::string pool;

  std::string_view string(const JsonNode& n) const { return std::string_view(pool).substr(n.high(), n.low()); }
  Index after(Index node) const { return nodes[node].isContainer() ? nodes[node].low() : node + 1; }
  FilePosition position(std::size_t offset) const;        // line and column of a byte
  std::size_t endOf(std::size_t begin) const;             // byte behind the value that begins here
};

}  // namespace fielddeform::detail
