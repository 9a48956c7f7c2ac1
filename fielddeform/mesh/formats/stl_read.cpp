#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/formats/ply.h>
#include <fielddeform/mesh/formats/stl.h>
#include <fielddeform/mesh/formats/text.h>
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace fielddeform::mesh::formats {
namespace {

constexpr std::size_t kHeader = 84, kFacet = 50;

std::uint64_t mix(std::uint64_t hash, std::uint64_t x) noexcept {
  hash = (hash ^ x) * 0xBF58476D1CE4E5B9ull;
  return hash ^ (hash >> 31);
}
// Equal coordinates give equal hashes: -0 counts as 0.
std::uint64_t hashPoint(const Vec3& p) noexcept {
  std::uint64_t hash = 0x9E3779B97F4A7C15ull;
  for (int k = 0; k < 3; ++k) hash = mix(hash, std::bit_cast<std::uint64_t>(p[k] + 0.0));
  return hash;
}

class StlReader {
 public:
  explicit StlReader(const ReadContext& context)
      : context_(context), source_(context.source), at_(source_.begin()), end_(source_.end()) {}

  Mesh read() {
    layout_->ascii = looksAscii();
    if (layout_->ascii)
      readAscii();
    else
      readBinary();
    return build();
  }

 private:
  // Many exporters begin binary files with "solid" too: the size decides, then a zero byte among the first.
  bool looksAscii() const {
    if (hasBinaryStlSize(source_.bytes)) return false;
    const char* p = at_;
    while (p < end_ && (isBlank(*p) || isEol(*p))) ++p;
    if (end_ - p < 5 || !sameWord({p, 5}, "solid")) return false;
    const char* stop = end_ - at_ > 512 ? at_ + 512 : end_;
    return std::find(at_, stop, '\0') == stop;
  }
  static bool sameWord(std::string_view text, std::string_view lower) {
    return std::equal(text.begin(), text.end(), lower.begin(), lower.end(),
                      [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
  }

  void checkVertex(const char* at) {
    checkFinite(context_, positions_.back(), positions_.size() - 1,
                [&](std::string element, std::string found, std::string expected) {
                  if (layout_->ascii) source_.failText(at, std::move(element), std::move(found), std::move(expected));
                  source_.failBinary(at, std::move(element), std::move(found), std::move(expected));
                });
  }

  void readBinary() {
    context_.report.encoding = "binary little endian";
    const auto size = static_cast<std::size_t>(end_ - at_);
    if (size < kHeader)
      source_.failBinary(end_, "header", fmt::format("end of file after {} bytes", size),
                         "'solid', or 80 bytes and the number of facets");
    std::copy(at_, at_ + 80, layout_->header.begin());
    const std::uint64_t facets = little<std::uint32_t>(at_ + 80);
    if (facets > (size - kHeader) / kFacet)
      source_.failBinary(at_ + 80, "header", fmt::format("{} facets but {} bytes left", facets, size - kHeader),
                         fmt::format("{} bytes", facets * kFacet));
    if (3 * facets > kMaxCount)
      source_.failBinary(at_ + 80, "header", fmt::format("{} facets", facets),
                         fmt::format("at most {}", kMaxCount / 3));
    positions_.reserve(3 * facets);
    std::vector<float> normals(3 * facets);
    std::vector<std::uint16_t> words(facets);
    at_ += kHeader;
    for (std::size_t f = 0; f < facets; ++f, at_ += kFacet) {
      for (std::size_t k = 0; k < 3; ++k) normals[3 * f + k] = little<float>(at_ + 4 * k);
      for (int v = 1; v <= 3; ++v) {
        const char* p = at_ + 12 * v;
        positions_.emplace_back(widen(little<float>(p)), widen(little<float>(p + 4)), widen(little<float>(p + 8)));
        checkVertex(p);
      }
      words[f] = little<std::uint16_t>(at_ + 48);
      if (f % 8192 == 0) source_.advance(at_);
    }
    layout_->trailing.assign(at_, end_);
    context_.report.trailingBytes = layout_->trailing.size();
    addNormals(std::move(normals));
    if (std::any_of(words.begin(), words.end(), [](std::uint16_t w) { return w != 0; }))
      attributes_.push_back({"stl_attribute", Element::Face, 1, Interpolation::Nearest, std::move(words), {}, {}});
  }
  template <class T>
  static T little(const char* p) noexcept {
    return loadScalar<T, std::endian::native != std::endian::little>(p);
  }

  void readAscii() {
    layout_->eol = std::string(findEol(at_, end_), skipEol(findEol(at_, end_), end_));
    if (layout_->eol.empty()) layout_->eol.assign(1, '\n');
    std::vector<double> normals;
    while (skipSpace()) {
      expect("solid");
      StlLayout::Solid solid;
      solid.name = restOfLine();
      for (;;) {
        if (!skipSpace()) fail(at_, fmt::format("solid {}", solid.name), "'facet' or 'endsolid'");
        if (sameWord(word(), "endsolid")) break;
        readFacet(normals);
        ++solid.facets;
      }
      expect("endsolid");
      solid.endName = restOfLine();
      layout_->solids.push_back(std::move(solid));
    }
    addNormals(std::move(normals));
  }
  [[noreturn]] void fail(const char* at, std::string element, std::string expected) const {
    source_.failText(at, std::move(element), excerpt(at, end_), std::move(expected));
  }
  bool skipSpace() {
    while (at_ < end_ && (isBlank(*at_) || isEol(*at_))) ++at_;
    return at_ < end_;
  }
  std::string_view word() const { return {at_, static_cast<std::size_t>(skipToken(at_, end_) - at_)}; }
  void expect(std::string_view lower) {
    skipSpace();
    if (!sameWord(word(), lower))
      fail(at_, inFacet_ ? fmt::format("facet {}", facet_) : "solid", fmt::format("'{}'", lower));
    at_ += lower.size();
  }
  std::string restOfLine() {
    const char* begin = skipBlanks(at_, end_);
    const char* p = begin;
    while (p < end_ && !isEol(*p)) ++p;
    at_ = p;
    while (p > begin && isBlank(p[-1])) --p;
    return {begin, p};
  }
  Vec3 threeNumbers(const char* element, std::size_t index) {
    Vec3 v;
    for (int k = 0; k < 3; ++k) {
      skipSpace();
      const char* stop = parseDouble(at_, end_, v[k]);
      if (!stop || (stop < end_ && !isBlank(*stop) && !isEol(*stop)))
        fail(at_, fmt::format("{} {}", element, index), "a number");
      at_ = stop;
    }
    return v;
  }
  void readFacet(std::vector<double>& normals) {
    const std::size_t facet = positions_.size() / 3;
    facet_ = facet;
    inFacet_ = true;
    if (facet % 8192 == 0) source_.advance(at_);
    if (positions_.size() + 3 > kMaxCount) fail(at_, "facet", fmt::format("at most {} corners", kMaxCount));
    expect("facet");
    expect("normal");
    const Vec3 normal = threeNumbers("normal of facet", facet);
    normals.insert(normals.end(), normal.data(), normal.data() + 3);
    expect("outer");
    expect("loop");
    for (int k = 0; k < 3; ++k) {
      expect("vertex");
      const char* begin = at_;
      positions_.push_back(threeNumbers("vertex", positions_.size()));
      checkVertex(begin);
    }
    expect("endloop");
    expect("endfacet");
    inFacet_ = false;
  }

  template <class T>
  void addNormals(std::vector<T> normals) {
    attributes_.push_back({"normal", Element::Face, 3, Interpolation::Direction, std::move(normals), {}, {}});
  }

  // Vertices in the order of their first corner. Sorted by hash, so that a hostile file cannot make it slow.
  std::vector<Index> weld() {
    const std::size_t n = positions_.size();
    std::vector<std::uint64_t> keys(n);
    for (std::size_t c = 0; c < n; ++c) keys[c] = hashPoint(positions_[c]);
    std::vector<std::uint32_t> order = sortedOrder(keys);
    std::vector<Index> first(n);
    for (std::size_t begin = 0, end = 0; begin < n; begin = end) {
      for (end = begin; end < n && keys[order[end]] == keys[order[begin]]; ++end) {
      }
      weldRun(std::span(order).subspan(begin, end - begin), first);
    }
    std::vector<Vec3> kept;
    std::vector<Index> corners(n), number(n);
    for (std::size_t c = 0; c < n; ++c) {
      if (first[c] == c) {
        number[c] = static_cast<Index>(kept.size());
        kept.push_back(positions_[c]);
      } else {
        noteNegativeZeros(c, positions_[first[c]]);
      }
      corners[c] = number[first[c]];
    }
    context_.report.weldedCorners = n - kept.size();
    positions_ = std::move(kept);
    return corners;
  }
  // Corners of one hash, ascending: nearly always all equal.
  void weldRun(std::span<std::uint32_t> run, std::vector<Index>& first) const {
    const auto less = [&](std::uint32_t a, std::uint32_t b) {
      const Vec3 &p = positions_[a], &q = positions_[b];
      return std::lexicographical_compare(p.data(), p.data() + 3, q.data(), q.data() + 3);
    };
    const bool finite = std::all_of(run.begin(), run.end(), [&](std::uint32_t c) { return positions_[c].allFinite(); });
    if (!finite) {  // invalid points stay as they are, each for itself
      for (const std::uint32_t c : run) first[c] = c;
      return;
    }
    const bool equal =
        std::all_of(run.begin(), run.end(), [&](std::uint32_t c) { return positions_[c] == positions_[run[0]]; });
    if (!equal) std::stable_sort(run.begin(), run.end(), less);
    std::uint32_t leader = run[0];
    for (const std::uint32_t c : run) {
      if (positions_[c] != positions_[leader]) leader = c;
      first[c] = leader;
    }
  }
  void noteNegativeZeros(std::size_t corner, const Vec3& kept) {
    for (int k = 0; k < 3; ++k)
      if (std::signbit(positions_[corner][k]) != std::signbit(kept[k]) && kept[k] == 0)
        layout_->negativeZeros.push_back(3 * corner + static_cast<std::size_t>(k));
  }

  Mesh build() {
    std::vector<Index> corners;
    if (context_.options.weld == Weld::Exact) {
      corners = weld();
    } else {
      corners.resize(positions_.size());
      for (std::size_t c = 0; c < corners.size(); ++c) corners[c] = static_cast<Index>(c);
    }
    layout_->facetHash.resize(corners.size() / 3);
    for (std::size_t f = 0; f < layout_->facetHash.size(); ++f)
      layout_->facetHash[f] =
          hashFacet(positions_[corners[3 * f]], positions_[corners[3 * f + 1]], positions_[corners[3 * f + 2]]);
    Mesh mesh(std::move(positions_), std::move(corners));
    mesh.attributes() = std::move(attributes_);
    mesh.setPositionType(layout_->ascii ? ScalarType::Float64 : ScalarType::Float32);
    mesh.setLayout(layout_);
    return mesh;
  }

  const ReadContext& context_;
  const Source& source_;
  const char *at_, *end_;
  std::shared_ptr<StlLayout> layout_ = std::make_shared<StlLayout>();
  std::vector<Vec3> positions_;
  std::vector<Attribute> attributes_;
  bool inFacet_ = false;
  std::size_t facet_ = 0;
};

}  // namespace

bool hasBinaryStlSize(std::span<const char> bytes) noexcept {
  if (bytes.size() < kHeader) return false;
  const std::uint64_t facets = loadScalar<std::uint32_t, std::endian::native != std::endian::little>(bytes.data() + 80);
  return bytes.size() == kHeader + kFacet * facets;
}

std::uint64_t hashFacet(const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
  std::uint64_t hash = 1;
  for (const Vec3* p : {&a, &b, &c})
    for (int k = 0; k < 3; ++k) hash = mix(hash, std::bit_cast<std::uint64_t>((*p)[k]));
  return hash;
}

Mesh readStl(const ReadContext& context) { return StlReader(context).read(); }

}  // namespace fielddeform::mesh::formats
