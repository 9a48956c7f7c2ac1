#include <fielddeform/core/parallel.h>
#include <fielddeform/resample/detail/marking.h>

#include <algorithm>

namespace fielddeform::resample::detail {
namespace {

constexpr std::size_t kBatch = 1 << 16;  ///< midpoints bound at once: bounds the memory of their binding

/// What the ends alone tell about an edge.
struct Candidate {
  Index edge;
  double stretch;  ///< deformed length / (maxStretch * reference): too long from 1 on
  bool forced;
};

bool finite(Points rest, Points posed, Index a, Index b) {
  return rest[a].allFinite() && rest[b].allFinite() && posed[a].allFinite() && posed[b].allFinite();
}

bool moved(Points rest, Points posed, Index a, Index b) { return rest[a] != posed[a] || rest[b] != posed[b]; }

/// Edges whose longer state is within the tolerance cannot leave it under a map of moderate stretch.
bool mayDeviate(const Judge& judge, Points rest, Points posed, Index a, Index b) {
  return judge.options.by != Criterion::Stretch && judge.tolerance > 0 &&
         std::max((posed[a] - posed[b]).norm(), (rest[a] - rest[b]).norm()) > judge.tolerance;
}

/// The edges with a moved vertex whose midpoint has to be mapped: forced ones, too long ones, those that may deviate.
std::vector<Candidate> candidates(const Judge& judge, const State& state, EdgeMemory& memory,
                                  std::span<const Index> forced) {
  const mesh::EdgeTable& table = state.table;
  const Points rest = state.mesh.positions(), posed = state.posed;
  std::vector<double> stretch(table.size(), -1);
  std::vector<std::uint8_t> isForced(table.size(), 0);
  for (const Index e : forced) isForced[e] = memory.settled[e] != kRefused;
  parallelFor(table.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      if (memory.settled[e] && !isForced[e]) continue;
      memory.settled[e] = 1;
      const auto [a, b] = table.vertices(e);
      if (!finite(rest, posed, a, b) || !(isForced[e] || moved(rest, posed, a, b))) continue;
      const double bound = judge.options.maxStretch * memory.reference[e];
      const double ratio = (posed[a] - posed[b]).norm() / bound;
      const bool tooLong = judge.options.by != Criterion::Deviation && bound > 0 && ratio >= 1;
      if (tooLong || isForced[e] || mayDeviate(judge, rest, posed, a, b)) stretch[e] = tooLong ? ratio : 0;
    }
  });
  std::vector<Candidate> out;
  for (std::size_t e = 0; e < table.size(); ++e)
    if (stretch[e] >= 0) out.push_back({static_cast<Index>(e), stretch[e], isForced[e] != 0});
  return out;
}

/// Distance of a point from the segment a b.
double distance(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 d = b - a;
  const double length = d.squaredNorm();
  const double t = length > 0 ? std::clamp((p - a).dot(d) / length, 0.0, 1.0) : 0.0;
  return (p - (a + t * d)).norm();
}

/// Reports a part of a whole, and passes cancelling on.
class PartProgress final : public Progress {
 public:
  PartProgress(Progress& whole, double begin, double end) : whole_(whole), begin_(begin), end_(end) {}
  void advance(double fraction) override {
    if (whole_.cancelled()) cancel();
    whole_.advance(begin_ + fraction * (end_ - begin_));
  }

 private:
  Progress& whole_;
  double begin_, end_;
};

}  // namespace

void Images::resize(std::size_t count) {
  position.resize(count), safe.resize(count);
  status.resize(count, Status::Fixed), residual.resize(count, 0.0f);
}

std::size_t Marking::tooCoarse() const {
  std::size_t count = asFan.size();
  for (const Marked& m : edges) count += m.severity >= 1;
  return count;
}

