#include <fielddeform/mesh/formats/ply.h>
#include <fielddeform/mesh/formats/stl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string_view>

namespace fielddeform::mesh::formats {
namespace {

class StlWriter {
 public:
  explicit StlWriter(const WriteContext& context) : context_(context), mesh_(context.mesh), out_(context.out) {}

  void write() {
    layout_ = layoutFor<StlLayout>(mesh_, context_.report);
    const Attribute* normal = mesh_.find(Element::Face, "normal");
    // A mesh with other faces than the layout knows cannot use what belongs to facets.
    same_ = layout_ && layout_->facetHash.size() == mesh_.faceCount() && mesh_.allTriangles();
    if (same_ && normal && normal->width == 3 && normal->indices.empty() && normal->listOffsets.empty())
      normal_ = normal;
    const Attribute* words = mesh_.find(Element::Face, "stl_attribute");
    if (words && words->width == 1 && words->type() == ScalarType::UInt16 && words->listOffsets.empty()) words_ = words;
    ascii_ = layout_ && layout_->ascii;
    if (same_) zeros_ = layout_->negativeZeros;
    reportLost();
    if (ascii_)
      writeAscii();
    else
      writeBinary();
  }

 private:
  void reportLost() {
    std::vector<std::string> lost;
    for (const Attribute& a : mesh_.attributes())
      if (!(a.on == Element::Face && a.name == "normal") && (&a != words_ || ascii_)) lost.push_back(a.name);
    reportDropped(context_.report, lost, mesh_.lines().size(), mesh_.loosePoints().size());
    std::vector<bool> used(mesh_.vertexCount(), false);
    for (const Index v : mesh_.corners()) used[v] = true;
    auto& dropped = context_.report.dropped;
    addCount(dropped, static_cast<std::size_t>(std::count(used.begin(), used.end(), false)), "isolated vertex",
             "isolated vertices");
    std::size_t polygons = 0, shorts = 0;
    for (std::size_t f = 0; f < mesh_.faceCount() && !mesh_.allTriangles(); ++f) {
      polygons += mesh_.face(f).size() > 3;
      shorts += mesh_.face(f).size() < 3;
    }
    addCount(dropped, polygons, "polygon, cut into triangles", "polygons, cut into triangles");
    addCount(dropped, shorts, "face of fewer than 3 corners", "faces of fewer than 3 corners");
    if (!ascii_) checkFloats();
  }
  void checkFloats() {
    bool rounded = false;
    for (const Vec3& p : mesh_.positions())
      for (int k = 0; k < 3; ++k) {
        if (std::isfinite(p[k]) && std::abs(p[k]) > std::numeric_limits<float>::max())
          throw std::invalid_argument(
              fmt::format("a coordinate is {}, expected at most {} for STL", p[k], std::numeric_limits<float>::max()));
        rounded = rounded || (std::isfinite(p[k]) && static_cast<double>(static_cast<float>(p[k])) != p[k]);
      }
    const bool wanted = context_.options.precision == Precision::Double || mesh_.positionType() != ScalarType::Float32;
    if (rounded && wanted) context_.report.dropped.push_back("digits beyond single precision");
  }

  // The stored normal where the facet is as it was read, else that of its corners; 0 0 0 if it has none.
  Vec3 normalOf(std::size_t face, const Vec3& a, const Vec3& b, const Vec3& c) const {
    if (normal_ && layout_->facetHash[face] == hashFacet(a, b, c))
      return {normal_->get(face, 0), normal_->get(face, 1), normal_->get(face, 2)};
    // Scaled first: an area near the limits of double must not become 0 or infinite.
    const double scale = std::max((b - a).cwiseAbs().maxCoeff(), (c - a).cwiseAbs().maxCoeff());
    if (!(scale > 0) || !std::isfinite(scale)) return Vec3::Zero();
    const Vec3 n = ((b - a) / scale).cross((c - a) / scale);
    const double length = n.norm();
    return length > 0 && std::isfinite(length) ? Vec3(n / length) : Vec3(Vec3::Zero());
  }
  // A corner's position with the sign of zero that it had before welding.
  Vec3 corner(std::size_t corner, Index vertex) {
    Vec3 p = mesh_.positions()[vertex];
    for (; zero_ < zeros_.size() && zeros_[zero_] / 3 == corner; ++zero_) {
      double& x = p[static_cast<int>(zeros_[zero_] % 3)];
      if (x == 0) x = -x;
    }
    return p;
  }

  template <class Call>
  void forFacets(std::size_t face, Call&& call) {
    std::size_t c = mesh_.faceBegin(face);
    mesh_.forEachTriangle(face, [&](Index i, Index j, Index k) {
      const auto& p = mesh_.positions();
      const Vec3 normal = normalOf(face, p[i], p[j], p[k]);
      const Vec3 a = corner(c, i), b = corner(c + 1, j), d = corner(c + 2, k);
      call(normal, a, b, d);
      c += 3;
    });
  }

