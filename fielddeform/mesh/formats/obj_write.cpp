#include <fielddeform/mesh/formats/obj.h>
#include <fielddeform/mesh/formats/text.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::mesh::formats {
namespace {

using Kind = ObjRun::Kind;

// The values of "vt" or "vn" statements, and the one that a corner refers to.
struct ValueList {
  const Attribute* attribute = nullptr;

  std::size_t size() const { return attribute ? attribute->valueCount() : 0; }
  Index at(const Mesh& mesh, std::size_t corner) const {
    if (!attribute) return kNoIndex;
    return attribute->on == Element::Vertex ? mesh.corners()[corner] : cornerValue(*attribute, corner);
  }
};

class ObjWriter {
 public:
  explicit ObjWriter(const WriteContext& context)
      : context_(context), mesh_(context.mesh), out_(context.out), type_(coordinateType(mesh_, context.options)) {}

  void write() {
    chooseAttributes();
    layout_ = layoutFor<ObjLayout>(mesh_, context_.report);
    makeRuns();
    for (const ObjRun& run : runs_) writeRun(run);
  }

 private:
  // Corner values where there are any, else those of the vertices.
  void chooseAttributes() {
    std::vector<std::string> lost;
    const auto choose = [&](std::string_view name) -> const Attribute* {
      const Attribute* a = mesh_.find(Element::Corner, name);
      if (!a) a = mesh_.find(Element::Vertex, name);
      return a && a->listOffsets.empty() && a->width <= 3 && (name == "uv" || a->width == 3) ? a : nullptr;
    };
    uv_.attribute = mesh_.cornerCount() != 0 ? choose("uv") : nullptr;
    normal_.attribute = mesh_.cornerCount() != 0 ? choose("normal") : nullptr;
    const auto scalar = [&](std::string_view name, int low, int high) -> const Attribute* {
      const Attribute* a = mesh_.find(Element::Vertex, name);
      return a && a->listOffsets.empty() && a->width >= low && a->width <= high ? a : nullptr;
    };
    color_ = scalar("color", 3, 4);
    weight_ = scalar("w", 1, 1);
    for (const Attribute& a : mesh_.attributes())
      if (&a != uv_.attribute && &a != normal_.attribute && &a != color_ && &a != weight_) lost.push_back(a.name);
    reportDropped(context_.report, lost, 0, 0);
  }

  std::uint32_t vertexWidth() const {
    if (color_) return color_->width == 4 ? 7 : 6;
    return weight_ ? 4 : 3;
  }
  std::uint64_t wanted(Kind kind) const {
    switch (kind) {
      case Kind::Vertex:
        return mesh_.vertexCount();
      case Kind::Texture:
        return uv_.size();
      case Kind::Normal:
        return normal_.size();
      case Kind::Face:
        return mesh_.faceCount();
      case Kind::Line:
        return mesh_.lines().size();
      case Kind::Points:
        return mesh_.loosePoints().size();
      default:
        return 0;
    }
  }

  // The input's runs, their counts brought to the mesh's: fewer values end early, new ones follow the last of a kind.
  void makeRuns() {
    if (layout_) runs_ = layout_->runs;
    if (layout_ && layout_->total(Kind::Face) != mesh_.faceCount())
      context_.report.dropped.push_back("which faces belong to which group: their number changed");
    for (const Kind kind : {Kind::Vertex, Kind::Texture, Kind::Normal, Kind::Face, Kind::Line, Kind::Points})
      fitRuns(kind);
  }
  void fitRuns(Kind kind) {
    std::uint64_t left = wanted(kind);
    std::size_t last = runs_.size();
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      ObjRun& run = runs_[i];
      if (run.kind != kind) continue;
      const std::uint64_t each = kind == Kind::Points ? run.width : 1;
      run.count = std::min(run.count, left / each);
      left -= run.count * each;
      last = i;
    }
    if (left == 0) return;
    std::uint32_t width = 0;
    if (kind == Kind::Vertex) width = vertexWidth();
    if (kind == Kind::Texture) width = static_cast<std::uint32_t>(uv_.attribute->width);
    if (kind == Kind::Points) width = 1;
    const auto isFace = [](const ObjRun& r) { return r.kind == Kind::Face; };
    auto at = last < runs_.size() ? runs_.begin() + static_cast<std::ptrdiff_t>(last) + 1 : runs_.end();
    if (last == runs_.size() && kind < Kind::Face) at = std::find_if(runs_.begin(), runs_.end(), isFace);
    runs_.insert(at, {kind, width, left});
  }

  void writeRun(const ObjRun& run) {
    if (run.kind == Kind::Raw || run.kind == Kind::Mtllib) {
      const std::string_view text = std::string_view(layout_->text).substr(rawDone_, run.count);
      rawDone_ += run.count;
      if (run.kind == Kind::Raw)
        out_.text(text);
      else
        writeLibrary(text);
      return;
    }
    for (std::uint64_t i = 0; i < run.count; ++i) {
      switch (run.kind) {
        case Kind::Vertex:
          writeVertex(run.width);
          break;
        case Kind::Texture:
          writeValue("vt", *uv_.attribute, textureDone_++, std::min(static_cast<int>(run.width), uv_.attribute->width));
          break;
        case Kind::Normal:
          writeValue("vn", *normal_.attribute, normalDone_++, 3);
          break;
        case Kind::Face:
          writeFace(run.width == 1);
          break;
        case Kind::Line:
          writeLine();
          break;
        default:
          writePoints(run.width);
          break;
      }
      out_.text(layout_ ? std::string_view(layout_->eol) : std::string_view("\n"));
    }
  }

