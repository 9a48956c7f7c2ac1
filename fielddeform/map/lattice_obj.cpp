// Lattices as Wavefront OBJ: the nodes as vertices in node order, the grid as lines, the rest in comments.
#include <fielddeform/core/detail/words.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/lattice_io.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using fielddeform::detail::kBlank;
constexpr std::string_view kTitle = "fielddeform lattice";
// Statements that say nothing about where nodes stand.
constexpr std::array<std::string_view, 19> kIgnored = {"p",  "l",  "f",  "o",      "vt",     "vn",     "vp",  "g",     "s",       "usemtl",
                                                       "mtllib", "usemap", "maplib", "lod", "bevel", "c_interp", "d_interp", "shadow_obj", "trace_obj"};

std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 40)) out += c >= 0x20 && c < 0x7F ? c : '?';
  return fmt::format("\"{}\"{}", out, text.size() > 40 ? "..." : "");
}

struct Vertex {
  Vec3 at = Vec3::Zero();
  Vec3 halfDigit = Vec3::Zero();  // half a unit of the last decimal written
};

// What a comment says in words after its first.
struct Header {
  bool titled = false;
  std::optional<Vec3> origin;
  std::vector<Vec3> edges;
  std::vector<AxisBasis> axes;
  std::optional<Outside> outside;
};

class Scanner {
 public:
  Scanner(std::string_view text, const std::filesystem::path& path) : rest_(text), path_(path) {
    if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
  }

  void scan() {
    while (!rest_.empty()) {
      ++line_;
      const std::size_t newline = rest_.find('\n');
      words_ = rest_.substr(0, newline);
      rest_.remove_prefix(newline == std::string_view::npos ? rest_.size() : newline + 1);
      statement();
    }
  }

  Header header;
  std::vector<Vertex> vertices;

 private:
  [[noreturn]] void fail(std::string found, std::string expected) const {
    FilePosition position;
    position.line = line_;
    throw IoError(path_, position, "", std::move(found), std::move(expected));
  }

  std::string_view word() { return fielddeform::detail::takeWord(words_); }

