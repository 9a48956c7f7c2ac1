#include <fielddeform/mesh/formats/off.h>
#include <fmt/format.h>

#include <algorithm>

namespace fielddeform::mesh::formats {
namespace {

using Before = OffLayout::Before;

class OffWriter {
 public:
  explicit OffWriter(const WriteContext& context)
      : context_(context), mesh_(context.mesh), out_(context.out), type_(coordinateType(mesh_, context.options)) {}

  void write() {
    layout_ = layoutFor<OffLayout>(mesh_, context_.report);
    if (layout_) eol_ = layout_->eol;
    chooseAttributes();
    comments(Before::Magic, 0);
    writeHeader();
    for (std::size_t v = 0; v < mesh_.vertexCount(); ++v) writeVertex(v);
    comments(Before::Vertex, mesh_.vertexCount());
    for (std::size_t f = 0; f < mesh_.faceCount(); ++f) writeFace(f);
    comments(Before::Face, static_cast<std::size_t>(-1));
  }

 private:
  void chooseAttributes() {
    const auto choose = [&](std::string_view name, int low, int high) -> const Attribute* {
      const Attribute* a = mesh_.find(Element::Vertex, name);
      return a && a->listOffsets.empty() && a->width >= low && a->width <= high ? a : nullptr;
    };
    normal_ = choose("normal", 3, 3);
    color_ = choose("color", 3, 4);
    texture_ = choose("uv", 2, 2);
    std::vector<std::string> lost;
    for (const Attribute& a : mesh_.attributes())
      if (&a != normal_ && &a != color_ && &a != texture_) lost.push_back(a.name);
    reportDropped(context_.report, lost, mesh_.lines().size(), mesh_.loosePoints().size());
  }

  // The input's word if it still says what the vertices hold; some files hold colours and say "OFF".
  std::string magic() const {
    const std::string now = fmt::format("{}{}{}OFF", texture_ ? "ST" : "", color_ ? "C" : "", normal_ ? "N" : "");
    if (!layout_) return now;
    const std::string plain = fmt::format("{}{}OFF", texture_ ? "ST" : "", normal_ ? "N" : "");
    const std::string coloured = fmt::format("{}C{}OFF", texture_ ? "ST" : "", normal_ ? "N" : "");
    const std::string& old = layout_->magic;
    if (old == plain || (color_ && old == coloured) || (old.empty() && plain == "OFF")) return old;
    return now;
  }
  void writeHeader() {
    const std::string word = magic();
    const bool sameLine = layout_ && layout_->countsOnMagicLine;
    out_.text(word);
    if (!word.empty()) out_.text(sameLine ? " " : eol_);
    comments(Before::Counts, 0);
    const bool same = layout_ && layout_->faces == mesh_.faceCount() && layout_->vertices == mesh_.vertexCount();
    out_.text(fmt::format("{} {} {}{}", mesh_.vertexCount(), mesh_.faceCount(), same ? layout_->edges : 0, eol_));
  }
  void comments(Before before, std::size_t row) {
    if (!layout_) return;
    const auto& all = layout_->comments;
    while (comment_ < all.size() &&
           (all[comment_].before < before || (all[comment_].before == before && all[comment_].row <= row))) {
      out_.text(all[comment_++].text);
      out_.text(eol_);
    }
  }

  void values(const Attribute& a, std::size_t value) {
    for (int k = 0; k < a.width; ++k) {
      out_.put(' ');
      if (a.type() == ScalarType::Float32)
        out_.number(static_cast<float>(a.get(value, k)));
      else if (a.type() == ScalarType::Float64)
        out_.number(a.get(value, k));
      else
        out_.integer(static_cast<std::int64_t>(a.get(value, k)));
    }
  }
  void writeVertex(std::size_t v) {
    comments(Before::Vertex, v);
    for (int k = 0; k < 3; ++k) {
      if (k != 0) out_.put(' ');
      writeCoordinate(out_, mesh_.positions()[v][k], type_);
    }
    for (const Attribute* a : {normal_, color_, texture_})
      if (a) values(*a, v);
    out_.text(eol_);
  }
  void writeFace(std::size_t f) {
    comments(Before::Face, f);
    const auto face = mesh_.face(f);
    out_.integer(static_cast<std::int64_t>(face.size()));
    for (const Index v : face) {
      out_.put(' ');
      out_.integer(v);
    }
    if (layout_ && layout_->faces == mesh_.faceCount()) writeTail();
    out_.text(eol_);
  }
  void writeTail() {
    while (tail_ < layout_->tails.size() && inTail_ == layout_->tails[tail_].faces) ++tail_, inTail_ = 0;
    if (tail_ >= layout_->tails.size()) return;
    ++inTail_;
    if (layout_->tails[tail_].text.empty()) return;
    out_.put(' ');
    out_.text(layout_->tails[tail_].text);
  }

  const WriteContext& context_;
  const Mesh& mesh_;
  Output& out_;
  ScalarType type_;
  std::shared_ptr<const OffLayout> layout_;
  std::string eol_ = "\n";
  const Attribute *normal_ = nullptr, *color_ = nullptr, *texture_ = nullptr;
  std::size_t comment_ = 0, tail_ = 0;
  std::uint64_t inTail_ = 0;
};

}  // namespace

std::vector<std::string> OffLayout::extras() const {
  std::vector<std::string> phrases;
  addCount(phrases, comments.size(), "comment", "comments");
  std::uint64_t coloured = 0;
  for (const Tail& t : tails) coloured += t.text.empty() ? 0 : t.faces;
  addCount(phrases, coloured, "face's colour", "faces' colours");
  return phrases;
}

std::shared_ptr<const FileLayout> OffLayout::refined(std::span<const Index> faceParent, std::size_t vertexCount) const {
  auto out = std::make_shared<OffLayout>(*this);
  out->vertices = vertexCount;
  out->faces = faceParent.size();
  out->edges = faceParent.size() == faces && vertexCount == vertices ? edges : 0;
  std::size_t child = 0;
  std::uint64_t end = 0;
  for (std::size_t t = 0; t < tails.size(); ++t) {
    end += tails[t].faces;
    out->tails[t].faces = 0;
    for (; child < faceParent.size() && faceParent[child] < end; ++child) ++out->tails[t].faces;
  }
  for (Comment& c : out->comments)
    if (c.before == Before::Face)
      c.row =
          static_cast<std::size_t>(std::lower_bound(faceParent.begin(), faceParent.end(), c.row) - faceParent.begin());
  return out;
}

void writeOff(const WriteContext& context) { OffWriter(context).write(); }

}  // namespace fielddeform::mesh::formats
