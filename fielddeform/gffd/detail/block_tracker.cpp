#include <fielddeform/gffd/detail/block_tracker.h>
#include <fielddeform/gffd/detail/neighbourhoods.h>

#include <algorithm>

namespace fielddeform::gffd::detail {
namespace {

class Tracker {
 public:
  Tracker(const Stage& stage, const GffdBinding& binding, const map::MapOutput& out)
      : stage_(stage), binding_(binding), out_(out), settler_(stage) {}

  void take(std::uint32_t i) {
    index_[count_] = i;
    point_[count_].start = binding_.rest[i];
    point_[count_].value = binding_.value(i);
    point_[count_].weight = stage_.weight(point_[count_].value);
    point_[count_].feet = binding_.feetOf(i);
    if (++count_ == BlockSettler::kSize) finish();
  }

  void pause() {
    if (count_ >= BlockSettler::kSize / 2) finish();
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
  const auto known = [](const Point& p) { return !p.feet.empty() && std::all_of(p.feet.begin(), p.feet.end(), [](const field::Foot& f) { return f.known(); }); };
  std::size_t moving = 0;
  for (const Point& p : points)
    if (p.weight > 0 && !known(p)) position_[moving++] = p.start;
  stage_.axial()->at(std::span(position_).first(moving), std::span(motion_).first(moving), rest_);
  moving = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Point& p = points[k];
    if (p.weight > 0) to[k] = p.start + Stage::part(known(p) ? stage_.axial()->at(p.start, p.feet) : motion_[moving++], p.weight);
    else to[k] = p.start;
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
  forEachNeighbourhood(*binding.embedding->cells, binding.cells(), binding.rest, progress, [&](const auto& forEach) {
    Tracker tracker(stage, binding, out);
    forEach(tracker);
    tracker.finish();
  });
}

}  // namespace fielddeform::gffd::detail
