#include <fielddeform/core/detail/words.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/skeleton/detail/obj_objects.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <unordered_map>

namespace fielddeform::skeleton::detail {
namespace {

using fielddeform::detail::kBlank;
// Statements of modellers that say nothing about a skeleton's shape.
constexpr std::array<std::string_view, 15> kIgnored = {"vt",     "vn",  "vp",    "g",        "s",        "usemtl",     "mtllib", "usemap",
                                                       "maplib", "lod", "bevel", "c_interp", "d_interp", "shadow_obj", "trace_obj"};

std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 40)) out += c >= 0x20 && c < 0x7F ? c : '?';
  return fmt::format("\"{}\"{}", out, text.size() > 40 ? "..." : "");
}

// Reads statement after statement; a backslash at a line's end joins the next line.
class ObjScanner {
 public:
  ObjScanner(std::string_view text, const std::filesystem::path& path) : rest_(text) {
    file_.path = path;
    if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
    file_.objects.push_back({"", 1, 0, 0, {}});
  }

  ObjFile scan() {
    while (nextStatement()) statement();
    file_.objects.back().vertexEnd = static_cast<Index>(file_.vertices.size());
    return std::move(file_);
  }

 private:
  [[noreturn]] void fail(std::string found, std::string expected) const {
    FilePosition position;
    position.line = line_;
    throw IoError(file_.path, position, "", std::move(found), std::move(expected));
  }

  bool nextStatement() {
    if (rest_.empty()) return false;
    joined_.clear();
    line_ = nextLine_;
    for (;;) {
      const std::size_t newline = rest_.find('\n');
      std::string_view piece = rest_.substr(0, newline);
      rest_.remove_prefix(newline == std::string_view::npos ? rest_.size() : newline + 1);
      ++nextLine_;
      if (piece.ends_with('\r')) piece.remove_suffix(1);
      const bool continues = piece.ends_with('\\') && !rest_.empty();
      if (!continues && joined_.empty()) {
        words_ = piece;
        return true;
      }
      if (piece.ends_with('\\')) piece.remove_suffix(1);
      joined_.append(piece).append(1, ' ');
      if (continues) continue;
      words_ = joined_;
      return true;
    }
  }

  std::string_view word() { return fielddeform::detail::takeWord(words_); }

  void statement() {
    const std::string_view keyword = word();
    if (keyword.empty() || keyword[0] == '#') return;
    if (keyword == "v") return vertex();
    if (keyword == "o") return object();
    if (keyword == "p" || keyword == "l" || keyword == "f") return element(keyword[0]);
    if (std::find(kIgnored.begin(), kIgnored.end(), keyword) == kIgnored.end())
      fail("statement " + shown(keyword), "o, v, p, l or f (a skeleton in OBJ or JSON)");
  }

  void vertex() {
    Vec3 v;
    for (int k = 0; k < 3; ++k) {
      const std::string_view w = word();
      if (w.empty()) fail(fmt::format("vertex with {} coordinates", k), "3");
      std::string_view digits = w;
      if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
      const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), v[k]);
      if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(v[k]))
        fail("coordinate " + shown(w), "a finite number");
    }
    if (file_.vertices.size() + 1 >= kNoIndex) fail("too many vertices", "at most 4294967293");
    file_.vertices.push_back(v);
  }

  void object() {
    std::size_t begin = words_.find_first_not_of(kBlank);
    const std::size_t end = words_.find_last_not_of(kBlank);
    const auto here = static_cast<Index>(file_.vertices.size());
    file_.objects.back().vertexEnd = here;
    if (begin == std::string_view::npos) fail("object without a name", "o NAME");
    file_.objects.push_back({std::string(words_.substr(begin, end + 1 - begin)), line_, here, here, {}});
  }

  void element(char kind) {
    ObjElement e{kind, line_, {}};
    for (std::string_view w = word(); !w.empty() && w[0] != '#'; w = word()) e.vertices.push_back(vertexIndex(w));
    const std::size_t least = kind == 'p' ? 1 : kind == 'l' ? 2 : 3;
    if (e.vertices.size() < least)
      fail(fmt::format("\"{}\" with {} vertices", kind, e.vertices.size()), fmt::format("at least {}", least));
    file_.objects.back().elements.push_back(std::move(e));
  }

  // "7", "7/1", "7//3" or "7/1/3"; negative numbers count back from the last vertex so far.
  Index vertexIndex(std::string_view w) {
    const std::string_view number = w.substr(0, w.find('/'));
    std::int64_t i = 0;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), i);
    const auto count = static_cast<std::int64_t>(file_.vertices.size());
    if (error != std::errc() || end != number.data() + number.size() || i == 0 || i > count || i < -count)
      fail("vertex index " + shown(w), count == 0 ? "a vertex before it" : fmt::format("1 to {} or -{} to -1", count, count));
    return static_cast<Index>(i > 0 ? i - 1 : count + i);
  }

  ObjFile file_;
  std::string_view rest_, words_;
  std::string joined_;
  std::uint64_t line_ = 0, nextLine_ = 1;
};