  void writeVertex(std::uint32_t width) {
    const std::size_t v = vertexDone_++;
    out_.put('v');
    for (int k = 0; k < 3; ++k) {
      out_.put(' ');
      writeCoordinate(out_, mesh_.positions()[v][k], type_);
    }
    if (width == 4 && weight_) writeChannels(*weight_, v, 1);
    if (width >= 6 && color_) writeColor(v, width == 7 && color_->width == 4 ? 4 : 3);
  }
  void writeChannels(const Attribute& a, std::size_t value, int channels) {
    for (int k = 0; k < channels; ++k) {
      out_.put(' ');
      if (a.type() == ScalarType::Float32)
        out_.number(static_cast<float>(a.get(value, k)));
      else
        out_.number(a.get(value, k));
    }
  }
  // Whole numbers count to their type's largest, OBJ's colours go from 0 to 1.
  void writeColor(std::size_t v, int channels) {
    if (color_->type() >= ScalarType::Float32) return writeChannels(*color_, v, channels);
    const double largest = std::visit(
        [](const auto& data) {
          return static_cast<double>(std::numeric_limits<typename std::decay_t<decltype(data)>::value_type>::max());
        },
        color_->data);
    for (int k = 0; k < channels; ++k) {
      out_.put(' ');
      out_.number(static_cast<float>(color_->get(v, k) / largest));
    }
  }
  void writeValue(std::string_view word, const Attribute& a, std::size_t value, int channels) {
    out_.text(word);
    writeChannels(a, value, channels);
  }

  void writeIndex(Index index, std::uint64_t soFar, bool relative) {
    const auto i = static_cast<std::int64_t>(index), n = static_cast<std::int64_t>(soFar);
    out_.integer(relative && i < n ? i - n : i + 1);
  }
  void writeFace(bool relative) {
    const std::size_t f = faceDone_++;
    out_.put('f');
    for (std::size_t c = mesh_.faceBegin(f); c < mesh_.faceBegin(f + 1); ++c) {
      out_.put(' ');
      writeIndex(mesh_.corners()[c], vertexDone_, relative);
      const Index texture = uv_.at(mesh_, c), normal = normal_.at(mesh_, c);
      if (texture == kNoIndex && normal == kNoIndex) continue;
      out_.put('/');
      if (texture != kNoIndex) writeIndex(texture, textureDone_, relative);
      if (normal == kNoIndex) continue;
      out_.put('/');
      writeIndex(normal, normalDone_, relative);
    }
  }
  void writeLine() {
    out_.put('l');
    for (const Index v : mesh_.lines()[lineDone_++].vertices) {
      out_.put(' ');
      out_.integer(std::int64_t{v} + 1);
      const std::size_t point = linePoint_++;
      if (!layout_ || point >= layout_->lineTexture.size() || layout_->lineTexture[point] == kNoIndex || !uv_.attribute)
        continue;
      out_.put('/');
      out_.integer(std::int64_t{layout_->lineTexture[point]} + 1);
    }
  }
  void writePoints(std::uint32_t count) {
    out_.put('p');
    for (std::uint32_t k = 0; k < count; ++k) {
      out_.put(' ');
      out_.integer(std::int64_t{mesh_.loosePoints()[pointDone_++]} + 1);
    }
  }

  // "mtllib" names files beside the input: they are named from the output's folder. A name may hold spaces.
  void writeLibrary(std::string_view line) {
    const char* end = line.data() + line.size();
    const char* first = skipBlanks(line.data(), end) + 6;
    const char* names = skipBlanks(first, end);
    const char* stop = end;
    while (stop > names && (isBlank(stop[-1]) || isEol(stop[-1]))) --stop;
    const std::string all(names, stop);
    std::string moved = relocated(all, layout_->folder, context_.folder);
    if (moved == all) {
      moved.clear();
      for (const char* p = names; p < stop;) {
        const char* token = skipToken(p, stop);
        moved += relocated(std::string(p, token), layout_->folder, context_.folder);
        p = token;
        while (p < stop && (isBlank(*p) || isEol(*p))) ++p;  // the statement may go on over several lines
        moved.append(token, p);
      }
    }
    out_.text({line.data(), static_cast<std::size_t>(names - line.data())});
    out_.text(moved);
    out_.text({stop, static_cast<std::size_t>(end - stop)});
  }

  const WriteContext& context_;
  const Mesh& mesh_;
  Output& out_;
  ScalarType type_;
  std::shared_ptr<const ObjLayout> layout_;
  std::vector<ObjRun> runs_;
  ValueList uv_, normal_;
  const Attribute *color_ = nullptr, *weight_ = nullptr;
  std::size_t rawDone_ = 0, vertexDone_ = 0, textureDone_ = 0, normalDone_ = 0, faceDone_ = 0;
  std::size_t lineDone_ = 0, linePoint_ = 0, pointDone_ = 0;
};

}  // namespace

void writeObj(const WriteContext& context) { ObjWriter(context).write(); }

}  // namespace fielddeform::mesh::formats
