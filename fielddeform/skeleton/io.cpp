#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/skeleton/io.h>

#include <algorithm>
#include <cctype>
#include <utility>

namespace fielddeform::skeleton {

Skeleton readSkeleton(const std::filesystem::path& path) { return parseSkeleton(readTextFile(path), path); }

Skeleton parseSkeleton(std::string text, const std::filesystem::path& path) {
  std::size_t begin = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  begin = text.find_first_not_of(" \t\r\n", begin);
  if (begin == std::string::npos) throw IoError(path, "is empty, expected a skeleton (JSON or OBJ)");
  const bool json = text[begin] == '{' || text[begin] == '[';
  return json ? detail::parseJson(std::move(text), path) : detail::parseObj(text, path);
}

std::string formatSkeleton(const Skeleton& skeleton, FileFormat format) {
  validate(skeleton);
  return format == FileFormat::Json ? detail::formatJson(skeleton) : detail::formatObj(skeleton);
}

void writeSkeleton(const Skeleton& skeleton, const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  writeTextFile(path, formatSkeleton(skeleton, extension == ".obj" ? FileFormat::Obj : FileFormat::Json));
}

bool boundsSolid(std::span<const std::vector<Index>> faces) {
  // A directed edge and its reverse must each occur once.
  std::vector<std::pair<Index, Index>> edges;
  for (const std::vector<Index>& face : faces)
    for (std::size_t k = 0; k < face.size(); ++k) edges.emplace_back(face[k], face[(k + 1) % face.size()]);
  std::sort(edges.begin(), edges.end());
  if (std::adjacent_find(edges.begin(), edges.end()) != edges.end()) return false;
  return !edges.empty() && std::all_of(edges.begin(), edges.end(), [&](const auto& e) {
    return e.first != e.second && std::binary_search(edges.begin(), edges.end(), std::pair(e.second, e.first));
  });
}

}  // namespace fielddeform::skeleton