// An object of vertices alone is a point set, unless others are built on its vertices.
void takeLooseVertices(ObjFile& file) {
  std::vector<bool> used(file.vertices.size(), false);
  for (const ObjObject& object : file.objects)
    for (const ObjElement& e : object.elements)
      for (const Index i : e.vertices) used[i] = true;
  for (std::size_t k = 0; k < file.objects.size(); ++k) {
    ObjObject& object = file.objects[k];
    if (!object.elements.empty()) continue;
    const auto begin = used.begin() + object.firstVertex, end = used.begin() + object.vertexEnd;
    const bool anyUsed = std::find(begin, end, true) != end;
    const bool empty = object.firstVertex == object.vertexEnd;
    if (object.name.empty() && (empty || anyUsed || file.objects.size() > 1)) continue;
    FilePosition position;
    position.line = object.line;
    if (empty)
      throw IoError(file.path, position, fmt::format("object \"{}\"", object.name),
                    "no vertices and no elements", "p, l or f statements");
    if (anyUsed)
      throw IoError(file.path, position, fmt::format("object \"{}\"", object.name),
                    "no elements, and its vertices belong to another object", "p, l or f statements");
    ObjElement e{'p', object.line, {}};
    for (Index i = object.firstVertex; i < object.vertexEnd; ++i) e.vertices.push_back(i);
    object.elements.push_back(std::move(e));
  }
}

std::string objectName(std::string name) {
  for (char& c : name)
    if (static_cast<unsigned char>(c) < 0x20) c = '_';
  if (name.ends_with('\\')) name.back() = '_';  // would join the next line
  return name;
}

}  // namespace

ObjFile scanObj(std::string_view text, const std::filesystem::path& path) { return ObjScanner(text, path).scan(); }

Skeleton parseObj(std::string_view text, const std::filesystem::path& path) {
  ObjFile file = scanObj(text, path);
  takeLooseVertices(file);
  Skeleton skeleton;
  std::unordered_map<std::string, std::uint64_t> lines;
  for (ObjObject& object : file.objects) {
    if (object.elements.empty()) continue;
    if (object.name.empty()) object.name = "skeleton";
    for (Primitive& p : buildPrimitives(file, object)) {
      const auto [first, fresh] = lines.emplace(p.name, object.line);
      if (!fresh) {
        FilePosition position;
        position.line = object.line;
        throw IoError(file.path, position, "", fmt::format("object name \"{}\" a second time", p.name),
                      fmt::format("another name (it stands in line {})", first->second));
      }
      skeleton.primitives.push_back(std::move(p));
    }
  }
  if (skeleton.primitives.empty()) throw IoError(path, "has no points, lines or faces, expected a skeleton (JSON or OBJ)");
  return skeleton;
}

std::string formatObj(const Skeleton& skeleton) {
  std::string text = "# fielddeform skeleton\n";
  std::size_t first = 1;
  for (const Primitive& p : skeleton.primitives) {
    text += fmt::format("o {}\n", objectName(p.name));
    for (const Vec3& x : p.points)
      text += fmt::format("v {} {} {}\n", shortestNumber(x.x()), shortestNumber(x.y()), shortestNumber(x.z()));
    if (p.type == PrimitiveType::Mesh) {
      for (const std::vector<Index>& face : p.faces) {
        text += 'f';
        for (const Index i : face) text += fmt::format(" {}", first + i);
        text += '\n';
      }
    } else {
      text += p.type == PrimitiveType::Points ? 'p' : 'l';
      for (std::size_t i = 0; i < p.points.size(); ++i) text += fmt::format(" {}", first + i);
      if (p.closed) text += fmt::format(" {}", first);
      text += '\n';
    }
    first += p.points.size();
  }
  return text;
}

}  // namespace fielddeform::skeleton::detail
