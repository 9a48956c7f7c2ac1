#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/block_tracker.h>

#include <algorithm>

namespace fielddeform::gffd::detail {
namespace {

constexpr std::size_t kTask = 64;      // blocks
constexpr std::uint32_t kSplit = 96;   // a cell with more points is sorted by its parts
constexpr int kParts = 4;              // along an axis
constexpr double kEdge = 1e-12;

// Points of a cell by part, so that those that share a block are near one another in meshes of any order.
class PartOrder {
 public:
  PartOrder(const CellFrame& frame, Points rest) : frame_(frame), rest_(rest) {}

  std::span<const std::uint32_t> sort(const CellIndex& cell, std::span<const std::uint32_t> points) {
    part_.resize(points.size());
    sorted_.resize(points.size());
    std::array<std::uint32_t, kParts * kParts * kParts + 1> start{};
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Vec3 at = (rest_[points[k]] - frame_.node(cell)) * (kParts * frame_.inverse);
      const auto along = [&](int axis) { return static_cast<int>(std::clamp(at[axis], 0.0, kParts - kEdge)); };
      const int x = along(0), y = along(1), z = along(2);
      // The eight parts of one octant follow one another.
      part_[k] = static_cast<std::uint8_t>((x & 2) << 4 | (y & 2) << 3 | (z & 2) << 2 | (x & 1) << 2 | (y & 1) << 1 | (z & 1));
      ++start[part_[k] + std::size_t{1}];
    }
    for (std::size_t p = 1; p < start.size(); ++p) start[p] += start[p - 1];
    for (std::size_t k = 0; k < points.size(); ++k) sorted_[start[part_[k]]++] = points[k];
    return sorted_;
  }

 private:
  const CellFrame& frame_;
  Points rest_;
  std::vector<std::uint8_t> part_;
  std::vector<std::uint32_t> sorted_;
};

class Tracker {
 public:
  Tracker(const Stage& stage, const GffdBinding& binding, const map::MapOutput& out)
      : stage_(stage), binding_(binding), out_(out), settler_(stage) {}

  void take(std::uint32_t i) {
    index_[count_] = i;
    point_[count_].start = binding_.rest[i];
    point_[count_].value = binding_.value(i);
    point_[count_].weight = stage_.weight(point_[count_].value);
    if (++count_ == BlockSettler::kSize) finish();
  }

  void finish() {
    settler_.predict(std::span(point_).first(count_), std::span(predicted_).first(count_));
    std::size_t kept = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const Vec3 rest = point_[k].start;
      if (!predicted_[k].allFinite()) {
        write(index_[k], {rest, rest, Status::Stalled, 0});
        continue;
      }
      index_[kept] = index_[k];
      point_[kept] = point_[k];
      point_[kept++].start = predicted_[k];
    }
    settler_.settle(std::span(point_).first(kept), std::span(tracked_).first(kept));
    for (std::size_t k = 0; k < kept; ++k) write(index_[k], tracked_[k]);
    count_ = 0;
  }

 private:
  void write(std::uint32_t i, const Tracked& t) {
    if (!out_.position.empty()) out_.position[i] = t.position;
    if (!out_.safe.empty()) out_.safe[i] = t.safe;
    if (!out_.status.empty()) out_.status[i] = t.status;
    if (!out_.residual.empty()) out_.residual[i] = static_cast<float>(t.residual);
  }

  const Stage& stage_;
  const GffdBinding& binding_;
  const map::MapOutput& out_;
  BlockSettler settler_;
  std::size_t count_ = 0;
  std::array<std::uint32_t, BlockSettler::kSize> index_;
  std::array<BlockSettler::Point, BlockSettler::kSize> point_;
  std::array<Vec3, BlockSettler::kSize> predicted_;
  std::array<Tracked, BlockSettler::kSize> tracked_;
};

}  // namespace

void BlockSettler::predict(std::span<const Point> points, std::span<Vec3> to) {
  std::size_t moving = 0;
  for (const Point& p : points)
    if (p.weight > 0) position_[moving++] = p.start;
  stage_.axial()->at(std::span(position_).first(moving), std::span(motion_).first(moving), rest_);
  moving = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Point& p = points[k];
    to[k] = p.weight > 0 ? Vec3(p.start + Stage::part(motion_[moving++], p.weight)) : p.start;
  }
}

void BlockSettler::settle(std::span<const Point> points, std::span<Tracked> out) {
  const field::Field& field = stage_.posedField();
  const std::size_t n = points.size();
  for (std::size_t k = 0; k < n; ++k) position_[k] = points[k].start;
  field.evaluateTogether(std::span(position_).first(n), std::span(value_).first(n), posed_);
  std::size_t open = 0;
  for (std::size_t k = 0; k < n; ++k) {
    correction_[k] = stage_.correction(points[k].start, value_[k], points[k].value, points[k].weight);
    if (correction_[k].open()) open_[open++] = static_cast<std::uint32_t>(k);
  }
  while (open > 0) {
    for (std::size_t o = 0; o < open; ++o) position_[o] = correction_[open_[o]].next();
    field.evaluateTogether(std::span(position_).first(open), std::span(value_).first(open), posed_);
    std::size_t left = 0;
    for (std::size_t o = 0; o < open; ++o) {
      Correction& c = correction_[open_[o]];
      c.take(position_[o], value_[o]);
      if (c.open()) open_[left++] = open_[o];
    }
    open = left;
  }
  for (std::size_t k = 0; k < n; ++k) out[k] = correction_[k].result();
}

void trackByBlocks(const Stage& stage, const GffdBinding& binding, map::MapOutput out, Progress& progress) {
  const CellOrder& cells = binding.cells();
  // Tasks of whole cells; one large cell is a task.
  std::vector<std::size_t> tasks{0};
  std::size_t held = 0;
  for (std::size_t r = 0; r < cells.runs.size(); ++r) {
    held += cells.runs[r].end - cells.runs[r].begin;
    if (held < kTask * BlockSettler::kSize && r + 1 < cells.runs.size()) continue;
    tasks.push_back(r + 1);
    held = 0;
  }
  parallelFor(tasks.size() - 1, 1, progress, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      Tracker tracker(stage, binding, out);
      PartOrder parts(*binding.embedding->cells, binding.rest);
      for (std::size_t r = tasks[t]; r < tasks[t + 1]; ++r) {
        const CellOrder::Run& run = cells.runs[r];
        std::span<const std::uint32_t> points(cells.order.data() + run.begin, run.end - run.begin);
        if (points.size() > kSplit) points = parts.sort(run.cell, points);
        for (const std::uint32_t i : points) tracker.take(i);
      }
      tracker.finish();
    }
  });
}

}  // namespace fielddeform::gffd::detail
