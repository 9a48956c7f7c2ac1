#include <fielddeform/mesh/formats/ply.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::mesh::formats {
namespace {

using Role = PlyProperty::Role;
using Kind = PlyHeaderLine::Kind;

constexpr std::size_t kAdded = static_cast<std::size_t>(-1);

// A property to be written: its declaration and where its values come from.
struct Slot {
  PlyProperty property;
  std::string line;  // verbatim from the input, or empty: made from the property
  const Attribute* attribute = nullptr;
  std::size_t headerLine = kAdded;  // of the layout's header
};
struct Table {
  const PlyElement* element = nullptr;
  std::string line;                  // of the element
  std::size_t first = 0, count = 0;  // rows
  bool dropped = false;
  std::vector<Slot> slots;
};

struct ChannelNames {
  std::string_view attribute;
  std::vector<std::string_view> names;
};

std::string channelName(const Attribute& a, int channel) {
  static const ChannelNames known[] = {
      {"normal", {"nx", "ny", "nz"}}, {"color", {"red", "green", "blue", "alpha"}}, {"uv", {"s", "t"}}};
  for (const ChannelNames& k : known)
    if (a.name == k.attribute && static_cast<std::size_t>(a.width) <= k.names.size())
      return std::string(k.names[static_cast<std::size_t>(channel)]);
  std::string name = a.name.empty() ? "unnamed" : a.name;
  for (char& c : name)
    if (static_cast<unsigned char>(c) <= ' ') c = '_';
  return a.width == 1 ? name : fmt::format("{}_{}", name, channel);
}

class PlyWriter {
 public:
  explicit PlyWriter(const WriteContext& context) : mesh_(context.mesh), out_(context.out), context_(context) {}

  void write() {
    layout_ = layoutFor<PlyLayout>(mesh_, context_.report);
    if (!layout_) layout_ = freshLayout();
    keepStrips_ = layout_->topology == hashCornersIfStrips();
    makeTables();
    addAttributes();
    for (Table& t : tables_)
      for (Slot& s : t.slots) fitTypes(t, s);
    reportDropped(context_.report, {}, mesh_.lines().size(), mesh_.loosePoints().size());
    writeHeader();
    for (const Table& t : tables_) {
      if (t.dropped) continue;
      if (t.element->raw)
        writeRaw(*t.element->raw);
      else
        writeRows(t);
    }
    out_.text(layout_->trailing);
  }

 private:
  bool ascii() const { return layout_->encoding == PlyEncoding::Ascii; }
  bool hasStrips() const {
    return std::any_of(layout_->elements.begin(), layout_->elements.end(),
                       [](const PlyElement& e) { return e.role == PlyElement::Role::Strips; });
  }
  std::uint64_t hashCornersIfStrips() const { return hasStrips() ? hashCorners(mesh_) : layout_->topology; }

  static PlyProperty indices() {
    PlyProperty p;
    p.name = "vertex_indices";
    p.type = ScalarType::Int32;
    p.countType = ScalarType::UInt8;
    p.role = Role::Indices;
    p.on = Element::Face;
    return p;
  }
  std::shared_ptr<const PlyLayout> freshLayout() const {
    auto layout = std::make_shared<PlyLayout>();
    layout->header.push_back({"format binary_little_endian 1.0", Kind::Text, 0, 0});
    layout->positionType = mesh_.positionType() == ScalarType::Float32 ? ScalarType::Float32 : ScalarType::Float64;
    PlyElement vertex;
    vertex.name = "vertex";
    vertex.role = PlyElement::Role::Vertex;
    layout->header.push_back({"", Kind::Element, 0, 0});
    for (int k = 0; k < 3; ++k) {
      PlyProperty p;
      p.name = std::string(1, static_cast<char>('x' + k));
      p.type = layout->positionType;
      p.role = Role::Position;
      p.channel = k;
      vertex.properties.push_back(p);
      layout->header.push_back({"", Kind::Property, 0, static_cast<std::size_t>(k)});
    }
    layout->elements.push_back(std::move(vertex));
    return layout;
  }