namespace {

/// Maps the midpoints of pairs of vertices in batches: each(i, images, k) for pair i, the batch's k-th.
template <class Each>
void mapMidpoints(const map::SpaceMap& map, const State& state, std::span<const std::array<Index, 2>> pairs,
                  Progress& progress, Each&& each) {
  const std::vector<Vec3>& rest = state.mesh.positions();
  std::vector<Vec3> middle;
  Images images;
  const double total = static_cast<double>(pairs.size());
  for (std::size_t first = 0; first < pairs.size(); first += kBatch) {
    progress.throwIfCancelled();
    const auto batch = pairs.subspan(first, std::min(kBatch, pairs.size() - first));
    middle.clear();
    for (const auto& [a, b] : batch) middle.push_back(0.5 * (rest[a] + rest[b]));
    images.resize(batch.size());
    const auto bound = state.binding ? map.bindMidpoints(*state.binding, rest, batch) : map.bind(middle);
    PartProgress part(progress, static_cast<double>(first) / total, static_cast<double>(first + batch.size()) / total);
    map.apply(*bound, images.output(), part);
    for (std::size_t k = 0; k < batch.size(); ++k) each(first + k, images, k);
  }
}

}  // namespace

Marking Judge::mark(const State& state, EdgeMemory& memory, std::span<const Index> forced, Progress& progress) const {
  const std::vector<Candidate> todo = candidates(*this, state, memory, forced);
  std::vector<std::array<Index, 2>> ends;
  ends.reserve(todo.size());
  for (const Candidate& c : todo) ends.push_back(state.table.vertices(c.edge));
  Marking out;
  mapMidpoints(map, state, ends, progress, [&](std::size_t i, const Images& images, std::size_t k) {
    const Candidate& c = todo[i];
    const Vec3& image = images.position[k];
    if (!image.allFinite()) {
      ++out.refused;
      memory.settled[c.edge] = kRefused;
      return;
    }
    const double off = options.by == Criterion::Stretch ? 0 : distance(image, state.posed[ends[i][0]], state.posed[ends[i][1]]);
    const double share = off > tolerance ? off / tolerance : 0;
    if (c.stretch < 1 && share < 1 && !c.forced) {
      out.deviation = std::max(out.deviation, off);
      return;
    }
    memory.settled[c.edge] = 0;
    const Vec3& safe = images.safe[k].allFinite() ? images.safe[k] : image;
    out.edges.push_back({c.edge, images.residual[k], std::max(c.stretch, share), image, safe, images.status[k]});
  });
  return out;
}

void Judge::markPolygons(const State& state, std::vector<std::uint8_t>& faceSettled, Marking& marking,
                         Progress& progress) const {
  const mesh::Mesh& mesh = state.mesh;
  if (mesh.allTriangles() || options.by == Criterion::Stretch) return;
  const Points rest = mesh.positions();
  std::vector<bool> divided(state.table.size(), false);
  for (const Marked& m : marking.edges) divided[m.edge] = true;
  std::vector<std::array<Index, 2>> diagonals;
  std::vector<Index> owner;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    const auto face = mesh.face(f);
    if (face.size() < 4 || faceSettled[f]) continue;
    bool whole = true;
    for (Index c = mesh.faceBegin(f); c < mesh.faceBegin(f + 1); ++c)
      whole = whole && (state.table.ofCorner(c) == kNoIndex || !divided[state.table.ofCorner(c)]);
    if (!whole) continue;
    faceSettled[f] = 1;
    for (std::size_t k = 2; k + 1 < face.size(); ++k)
      if (const auto [a, b] = std::minmax(face[0], face[k]);
          finite(rest, state.posed, a, b) && moved(rest, state.posed, a, b) && mayDeviate(*this, rest, state.posed, a, b)) {
        diagonals.push_back({a, b});
        owner.push_back(static_cast<Index>(f));
      }
  }
  mapMidpoints(map, state, diagonals, progress, [&](std::size_t i, const Images& images, std::size_t k) {
    const Vec3& image = images.position[k];
    if (!image.allFinite()) return;
    const double off = distance(image, state.posed[diagonals[i][0]], state.posed[diagonals[i][1]]);
    if (off > tolerance && (marking.asFan.empty() || marking.asFan.back() != owner[i])) marking.asFan.push_back(owner[i]);
  });
}

}  // namespace fielddeform::resample::detail
