#include <fielddeform/mesh/formats/obj.h>
#include <fielddeform/mesh/formats/text.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string_view>

namespace fielddeform::mesh::formats {
namespace {

using Kind = ObjRun::Kind;

struct Counts {
  std::uint64_t vertices = 0, textures = 0, normals = 0, faces = 0;
};

// What a statement is, by its first letters.
Kind kindOf(const char* p, const char* end) noexcept {
  if (end - p < 2) return Kind::Raw;
  if (p[0] == 'v') {
    if (isBlank(p[1])) return Kind::Vertex;
    if (end - p > 2 && isBlank(p[2])) {
      if (p[1] == 't') return Kind::Texture;
      if (p[1] == 'n') return Kind::Normal;
    }
    return Kind::Raw;
  }
  if (isBlank(p[1]) || isEol(p[1])) {
    if (p[0] == 'f') return Kind::Face;
    if (p[0] == 'l') return Kind::Line;
    if (p[0] == 'p') return Kind::Points;
  }
  constexpr std::string_view kMtllib = "mtllib";
  const bool library = static_cast<std::size_t>(end - p) > kMtllib.size() &&
                       std::memcmp(p, kMtllib.data(), kMtllib.size()) == 0 && isBlank(p[kMtllib.size()]);
  return library ? Kind::Mtllib : Kind::Raw;
}

class ObjReader {
 public:
  explicit ObjReader(const ReadContext& context)
      : context_(context), source_(context.source), at_(source_.begin()), end_(source_.end()) {}

  Mesh read() {
    findLineEnd();
    count();
    reserve();
    for (std::uint64_t statement = 0; at_ < end_; ++statement) {
      if (statement % 8192 == 0) source_.advance(at_);
      readStatement();
    }
    return build();
  }

 private:
  [[noreturn]] void fail(const char* at, std::string element, std::string found, std::string expected) const {
    source_.failText(at, std::move(element), std::move(found), std::move(expected));
  }

  // "\n", "\r\n", or "\r" alone in very old files.
  void findLineEnd() {
    const char* line = lineEnd(at_);
    if (line < end_)
      layout_->eol = line > at_ && line[-1] == '\r' ? "\r\n" : "\n";
    else if (std::find(at_, end_, '\r') < end_)
      layout_->eol = "\r";
    newline_ = layout_->eol.back();
  }
  const char* lineEnd(const char* p) const noexcept {
    if (p >= end_) return end_;
    const void* stop = std::memchr(p, newline_, static_cast<std::size_t>(end_ - p));
    return stop ? static_cast<const char*>(stop) : end_;
  }
  // The end of the statement at p: lines that end in "\" go on, except comments.
  const char* statementEnd(const char* p) const noexcept {
    const char* first = skipBlanks(p, end_);
    const char* stop = lineEnd(p);
    if (first < end_ && *first == '#') return stop;
    while (stop < end_ && continued(p, stop)) stop = lineEnd(stop + 1);
    return stop;
  }
  bool continued(const char* p, const char* stop) const noexcept {
    if (stop > p && stop[-1] == '\r') --stop;
    return stop > p && stop[-1] == '\\';
  }

  void count() {
    for (const char* p = at_; p < end_;) {
      const char* stop = statementEnd(p);
      switch (kindOf(skipBlanks(p, stop), stop)) {
        case Kind::Vertex:
          ++counts_.vertices;
          break;
        case Kind::Texture:
          ++counts_.textures;
          break;
        case Kind::Normal:
          ++counts_.normals;
          break;
        case Kind::Face:
          ++counts_.faces;
          break;
        default:
          break;
      }
      p = stop + (stop < end_);
    }
    if (counts_.vertices == 0) source_.failText(at_, "", "no vertex", "at least one 'v' statement");
    if (counts_.vertices > kMaxCount || counts_.textures > kMaxCount || counts_.normals > kMaxCount)
      source_.failText(at_, "", "too many vertices", fmt::format("at most {}", kMaxCount));
  }
  void reserve() {
    positions_.reserve(counts_.vertices);
    corners_.reserve(3 * counts_.faces);
    if (counts_.faces == 0) return;
    uv_.reserve(2 * counts_.textures);
    normal_.reserve(3 * counts_.normals);
  }