  // Which elements are written, and which of their properties still have values.
  void makeTables() {
    bool faces = false;
    for (const PlyElement& e : layout_->elements) {
      Table t;
      t.element = &e;
      t.count = e.count;
      if (e.role == PlyElement::Role::Vertex) t.count = mesh_.vertexCount();
      if (e.role == PlyElement::Role::Strips && !keepStrips_) t.dropped = true;
      if (e.role == PlyElement::Role::Face) {
        faces = true;
        t.first = keepStrips_ && hasStrips() ? e.firstFace : 0;
        t.count = keepStrips_ && hasStrips() ? e.faces : mesh_.faceCount();
      }
      tables_.push_back(std::move(t));
    }
    for (std::size_t line = 0; line < layout_->header.size(); ++line) {
      const PlyHeaderLine& h = layout_->header[line];
      if (h.kind == Kind::Element) tables_[h.element].line = h.text;
      if (h.kind != Kind::Property) continue;
      const PlyElement& e = layout_->elements[h.element];
      if (e.role != PlyElement::Role::Vertex && e.role != PlyElement::Role::Face) continue;
      const PlyProperty& p = e.properties[h.property];
      Slot slot{p, h.text, nullptr, line};
      if (p.role == Role::Attribute) {
        slot.attribute = mesh_.find(p.on, p.attribute);
        if (!slot.attribute || p.channel >= slot.attribute->width) continue;
        const bool list = p.on == Element::Corner || !slot.attribute->listOffsets.empty();
        if (list != p.countType.has_value()) continue;
      }
      tables_[h.element].slots.push_back(std::move(slot));
    }
    if (faces || mesh_.faceCount() == 0 || (keepStrips_ && hasStrips())) return;
    addFaceTable();
  }

  // Faces where the input had none or had strips that no longer hold: in the strips' place, else at the end.
  void addFaceTable() {
    ownFace_.name = "face";
    ownFace_.role = PlyElement::Role::Face;
    Table t;
    t.element = &ownFace_;
    t.count = mesh_.faceCount();
    t.slots.push_back({indices(), "", nullptr, kAdded});
    auto at = std::find_if(tables_.begin(), tables_.end(), [](const Table& x) { return x.dropped; });
    tables_.insert(at, std::move(t));
  }

  Table* tableOf(PlyElement::Role role) {
    for (Table& t : tables_)
      if (t.element->role == role && !t.dropped) return &t;
    return nullptr;
  }

  // Attributes that the layout does not know: new properties behind the old ones.
  void addAttributes() {
    std::vector<std::string> lost;
    for (const Attribute& a : mesh_.attributes()) {
      if (mesh_.find(a.on, a.name) != &a) {
        lost.push_back(a.name);
        continue;
      }
      if (a.on == Element::Corner && !written(a)) {
        if (const auto value = valuePerVertex(mesh_, a); !value.empty() || mesh_.cornerCount() == 0) {
          spread_.push_back(std::make_unique<Attribute>(onVertices(a, value)));
          addChannels(*spread_.back(), tableOf(PlyElement::Role::Vertex));
          continue;
        }
      }
      Table* t = tableOf(a.on == Element::Vertex ? PlyElement::Role::Vertex : PlyElement::Role::Face);
      if (t)
        addChannels(a, t);
      else
        lost.push_back(a.name);
    }
    reportDropped(context_.report, lost, 0, 0);
  }
  bool written(const Attribute& a) const {
    for (const Table& t : tables_)
      for (const Slot& s : t.slots)
        if (s.attribute == &a) return true;
    return false;
  }
  Attribute onVertices(const Attribute& a, const std::vector<Index>& value) const {
    Attribute out{a.name, Element::Vertex, a.width, a.onSplit, {}, {}, {}};
    if (a.name == "uv") out.width = std::min(a.width, 2);
    out.data = makeData(a.type(), mesh_.vertexCount() * static_cast<std::size_t>(out.width));
    for (std::size_t v = 0; v < value.size(); ++v)
      for (int k = 0; k < out.width && value[v] != kNoIndex; ++k) out.set(v, k, a.get(value[v], k));
    return out;
  }
  void addChannels(const Attribute& a, Table* t) {
    const bool list = a.on == Element::Corner || !a.listOffsets.empty();
    for (int k = 0; k < (list ? 1 : a.width); ++k) {
      const bool there = std::any_of(t->slots.begin(), t->slots.end(), [&](const Slot& s) {
        return s.attribute == &a && (list || s.property.channel == k);
      });
      if (there) continue;
      PlyProperty p;
      p.name = !list            ? channelName(a, k)
               : a.name == "uv" ? "texcoord"
                                : channelName({a.name, a.on, 1, {}, {}, {}, {}}, 0);
      const auto taken = [&] {
        return std::any_of(t->slots.begin(), t->slots.end(), [&](const Slot& s) { return s.property.name == p.name; });
      };
      for (const std::string base = p.name; taken();) p.name += "_";
      p.type = a.type();
      if (list) p.countType = ScalarType::UInt8;
      p.attribute = a.name;
      p.on = a.on;
      p.channel = k;
      t->slots.push_back({p, "", &a, kAdded});
    }
  }

