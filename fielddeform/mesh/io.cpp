#include <fielddeform/mesh/formats/codec.h>
#include <fielddeform/mesh/formats/stl.h>
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace fielddeform::mesh {
namespace {

using namespace formats;

struct Entry {
  Format format;
  std::string_view name;
  Mesh (*read)(const ReadContext&);
  void (*write)(const WriteContext&);
};

constexpr Entry kEntries[] = {
    {Format::Ply, "ply", &readPly, &writePly},
    {Format::Obj, "obj", &readObj, &writeObj},
    {Format::Stl, "stl", &readStl, &writeStl},
    {Format::Off, "off", &readOff, &writeOff},
};

const Entry* entryOf(Format format) {
  for (const Entry& e : kEntries)
    if (e.format == format) return &e;
  return nullptr;
}

// Defects that are kept and counted.
void countDefects(const Mesh& mesh, ReadReport& report) {
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    const auto c = mesh.face(f);
    if (c.size() < 3) {
      ++report.shortFaces;
      continue;
    }
    bool repeated = false;
    if (c.size() <= 16) {
      for (std::size_t i = 1; i < c.size() && !repeated; ++i)
        for (std::size_t j = 0; j < i; ++j) repeated = repeated || c[i] == c[j];
    } else {  // a hostile face of a million corners must not take a day
      std::vector<Index> sorted(c.begin(), c.end());
      std::sort(sorted.begin(), sorted.end());
      repeated = std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end();
    }
    report.repeatedCorners += repeated;
  }
}

Mesh readSource(const Source& source, const ReadOptions& options, ReadReport* report) {
  if (source.progress) source.progress->beginStage("read");
  std::optional<Format> format = formatFromContent(source.bytes);
  if (!format) format = formatFromExtension(source.path);
  if (!format)
    throw IoError(source.path, "neither content nor extension tells the format, expected ply, obj, stl or off");
  const Entry* entry = entryOf(*format);
  if (!entry) throw IoError(source.path, fmt::format("{} files are not supported", toString(*format)));
  ReadReport own;
  own.format = *format;
  own.encoding = "ascii";
  Mesh mesh = entry->read({source, options, own});
  if (report) {
    countDefects(mesh, own);
    *report = std::move(own);
  }
  return mesh;
}

Format targetFormat(const Mesh& mesh, const std::filesystem::path& path, const WriteOptions& options) {
  if (options.format) return *options.format;
  if (const auto byName = formatFromExtension(path)) return *byName;
  if (path.extension().empty())
    if (const auto own = formatOf(mesh)) return *own;
  throw std::invalid_argument(
      fmt::format("{}: the extension names no mesh format, expected .ply, .obj, .stl or .off", path.string()));
}

WriteReport writeTo(Output& out, const Mesh& mesh, Format format, const WriteOptions& options,
                    const std::filesystem::path& folder) {
  const Entry* entry = entryOf(format);
  if (!entry) throw std::invalid_argument(fmt::format("{} files cannot be written", toString(format)));
  checkAttributes(mesh);
  WriteReport report;
  report.format = format;
  entry->write({mesh, out, options, report, folder});
  out.flush();
  return report;
}

}  // namespace

std::string_view toString(Format format) noexcept {
  switch (format) {
    case Format::Ply:
      return "ply";
    case Format::Obj:
      return "obj";
    case Format::Stl:
      return "stl";
    case Format::Off:
      return "off";
  }
  return "ply";
}

std::optional<Format> formatFromExtension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  for (const Format f : {Format::Ply, Format::Obj, Format::Stl, Format::Off})
    if (std::string_view(extension).substr(extension.empty() ? 0 : 1) == toString(f)) return f;
  if (extension == ".coff" || extension == ".noff") return Format::Off;
  return {};
}

std::optional<Format> formatFromContent(std::span<const char> bytes) {
  std::string_view text(bytes.data(), std::min<std::size_t>(bytes.size(), 512));
  if (text.starts_with("ply\n") || text.starts_with("ply\r") || text.starts_with("ply ")) return Format::Ply;
  if (hasBinaryStlSize(bytes)) return Format::Stl;
  text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(" \t\r\n"));
  if (word == "solid" && text.find("facet") != text.npos) return Format::Stl;
  for (const std::string_view magic :
       {"OFF", "COFF", "NOFF", "CNOFF", "STOFF", "STCOFF", "STNOFF", "STCNOFF", "4OFF", "nOFF"})
    if (word == magic) return Format::Off;
  return {};
}

std::optional<Format> formatOf(const Mesh& mesh) noexcept {
  const auto* layout = dynamic_cast<const FormatLayout*>(mesh.layout().get());
  return layout ? std::optional(layout->format()) : std::nullopt;
}

Mesh readMesh(const std::filesystem::path& path, const ReadOptions& options, ReadReport* report, Progress* progress) {
  const FileBytes file(path);
  return readSource({file.bytes(), path, progress}, options, report);
}

Mesh readMesh(std::span<const char> bytes, const std::filesystem::path& name, const ReadOptions& options,
              ReadReport* report, Progress* progress) {
  return readSource({bytes, name, progress}, options, report);
}

WriteReport writeMesh(const Mesh& mesh, const std::filesystem::path& path, const WriteOptions& options,
                      Progress* progress) {
  const Format format = targetFormat(mesh, path, options);
  if (progress) progress->beginStage("write");
  AtomicFile file(path);
  Output out([&](const char* data, std::size_t size) { file.write(data, size); }, progress);
  WriteReport report = writeTo(out, mesh, format, options, folderOf(path));
  file.commit();
  return report;
}

std::string meshBytes(const Mesh& mesh, Format format, const WriteOptions& options, WriteReport* report,
                      const std::filesystem::path& folder) {
  std::string bytes;
  Output out([&](const char* data, std::size_t size) { bytes.append(data, size); });
  WriteReport own = writeTo(out, mesh, format, options, folder);
  if (report) *report = std::move(own);
  return bytes;
}

}  // namespace fielddeform::mesh
