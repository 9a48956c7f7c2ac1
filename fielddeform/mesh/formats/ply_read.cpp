#include <fielddeform/mesh/formats/ply_rows.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::mesh::formats {
namespace {

using Role = PlyProperty::Role;

class PlyReader {
 public:
  explicit PlyReader(const ReadContext& context) : context_(context), source_(context.source) {}

  Mesh read() {
    layout_ = readPlyHeader(source_, at_);
    for (const PlyElement& e : layout_->elements)
      if (e.role == PlyElement::Role::Vertex) vertexCount_ = e.count;
    if (vertexCount_ > kMaxCount)
      source_.failText(source_.begin(), "element vertex", fmt::format("{} vertices", vertexCount_),
                       fmt::format("at most {}", kMaxCount));
    for (PlyElement& e : layout_->elements) readElement(e);
    finishTrailing();
    return build();
  }

 private:
  bool ascii() const { return layout_->encoding == PlyEncoding::Ascii; }
  bool swapped() const {
    return (layout_->encoding == PlyEncoding::Big) == (std::endian::native == std::endian::little);
  }
  [[noreturn]] void fail(const char* at, std::string element, std::string found, std::string expected) const {
    if (ascii()) source_.failText(at, std::move(element), std::move(found), std::move(expected));
    source_.failBinary(at, std::move(element), std::move(found), std::move(expected));
  }

  // Refuses a count that the bytes left cannot hold, before anything is allocated for it.
  void checkCount(const PlyElement& e) const {
    std::uint64_t row = 0;
    for (const PlyProperty& p : e.properties)
      row += ascii() ? 2u : static_cast<std::uint64_t>(byteSize(p.countType.value_or(p.type)));
    const auto left = static_cast<std::uint64_t>(source_.end() - at_) + (ascii() ? 1u : 0u);
    if (row != 0 && e.count > left / row)
      fail(at_, "element " + e.name, fmt::format("{} bytes left", source_.end() - at_),
           fmt::format("{} rows of at least {} bytes", e.count, row));
  }

  void readElement(PlyElement& e) {
    checkCount(e);
    e.firstFace = faces_.count();
    const char* begin = at_;
    if (e.role == PlyElement::Role::Vertex) positions_.resize(e.count);
    makeColumns(e);
    std::uint64_t row = 0;
    if (!ascii()) {
      if (e.role == PlyElement::Role::Face)
        row = swapped() ? fastTriangles<true>(e) : fastTriangles<false>(e);
      else if (e.role != PlyElement::Role::Strips)
        row = swapped() ? fastRows<true>(e) : fastRows<false>(e);
    }
    if (row < e.count && !e.properties.empty()) {
      if (ascii())
        decode(AsciiRows(source_, at_), e, row);
      else if (swapped())
        decode(BinaryRows<true>(source_, at_), e, row);
      else
        decode(BinaryRows<false>(source_, at_), e, row);
    }
    e.faces = faces_.count() - e.firstFace;
    if (e.role == PlyElement::Role::Other || e.role == PlyElement::Role::Strips)
      e.raw = std::make_shared<const std::vector<char>>(begin, at_);
    for (Column& c : columns_)
      if (c.property->channel == 0 && !c.list.name.empty()) attributes_.push_back(std::move(c.list));
    columns_.clear();
  }

  // One column a property; a group's channels share the attribute of its first channel.
  void makeColumns(const PlyElement& e) {
    columns_.resize(e.properties.size());
    const bool keep = e.role == PlyElement::Role::Vertex || e.role == PlyElement::Role::Face;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      Column& c = columns_[k];
      c.property = &e.properties[k];
      if (!keep || c.property->role != Role::Attribute) continue;
      c.owner = k;
      for (std::size_t o = 0; o < columns_.size(); ++o)
        if (e.properties[o].attribute == c.property->attribute && e.properties[o].channel == 0 &&
            e.properties[o].role == Role::Attribute)
          c.owner = o;
      if (c.property->channel != 0) continue;
      Attribute& a = c.list;
      a.name = c.property->attribute;
      a.on = c.property->on;
      a.onSplit = c.property->onSplit;
      a.width = static_cast<int>(std::count_if(e.properties.begin(), e.properties.end(), [&](const PlyProperty& p) {
        return p.role == Role::Attribute && p.attribute == a.name;
      }));
      const std::size_t rows = e.firstFace * (a.on == Element::Face) + e.count;
      if (c.property->countType) {
        a.data = makeData(c.property->type, 0);
        a.listOffsets.assign(e.firstFace * (a.on == Element::Face) + 1, 0);
      } else {
        a.data = makeData(c.property->type, rows * static_cast<std::size_t>(a.width));
      }
    }
  }