  void readStatement() {
    const char* begin = at_;
    const char* p = skipBlanks(at_, end_);
    const Kind kind = kindOf(p, end_);
    const bool loose = counts_.faces == 0 && (kind == Kind::Texture || kind == Kind::Normal);
    if (loose || kind == Kind::Raw || kind == Kind::Mtllib) {
      readRaw(begin, kind == Kind::Mtllib ? Kind::Mtllib : Kind::Raw);
      return;
    }
    at_ = p + (kind == Kind::Texture || kind == Kind::Normal ? 2 : 1);
    switch (kind) {
      case Kind::Vertex:
        readVertex();
        break;
      case Kind::Texture:
        readTexture();
        break;
      case Kind::Normal:
        readNormal();
        break;
      case Kind::Face:
        readFace();
        break;
      case Kind::Line:
        readLine();
        break;
      default:
        readPoints();
        break;
    }
    endStatement();
  }

  void addRun(Kind kind, std::uint32_t width, std::uint64_t count = 1) {
    if (!layout_->runs.empty()) {
      ObjRun& last = layout_->runs.back();
      if (last.kind == kind && last.width == width && kind != Kind::Mtllib) {
        last.count += count;
        return;
      }
    }
    layout_->runs.push_back({kind, width, count});
  }
  void readRaw(const char* begin, Kind kind) {
    const char* stop = statementEnd(begin);
    const bool closed = stop < end_;
    // The last line gets its end, unless it is a "\" that would go on in a line that is not there.
    std::string_view end = closed ? std::string_view(stop, 1) : std::string_view(layout_->eol);
    if (!closed && stop > begin && stop[-1] == newline_) end = {};
    addRun(kind, 0, static_cast<std::uint64_t>(stop - begin) + end.size());
    layout_->text.append(begin, stop);
    layout_->text.append(end);
    at_ = stop + closed;
  }

  // To the next token of the statement, over continued lines. False at its end.
  bool nextToken() {
    for (;;) {
      at_ = skipBlanks(at_, end_);
      if (at_ >= end_ || isEol(*at_) || *at_ == '#') return false;
      if (*at_ != '\\' || at_ + 1 >= end_ || !isEol(at_[1])) return true;
      at_ = skipEol(at_ + 1, end_);
    }
  }
  bool atTokenEnd(const char* p) const noexcept {
    return p >= end_ || isBlank(*p) || isEol(*p) || *p == '\\' || *p == '#';
  }

  void endStatement() {
    if (nextToken()) fail(at_, "", excerpt(at_, end_), "end of line");
    if (at_ < end_ && *at_ == '#') {
      readRaw(at_, Kind::Raw);
      return;
    }
    const char* stop = lineEnd(at_);
    // The other kind of line end in mid-line would hide what follows it.
    if (stop > at_ + (at_ < end_ && newline_ == '\n' && *at_ == '\r'))
      fail(at_, "", "a stray line end", "one kind of line end");
    at_ = stop + (stop < end_);
  }

  // Up to `most` numbers of a statement; returns how many there were.
  std::uint32_t readNumbers(double* values, std::uint32_t most, const char* element, std::uint64_t index) {
    std::uint32_t n = 0;
    while (n < most && nextToken()) {
      const char* stop = parseDouble(at_, end_, values[n]);
      if (!stop || !atTokenEnd(stop)) fail(at_, fmt::format("{} {}", element, index), excerpt(at_, end_), "a number");
      at_ = stop;
      ++n;
    }
    return n;
  }