  // Longest list of a slot, for its count type.
  std::size_t longestList(const Table& t, const Slot& s) const {
    std::size_t longest = 0;
    for (std::size_t r = t.first; r < t.first + t.count; ++r) {
      std::size_t n = 0;
      if (s.property.role == Role::Indices)
        n = mesh_.face(r).size();
      else if (s.property.on == Element::Corner)
        n = mesh_.face(r).size() * static_cast<std::size_t>(s.attribute->width);
      else
        n = s.attribute->listOffsets[r + 1] - s.attribute->listOffsets[r];
      longest = std::max(longest, n);
    }
    return longest;
  }

  static double largest(ScalarType type) {
    return withScalar(type, [](auto x) { return static_cast<double>(std::numeric_limits<decltype(x)>::max()); });
  }
  // Types stay as declared unless the values no longer fit.
  void fitTypes(const Table& t, Slot& s) {
    PlyProperty p = s.property;
    if (p.countType && !(static_cast<double>(longestList(t, s)) <= largest(*p.countType)))
      p.countType = ScalarType::Int32;
    if (p.role == Role::Indices) {
      if (mesh_.vertexCount() != 0 && static_cast<double>(mesh_.vertexCount() - 1) > largest(p.type))
        p.type = ScalarType::Int32;
    } else if (p.role == Role::Position) {
      p.type = positionTypeFor(p);
    } else {
      p.type = s.attribute->type();
    }
    if (p.type != s.property.type || p.countType != s.property.countType) s.line.clear();
    s.property = p;
    if (!s.line.empty()) return;
    s.line = p.countType ? fmt::format("property list {} {} {}", plyTypeName(*p.countType), plyTypeName(p.type), p.name)
                         : fmt::format("property {} {}", plyTypeName(p.type), p.name);
  }
  ScalarType positionTypeFor(const PlyProperty& p) const {
    const bool changed = layout_->positionType == ScalarType::Float32 && mesh_.positionType() != ScalarType::Float32;
    if (context_.options.precision == Precision::Double || changed) return ScalarType::Float64;
    if (p.type == ScalarType::Float64) return p.type;
    for (const Vec3& v : mesh_.positions()) {
      const double x = v[p.channel];
      const bool fits = withScalar(p.type, [&](auto zero) {
        using T = decltype(zero);
        if constexpr (std::is_same_v<T, float>)
          return !std::isfinite(x) || std::abs(x) <= std::numeric_limits<float>::max();
        else
          return x >= static_cast<double>(std::numeric_limits<T>::min()) &&
                 x <= static_cast<double>(std::numeric_limits<T>::max()) && x == std::trunc(x);
      });
      if (!fits) return ScalarType::Float64;
    }
    return p.type;
  }

  void line(const std::string& text) {
    out_.text(text);
    out_.text(layout_->eol);
  }
  void declare(const Table& t) {
    const bool same = !t.line.empty() && t.count == t.element->count;
    line(same ? t.line : fmt::format("element {} {}", t.element->name, t.count));
  }
  void declareAdded(const Table& t) {
    for (const Slot& s : t.slots)
      if (s.headerLine == kAdded) line(s.line);
  }
  void declareOwnFaces() {
    for (const Table& t : tables_) {
      if (t.element != &ownFace_) continue;
      declare(t);
      declareAdded(t);
    }
  }
  // The lines as they stood; new properties follow the last old one of their element.
  void writeHeader() {
    line("ply");
    bool ownFaces = false;
    for (std::size_t h = 0; h < layout_->header.size(); ++h) {
      const PlyHeaderLine& old = layout_->header[h];
      if (old.kind == Kind::Text) {
        line(relocatedComment(old.text));
        continue;
      }
      const PlyElement& e = layout_->elements[old.element];
      const Table& t = *std::find_if(tables_.begin(), tables_.end(), [&](const Table& x) { return x.element == &e; });
      if (t.dropped) {
        if (!ownFaces) declareOwnFaces();
        ownFaces = true;
      } else if (old.kind == Kind::Element) {
        declare(t);
      } else if (e.role != PlyElement::Role::Vertex && e.role != PlyElement::Role::Face) {
        line(old.text);
      } else {
        for (const Slot& s : t.slots)
          if (s.headerLine == h) line(s.line);
        if (old.property + 1 == e.properties.size()) declareAdded(t);
      }
    }
    if (!ownFaces) declareOwnFaces();
    line("end_header");
  }

