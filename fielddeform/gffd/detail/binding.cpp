#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/binding.h>
#include <fielddeform/gffd/detail/neighbourhoods.h>

#include <algorithm>
#include <array>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kFixed = std::numeric_limits<double>::quiet_NaN();
constexpr double kFar = std::numeric_limits<double>::max();

constexpr std::size_t kBlock = 64;    // points that share searches
constexpr std::size_t kMostFeet = 4;  // of a point, four bytes each

double shareOf(double level) { return std::clamp(1 - level, 0.0, 1.0); }

}  // namespace

std::shared_ptr<const Embedding> makeEmbedding(const skeleton::SkeletonPair& pair, const field::FieldOptions& options,
                                               Points around) {
  auto e = std::make_shared<Embedding>();
  e->field = std::make_shared<const field::Field>(pair.rest, options, around);
  e->radius = e->field->referenceRadius();
  for (const auto& p : pair.rest.primitives) e->surfaces = e->surfaces || p.type == skeleton::PrimitiveType::Mesh;
  const MovingPart part = movingPart(pair);
  e->movingIndex = part.restIndex;
  e->cells = CellFrame::of(part.rest);
  if (part.rest.primitives.size() == pair.rest.primitives.size()) e->moving = e->field;
  else if (!part.rest.primitives.empty())
    e->moving = std::make_shared<const field::Field>(part.rest, options.after(*e->field), around);
  e->lines = LinesField::of(pair.rest, options, e->radius);
  if (e->moving && e->moving != e->field) e->movingLines = LinesField::of(part.rest, options, e->moving->referenceRadius());
  return e;
}

Value GffdBinding::value(std::size_t i) const {
  return {level[i], share.empty() ? shareOf(level[i]) : share[i]};
}

const CellOrder& GffdBinding::cells() const {
  std::call_once(ordered_, [this] {
    cells_ = orderByCell(*embedding->cells, rest, [this](std::size_t i) { return movable(i); });
  });
  return cells_;
}

void GffdBinding::adopt(CellOrder all) const {
  std::call_once(ordered_, [&] {
    std::uint32_t kept = 0;
    std::size_t runs = 0;
    for (CellOrder::Run run : all.runs) {
      const std::uint32_t begin = kept;
      for (std::uint32_t k = run.begin; k < run.end; ++k)
        if (movable(all.order[k])) all.order[kept++] = all.order[k];
      if (kept > begin) all.runs[runs++] = {run.cell, begin, kept};
    }
    all.order.resize(kept);
    all.runs.resize(runs);
    cells_ = std::move(all);
  });
}

namespace {

// What only a removed primitive influenced has nothing left to follow.
Value valueOf(const Embedding& e, const field::FieldValue& v, const field::FieldValue& moving) {
  if (!v.inside || !moving.inside) return {kFixed, 0};
  return {v.pseudoDistance / e.radius, shareOf(moving.pseudoDistance / e.moving->referenceRadius())};
}

// Values of points that follow one another, 64 at a time.
class BlockBinder {
 public:
  explicit BlockBinder(GffdBinding& binding) : binding_(binding), embedding_(*binding.embedding) {}

  void take(std::uint32_t i) {
    index_[count_] = i;
    position_[count_] = binding_.rest[i];
    if (++count_ == kBlock) finish();
  }

  void pause() {
    if (count_ >= kBlock / 2) finish();
  }

  void finish() {
    const std::span<const Vec3> points(position_.data(), count_);
    const bool removed = embedding_.moving != embedding_.field;
    const std::size_t stride = binding_.feet.empty() ? 0 : embedding_.moving->primitiveCount();
    const auto feet = std::span(feet_).first(stride * count_);
    embedding_.field->evaluateTogether(points, std::span(value_).first(count_), hints_, removed ? std::span<field::Foot>{} : feet);
    if (removed && embedding_.moving) embedding_.moving->evaluateTogether(points, std::span(moving_).first(count_), movingHints_, feet);
    for (std::size_t k = 0; k < count_; ++k)
      for (std::size_t f = 0; f < stride; ++f) binding_.feet[index_[k] * stride + f] = feet[k * stride + f];
    for (std::size_t k = 0; k < count_; ++k) {
      const Value v = removed && !embedding_.moving ? Value{kFixed, 0} : valueOf(embedding_, value_[k], removed ? moving_[k] : value_[k]);
      binding_.level[index_[k]] = v.level;
      if (removed) binding_.share[index_[k]] = v.share;
    }
    count_ = 0;
  }

