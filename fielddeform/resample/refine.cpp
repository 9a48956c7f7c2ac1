#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/resample/detail/marking.h>
#include <fielddeform/resample/detail/slivers.h>
#include <fielddeform/resample/detail/split.h>
#include <fielddeform/resample/refine.h>
#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <numeric>
#include <stdexcept>

namespace fielddeform::resample {
namespace {

using detail::EdgeMemory;
using detail::Images;
using detail::Marked;
using detail::Marking;
using mesh::EdgeTable;
using mesh::Mesh;

/// Worst first, so that a limit on the vertices spends them where they matter.
void keepWorst(std::vector<Marked>& marked, std::size_t count) {
  if (marked.size() <= count) return;
  const auto end = marked.begin() + static_cast<std::ptrdiff_t>(count);
  std::nth_element(marked.begin(), end, marked.end(), [](const Marked& a, const Marked& b) {
    return a.severity != b.severity ? a.severity > b.severity : a.edge < b.edge;
  });
  marked.erase(end, marked.end());
  std::sort(marked.begin(), marked.end(), [](const Marked& a, const Marked& b) { return a.edge < b.edge; });
}

class Refiner {
 public:
  Refiner(Mesh rest, const map::SpaceMap& map, const Options& options, Progress& progress)
      : map_(map), options_(options), progress_(progress), mesh_(std::move(rest)), faceSettled_(mesh_.faceCount(), 0),
        inputVertices_(mesh_.vertexCount()), inputFaces_(mesh_.faceCount()), layout_(mesh_.layout()), parentOf_(mesh_.faceCount()) {
    mesh_.setLayout(nullptr);
    std::iota(parentOf_.begin(), parentOf_.end(), 0u);
    const std::size_t automatic = 8 * inputVertices_ + 100'000;
    limit_ = std::min<std::size_t>(options.maxVertices.value_or(automatic), kNoIndex - 1);
    // Far from the origin coordinates end before the tolerance does.
    const Box box = mesh::boundingBox(mesh_.positions());
    const double farthest = box.isEmpty() ? 0 : box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
    tolerance_ = std::max(options.maxDeviation * mesh::objectSize(mesh_.positions()), 32 * 0x1p-52 * farthest);
  }

  Refined run(Start start) {
    EdgeTable table = start.edges ? std::move(*start.edges) : EdgeTable(mesh_);
    if (table.cornerCount() != mesh_.corners().size())
      throw std::invalid_argument(fmt::format("start.edges: of {} corners, expected {}", table.cornerCount(), mesh_.corners().size()));
    takeStart(std::move(start));
    report_.minAngleBefore = mesh::smallestAngle(mesh_, mesh_.positions());
    const detail::Judge judge{map_, options_, tolerance_};
    EdgeMemory memory(table, mesh_.positions());
    for (;;) {
      const detail::State state{mesh_, table, images_.position, binding_.get()};
      const std::vector<Index> thin =
          detail::sidesOfThinFaces(input_ ? *input_ : mesh_, mesh_, table, images_.position, parentOf_, options_.minAngle);
      Marking marking = judge.mark(state, memory, thin, progress_);
      judge.markPolygons(state, faceSettled_, marking, progress_);
      report_.refused += marking.refused;
      report_.deviationMax = std::max(report_.deviationMax, marking.deviation);
      const std::size_t room = limit_ > mesh_.vertexCount() ? limit_ - mesh_.vertexCount() : 0;
      if (marking.edges.empty() && marking.asFan.empty()) break;
      const bool full = room == 0 && !marking.edges.empty();
      if (full || report_.rounds == options_.maxRounds) {
        report_.remaining = marking.tooCoarse();
        if (report_.remaining) report_.reason = full ? StopReason::MaxVertices : StopReason::MaxRounds;
        break;
      }
      keepWorst(marking.edges, room);
      insert(marking, table, memory);
      ++report_.rounds;
    }
    measure(table, memory);
    return finish(std::move(table));
  }