  // Rows of fixed size: column after column through blocks that stay in the cache.
  template <bool Swap>
  std::uint64_t fastRows(const PlyElement& e) {
    std::size_t stride = 0;
    for (const PlyProperty& p : e.properties) {
      if (p.countType) return 0;
      stride += static_cast<std::size_t>(byteSize(p.type));
    }
    if (e.role == PlyElement::Role::Other) {
      at_ += stride * e.count;
      return e.count;
    }
    constexpr std::size_t kBlock = 4096;
    for (std::size_t row = 0; row < e.count; row += kBlock) {
      const std::size_t rows = std::min<std::size_t>(kBlock, e.count - row);
      const char* column = at_;
      for (const Column& c : columns_) {
        copyColumn<Swap>(c, column, stride, row, rows);
        column += byteSize(c.property->type);
      }
      for (std::size_t i = 0; i < rows; ++i) checkVertex(row + i, at_ + i * stride);
      at_ += stride * rows;
      source_.advance(at_);
    }
    return e.count;
  }

  template <bool Swap>
  void copyColumn(const Column& c, const char* from, std::size_t stride, std::size_t row, std::size_t rows) {
    const auto channel = static_cast<std::size_t>(c.property->channel);
    withScalar(c.property->type, [&](auto scalar) {
      using T = decltype(scalar);
      if (c.property->role == Role::Position) {
        double* to = positions_[row].data() + channel;
        for (std::size_t i = 0; i < rows; ++i, from += stride, to += 3) {
          const T value = loadScalar<T, Swap>(from);
          if constexpr (std::is_same_v<T, float>)
            *to = widen(value);
          else
            *to = static_cast<double>(value);
        }
      } else {
        Attribute& a = columns_[c.owner].list;
        const auto width = static_cast<std::size_t>(a.width);
        T* to = std::get<std::vector<T>>(a.data).data() + row * width + channel;
        for (std::size_t i = 0; i < rows; ++i, from += stride, to += width) *to = loadScalar<T, Swap>(from);
      }
    });
  }

  // Triangles of (uchar 3, three 4-byte indices) and nothing else, the common case. Stops at the first other row.
  template <bool Swap>
  std::uint64_t fastTriangles(const PlyElement& e) {
    const PlyProperty& p = e.properties.front();
    if (e.properties.size() != 1 || byteSize(*p.countType) != 1 || byteSize(p.type) != 4 || !faces_.uniform()) return 0;
    std::vector<Index>& corners = faces_.corners;
    const std::size_t before = corners.size();
    corners.resize(before + 3 * std::min<std::size_t>(e.count, static_cast<std::size_t>(source_.end() - at_) / 13));
    Index* to = corners.data() + before;
    const Index* last = corners.data() + corners.size();
    const auto limit = static_cast<Index>(vertexCount_);
    for (; to != last && *at_ == 3; at_ += 13, to += 3) {
      for (int k = 0; k < 3; ++k) to[k] = loadScalar<Index, Swap>(at_ + 1 + 4 * k);
      if ((to[0] >= limit) | (to[1] >= limit) | (to[2] >= limit)) break;  // decode() says which
    }
    corners.resize(static_cast<std::size_t>(to - corners.data()));
    source_.advance(at_);
    return (corners.size() - before) / 3;
  }

  template <class Rows>
  void decode(Rows rows, const PlyElement& e, std::uint64_t first) {
    for (std::uint64_t row = first; row < e.count; ++row) {
      rows.beginRow(e.name, row);
      const char* begin = rows.at();
      for (const Column& c : columns_) {
        const PlyProperty& p = *c.property;
        rows.beginProperty(p.name);
        if (p.countType)
          decodeList(rows, e, c);
        else
          decodeScalar(rows, e, c, row);
      }
      rows.endRow();
      if (e.role == PlyElement::Role::Vertex) checkVertex(row, begin);
      if (row % 8192 == 0) source_.advance(rows.at());
    }
    at_ = rows.at();
    faithful_ = faithful_ && rows.faithfulFloats();
  }

  template <class Rows>
  void decodeScalar(Rows& rows, const PlyElement& e, const Column& c, std::uint64_t row) {
    const PlyProperty& p = *c.property;
    if (p.role == Role::Position) {
      positions_[row][p.channel] = rows.coordinate(p.type);
    } else {
      const double value = rows.number(p.type);
      if (c.owner == kNoColumn) return;
      Attribute& a = columns_[c.owner].list;
      const std::size_t element = row + (a.on == Element::Face ? e.firstFace : 0);
      store(a.data, element * static_cast<std::size_t>(a.width) + static_cast<std::size_t>(p.channel), value);
    }
  }

