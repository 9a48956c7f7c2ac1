#include <fielddeform/mesh/formats/ply.h>
#include <fielddeform/mesh/formats/text.h>
#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace fielddeform::mesh::formats {
namespace {

// More than any real file has; keeps look-ups by name from becoming slow on a hostile one.
constexpr std::size_t kMaxDeclarations = 4096;

constexpr std::pair<std::string_view, ScalarType> kTypes[] = {
    {"char", ScalarType::Int8},      {"uchar", ScalarType::UInt8},    {"short", ScalarType::Int16},
    {"ushort", ScalarType::UInt16},  {"int", ScalarType::Int32},      {"uint", ScalarType::UInt32},
    {"float", ScalarType::Float32},  {"double", ScalarType::Float64}, {"int8", ScalarType::Int8},
    {"uint8", ScalarType::UInt8},    {"int16", ScalarType::Int16},    {"uint16", ScalarType::UInt16},
    {"int32", ScalarType::Int32},    {"uint32", ScalarType::UInt32},  {"float32", ScalarType::Float32},
    {"float64", ScalarType::Float64}};

// Properties that belong together, and their well-known name.
struct Group {
  std::string_view attribute;
  std::vector<std::string_view> names;
};
const Group* groups(std::size_t& count) {
  static const Group all[] = {{"normal", {"nx", "ny", "nz"}},
                              {"color", {"red", "green", "blue", "alpha"}},
                              {"color", {"red", "green", "blue"}},
                              {"uv", {"s", "t"}},
                              {"uv", {"u", "v"}},
                              {"uv", {"texture_u", "texture_v"}},
                              {"uv", {"texture_s", "texture_t"}}};
  count = std::size(all);
  return all;
}

class HeaderReader {
 public:
  explicit HeaderReader(const Source& source) : source_(source), at_(source.begin()), end_(source.end()) {}

  std::shared_ptr<PlyLayout> read(const char*& data) {
    nextLine();
    if (word() != "ply") fail(lineStart_, "header", "'ply'");
    layout_->eol = std::string(lineEnd_, at_);
    if (layout_->eol.empty()) fail(at_, "header", "'format' and the elements");
    for (bool format = false;;) {
      if (at_ >= end_) fail(at_, "header", "'end_header'");
      nextLine();
      const std::string_view keyword = word();
      PlyHeaderLine line{std::string(lineStart_, lineEnd_), PlyHeaderLine::Kind::Text, 0, 0};
      if (keyword == "end_header") {
        if (!format) fail(lineStart_, "header", "'format ascii 1.0' or another encoding before");
        break;
      }
      if (keyword == "format") {
        if (format) fail(lineStart_, "header", "one 'format' line");
        format = true;
        readFormat();
      } else if (keyword == "element") {
        readElement();
        line.kind = PlyHeaderLine::Kind::Element;
        line.element = layout_->elements.size() - 1;
      } else if (keyword == "property") {
        readProperty();
        line.kind = PlyHeaderLine::Kind::Property;
        line.element = layout_->elements.size() - 1;
        line.property = layout_->elements.back().properties.size() - 1;
      } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
        fail(lineStart_, "header", "format, element, property, comment, obj_info or end_header");
      }
      layout_->header.push_back(std::move(line));
    }
    data = at_;
    return layout_;
  }

 private:
  [[noreturn]] void fail(const char* at, const std::string& element, const std::string& expected) const {
    source_.failText(at, element, excerpt(at, end_), expected);
  }
  void nextLine() {
    lineStart_ = word_ = at_;
    if (layout_->eol == "\r") {  // a "\n" behind is data; looking for one in every line would take quadratic time
      lineEnd_ = std::find(at_, end_, '\r');
      at_ = lineEnd_ + (lineEnd_ < end_);
      return;
    }
    lineEnd_ = findEol(at_, end_);
    at_ = skipEol(lineEnd_, end_);
  }
  std::string_view word() {
    word_ = skipBlanks(word_, lineEnd_);
    const char* begin = word_;
    word_ = skipToken(word_, lineEnd_);
    return {begin, static_cast<std::size_t>(word_ - begin)};
  }
  void readFormat() {
    const std::string_view encoding = word();
    if (encoding == "ascii")
      layout_->encoding = PlyEncoding::Ascii;
    else if (encoding == "binary_little_endian")
      layout_->encoding = PlyEncoding::Little;
    else if (encoding == "binary_big_endian")
      layout_->encoding = PlyEncoding::Big;
    else
      fail(encoding.data(), "format", "ascii, binary_little_endian or binary_big_endian");
    if (const auto version = word(); version != "1.0") fail(version.data(), "format", "version 1.0");
  }
  void readElement() {
    PlyElement element;
    const std::string_view name = word(), count = word();
    if (name.empty()) fail(name.data(), "element", "a name");
    std::int64_t value = -1;
    const char* stop = parseInteger(count.data(), lineEnd_, value);
    if (stop != count.data() + count.size() || value < 0)
      fail(count.data(), "element " + std::string(name), "a count >= 0");
    for (const PlyElement& e : layout_->elements)
      if (e.name == name) fail(name.data(), "element " + std::string(name), "each element once");
    if (++declarations_ > kMaxDeclarations)
      fail(lineStart_, "header", fmt::format("at most {} lines", kMaxDeclarations));
    element.name = name;
    element.count = static_cast<std::uint64_t>(value);
    layout_->elements.push_back(std::move(element));
  }
  ScalarType type(std::string_view name, bool integral) {
    for (const auto& [word, type] : kTypes)
      if (name == word) {
        if (integral && type >= ScalarType::Float32) break;
        return type;
      }
    fail(name.data(), "property", integral ? "an integer type" : "a scalar type (char ... double, int8 ... float64)");
  }
  void readProperty() {
    if (layout_->elements.empty()) fail(lineStart_, "property", "an element before");
    if (++declarations_ > kMaxDeclarations)
      fail(lineStart_, "header", fmt::format("at most {} lines", kMaxDeclarations));
    PlyProperty property;
    std::string_view typeWord = word();
    if (typeWord == "list") {
      property.countType = type(word(), true);
      typeWord = word();
    }
    property.type = type(typeWord, false);
    const std::string_view name = word();
    if (name.empty()) fail(name.data(), "property", "a name");
    property.name = name;
    layout_->elements.back().properties.push_back(std::move(property));
  }