 private:
  void takeStart(Start start) {
    const std::size_t n = mesh_.vertexCount();
    const bool known = !(start.position.empty() && start.safe.empty() && start.status.empty() && start.residual.empty());
    if (known) {
      const auto check = [&](std::size_t size, const char* what) {
        if (size != n) throw std::invalid_argument(fmt::format("start.{}: {} values, expected {}", what, size, n));
      };
      check(start.position.size(), "position"), check(start.safe.size(), "safe");
      check(start.status.size(), "status"), check(start.residual.size(), "residual");
      images_ = {std::move(start.position), std::move(start.safe), std::move(start.status), std::move(start.residual)};
    }
    if (!known || map_.midpointsInherit()) {
      binding_ = map_.bind(mesh_.positions());
      if (!known) {
        images_.resize(n);
        map_.apply(*binding_, images_.output(), progress_);
      }
      if (!map_.midpointsInherit()) binding_.reset();
    }
    makeFinite();
    if (!known && options_.meshStep) options_.meshStep(mesh_, images_.output());
  }

  /// A map that gives no number leaves the vertex where it was: never a NaN from finite input.
  void makeFinite() {
    for (std::size_t i = 0; i < images_.position.size(); ++i) {
      Vec3& p = images_.position[i];
      const Vec3& rest = mesh_.positions()[i];
      if (!p.allFinite()) {
        p = images_.safe[i].allFinite() ? images_.safe[i] : rest;
        images_.status[i] = rest.allFinite() ? Status::Stalled : Status::Invalid;
      }
      if (!images_.safe[i].allFinite()) images_.safe[i] = p;
    }
  }

  void insert(const Marking& marking, EdgeTable& table, EdgeMemory& memory) {
    const std::vector<Marked>& marked = marking.edges;
    const std::size_t old = mesh_.vertexCount();
    std::vector<Index> rank(table.size(), kNoIndex), divided;
    std::vector<Vec3> positions = mesh_.positions();
    positions.reserve(old + marked.size());
    for (const Marked& m : marked) {
      const auto ends = table.vertices(m.edge);
      rank[m.edge] = static_cast<Index>(divided.size());
      divided.push_back(m.edge);
      parents_.push_back(ends);
      positions.push_back(0.5 * (positions[ends[0]] + positions[ends[1]]));
      images_.position.push_back(m.position), images_.safe.push_back(m.safe);
      images_.status.push_back(m.status), images_.residual.push_back(m.residual);
    }
    const detail::SplitFaces faces = detail::splitFaces(mesh_, table, rank, marking.asFan, positions);
    Mesh finer = detail::makeRefined(mesh_, table, divided, rank, faces, std::move(positions));
    if (binding_) bindAll();

    EdgeTable next(finer);
    EdgeMemory carried =
        detail::carryOver(memory, table, mesh_, divided, rank, next, finer.positions(), faces.faceParent);
    if (!input_) input_ = std::move(mesh_);
    mesh_ = std::move(finer);
    table = std::move(next), memory = std::move(carried);
    inheritFaces(faces.faceParent);
    applyMeshStep(table, memory);
  }

  void inheritFaces(const std::vector<Index>& parent) {
    std::vector<Index> parents(parent.size());
    for (std::size_t f = 0; f < parents.size(); ++f) parents[f] = parentOf_[parent[f]];
    parentOf_ = std::move(parents);
    std::vector<std::uint8_t> settled(parent.size());
    for (std::size_t f = 0; f < parent.size(); ++f) settled[f] = faceSettled_[parent[f]];
    for (const Index f : detail::replacedFaces(parent)) settled[f] = 0;
    faceSettled_ = std::move(settled);
  }

  /// The binding of all vertices, old ones as midpoints of themselves: they keep their values, new ones inherit.
  void bindAll() {
    std::vector<std::array<Index, 2>> ends(images_.position.size());
    const std::size_t old = mesh_.vertexCount();
    for (std::size_t i = 0; i < ends.size(); ++i)
      ends[i] = i < old ? std::array{static_cast<Index>(i), static_cast<Index>(i)} : parents_[i - inputVertices_];
    binding_ = map_.bindMidpoints(*binding_, mesh_.positions(), ends);
  }

  /// Edges and faces that the step has moved are to be judged again.
  void applyMeshStep(const EdgeTable& table, EdgeMemory& memory) {
    if (!options_.meshStep) return;
    const std::vector<Vec3> before = images_.position;
    options_.meshStep(mesh_, images_.output());
    makeFinite();
    const auto moved = [&](Index v) { return images_.position[v] != before[v]; };
    for (std::size_t e = 0; e < table.size(); ++e)
      if (moved(table.vertices(e)[0]) || moved(table.vertices(e)[1])) memory.settled[e] = 0;
    for (std::size_t f = 0; f < mesh_.faceCount(); ++f)
      if (const auto face = mesh_.face(f); std::any_of(face.begin(), face.end(), moved)) faceSettled_[f] = 0;
  }