  void readVertex() {
    double v[8];
    const char* begin = at_;
    const std::size_t index = positions_.size();
    const std::uint32_t n = readNumbers(v, 8, "vertex", index);
    if (n != 3 && n != 4 && n != 6 && n != 7)
      fail(begin, fmt::format("vertex {}", index), fmt::format("{} numbers", n), "x y z, x y z w, x y z r g b (a)");
    positions_.emplace_back(v[0], v[1], v[2]);
    checkFinite(context_, positions_.back(), index, [&](std::string element, std::string found, std::string expected) {
      fail(begin, std::move(element), std::move(found), std::move(expected));
    });
    addRun(Kind::Vertex, n);
    if (n == 3) return;
    if (n == 4) {
      weight_.resize(index, 1.0);
      weight_.push_back(v[3]);
      return;
    }
    color_.resize(4 * index, 1.0);
    color_.insert(color_.end(), {v[3], v[4], v[5], n == 7 ? v[6] : 1.0});
    alpha_ = alpha_ || n == 7;
  }
  void readTexture() {
    double v[3] = {0, 0, 0};
    const char* begin = at_;
    const std::uint32_t n = readNumbers(v, 3, "vt", textures_);
    if (n == 0) fail(begin, fmt::format("vt {}", textures_), "no number", "u, u v or u v w");
    if (n == 3 && uvWidth_ == 2) widenTexture();
    uv_.insert(uv_.end(), v, v + uvWidth_);
    ++textures_;
    addRun(Kind::Texture, n);
  }
  void widenTexture() {
    std::vector<double> wide;
    wide.reserve(3 * counts_.textures);
    for (std::size_t i = 0; i < textures_; ++i) wide.insert(wide.end(), {uv_[2 * i], uv_[2 * i + 1], 0.0});
    uv_ = std::move(wide);
    uvWidth_ = 3;
  }
  void readNormal() {
    double v[3];
    const char* begin = at_;
    const std::uint32_t n = readNumbers(v, 3, "vn", normal_.size() / 3);
    if (n != 3) fail(begin, fmt::format("vn {}", normal_.size() / 3), fmt::format("{} numbers", n), "3 numbers");
    normal_.insert(normal_.end(), v, v + 3);
    addRun(Kind::Normal, 3);
  }

  // One index, 1-based or counted back from the last; becomes 0-based.
  Index readIndex(const char* element, std::uint64_t number, const char* what, std::uint64_t all, std::uint64_t soFar,
                  bool& relative) {
    std::int64_t value = 0;
    const char* begin = at_;
    const char* stop = parseInteger(at_, end_, value);
    if (!stop)
      fail(begin, fmt::format("{} {}", element, number), excerpt(begin, end_), fmt::format("a {} index", what));
    relative = value < 0;
    const std::int64_t index = value < 0 ? static_cast<std::int64_t>(soFar) + value : value - 1;
    if (index < 0 || index >= static_cast<std::int64_t>(all))
      fail(begin, fmt::format("{} {}", element, number), fmt::format("{} {}", what, value),
           value < 0 ? fmt::format("at most {} back", soFar) : fmt::format("1 to {}", all));
    at_ = stop;
    return static_cast<Index>(index);
  }
  struct Corner {
    Index vertex = kNoIndex, texture = kNoIndex, normal = kNoIndex;
    bool relative = false;
  };
  Corner readCorner(const char* element, std::uint64_t number, bool normals) {
    Corner c;
    bool back = false;
    c.vertex = readIndex(element, number, "vertex", counts_.vertices, positions_.size(), c.relative);
    if (at_ < end_ && *at_ == '/') {
      ++at_;
      if (!atTokenEnd(at_) && *at_ != '/')
        c.texture = readIndex(element, number, "vt", counts_.textures, textures_, back),
        c.relative = c.relative && back;
      if (normals && at_ < end_ && *at_ == '/') {
        ++at_;
        if (!atTokenEnd(at_))
          c.normal = readIndex(element, number, "vn", counts_.normals, normal_.size() / 3, back),
          c.relative = c.relative && back;
      }
    }
    if (!atTokenEnd(at_))
      fail(at_, fmt::format("{} {}", element, number), excerpt(at_, end_), "the next corner or end of line");
    return c;
  }
  static void addReference(std::vector<Index>& list, std::size_t corner, Index value) {
    if (list.empty() && value == kNoIndex) return;
    list.resize(corner, kNoIndex);
    list.push_back(value);
  }
  void readFace() {
    const char* begin = at_;
    const std::size_t first = corners_.size();
    const std::uint64_t number = faceCount_;
    bool relative = true;
    while (nextToken()) {
      const Corner c = readCorner("face", number, true);
      addReference(uvIndex_, corners_.size(), c.texture);
      addReference(normalIndex_, corners_.size(), c.normal);
      corners_.push_back(c.vertex);
      relative = relative && c.relative;
    }
    const std::size_t n = corners_.size() - first;
    if (n == 0) fail(begin, fmt::format("face {}", number), "no corner", "at least one");
    if (corners_.size() > kMaxCount)
      fail(begin, fmt::format("face {}", number), "too many corners", fmt::format("at most {}", kMaxCount));
    if (n != 3 && offsets_.empty()) {
      offsets_.reserve(counts_.faces + 1);
      for (std::size_t f = 0; f <= number; ++f) offsets_.push_back(static_cast<Index>(3 * f));
    }
    if (!offsets_.empty()) offsets_.push_back(static_cast<Index>(corners_.size()));
    ++faceCount_;
    addRun(Kind::Face, relative);
  }
  void readLine() {
    Polyline line;
    const char* begin = at_;
    std::vector<Index>& texture = layout_->lineTexture;
    while (nextToken()) {
      const Corner c = readCorner("line", lines_.size(), false);
      addReference(texture, linePoints_++, c.texture);
      line.vertices.push_back(c.vertex);
    }
    if (line.vertices.empty()) fail(begin, fmt::format("line {}", lines_.size()), "no vertex", "at least one");
    lines_.push_back(std::move(line));
    addRun(Kind::Line, 0);
  }
  void readPoints() {
    const char* begin = at_;
    std::uint32_t n = 0;
    for (bool back = false; nextToken(); ++n) {
      points_.push_back(readIndex("point", points_.size(), "vertex", counts_.vertices, positions_.size(), back));
      if (!atTokenEnd(at_)) fail(at_, "point", excerpt(at_, end_), "the next point or end of line");
    }
    if (n == 0) fail(begin, fmt::format("point {}", points_.size()), "no vertex", "at least one");
    addRun(Kind::Points, n);
  }

