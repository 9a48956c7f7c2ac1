#include <fielddeform/mesh/formats/obj.h>

#include <algorithm>
#include <string_view>

namespace fielddeform::mesh::formats {

using Kind = ObjRun::Kind;

std::uint64_t ObjLayout::total(Kind kind) const noexcept {
  std::uint64_t sum = 0;
  for (const ObjRun& r : runs)
    if (r.kind == kind) sum += r.kind == Kind::Points ? r.count * r.width : r.count;
  return sum;
}

std::vector<std::string> ObjLayout::extras() const {
  std::size_t comments = 0, groups = 0, materials = 0, others = 0;
  std::string_view rest = text;
  while (!rest.empty()) {
    const std::size_t stop = std::min(rest.find_first_of("\r\n"), rest.size());
    std::string_view line = rest.substr(0, stop);
    rest.remove_prefix(std::min(stop + 1, rest.size()));
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
    const std::string_view word = line.substr(0, line.find_first_of(" \t"));
    if (word.empty()) continue;
    if (word[0] == '#')
      ++comments;
    else if (word == "o" || word == "g" || word == "s")
      ++groups;
    else if (word == "usemtl" || word == "mtllib")
      ++materials;
    else
      ++others;
  }
  std::vector<std::string> phrases;
  addCount(phrases, comments, "comment", "comments");
  addCount(phrases, groups, "group statement (o, g, s)", "group statements (o, g, s)");
  addCount(phrases, materials, "material statement", "material statements");
  addCount(phrases, others, "other statement", "other statements");
  return phrases;
}

std::shared_ptr<const FileLayout> ObjLayout::refined(std::span<const Index> faceParent, std::size_t vertexCount) const {
  auto out = std::make_shared<ObjLayout>(*this);
  std::size_t child = 0;
  std::uint64_t parentEnd = 0;
  std::uint32_t widest = 3;
  std::size_t lastVertexRun = out->runs.size();
  for (std::size_t i = 0; i < out->runs.size(); ++i) {
    ObjRun& run = out->runs[i];
    if (run.kind == Kind::Vertex) {
      widest = std::max(widest, run.width);
      lastVertexRun = i;
    }
    if (run.kind != Kind::Face) continue;
    parentEnd += run.count;
    run.count = 0;
    for (; child < faceParent.size() && faceParent[child] < parentEnd; ++child) ++run.count;
  }
  const std::uint64_t old = total(Kind::Vertex);
  if (vertexCount > old && lastVertexRun < out->runs.size())
    out->runs.insert(out->runs.begin() + static_cast<std::ptrdiff_t>(lastVertexRun) + 1,
                     {Kind::Vertex, widest, vertexCount - old});
  return out;
}

}  // namespace fielddeform::mesh::formats
