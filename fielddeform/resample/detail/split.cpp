#include <fielddeform/resample/detail/split.h>

#include <array>

namespace fielddeform::resample::detail {
namespace {

/// A corner of a new face: on a corner of the parent, or halfway to the parent's next one.
struct Source {
  Index corner = kNoIndex;
  bool middle = false;
  explicit operator bool() const { return corner != kNoIndex; }
};

class Splitter {
 public:
  Splitter(const mesh::Mesh& mesh, const mesh::EdgeTable& table, std::span<const Index> rank,
           std::span<const Index> asFan, Points positions)
      : mesh_(mesh), table_(table), rank_(rank), asFan_(asFan), positions_(positions) {
    out_.offsets.push_back(0);
  }

  SplitFaces run() {
    for (std::size_t f = 0; f < mesh_.faceCount(); ++f) {
      const Index begin = mesh_.faceBegin(f), end = mesh_.faceBegin(f + 1);
      face_ = static_cast<Index>(f);
      std::size_t marked = 0;
      for (Index c = begin; c < end; ++c) marked += isDivided(c);
      const bool whole = asFan_.empty() || asFan_.front() != f;
      if (!whole) asFan_ = asFan_.subspan(1);
      if (marked == 0 && whole) copy(begin, end);
      else if (marked > 0 && end - begin == 4 && isConvex(begin)) quad(begin, marked);
      else fan(begin, end);
    }
    return std::move(out_);
  }

 private:
  bool isDivided(Index corner) const {
    const Index e = table_.ofCorner(corner);
    return e != kNoIndex && rank_[e] != kNoIndex;
  }
  Index vertex(const Source& s) const {
    return s.middle ? static_cast<Index>(mesh_.vertexCount()) + rank_[table_.ofCorner(s.corner)] : mesh_.corners()[s.corner];
  }
  const Vec3& at(const Source& s) const { return positions_[vertex(s)]; }
  Source midpoint(Index corner) const { return isDivided(corner) ? Source{corner, true} : Source{}; }

  void emit(std::initializer_list<Source> face) {
    for (const Source& s : face) {
      out_.corners.push_back(vertex(s));
      out_.source.push_back(s.corner);
      out_.middle.push_back(s.middle);
    }
    close();
  }
  void copy(Index begin, Index end) {
    for (Index c = begin; c < end; ++c) {
      out_.corners.push_back(mesh_.corners()[c]);
      out_.source.push_back(c);
      out_.middle.push_back(false);
    }
    close();
  }
  void close() {
    out_.offsets.push_back(static_cast<Index>(out_.corners.size()));
    out_.faceParent.push_back(face_);
  }

  /// A quad a b c d as two triangles along its shorter rest diagonal; ties: the one at the smaller of the vertices a, b.
  void emitTriangles(const Source& a, const Source& b, const Source& c, const Source& d) {
    const double ac = (at(a) - at(c)).squaredNorm(), bd = (at(b) - at(d)).squaredNorm();
    if (ac < bd || (ac == bd && vertex(a) <= vertex(b))) emit({a, b, c}), emit({a, c, d});
    else emit({a, b, d}), emit({b, c, d});
  }

  /// Templates for one, two and three divided edges; m[i] lies between v[i] and v[i + 1].
  void triangle(const std::array<Source, 3>& v, const std::array<Source, 3>& m) {
    const int count = bool(m[0]) + bool(m[1]) + bool(m[2]);
    if (count == 0) return emit({v[0], v[1], v[2]});
    if (count == 3) {
      for (int i = 0; i < 3; ++i) emit({v[i], m[i], m[(i + 2) % 3]});
      return emit({m[0], m[1], m[2]});
    }
    int i = 0;  // the one divided, or the one undivided edge
    while (bool(m[i]) != (count == 1)) ++i;
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    if (count == 1) {
      emit({v[i], m[i], v[k]});
      emit({m[i], v[j], v[k]});
    } else {
      emit({m[j], v[k], m[k]});
      emitTriangles(v[i], v[j], m[j], m[k]);
    }
  }

  void fan(Index begin, Index end) {
    for (Index c = begin + 1; c + 1 < end; ++c) {
      const std::array<Source, 3> m{c == begin + 1 ? midpoint(begin) : Source{}, midpoint(c),
                                    c + 2 == end ? midpoint(c + 1) : Source{}};
      triangle({Source{begin}, Source{c}, Source{c + 1}}, m);
    }
  }

  /// Whether all corners turn the same way, within 60 degrees of the common normal: then every template is valid.
  bool isConvex(Index begin) const {
    const auto p = [&](Index k) -> const Vec3& { return positions_[mesh_.corners()[begin + k % 4]]; };
    const Vec3 normal = (p(2) - p(0)).cross(p(3) - p(1));
    for (Index k = 0; k < 4; ++k) {
      const Vec3 n = (p(k + 1) - p(k)).cross(p(k + 3) - p(k));
      if (!(n.dot(normal) > 0.5 * n.norm() * normal.norm())) return false;
    }
    return true;
  }

  void quad(Index begin, std::size_t marked) {
    const auto v = [&](Index k) { return Source{begin + k % 4}; };
    const auto m = [&](Index k) { return Source{begin + k % 4, true}; };
    const auto divided = [&](Index k) { return isDivided(begin + k % 4); };
    Index i = 0;
    if (marked == 4) {
      for (Index k = 0; k < 4; ++k) emit({m(k + 3), v(k), m(k)});
      return emit({m(0), m(1), m(2), m(3)});
    }
    if (marked == 3) {
      while (divided(i + 3)) ++i;  // edge i + 3 is whole
      emit({m(i), v(i + 1), m(i + 1)});
      emit({m(i + 1), v(i + 2), m(i + 2)});
      emit({m(i), m(i + 1), m(i + 2)});
      return emit({v(i), m(i), m(i + 2), v(i + 3)});
    }
    if (marked == 2 && divided(0) == divided(2)) {  // opposite ones: two quads
      i = divided(0) ? 0 : 1;
      emit({v(i), m(i), m(i + 2), v(i + 3)});
      return emit({m(i), v(i + 1), v(i + 2), m(i + 2)});
    }
    if (marked == 2) {
      while (!divided(i) || !divided(i + 1)) ++i;  // they meet at i + 1
      emit({m(i), v(i + 1), m(i + 1)});
      emit({m(i), m(i + 1), v(i + 3)});
      emit({v(i), m(i), v(i + 3)});
      return emit({m(i + 1), v(i + 2), v(i + 3)});
    }
    while (!divided(i)) ++i;
    emit({v(i), m(i), v(i + 3)});
    emit({m(i), v(i + 1), v(i + 2)});
    emit({m(i), v(i + 2), v(i + 3)});
  }

  const mesh::Mesh& mesh_;
  const mesh::EdgeTable& table_;
  std::span<const Index> rank_, asFan_;
  Points positions_;
  Index face_ = 0;
  SplitFaces out_;
};

}  // namespace

SplitFaces splitFaces(const mesh::Mesh& mesh, const mesh::EdgeTable& table, std::span<const Index> rank,
                      std::span<const Index> asFan, Points positions) {
  return Splitter(mesh, table, rank, asFan, positions).run();
}

}  // namespace fielddeform::resample::detail
