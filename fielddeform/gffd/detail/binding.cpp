#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/binding.h>
#include <fielddeform/gffd/detail/neighbourhoods.h>

#include <algorithm>
#include <array>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kFixed = std::numeric_limits<double>::quiet_NaN();

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

void bindByBlocks(GffdBinding& b) {
  std::fill(b.level.begin(), b.level.end(), kFixed);
  if (b.embedding->moving && b.embedding->moving->primitiveCount() <= kMostFeet)
    b.feet.resize(b.rest.size() * b.embedding->moving->primitiveCount());
  const CellFrame& frame = *b.embedding->cells;
  CellOrder all = orderByCell(frame, b.rest, [&](std::size_t i) { return b.rest[i].allFinite(); });
  Progress silent;
  forEachNeighbourhood(frame, all, b.rest, silent, [&](const auto& forEach) {
    BlockBinder binder(b);
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
  // Triangles are worth the order; the nearest point of a line is soon found singly.
  if (b->embedding->surfaces && b->embedding->cells && rest.size() >= kFew) bindByBlocks(*b);
  else bindSingly(*b);
  return b;
}

}  // namespace fielddeform::gffd::detail
