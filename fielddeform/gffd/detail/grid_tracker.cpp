#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/block_tracker.h>
#include <fielddeform/gffd/detail/displacement_grid.h>
#include <fielddeform/gffd/detail/grid_kernel.h>
#include <fielddeform/gffd/detail/grid_tracker.h>
#include <fielddeform/gffd/detail/lines_field.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

constexpr std::uint32_t kTaskPoints = 4096;
constexpr int kPasses = 6;
constexpr double kGradientFloor = 0.05;  // as Stage::correct
constexpr double kLongestStep = 0.5;     // radii

// A stretch of one cell's points.
struct Piece {
  std::uint32_t run, begin, end;
};

// Pieces of at most kTaskPoints points, and where each task begins among them.
struct Tasks {
  std::vector<Piece> pieces;
  std::vector<std::size_t> start;
};

Tasks makeTasks(const CellOrder& cells) {
  Tasks t;
  std::uint32_t room = 0;
  for (std::uint32_t r = 0; r < cells.runs.size(); ++r)
    for (std::uint32_t begin = cells.runs[r].begin; begin < cells.runs[r].end;) {
      if (room == 0) {
        t.start.push_back(t.pieces.size());
        room = kTaskPoints;
      }
      const std::uint32_t take = std::min(room, cells.runs[r].end - begin);
      t.pieces.push_back({r, begin, begin + take});
      begin += take;
      room -= take;
    }
  t.start.push_back(t.pieces.size());
  return t;
}

class Tracker {
 public:
  Tracker(const Stage& stage, const GffdBinding& binding, const DisplacementGrid::Cells& cells, const map::MapOutput& out)
      : stage_(stage), binding_(binding), order_(binding.cells()), cells_(cells), out_(out), settler_(stage) {}

  EvaluationCounts run(std::span<const Piece> pieces) {
    std::uint32_t known = 0xFFFFFFFFu;
    bool fine = false;
    for (const Piece& piece : pieces) {
      const CellOrder::Run& run = order_.runs[piece.run];
      if (piece.run != known) {
        known = piece.run;
        fine = cells_.fine(run.cell);
        if (fine) cells_.polynomial(run.cell, polynomial_);
      }
      for (std::uint32_t begin = piece.begin; begin < piece.end;) {
        const std::uint32_t take = std::min(piece.end - begin, static_cast<std::uint32_t>(kLanes - count_));
        predict(run.cell, begin, take, fine);
        begin += take;
        if (count_ == kLanes) finish();
      }
    }
    if (count_ > 0) finish();
    return counts_;
  }

 private:
  // Predictions of a cell's points, appended to the block.
  void predict(const CellIndex& cell, std::uint32_t begin, std::uint32_t take, bool fine) {
    const CellFrame& frame = stage_.grid()->frame();
    const std::size_t at = count_;
    for (std::uint32_t k = 0; k < take; ++k) {
      const std::uint32_t i = order_.order[begin + k];
      const Vec3& p = binding_.rest[i];
      index_[at + k] = i;
      u_[k] = (p[0] - frame.origin[0]) * frame.inverse - cell.x;
      v_[k] = (p[1] - frame.origin[1]) * frame.inverse - cell.y;
      w_[k] = (p[2] - frame.origin[2]) * frame.inverse - cell.z;
    }
    if (fine) cubicAt(polynomial_, take, u_, v_, w_, dx_, dy_, dz_);
    predictExactly(at, take, fine);
    for (std::size_t k = 0; k < take; ++k) {
      const std::uint32_t i = index_[at + k];
      const Vec3 p = binding_.rest[i], to = p + Vec3(dx_[k], dy_[k], dz_[k]);
      if (!to.allFinite()) {
        write(i, {p, p, Status::Stalled, 0});
        continue;
      }
      index_[count_] = i;
      weight_[count_] = weight_[at + k];
      predicted_.x[count_] = to[0];
      predicted_.y[count_] = to[1];
      predicted_.z[count_] = to[2];
      ++count_;
    }
  }

