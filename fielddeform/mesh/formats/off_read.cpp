#include <fielddeform/mesh/formats/off.h>
#include <fielddeform/mesh/formats/text.h>
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace fielddeform::mesh::formats {
namespace {

using Before = OffLayout::Before;

class OffReader {
 public:
  explicit OffReader(const ReadContext& context)
      : context_(context), source_(context.source), at_(source_.begin()), end_(source_.end()) {}

  Mesh read() {
    const char* eol = findEol(at_, end_);
    layout_->eol = std::string(eol, skipEol(eol, end_));
    if (layout_->eol.empty()) layout_->eol.assign(1, '\n');
    readMagic();
    readCounts();
    for (std::uint64_t v = 0; v < vertexCount_; ++v) readVertex(v);
    for (std::uint64_t f = 0; f < faceCount_; ++f) readFace(f);
    // What follows the faces are edges in files that have them; nothing else is known to stand there.
    if (nextRow(Before::Face, faceCount_)) fail("after the last face", excerpt(at_, end_), "end of file");
    return build();
  }

 private:
  [[noreturn]] void fail(std::string element, std::string found, std::string expected) const {
    source_.failText(at_, std::move(element), std::move(found), std::move(expected));
  }

  // To the first token of the next line that has one; keeps the comments on the way. False at the end of the file.
  bool nextRow(Before before, std::size_t row) {
    for (;;) {
      while (at_ < end_ && (isBlank(*at_) || isEol(*at_))) ++at_;
      if (at_ >= end_) return false;
      if (*at_ != '#') return true;
      keepComment(before, row);
    }
  }
  void keepComment(Before before, std::size_t row) {
    const char* begin = at_;
    while (at_ < end_ && !isEol(*at_)) ++at_;
    layout_->comments.push_back({before, row, {begin, at_}});
  }
  // To the next token of this line. False at its end.
  bool nextToken() {
    at_ = skipBlanks(at_, end_);
    return at_ < end_ && !isEol(*at_) && *at_ != '#';
  }
  bool atTokenEnd(const char* p) const noexcept { return p >= end_ || isBlank(*p) || isEol(*p); }

  void readMagic() {
    if (!nextRow(Before::Magic, 0)) fail("header", "end of file", "'OFF'");
    const std::string_view word(at_, static_cast<std::size_t>(skipToken(at_, end_) - at_));
    if (isDigit(word[0])) {
      if (word != "4OFF") return;  // some writers leave the word out
    }
    std::string_view rest = word;
    if (rest.size() < 3 || rest.substr(rest.size() - 3) != "OFF") fail("header", excerpt(at_, end_), "'OFF'");
    rest.remove_suffix(3);
    const auto take = [&](std::string_view flag) {
      if (!rest.starts_with(flag)) return false;
      rest.remove_prefix(flag.size());
      return true;
    };
    texture_ = take("ST");
    color_ = take("C");
    normal_ = take("N");
    if (!rest.empty()) fail("header", excerpt(at_, end_), "points in three dimensions");
    layout_->magic = word;
    at_ += word.size();
    if (!nextToken()) return;
    if (std::string_view(at_, static_cast<std::size_t>(end_ - at_)).starts_with("BINARY"))
      fail("header", "'BINARY'", "a text file (binary OFF is not supported)");
    layout_->countsOnMagicLine = true;
  }

  std::uint64_t count(const char* what) {
    std::int64_t value = -1;
    const char* stop = nextToken() ? parseInteger(at_, end_, value) : nullptr;
    if (!stop || !atTokenEnd(stop) || value < 0)
      fail("header", excerpt(at_, end_), fmt::format("the number of {}", what));
    at_ = stop;
    return static_cast<std::uint64_t>(value);
  }
  void readCounts() {
    if (!layout_->countsOnMagicLine && !nextRow(Before::Counts, 0)) fail("header", "end of file", "the counts");
    vertexCount_ = count("vertices");
    faceCount_ = count("faces");
    if (nextToken()) layout_->edges = count("edges");
    endRow("header");
    // A vertex is at least "0 0 0\n", a face "1 0\n".
    const auto left = static_cast<std::uint64_t>(end_ - at_) + 1;
    if (vertexCount_ > left / 6 || faceCount_ > (left - 6 * vertexCount_) / 4)
      fail("header", fmt::format("{} bytes left", end_ - at_),
           fmt::format("{} vertices and {} faces", vertexCount_, faceCount_));
    if (vertexCount_ > kMaxCount)
      fail("header", fmt::format("{} vertices", vertexCount_), fmt::format("at most {}", kMaxCount));
    positions_.reserve(vertexCount_);
  }
  void endRow(const std::string& element) {
    if (nextToken()) fail(element, excerpt(at_, end_), "end of line");
  }

  void readVertex(std::uint64_t index) {
    if (!nextRow(Before::Vertex, index)) fail(fmt::format("vertex {}", index), "end of file", "x y z");
    if (index % 8192 == 0) source_.advance(at_);
    const char* begin = at_;
    double v[12];
    std::size_t n = 0;
    for (; n < 12 && nextToken(); ++n) {
      const char* stop = parseDouble(at_, end_, v[n]);
      if (!stop || !atTokenEnd(stop)) fail(fmt::format("vertex {}", index), excerpt(at_, end_), "a number");
      whole_ =
          whole_ && (n < 3 || std::find_if(at_, stop, [](char c) { return c == '.' || c == 'e' || c == 'E'; }) == stop);
      at_ = stop;
    }
    const std::size_t fixed = 3 + (normal_ ? 3u : 0u) + (texture_ ? 2u : 0u);
    const std::size_t extra = n >= fixed ? n - fixed : 99;
    if (index == 0) colors_ = extra;
    if ((extra != 0 && extra != 3 && extra != 4) || extra != colors_)
      fail(fmt::format("vertex {}", index), fmt::format("{} numbers", n),
           index != 0 ? fmt::format("{}", fixed + colors_) : fmt::format("{}, and 3 or 4 of a colour", fixed));
    positions_.emplace_back(v[0], v[1], v[2]);
    checkFinite(context_, positions_.back(), index, [&](std::string element, std::string found, std::string expected) {
      source_.failText(begin, std::move(element), std::move(found), std::move(expected));
    });
    const double* p = v + 3;
    if (normal_) normals_.insert(normals_.end(), p, p + 3), p += 3;
    colorValues_.insert(colorValues_.end(), p, p + colors_), p += colors_;
    if (texture_) textures_.insert(textures_.end(), p, p + 2);
    endRow(fmt::format("vertex {}", index));
  }

  void readFace(std::uint64_t index) {
    if (!nextRow(Before::Face, index)) fail(fmt::format("face {}", index), "end of file", "its number of corners");
    if (index % 8192 == 0) source_.advance(at_);
    const auto where = [&] { return fmt::format("face {}", index); };
    std::int64_t n = 0;
    const char* stop = parseInteger(at_, end_, n);
    if (!stop || !atTokenEnd(stop) || n < 1) fail(where(), excerpt(at_, end_), "a number of corners >= 1");
    at_ = stop;
    if (corners_.size() + static_cast<std::uint64_t>(n) > kMaxCount)
      fail(where(), fmt::format("{} corners", n), "fewer");
    for (std::int64_t k = 0; k < n; ++k) {
      std::int64_t v = -1;
      stop = nextToken() ? parseInteger(at_, end_, v) : nullptr;
      if (!stop || !atTokenEnd(stop)) fail(where(), excerpt(at_, end_), fmt::format("{} vertex indices", n));
      if (v < 0 || v >= static_cast<std::int64_t>(vertexCount_))
        fail(where(), fmt::format("vertex {}", v), fmt::format("less than {}", vertexCount_));
      corners_.push_back(static_cast<Index>(v));
      at_ = stop;
    }
    if (n != 3 && offsets_.empty())
      for (std::uint64_t f = 0; f <= index; ++f) offsets_.push_back(static_cast<Index>(3 * f));
    if (!offsets_.empty()) offsets_.push_back(static_cast<Index>(corners_.size()));
    keepTail();
  }
  // Colours are 0 to 4 numbers, whole or not, or an index into a map: kept as text.
  void keepTail() {
    at_ = skipBlanks(at_, end_);
    const char* begin = at_;
    while (at_ < end_ && !isEol(*at_) && *at_ != '#') ++at_;
    const char* stop = at_;
    while (stop > begin && isBlank(stop[-1])) --stop;
    const std::string_view text(begin, static_cast<std::size_t>(stop - begin));
    auto& tails = layout_->tails;
    if (tails.empty() || tails.back().text != text) tails.push_back({0, {begin, stop}});
    ++tails.back().faces;
  }

  void addAttributes(Mesh& mesh) {
    auto& list = mesh.attributes();
    if (normal_) list.push_back({"normal", Element::Vertex, 3, Interpolation::Direction, std::move(normals_), {}, {}});
    if (!colorValues_.empty()) {
      const bool bytes =
          whole_ && std::all_of(colorValues_.begin(), colorValues_.end(), [](double x) { return x >= 0 && x <= 255; });
      Attribute color{"color", Element::Vertex, static_cast<int>(colors_), Interpolation::Linear, {}, {}, {}};
      if (bytes)
        color.data = std::vector<std::uint8_t>(colorValues_.begin(), colorValues_.end());
      else
        color.data = std::move(colorValues_);
      list.push_back(std::move(color));
    }
    if (texture_) list.push_back({"uv", Element::Vertex, 2, Interpolation::Linear, std::move(textures_), {}, {}});
  }
  Mesh build() {
    layout_->faces = faceCount_;
    layout_->vertices = vertexCount_;
    Mesh mesh = offsets_.empty() ? Mesh(std::move(positions_), std::move(corners_))
                                 : Mesh(std::move(positions_), std::move(corners_), std::move(offsets_));
    addAttributes(mesh);
    mesh.setPositionType(ScalarType::Float64);
    mesh.setLayout(layout_);
    return mesh;
  }

  const ReadContext& context_;
  const Source& source_;
  const char *at_, *end_;
  std::shared_ptr<OffLayout> layout_ = std::make_shared<OffLayout>();
  bool texture_ = false, color_ = false, normal_ = false;
  bool whole_ = true;       // no colour so far has a point or an exponent
  std::size_t colors_ = 0;  // channels
  std::uint64_t vertexCount_ = 0, faceCount_ = 0;
  std::vector<Vec3> positions_;
  std::vector<double> normals_, colorValues_, textures_;
  std::vector<Index> corners_, offsets_;
};

}  // namespace

Mesh readOff(const ReadContext& context) { return OffReader(context).read(); }

}  // namespace fielddeform::mesh::formats