  void addAttribute(std::string name, Element on, int width, Interpolation onSplit, std::vector<double> data,
                    std::vector<Index> indices) {
    attributes_.push_back({std::move(name), on, width, onSplit, std::move(data), std::move(indices), {}});
  }
  void addAttributes() {
    const std::size_t vertices = positions_.size();
    if (!color_.empty()) {
      color_.resize(4 * vertices, 1.0);
      if (!alpha_)
        for (std::size_t v = 0; v < vertices; ++v) std::copy_n(&color_[4 * v], 3, &color_[3 * v]);
      color_.resize((alpha_ ? 4 : 3) * vertices);
      addAttribute("color", Element::Vertex, alpha_ ? 4 : 3, Interpolation::Linear, std::move(color_), {});
    }
    if (!weight_.empty()) {
      weight_.resize(vertices, 1.0);
      addAttribute("w", Element::Vertex, 1, Interpolation::Linear, std::move(weight_), {});
    }
    if (textures_ != 0) {
      uvIndex_.resize(corners_.size(), kNoIndex);
      addAttribute("uv", Element::Corner, uvWidth_, Interpolation::Linear, std::move(uv_), std::move(uvIndex_));
    }
    if (!normal_.empty()) {
      normalIndex_.resize(corners_.size(), kNoIndex);
      addAttribute("normal", Element::Corner, 3, Interpolation::Direction, std::move(normal_), std::move(normalIndex_));
    }
  }
  Mesh build() {
    addAttributes();
    if (!layout_->lineTexture.empty()) layout_->lineTexture.resize(linePoints_, kNoIndex);
    layout_->folder = folderOf(source_.path);
    Mesh mesh = offsets_.empty() ? Mesh(std::move(positions_), std::move(corners_))
                                 : Mesh(std::move(positions_), std::move(corners_), std::move(offsets_));
    mesh.attributes() = std::move(attributes_);
    mesh.lines() = std::move(lines_);
    mesh.loosePoints() = std::move(points_);
    mesh.setPositionType(ScalarType::Float64);
    mesh.setLayout(layout_);
    return mesh;
  }

  const ReadContext& context_;
  const Source& source_;
  const char *at_, *end_;
  char newline_ = '\n';
  Counts counts_;
  std::shared_ptr<ObjLayout> layout_ = std::make_shared<ObjLayout>();
  std::vector<Vec3> positions_;
  std::vector<double> color_, weight_, uv_, normal_;
  bool alpha_ = false;
  int uvWidth_ = 2;
  std::size_t textures_ = 0, faceCount_ = 0, linePoints_ = 0;
  std::vector<Index> corners_, offsets_, uvIndex_, normalIndex_, points_;
  std::vector<Polyline> lines_;
  std::vector<Attribute> attributes_;
};

}  // namespace

Mesh readObj(const ReadContext& context) { return ObjReader(context).read(); }

}  // namespace fielddeform::mesh::formats
