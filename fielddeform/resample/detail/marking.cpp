#include <fielddeform/core/parallel.h>
#include <fielddeform/resample/detail/marking.h>

#include <algorithm>

namespace fielddeform::resample::detail {
namespace {

constexpr std::size_t kGrain = 4096;

/// Edges judged at once: bounds the memory of their midpoints' binding, and keeps it small beside the mesh's own.
std::size_t batchOf(std::size_t count) { return std::clamp<std::size_t>(count / 8, 1 << 13, 1 << 16); }

/// What the ends alone tell about an edge.
struct Candidate {
  Index edge;
  bool forced;
  double stretch;  ///< deformed length / (maxStretch * reference): too long from 1 on
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

/// Finds the edges with a moved vertex whose midpoint has to be mapped: forced ones, too long ones, those that may deviate.
class Candidates {
 public:
  Candidates(const Judge& judge, const State& state, EdgeMemory& memory, std::span<const Index> forced)
      : judge_(judge), state_(state), memory_(memory), forced_(forced) {}

  /// Of the edges from begin to end, ascending.
  std::span<const Candidate> among(std::size_t begin, std::size_t end) {
    parts_.resize((end - begin + kGrain - 1) / kGrain);
    parallelFor(end - begin, kGrain, [&](std::size_t first, std::size_t last) { look(begin + first, begin + last, parts_[first / kGrain]); });
    found_.clear();
    for (const auto& part : parts_) found_.insert(found_.end(), part.begin(), part.end());
    return found_;
  }

 private:
  void look(std::size_t begin, std::size_t end, std::vector<Candidate>& out) const {
    const Points rest = state_.mesh.positions(), posed = state_.posed;
    auto next = std::lower_bound(forced_.begin(), forced_.end(), begin);
    out.clear();
    for (std::size_t e = begin; e < end; ++e) {
      bool forced = next != forced_.end() && *next == e;
      if (forced) ++next;
      forced = forced && memory_.settled[e] != kRefused;
      if (memory_.settled[e] && !forced) continue;
      memory_.settled[e] = 1;
      const auto [a, b] = state_.table.vertices(e);
      if (!finite(rest, posed, a, b) || !(forced || moved(rest, posed, a, b))) continue;
      const double bound = judge_.options.maxStretch * memory_.reference[e];
      const double ratio = (posed[a] - posed[b]).norm() / bound;
      const bool tooLong = judge_.options.by != Criterion::Deviation && bound > 0 && ratio >= 1;
      if (tooLong || forced || mayDeviate(judge_, rest, posed, a, b)) out.push_back({static_cast<Index>(e), forced, tooLong ? ratio : 0});
    }
  }

  const Judge& judge_;
  const State& state_;
  EdgeMemory& memory_;
  std::span<const Index> forced_;
  std::vector<std::vector<Candidate>> parts_;
  std::vector<Candidate> found_;
};

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

/// The images of midpoints of pairs of vertices, a batch at a time.
class Midpoints {
 public:
  Midpoints(const map::SpaceMap& map, const State& state) : map_(map), state_(state) {}

  /// @return by pair; until the next call
  const Images& of(std::span<const std::array<Index, 2>> pairs, Progress& progress) {
    const std::vector<Vec3>& rest = state_.mesh.positions();
    images_.resize(pairs.size());
    if (state_.binding) {
      map_.apply(*map_.bindMidpoints(*state_.binding, rest, pairs), images_.output(), progress);
      return images_;
    }
    middle_.resize(pairs.size());
    parallelFor(pairs.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) middle_[i] = 0.5 * (rest[pairs[i][0]] + rest[pairs[i][1]]);
    });
    map_.apply(*map_.bind(middle_), images_.output(), progress);
    return images_;
  }

 private:
  const map::SpaceMap& map_;
  const State& state_;
  std::vector<Vec3> middle_;
  Images images_;
};

/// The share of a whole that a batch is, as progress.
PartProgress partOf(Progress& whole, std::size_t begin, std::size_t end, std::size_t count) {
  return {whole, static_cast<double>(begin) / static_cast<double>(count), static_cast<double>(end) / static_cast<double>(count)};
}

}  // namespace

Marking Judge::mark(const State& state, EdgeMemory& memory, std::span<const Index> forced, Progress& progress) const {
  Candidates candidates(*this, state, memory, forced);
  Midpoints midpoints(map, state);
  std::vector<std::array<Index, 2>> ends;
  std::vector<double> off;
  Marking out;
  const std::size_t count = state.table.size(), batch = batchOf(count);
  for (std::size_t begin = 0; begin < count; begin += batch) {
    const std::size_t end = std::min(count, begin + batch);
    progress.throwIfCancelled();
    const std::span<const Candidate> todo = candidates.among(begin, end);
    if (todo.empty()) continue;
    ends.resize(todo.size()), off.resize(todo.size());
    for (std::size_t i = 0; i < todo.size(); ++i) ends[i] = state.table.vertices(todo[i].edge);
    PartProgress part = partOf(progress, begin, end, count);
    const Images& images = midpoints.of(ends, part);
    parallelFor(todo.size(), kGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        off[i] = options.by == Criterion::Stretch ? 0 : distance(images.position[i], state.posed[ends[i][0]], state.posed[ends[i][1]]);
    });
    for (std::size_t i = 0; i < todo.size(); ++i) {
      const Candidate& c = todo[i];
      const Vec3& image = images.position[i];
      if (!image.allFinite()) {
        ++out.refused;
        memory.settled[c.edge] = kRefused;
        continue;
      }
      const double share = off[i] > tolerance ? off[i] / tolerance : 0;
      if (c.stretch < 1 && share < 1 && !c.forced) {
        out.deviation = std::max(out.deviation, off[i]);
        continue;
      }
      memory.settled[c.edge] = 0;
      const Vec3& safe = images.safe[i].allFinite() ? images.safe[i] : image;
      out.edges.push_back({c.edge, images.residual[i], std::max(c.stretch, share), image, safe, images.status[i]});
    }
  }
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
  Midpoints midpoints(map, state);
  const std::size_t batch = batchOf(diagonals.size());
  for (std::size_t begin = 0; begin < diagonals.size(); begin += batch) {
    const std::size_t end = std::min(diagonals.size(), begin + batch);
    progress.throwIfCancelled();
    PartProgress part = partOf(progress, begin, end, diagonals.size());
    const Images& images = midpoints.of(std::span(diagonals).subspan(begin, end - begin), part);
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3& image = images.position[i - begin];
      if (!image.allFinite()) continue;
      const double off = distance(image, state.posed[diagonals[i][0]], state.posed[diagonals[i][1]]);
      if (off > tolerance && (marking.asFan.empty() || marking.asFan.back() != owner[i])) marking.asFan.push_back(owner[i]);
    }
  }
}

}  // namespace fielddeform::resample::detail