  void measure(const EdgeTable& table, const EdgeMemory& memory) {
    std::vector<double> ratio(table.size());
    parallelFor(ratio.size(), 4096, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        const auto [a, b] = table.vertices(e);
        ratio[e] = (images_.position[a] - images_.position[b]).norm() / memory.reference[e];
      }
    });
    std::erase_if(ratio, [](double r) { return !std::isfinite(r); });
    if (!ratio.empty()) {
      const auto rank = static_cast<std::ptrdiff_t>((ratio.size() * 99 + 99) / 100 - 1);
      std::nth_element(ratio.begin(), ratio.begin() + rank, ratio.end());
      report_.stretchP99 = ratio[static_cast<std::size_t>(rank)];
      report_.stretchMax = *std::max_element(ratio.begin() + rank, ratio.end());
    }
    report_.minAngleAfter = report_.rounds == 0 ? report_.minAngleBefore : mesh::smallestAngle(mesh_, mesh_.positions());
    const std::vector<Index> fresh = detail::replacedFaces(parentOf_);
    report_.minNewAngle = mesh::smallestAngle(mesh_, mesh_.positions(), fresh);
    report_.minNewAnglePosed = mesh::smallestAngle(mesh_, images_.position, fresh);
  }

  Refined finish(EdgeTable edges) {
    Report& r = report_;
    r.insertedVertices = mesh_.vertexCount() - inputVertices_;
    r.insertedFaces = mesh_.faceCount() - inputFaces_;
    if (r.reason == StopReason::MaxRounds)
      r.message = fmt::format("resampling stopped after {} rounds with {} edges still too coarse", r.rounds, r.remaining);
    if (r.reason == StopReason::MaxVertices)
      r.message = fmt::format("resampling stopped at the limit of {} vertices with {} edges still too coarse", limit_, r.remaining);
    if (r.refused)
      r.message += fmt::format("{}{} edges stay undivided: their midpoints have no finite image",
                               r.message.empty() ? "" : "; ", r.refused);
    if (layout_) mesh_.setLayout(r.rounds ? layout_->refined(parentOf_, mesh_.vertexCount()) : layout_);
    if (input_) input_->setLayout(layout_);
    return {std::move(mesh_), std::move(images_.position), std::move(images_.status), std::move(images_.residual),
            std::move(images_.safe), std::move(parents_), std::move(parentOf_), std::move(edges), std::move(input_), std::move(report_)};
  }

  const map::SpaceMap& map_;
  const Options& options_;
  Progress& progress_;
  Mesh mesh_;
  std::optional<Mesh> input_;  ///< once mesh_ is finer
  Images images_;
  std::shared_ptr<const map::Binding> binding_;  ///< of all vertices; only for maps whose midpoints inherit
  std::vector<std::uint8_t> faceSettled_;  ///< #F, polygons whose diagonals are fine enough
  std::size_t inputVertices_, inputFaces_, limit_ = 0;
  double tolerance_ = 0;
  std::shared_ptr<const mesh::FileLayout> layout_;
  std::vector<std::array<Index, 2>> parents_;
  std::vector<Index> parentOf_;
  Report report_;
};

}  // namespace

void Options::validate() const {
  if (!(maxStretch >= 1)) throw std::invalid_argument(fmt::format("maxStretch is {}, expected at least 1", maxStretch));
  requirePositive("maxDeviation", maxDeviation);
  requireInRange("minAngle", minAngle, 0, std::numbers::pi / 3);
  if (maxRounds < 0) throw std::invalid_argument(fmt::format("maxRounds is {}, expected at least 0", maxRounds));
}

std::string_view toString(StopReason reason) noexcept {
  constexpr std::string_view words[] = {"done", "max_rounds", "max_vertices"};
  return words[static_cast<std::size_t>(reason)];
}

Refined refine(Mesh rest, const map::SpaceMap& map, const Options& options, Progress& progress) {
  options.validate();
  return Refiner(std::move(rest), map, options, progress).run({});
}

Refined refine(Mesh rest, const map::SpaceMap& map, Start start, const Options& options, Progress& progress) {
  options.validate();
  return Refiner(std::move(rest), map, options, progress).run(std::move(start));
}

}  // namespace fielddeform::resample