  const Source& source_;
  const char *at_, *end_;
  const char *lineStart_ = nullptr, *lineEnd_ = nullptr, *word_ = nullptr;
  std::size_t declarations_ = 0;
  std::shared_ptr<PlyLayout> layout_ = std::make_shared<PlyLayout>();
};

PlyProperty* scalarNamed(PlyElement& element, std::string_view name) {
  for (PlyProperty& p : element.properties)
    if (p.name == name && !p.countType && p.attribute.empty() && p.role == PlyProperty::Role::Attribute) return &p;
  return nullptr;
}

// Gives every value property its attribute: well-known groups first, all others under their own names.
void nameAttributes(PlyElement& element, Element on) {
  std::set<std::string> taken;
  std::size_t count = 0;
  const Group* all = groups(count);
  for (std::size_t g = 0; g < count; ++g) {
    std::vector<PlyProperty*> members;
    for (const std::string_view name : all[g].names)
      if (PlyProperty* p = scalarNamed(element, name); p && (members.empty() || members.front()->type == p->type))
        members.push_back(p);
    if (members.size() != all[g].names.size() || !taken.insert(std::string(all[g].attribute)).second) continue;
    for (std::size_t k = 0; k < members.size(); ++k) {
      members[k]->attribute = all[g].attribute;
      members[k]->channel = static_cast<int>(k);
      if (all[g].attribute == "normal") members[k]->onSplit = Interpolation::Direction;
    }
  }
  for (PlyProperty& p : element.properties) {
    p.on = on;
    if (p.role != PlyProperty::Role::Attribute || !p.attribute.empty()) continue;
    p.attribute = p.name;
    // Whole numbers are ids and labels more often than measures.
    if (p.countType || p.type < ScalarType::Float32) p.onSplit = Interpolation::Nearest;
    for (int n = 2; !taken.insert(p.attribute).second; ++n) p.attribute = fmt::format("{}_{}", p.name, n);
  }
}

void assignVertex(const Source& source, PlyElement& element) {
  for (const char* axis : {"x", "y", "z"}) {
    PlyProperty* p = scalarNamed(element, axis);
    if (!p)
      source.failText(source.begin(), "element vertex", "no scalar property '" + std::string(axis) + "'", "x, y and z");
    p->role = PlyProperty::Role::Position;
    p->channel = *axis - 'x';
  }
  element.role = PlyElement::Role::Vertex;
  nameAttributes(element, Element::Vertex);
}

void assignFaces(PlyElement& element, PlyElement::Role role) {
  for (PlyProperty& p : element.properties) {
    if (!p.countType || p.type >= ScalarType::Float32 || (p.name != "vertex_indices" && p.name != "vertex_index"))
      continue;
    p.role = PlyProperty::Role::Indices;
    element.role = role;
    nameAttributes(element, Element::Face);
    return;
  }
}

}  // namespace

std::string_view plyTypeName(ScalarType type) noexcept { return kTypes[static_cast<int>(type)].first; }

std::uint64_t hashCorners(const Mesh& mesh) {
  std::uint64_t hash = 0x9E3779B97F4A7C15ull;
  const auto add = [&](std::uint64_t x) {
    hash = (hash ^ x) * 0xBF58476D1CE4E5B9ull;
    hash ^= hash >> 29;
  };
  for (const Index c : mesh.corners()) add(c);
  for (const Index o : mesh.offsets()) add(o);
  return hash;
}

std::shared_ptr<PlyLayout> readPlyHeader(const Source& source, const char*& data) {
  auto layout = HeaderReader(source).read(data);
  bool vertices = false;
  for (PlyElement& element : layout->elements) {
    if (element.name == "vertex") {
      assignVertex(source, element);
      vertices = true;
    } else if (element.name == "face") {
      assignFaces(element, PlyElement::Role::Face);
    } else if (element.name == "tristrips") {
      assignFaces(element, PlyElement::Role::Strips);
    }
  }
  if (!vertices) source.failText(source.begin(), "header", "no element 'vertex'", "one");
  layout->folder = folderOf(source.path);
  return layout;
}

}  // namespace fielddeform::mesh::formats