  void putFloat(double x) {
    const float f = narrow(x);
    out_.raw(loadScalar<float, std::endian::native != std::endian::little>(reinterpret_cast<const char*>(&f)));
  }
  template <class T>
  void putLittle(T x) {
    out_.raw(loadScalar<T, std::endian::native != std::endian::little>(reinterpret_cast<const char*>(&x)));
  }
  void writeBinary() {
    std::uint64_t facets = 0;
    for (std::size_t f = 0; f < mesh_.faceCount(); ++f)
      facets += mesh_.face(f).size() >= 3 ? mesh_.face(f).size() - 2 : 0;
    if (facets > 0xFFFFFFFFull)
      throw std::invalid_argument(fmt::format("{} facets, expected at most {} for STL", facets, 0xFFFFFFFFull));
    std::array<char, 80> header{};
    if (layout_) header = layout_->header;
    out_.bytes(header.data(), header.size());
    putLittle(static_cast<std::uint32_t>(facets));
    for (std::size_t f = 0; f < mesh_.faceCount(); ++f)
      forFacets(f, [&](const Vec3& n, const Vec3& a, const Vec3& b, const Vec3& c) {
        for (const Vec3* v : {&n, &a, &b, &c})
          for (int k = 0; k < 3; ++k) putFloat((*v)[k]);
        putLittle(static_cast<std::uint16_t>(words_ ? words_->get(f) : 0));
      });
    if (layout_) out_.text(layout_->trailing);
  }

  void line(std::string_view text) {
    out_.text(text);
    out_.text(layout_->eol);
  }
  void numbers(std::string_view start, const Vec3& v, ScalarType type) {
    out_.text(start);
    for (int k = 0; k < 3; ++k) {
      out_.put(' ');
      writeCoordinate(out_, v[k], type);
    }
    out_.text(layout_->eol);
  }
  void writeAscii() {
    std::vector<StlLayout::Solid> solids = layout_->solids;
    std::uint64_t known = 0;
    for (const auto& s : solids) known += s.facets;
    if (known != mesh_.faceCount()) {
      if (solids.size() > 1)
        context_.report.dropped.push_back("which facets belong to which solid: their number changed");
      solids.resize(1);
      solids[0].facets = mesh_.faceCount();
    }
    const ScalarType type = coordinateType(mesh_, context_.options);
    std::size_t face = 0;
    for (const auto& s : solids) {
      line(s.name.empty() ? "solid" : "solid " + s.name);
      for (std::uint64_t i = 0; i < s.facets; ++i, ++face)
        forFacets(face, [&](const Vec3& n, const Vec3& a, const Vec3& b, const Vec3& c) {
          numbers("  facet normal", n, ScalarType::Float64);
          line("    outer loop");
          for (const Vec3* v : {&a, &b, &c}) numbers("      vertex", *v, type);
          line("    endloop");
          line("  endfacet");
        });
      line(s.endName.empty() ? "endsolid" : "endsolid " + s.endName);
    }
  }

  const WriteContext& context_;
  const Mesh& mesh_;
  Output& out_;
  std::shared_ptr<const StlLayout> layout_;
  const Attribute *normal_ = nullptr, *words_ = nullptr;
  bool same_ = false, ascii_ = false;
  std::vector<std::uint64_t> zeros_;
  std::size_t zero_ = 0;
};

}  // namespace

std::vector<std::string> StlLayout::extras() const {
  std::vector<std::string> phrases;
  const bool named = std::any_of(header.begin(), header.end(), [](char c) { return c != 0 && c != ' '; });
  if (named && !ascii) phrases.emplace_back("the header text");
  if (ascii) addCount(phrases, solids.size(), "solid's name", "solids' names and limits");
  return phrases;
}

std::shared_ptr<const FileLayout> StlLayout::refined(std::span<const Index> faceParent, std::size_t) const {
  auto out = std::make_shared<StlLayout>(*this);
  const bool unchanged = faceParent.size() == facetHash.size();
  out->facetHash.clear();
  for (const Index parent : faceParent) out->facetHash.push_back(parent < facetHash.size() ? facetHash[parent] : 0);
  if (!unchanged) out->negativeZeros.clear();
  std::size_t child = 0;
  std::uint64_t end = 0;
  for (std::size_t s = 0; s < solids.size(); ++s) {
    end += solids[s].facets;
    out->solids[s].facets = 0;
    for (; child < faceParent.size() && faceParent[child] < end; ++child) ++out->solids[s].facets;
  }
  return out;
}

void writeStl(const WriteContext& context) { StlWriter(context).write(); }

}  // namespace fielddeform::mesh::formats