  template <class Rows>
  void decodeList(Rows& rows, const PlyElement& e, const Column& c) {
    const PlyProperty& p = *c.property;
    const std::uint64_t n = rows.listCount(*p.countType, p.type);
    if (p.role == Role::Indices && e.role == PlyElement::Role::Strips) {
      faces_.beginStrip();
      for (std::uint64_t k = 0; k < n; ++k) faces_.addToStrip(rows.index(p.type, vertexCount_, -1));
    } else if (p.role == Role::Indices) {
      if (n == 0) rows.failHere("a face without corners", "at least one");
      for (std::uint64_t k = 0; k < n; ++k)
        faces_.corners.push_back(static_cast<Index>(rows.index(p.type, vertexCount_, 0)));
      faces_.endFace(n);
    } else {
      for (std::uint64_t k = 0; k < n; ++k) {
        const double value = rows.number(p.type);
        if (c.owner != kNoColumn) push(columns_[c.owner].list.data, value);
      }
      if (c.owner == kNoColumn) return;
      Attribute& a = columns_[c.owner].list;
      if (a.valueCount() > kMaxCount) rows.failHere("too many list values", fmt::format("at most {}", kMaxCount));
      a.listOffsets.push_back(static_cast<Index>(a.valueCount()));
    }
    if (faces_.corners.size() > kMaxCount) rows.failHere("too many corners", fmt::format("at most {}", kMaxCount));
  }

  void checkVertex(std::size_t vertex, const char* at) {
    checkFinite(context_, positions_[vertex], vertex,
                [&](std::string element, std::string found, std::string expected) {
                  fail(at, std::move(element), std::move(found), std::move(expected));
                });
  }

  void finishTrailing() {
    if (ascii()) {
      while (at_ < source_.end() && (isBlank(*at_) || isEol(*at_))) ++at_;
      if (at_ < source_.end()) fail(at_, "after the last element", excerpt(at_, source_.end()), "end of file");
    }
    if (!ascii()) {
      layout_->trailing.assign(at_, source_.end());
      context_.report.trailingBytes = layout_->trailing.size();
      context_.report.encoding = layout_->encoding == PlyEncoding::Big ? "binary big endian" : "binary little endian";
    }
  }

  // Texture coordinates as MeshLab and others store them: a list of (u, v) a corner.
  void liftTexcoords() {
    for (PlyElement& e : layout_->elements) {
      if (e.role != PlyElement::Role::Face || e.faces != faces_.count()) continue;
      for (PlyProperty& p : e.properties) {
        if (p.name != "texcoord" || !p.countType || p.attribute != p.name) continue;
        for (Attribute& a : attributes_) {
          if (a.on != Element::Face || a.name != p.attribute || !faces_.matches(a.listOffsets, 2)) continue;
          a.name = p.attribute = "uv";
          a.on = p.on = Element::Corner;
          a.width = 2;
          a.onSplit = Interpolation::Linear;
          a.listOffsets = {};
        }
      }
    }
  }

  Mesh build() {
    liftTexcoords();
    bool floats = true;
    for (const PlyElement& e : layout_->elements)
      for (const PlyProperty& p : e.properties)
        if (p.role == Role::Position) floats = floats && p.type == ScalarType::Float32;
    layout_->positionType = floats && faithful_ ? ScalarType::Float32 : ScalarType::Float64;
    for (Attribute& a : attributes_) {
      if (a.on != Element::Face) continue;
      if (a.listOffsets.empty()) {
        std::visit([&](auto& v) { v.resize(faces_.count() * static_cast<std::size_t>(a.width)); }, a.data);
      } else {
        a.listOffsets.resize(faces_.count() + 1, a.listOffsets.back());
      }
    }
    Mesh mesh = faces_.uniform() ? Mesh(std::move(positions_), std::move(faces_.corners))
                                 : Mesh(std::move(positions_), std::move(faces_.corners), std::move(faces_.offsets));
    mesh.attributes() = std::move(attributes_);
    mesh.setPositionType(layout_->positionType);
    for (const PlyElement& e : layout_->elements)
      if (e.role == PlyElement::Role::Strips) layout_->topology = hashCorners(mesh);
    mesh.setLayout(layout_);
    return mesh;
  }

  const ReadContext& context_;
  const Source& source_;
  const char* at_ = nullptr;
  std::shared_ptr<PlyLayout> layout_;
  std::uint64_t vertexCount_ = 0;
  bool faithful_ = true;
  std::vector<Vec3> positions_;
  FaceCollector faces_;
  std::vector<Column> columns_;
  std::vector<Attribute> attributes_;
};

}  // namespace

Mesh readPly(const ReadContext& context) { return PlyReader(context).read(); }

}  // namespace fielddeform::mesh::formats