 private:
  GffdBinding& binding_;
  const Embedding& embedding_;
  field::SearchHints hints_, movingHints_;
  std::size_t count_ = 0;
  std::array<std::uint32_t, kBlock> index_;
  std::array<Vec3, kBlock> position_;
  std::array<field::FieldValue, kBlock> value_, moving_;
  std::array<field::Foot, kBlock * kMostFeet> feet_;
};

// The same values to rounding, of lines and points: by vector instructions.
class LineBinder {
 public:
  explicit LineBinder(GffdBinding& binding) : binding_(binding), embedding_(*binding.embedding) {}

  void take(std::uint32_t i) {
    const Vec3& p = binding_.rest[i];
    index_[count_] = i;
    block_.x[count_] = p[0], block_.y[count_] = p[1], block_.z[count_] = p[2];
    if (++count_ == kLanes) finish();
  }

  void pause() {
    if (count_ >= kLanes / 2) finish();
  }

  void finish() {
    if (count_ == 0) return;
    const Embedding& e = embedding_;
    const bool removed = e.moving != e.field;
    e.lines->evaluate(block_, count_, value_);
    if (removed && e.moving) e.movingLines->evaluate(block_, count_, moving_);
    for (std::size_t k = 0; k < count_; ++k) {
      bool inside = value_.value[k] < e.radius;
      double share = 0;
      if (removed) {
        const double near = e.moving ? moving_.value[k] / e.moving->referenceRadius() : kFixed;
        inside = inside && near < 1;
        share = inside ? shareOf(near) : 0;
        binding_.share[index_[k]] = share;
      }
      binding_.level[index_[k]] = inside ? value_.value[k] / e.radius : kFixed;
    }
    count_ = 0;
  }

 private:
  GffdBinding& binding_;
  const Embedding& embedding_;
  std::size_t count_ = 0;
  std::array<std::uint32_t, kLanes> index_;
  Block block_;
  LineValues value_, moving_;
};

bool boundByLines(const Embedding& e) { return e.lines && (e.moving == e.field || !e.moving || e.movingLines); }

// Where the field can reach: all points elsewhere stay.
Box reachOf(const Embedding& e) {
  Box box = e.field->bounds();
  if (e.field->options().distance.kind != field::Distance::Exact || box.isEmpty()) return Box(Vec3::Constant(-kFar), Vec3::Constant(kFar));
  const Vec3 margin = Vec3::Constant(e.radius * (1 + 1e-9)) + 1e-12 * box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs());
  return Box(box.min() - margin, box.max() + margin);
}

// The same values, point by point or block by block.
void bindSingly(GffdBinding& b) {
  const bool removed = !b.share.empty();
  parallelFor(b.rest.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Value v = b.rest[i].allFinite() ? bindOne(*b.embedding, b.rest[i]) : Value{kFixed, 0};
      b.level[i] = v.level;
      if (removed) b.share[i] = v.share;
    }
  });
}

template <class Binder>
void bindByBlocks(GffdBinding& b) {
  std::fill(b.level.begin(), b.level.end(), kFixed);
  const CellFrame& frame = *b.embedding->cells;
  const Box reach = reachOf(*b.embedding);
  CellOrder all = orderByCell(frame, b.rest, [&](std::size_t i) { return reach.contains(b.rest[i]); });
  Progress silent;
  forEachNeighbourhood(frame, all, b.rest, silent, [&](const auto& forEach) {
    Binder binder(b);
    forEach(binder);
    binder.finish();
  });
  b.adopt(std::move(all));
}

}  // namespace

Value bindOne(const Embedding& e, const Vec3& point) {
  const field::FieldValue v = e.field->evaluate(point);
  if (e.moving == e.field) return valueOf(e, v, v);
  return e.moving ? valueOf(e, v, e.moving->evaluate(point)) : Value{kFixed, 0};
}

std::shared_ptr<GffdBinding> bindPoints(std::shared_ptr<const Embedding> embedding, Points rest) {
  constexpr std::size_t kFew = 256;  // not worth an order
  auto b = std::make_shared<GffdBinding>();
  b->rest.assign(rest.begin(), rest.end());
  b->level.resize(rest.size());
  if (embedding->moving != embedding->field) b->share.resize(rest.size());
  b->embedding = std::move(embedding);
  const Embedding& e = *b->embedding;
  if (e.cells && boundByLines(e)) bindByBlocks<LineBinder>(*b);
  else if (e.cells && e.surfaces && rest.size() >= kFew) {
    if (e.moving && e.moving->primitiveCount() <= kMostFeet) b->feet.resize(rest.size() * e.moving->primitiveCount());
    bindByBlocks<BlockBinder>(*b);
  } else bindSingly(*b);
  return b;
}

}  // namespace fielddeform::gffd::detail