  double number(const char* what) {
    std::string_view w = word(), digits = w;
    if (w.empty()) fail(fmt::format("{} that ends too early", what), "three numbers");
    if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
    double x = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), x);
    if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(x)) fail(fmt::format("{} {}", what, shown(w)), "a finite number");
    // Half a unit of the last place, of plain decimals as modellers write them.
    const std::size_t point = digits.find('.');
    const bool plain = point != std::string_view::npos && digits.find_first_of("eE") == std::string_view::npos;
    const std::size_t decimals = plain ? digits.size() - point - 1 : 0;
    halfDigit_ = decimals >= 5 && decimals < 300 ? 0.5 * std::pow(10.0, -static_cast<double>(decimals)) : 0;
    return x;
  }

  Vec3 vec3(const char* what) {
    Vec3 v;
    for (int k = 0; k < 3; ++k) v[k] = number(what);
    return v;
  }

  int integer(int low, int high) {
    const std::string_view w = word();
    int i = 0;
    const auto [end, error] = std::from_chars(w.data(), w.data() + w.size(), i);
    if (error != std::errc() || end != w.data() + w.size() || i < low || i > high) fail(shown(w), fmt::format("a whole number from {} to {}", low, high));
    return i;
  }

  void statement() {
    const std::string_view keyword = word();
    if (keyword.empty()) return;
    if (keyword == "#") return comment();
    if (keyword[0] == '#') return;
    if (keyword == "v") {
      Vertex v;
      for (int k = 0; k < 3; ++k) {
        v.at[k] = number("coordinate");
        v.halfDigit[k] = halfDigit_;
      }
      vertices.push_back(v);
    } else if (std::find(kIgnored.begin(), kIgnored.end(), keyword) == kIgnored.end()) {
      fail("statement " + shown(keyword), "v, or lines and faces between them (a lattice in OBJ)");
    }
  }

  void comment() {
    std::size_t begin = words_.find_first_not_of(kBlank);
    if (begin == std::string_view::npos) return;
    if (words_.substr(begin).starts_with(kTitle)) {
      words_.remove_prefix(begin + kTitle.size());
      integer(1, 1);
      if (header.titled) fail("a second lattice", "one");
      header.titled = true;
      return;
    }
    if (!header.titled) return;
    const std::string_view key = word();
    if (key == "origin") header.origin = vec3("origin");
    if (key == "edge") {
      if (header.edges.size() == 3) fail("a fourth edge", "three");
      header.edges.push_back(vec3("edge"));
    }
    if (key == "axis") {
      if (header.axes.size() == 3) fail("a fourth axis", "three");
      header.axes.push_back(axis());
    }
    if (key == "outside") {
      const std::string_view w = word();
      if (w != "extend" && w != "keep") fail(shown(w), "extend or keep");
      header.outside = w == "keep" ? Outside::Keep : Outside::Extend;
    }
  }

  AxisBasis axis() {
    const std::string_view kind = word();
    try {
      if (kind == "bernstein") return AxisBasis::bernstein(integer(2, 0x7FFFFFFF));
      if (kind == "bspline") {
        const int nodes = integer(2, 0x7FFFFFFF), degree = integer(1, 3);
        const std::string_view border = word();
        if (border != "coincident" && border != "free") fail(shown(border), "coincident or free");
        return AxisBasis::bspline(nodes, degree, border == "free" ? Border::Free : Border::Coincident);
      }
      if (kind == "knots") {
        const int degree = integer(1, 3);
        std::vector<double> knots;
        while (words_.find_first_not_of(kBlank) != std::string_view::npos) knots.push_back(number("knot"));
        return AxisBasis::withKnots(degree, std::move(knots));
      }
      if (kind == "refined") {  // degree, then the nodes' places between 0 and 1, then the knots
        const int degree = integer(2, 3);
        std::vector<double> rest, knots;
        while (rest.empty() || rest.back() < 1) rest.push_back(number("node"));
        while (words_.find_first_not_of(kBlank) != std::string_view::npos) knots.push_back(number("knot"));
        return AxisBasis::coincident(degree, std::move(knots), std::move(rest));
      }
    } catch (const std::invalid_argument& problem) {
      fail(problem.what(), "an axis");
    }
    fail(shown(kind), "bernstein, bspline, knots or refined");
  }

  std::string_view rest_, words_;
  const std::filesystem::path& path_;
  std::uint64_t line_ = 0;
  double halfDigit_ = 0;
};

void requireCount(std::size_t vertices, std::size_t nodes, const std::filesystem::path& path) {
  if (vertices != nodes) throw IoError(path, {}, "", fmt::format("{} vertices", vertices), fmt::format("{}, one a node of the lattice", nodes));
}

std::string vectorText(const Vec3& x) {
  return fmt::format("{} {} {}", shortestNumber(x[0]), shortestNumber(x[1]), shortestNumber(x[2]));
}

std::string axisText(const AxisBasis& axis) {
  if (axis.kind() == BasisKind::Bernstein) return fmt::format("bernstein {}", axis.nodes());
  if (axis.uniform()) return fmt::format("bspline {} {} {}", axis.nodes(), axis.degree(), toString(axis.border()));
  const bool refined = axis.border() == Border::Coincident;
  std::string text = fmt::format("{} {}", refined ? "refined" : "knots", axis.degree());
  for (int i = 0; refined && i < axis.nodes(); ++i) text += ' ' + shortestNumber(axis.restNode(i));
  for (const double k : axis.knots()) text += ' ' + shortestNumber(k);
  return text;
}