  // The displacements that the grid does not give: all of them in a cell that is not fine, and those within a falloff.
  void predictExactly(std::size_t at, std::size_t take, bool fine) {
    const bool falloff = stage_.hasFalloff();
    std::size_t count = 0;
    for (std::size_t k = 0; k < take; ++k) {
      const std::uint32_t i = index_[at + k];
      const double weight = falloff ? stage_.weight(binding_.value(i)) : 1;
      weight_[at + k] = weight;
      if (fine && weight >= 1) continue;
      if (!(weight > 0)) {
        dx_[k] = dy_[k] = dz_[k] = 0;
        continue;
      }
      const Vec3& p = binding_.rest[i];
      slot_[count] = static_cast<std::uint32_t>(k);
      exact_.x[count] = p[0];
      exact_.y[count] = p[1];
      exact_.z[count] = p[2];
      exactLevel_[count] = binding_.level[i];
      exactWeight_[count++] = weight;
    }
    counts_.exact += count;
    counts_.grid += take - count;
    if (count == 0) return;
    stage_.displacementsAt(exact_, count, exactLevel_, falloff ? exactWeight_ : nullptr, exact_);
    for (std::size_t e = 0; e < count; ++e) {
      dx_[slot_[e]] = exact_.x[e];
      dy_[slot_[e]] = exact_.y[e];
      dz_[slot_[e]] = exact_.z[e];
    }
  }

  void finish() {
    stage_.lines() ? correct() : settle();
    count_ = 0;
  }

  // Another field: blocks share its searches.
  void settle() {
    counts_.singly += count_;
    std::array<BlockSettler::Point, kLanes> points;
    std::array<Tracked, kLanes> tracked;
    for (std::size_t k = 0; k < count_; ++k) points[k] = {predicted(k), binding_.value(index_[k]), weight_[k]};
    settler_.settle(std::span(points).first(count_), std::span(tracked).first(count_));
    for (std::size_t k = 0; k < count_; ++k) write(index_[k], tracked[k]);
  }

  Vec3 predicted(std::size_t k) const { return {predicted_.x[k], predicted_.y[k], predicted_.z[k]}; }

  void singly(std::size_t k) {
    ++counts_.singly;
    write(index_[k], stage_.settle(predicted(k), binding_.value(index_[k]), weight_[k]));
  }

