#include <fielddeform/core/error.h>
#include <fielddeform/skeleton/detail/obj_objects.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace fielddeform::skeleton::detail {
namespace {

[[noreturn]] void fail(const ObjFile& file, const ObjObject& object, std::uint64_t line, std::string found,
                       std::string expected) {
  FilePosition position;
  position.line = line;
  throw IoError(file.path, position, fmt::format("object \"{}\"", object.name), std::move(found), std::move(expected));
}

// Valid UTF-8 [RFC 3629]. Other names could not be written as JSON without becoming one another.
bool isUtf8(const std::string& text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i]);
    const std::size_t length = c < 0x80 ? 1 : c >= 0xC2 && c < 0xE0 ? 2 : (c & 0xF0) == 0xE0 ? 3 : c >= 0xF0 && c < 0xF5 ? 4 : 0;
    if (length == 0 || i + length > text.size()) return false;
    for (std::size_t k = 1; k < length; ++k)
      if ((static_cast<unsigned char>(text[i + k]) & 0xC0) != 0x80) return false;
    const auto d = length > 1 ? static_cast<unsigned char>(text[i + 1]) : 0;
    if ((c == 0xE0 && d < 0xA0) || (c == 0xED && d >= 0xA0) || (c == 0xF0 && d < 0x90) || (c == 0xF4 && d >= 0x90)) return false;
    i += length;
  }
  return true;
}

// The vertices an object uses, ascending: the order of a mesh's points.
std::vector<Index> usedVertices(const ObjObject& object) {
  std::vector<Index> used;
  for (const ObjElement& e : object.elements) used.insert(used.end(), e.vertices.begin(), e.vertices.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  return used;
}

Index localIndex(const std::vector<Index>& used, Index vertex) {
  return static_cast<Index>(std::lower_bound(used.begin(), used.end(), vertex) - used.begin());
}

Primitive pointsOf(const ObjFile& file, const ObjObject& object) {
  Primitive p;
  p.name = object.name;
  p.type = PrimitiveType::Points;
  std::vector<Index> sorted = usedVertices(object);
  std::vector<bool> taken(sorted.size(), false);
  for (const ObjElement& e : object.elements)
    for (const Index v : e.vertices) {
      const Index i = localIndex(sorted, v);
      if (taken[i]) fail(file, object, e.line, fmt::format("vertex {} a second time", v + 1), "each point once");
      taken[i] = true;
      p.points.push_back(file.vertices[v]);
    }
  return p;
}

Primitive meshOf(const ObjFile& file, const ObjObject& object) {
  Primitive p;
  p.name = object.name;
  p.type = PrimitiveType::Mesh;
  const std::vector<Index> used = usedVertices(object);
  for (const Index v : used) p.points.push_back(file.vertices[v]);
  if (used.size() < 3) fail(file, object, object.elements[0].line, "a mesh of less than 3 vertices", "at least 3");
  for (const ObjElement& e : object.elements) {
    p.faces.push_back(e.vertices);
    for (Index& v : p.faces.back()) v = localIndex(used, v);
  }
  p.closed = boundsSolid(p.faces);
  return p;
}

// Joins an object's line statements into chains. Modellers write one statement an edge, in any order.
class Chains {
 public:
  Chains(const ObjFile& file, const ObjObject& object) : file_(file), object_(object), used_(usedVertices(object)) {
    neighbours_.assign(used_.size(), {kNoIndex, kNoIndex});
    for (const ObjElement& e : object.elements)
      for (std::size_t k = 1; k < e.vertices.size(); ++k)
        join(localIndex(used_, e.vertices[k - 1]), localIndex(used_, e.vertices[k]), e.line);
  }

  std::vector<Primitive> build() {
    std::vector<Primitive> chains;
    std::vector<bool> done(used_.size(), false);
    const auto take = [&](Index start, Index second) {
      Primitive p;
      p.name = chains.empty() ? object_.name : fmt::format("{}.{}", object_.name, chains.size() + 1);
      for (Index from = kNoIndex, at = start; at != kNoIndex && !done[at];) {
        done[at] = true;
        p.points.push_back(file_.vertices[used_[at]]);
        const Index next = from == kNoIndex ? second : neighbours_[at][0] == from ? neighbours_[at][1] : neighbours_[at][0];
        from = at;
        at = next;
        p.closed = at == start;
      }
      chains.push_back(std::move(p));
    };
    // Where a statement begins, its direction holds; elsewhere the smaller index leads.
    for (const ObjElement& e : object_.elements) {
      const Index start = localIndex(used_, e.vertices.front());
      if (done[start]) continue;
      if (isWhole(e)) take(start, localIndex(used_, e.vertices[1]));
    }
    for (Index v = 0; v < used_.size(); ++v)
      if (!done[v] && neighbours_[v][1] == kNoIndex) take(v, neighbours_[v][0]);
    for (Index v = 0; v < used_.size(); ++v)
      if (!done[v]) take(v, std::min(neighbours_[v][0], neighbours_[v][1]));
    return chains;
  }

 private:
  void join(Index a, Index b, std::uint64_t line) {
    if (a == b) fail(file_, object_, line, fmt::format("a line from vertex {} to itself", used_[a] + 1), "two vertices");
    if (neighbours_[a][0] == b || neighbours_[a][1] == b)
      fail(file_, object_, line, fmt::format("the line from vertex {} to {} a second time", used_[a] + 1, used_[b] + 1),
           "each line once");
    add(a, b, line);
    add(b, a, line);
  }

  void add(Index a, Index b, std::uint64_t line) {
    for (Index& n : neighbours_[a])
      if (n == kNoIndex) {
        n = b;
        return;
      }
    fail(file_, object_, line, fmt::format("vertex {} joins 3 lines", used_[a] + 1),
         "at most 2 (each branch an object of its own)");
  }

  // Whether a statement covers its chain from end to end, or once around.
  bool isWhole(const ObjElement& e) const {
    const Index first = localIndex(used_, e.vertices.front()), last = localIndex(used_, e.vertices.back());
    if (first == last) return true;
    return neighbours_[first][1] == kNoIndex && neighbours_[last][1] == kNoIndex;
  }

  const ObjFile& file_;
  const ObjObject& object_;
  std::vector<Index> used_;
  std::vector<std::array<Index, 2>> neighbours_;
};

}  // namespace

std::vector<Primitive> buildPrimitives(const ObjFile& file, const ObjObject& object) {
  if (!isUtf8(object.name)) fail(file, object, object.line, "a name that is not UTF-8", "UTF-8 text");
  const char kind = object.elements[0].kind;
  for (const ObjElement& e : object.elements)
    if (e.kind != kind)
      fail(file, object, e.line, fmt::format("a \"{}\" after a \"{}\"", e.kind, kind),
           "one kind of element an object (give each an o statement of its own)");
  if (kind == 'p') return {pointsOf(file, object)};
  if (kind == 'f') return {meshOf(file, object)};
  return Chains(file, object).build();
}

}  // namespace fielddeform::skeleton::detail