// Lines through the nodes along one axis.
void addLines(const Lattice& l, int axis, std::string& text) {
  const std::array<int, 3> n = l.nodes();
  const int a = (axis + 1) % 3, b = (axis + 2) % 3;
  std::array<int, 3> at{};
  for (at[b] = 0; at[b] < n[b]; ++at[b])
    for (at[a] = 0; at[a] < n[a]; ++at[a]) {
      text += 'l';
      for (at[axis] = 0; at[axis] < n[axis]; ++at[axis]) text += fmt::format(" {}", l.index(at[0], at[1], at[2]) + std::size_t{1});
      text += '\n';
    }
}

}  // namespace

namespace detail {

Lattice parseLatticeObj(std::string_view text, const std::filesystem::path& path) {
  Scanner scanner(text, path);
  scanner.scan();
  const Header& h = scanner.header;
  if (!h.titled) throw IoError(path, {}, "", "an OBJ without the comment \"# fielddeform lattice 1\"",
                               "a lattice written by this program (modellers drop comments: give the moved nodes besides the lattice)");
  if (!h.origin || h.edges.size() != 3 || h.axes.size() != 3)
    throw IoError(path, {}, "", "an incomplete lattice", "the comments origin, edge (three) and axis (three)");
  Lattice l;
  l.box.origin = *h.origin;
  for (int k = 0; k < 3; ++k) l.box.axes.col(k) = h.edges[static_cast<std::size_t>(k)];
  for (std::size_t k = 0; k < 3; ++k) l.axis[k] = h.axes[k];
  if (h.outside) l.outside = *h.outside;
  try {
    l.validate();
  } catch (const std::invalid_argument& problem) {
    throw IoError(path, {}, "", problem.what(), "a valid lattice");
  }
  requireCount(scanner.vertices.size(), l.nodeCount(), path);
  const std::vector<Vec3> rest = l.restNodes();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Vec3 d = scanner.vertices[i].at - rest[i];
    if (!d.allFinite()) throw IoError(path, {}, fmt::format("vertex {}", i + 1), "a displacement beyond double", "a finite one");
    l.displacements.push_back(d);
  }
  return l;
}

std::string formatLatticeObj(const Lattice& l) {
  std::string text = fmt::format("# {} 1\n# origin {}\n", kTitle, vectorText(l.box.origin));
  for (int k = 0; k < 3; ++k) text += fmt::format("# edge {}\n", vectorText(l.box.axes.col(k)));
  for (const AxisBasis& axis : l.axis) text += fmt::format("# axis {}\n", axisText(axis));
  text += fmt::format("# outside {}\no lattice\n", toString(l.outside));
  const std::vector<Vec3> rest = l.restNodes();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Vec3 at = l.displacements.empty() || l.displacements[i] == Vec3::Zero() ? rest[i] : Vec3(rest[i] + l.displacements[i]);
    if (!at.allFinite()) throw std::invalid_argument(fmt::format("lattice: node {} stands beyond double", i));
    text += fmt::format("v {}\n", vectorText(at));
  }
  for (int axis = 0; axis < 3; ++axis) addLines(l, axis, text);
  return text;
}

}  // namespace detail

Lattice parseMovedNodes(Lattice rest, std::string_view text, const std::filesystem::path& path) {
  rest.validate();
  Scanner scanner(text, path);
  scanner.scan();
  requireCount(scanner.vertices.size(), rest.nodeCount(), path);
  const std::vector<Vec3> nodes = rest.restNodes();
  rest.displacements.assign(nodes.size(), Vec3::Zero());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Vertex& v = scanner.vertices[i];
    const Vec3 d = v.at - nodes[i];
    if (!d.allFinite()) throw IoError(path, {}, fmt::format("vertex {}", i + 1), "a displacement beyond double", "a finite one");
    // A modeller keeps floats, and writes a few decimals of them.
    for (int k = 0; k < 3; ++k)
      if (std::abs(d[k]) > 1.01 * v.halfDigit[k] + 0x1p-23 * std::abs(nodes[i][k])) rest.displacements[i][k] = d[k];
  }
  return rest;
}

}  // namespace fielddeform::map