  std::string relocatedComment(const std::string& text) const {
    constexpr std::string_view kTexture = "comment TextureFile ";
    if (text.rfind(kTexture, 0) != 0) return text;
    return std::string(kTexture) + relocated(text.substr(kTexture.size()), layout_->folder, context_.folder);
  }

  template <class T>
  void scalar(T value) {
    if (ascii()) {
      if (!rowStart_) out_.put(' ');
      rowStart_ = false;
      if constexpr (std::is_floating_point_v<T>)
        out_.number(value);
      else
        out_.integer(value);
    } else if ((layout_->encoding == PlyEncoding::Big) == (std::endian::native == std::endian::little)) {
      out_.raw(loadScalar<T, true>(reinterpret_cast<const char*>(&value)));
    } else {
      out_.raw(value);
    }
  }
  void typed(ScalarType type, double value) {
    withScalar(type, [&](auto zero) {
      using T = decltype(zero);
      if constexpr (std::is_same_v<T, float>)
        scalar(narrow(value));
      else
        scalar(static_cast<T>(value));
    });
  }
  void position(const PlyProperty& p, double value) {
    // A text file declared "float" whose decimals hold more than that keeps them.
    if (ascii() && p.type == ScalarType::Float32 && mesh_.positionType() != ScalarType::Float32)
      scalar(value);
    else
      typed(p.type, value);
  }
  void values(const Attribute& a, std::size_t first, std::size_t count) {
    std::visit(
        [&](const auto& v) {
          for (std::size_t i = first; i < first + count; ++i) scalar(v[i]);
        },
        a.data);
  }
  void slot(const Slot& s, std::size_t row) {
    const PlyProperty& p = s.property;
    if (p.role == Role::Position) {
      position(p, mesh_.positions()[row][p.channel]);
    } else if (p.role == Role::Indices) {
      const auto face = mesh_.face(row);
      typed(*p.countType, static_cast<double>(face.size()));
      for (const Index c : face) typed(p.type, c);
    } else if (p.on == Element::Corner) {
      cornerList(p, *s.attribute, row);
    } else if (p.countType) {
      const std::size_t begin = s.attribute->listOffsets[row], end = s.attribute->listOffsets[row + 1];
      typed(*p.countType, static_cast<double>(end - begin));
      values(*s.attribute, begin, end - begin);
    } else {
      values(*s.attribute, row * static_cast<std::size_t>(s.attribute->width) + static_cast<std::size_t>(p.channel), 1);
    }
  }
  void cornerList(const PlyProperty& p, const Attribute& a, std::size_t face) {
    const auto width = static_cast<std::size_t>(a.width);
    const std::size_t begin = mesh_.faceBegin(face), end = mesh_.faceBegin(face + 1);
    typed(*p.countType, static_cast<double>((end - begin) * width));
    for (std::size_t c = begin; c < end; ++c) {
      const Index value = cornerValue(a, c);
      if (value != kNoIndex)
        values(a, value * width, width);
      else
        for (std::size_t k = 0; k < width; ++k) typed(a.type(), 0);
    }
  }
  void writeRaw(const std::vector<char>& raw) {
    out_.bytes(raw.data(), raw.size());
    if (ascii() && !raw.empty() && raw.back() != '\n' && raw.back() != '\r') out_.text(layout_->eol);
  }
  void writeRows(const Table& t) {
    for (std::size_t row = t.first; row < t.first + t.count; ++row) {
      rowStart_ = true;
      for (const Slot& s : t.slots) slot(s, row);
      if (ascii()) out_.text(layout_->eol);
    }
  }

  const Mesh& mesh_;
  Output& out_;
  const WriteContext& context_;
  std::shared_ptr<const PlyLayout> layout_;
  bool keepStrips_ = false, rowStart_ = true;
  PlyElement ownFace_;
  std::vector<Table> tables_;
  std::vector<std::unique_ptr<Attribute>> spread_;
};

}  // namespace

void writePly(const WriteContext& context) { PlyWriter(context).write(); }

}  // namespace fielddeform::mesh::formats