  // Newton steps on the whole block; what they do not settle goes singly.
  void correct() {
    const double tolerance = stage_.tolerance(), longest = kLongestStep * stage_.radius();
    const LinesField& field = *stage_.lines();
    field.evaluate(predicted_, count_, values_);
    std::size_t open = 0, unsettled = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double kept = binding_.level[index_[k]] * stage_.radius(), w = weight_[k], here = values_.value[k];
      target_[k] = w < 1 ? (1 - w) * here + w * kept : kept;
      residual_[k] = here - target_[k];
      x_[k] = predicted_.x[k];
      y_[k] = predicted_.y[k];
      z_[k] = predicted_.z[k];
      gx_[k] = values_.gx[k];
      gy_[k] = values_.gy[k];
      gz_[k] = values_.gz[k];
      (std::isfinite(residual_[k]) ? open_[open++] : unsettled_[unsettled++]) = static_cast<std::uint32_t>(k);
    }
    if (!stage_.corrects()) open = 0;
    for (int pass = 0; open > 0 && pass < kPasses; ++pass) {
      std::size_t moving = 0;
      for (std::size_t o = 0; o < open; ++o) {
        const std::uint32_t k = open_[o];
        const double g2 = gx_[k] * gx_[k] + gy_[k] * gy_[k] + gz_[k] * gz_[k];
        const double step = -residual_[k] / std::max(g2, kGradientFloor * kGradientFloor);
        if (!(step * step * g2 <= longest * longest)) {  // also where there is no number
          unsettled_[unsettled++] = k;
          continue;
        }
        next_.x[moving] = x_[k] + step * gx_[k];
        next_.y[moving] = y_[k] + step * gy_[k];
        next_.z[moving] = z_[k] + step * gz_[k];
        open_[moving++] = k;
      }
      if (moving == 0) {
        open = 0;
        break;
      }
      field.evaluate(next_, moving, values_);
      open = 0;
      for (std::size_t m = 0; m < moving; ++m) {
        const std::uint32_t k = open_[m];
        const double r = values_.value[m] - target_[k], before = std::abs(residual_[k]);
        if (!(std::abs(r) < before)) {
          if (!(before <= tolerance)) unsettled_[unsettled++] = k;
          continue;
        }
        x_[k] = next_.x[m];
        y_[k] = next_.y[m];
        z_[k] = next_.z[m];
        residual_[k] = r;
        gx_[k] = values_.gx[m];
        gy_[k] = values_.gy[m];
        gz_[k] = values_.gz[m];
        if (!(std::abs(r) <= tolerance)) open_[open++] = k;
      }
    }
    for (std::size_t o = 0; o < open; ++o) unsettled_[unsettled++] = open_[o];
    for (std::size_t k = 0; k < count_; ++k) {
      const double r = std::abs(residual_[k]);
      write(index_[k], {predicted(k), Vec3(x_[k], y_[k], z_[k]), r <= tolerance ? Status::Converged : Status::Stalled, r});
    }
    for (std::size_t n = 0; n < unsettled; ++n) singly(unsettled_[n]);
  }

  void write(std::uint32_t i, const Tracked& t) {
    if (!out_.position.empty()) out_.position[i] = t.position;
    if (!out_.safe.empty()) out_.safe[i] = t.safe;
    if (!out_.status.empty()) out_.status[i] = t.status;
    if (!out_.residual.empty()) out_.residual[i] = static_cast<float>(t.residual);
  }

  const Stage& stage_;
  const GffdBinding& binding_;
  const CellOrder& order_;
  const DisplacementGrid::Cells& cells_;
  const map::MapOutput& out_;
  BlockSettler settler_;
  EvaluationCounts counts_;
  std::size_t count_ = 0;
  alignas(64) double polynomial_[kCoefficients];
  alignas(64) double u_[kLanes + 8] = {}, v_[kLanes + 8] = {}, w_[kLanes + 8] = {}, dx_[kLanes + 8], dy_[kLanes + 8], dz_[kLanes + 8];
  Block predicted_, next_, exact_;
  LineValues values_;
  double x_[kLanes], y_[kLanes], z_[kLanes], gx_[kLanes], gy_[kLanes], gz_[kLanes];
  double weight_[kLanes], exactLevel_[kLanes], exactWeight_[kLanes], target_[kLanes], residual_[kLanes];
  std::uint32_t index_[kLanes], slot_[kLanes], open_[kLanes], unsettled_[kLanes];
};

}  // namespace

EvaluationCounts trackByGrid(const Stage& stage, const GffdBinding& binding, map::MapOutput out, Progress& progress) {
  const CellOrder& order = binding.cells();
  const auto cells = stage.grid()->with(order.runs, progress);
  const Tasks tasks = makeTasks(order);
  std::vector<EvaluationCounts> counts(tasks.start.size() - 1);
  parallelFor(counts.size(), 1, progress, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      Tracker tracker(stage, binding, *cells, out);
      counts[t] = tracker.run(std::span(tasks.pieces).subspan(tasks.start[t], tasks.start[t + 1] - tasks.start[t]));
    }
  });
  EvaluationCounts total;
  for (const EvaluationCounts& c : counts) {
    total.grid += c.grid;
    total.exact += c.exact;
    total.singly += c.singly;
  }
  return total;
}

}  // namespace fielddeform::gffd::detail
