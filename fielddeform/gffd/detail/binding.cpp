#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/binding.h>

#include <algorithm>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kFixed = std::numeric_limits<double>::quiet_NaN();

double shareOf(double level) { return std::clamp(1 - level, 0.0, 1.0); }

}  // namespace

std::shared_ptr<const Embedding> makeEmbedding(const skeleton::SkeletonPair& pair, const field::FieldOptions& options,
                                               Points around) {
  auto e = std::make_shared<Embedding>();
  e->field = std::make_shared<const field::Field>(pair.rest, options, around);
  e->radius = e->field->referenceRadius();
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

Value bindOne(const Embedding& e, const Vec3& point) {
  const field::FieldValue v = e.field->evaluate(point);
  if (e.moving == e.field) return {v.inside ? v.pseudoDistance / e.radius : kFixed, v.inside ? shareOf(v.pseudoDistance / e.radius) : 0};
  if (!e.moving) return {kFixed, 0};
  // What only a removed primitive influenced has nothing left to follow.
  const field::FieldValue m = e.moving->evaluate(point);
  if (!v.inside || !m.inside) return {kFixed, 0};
  return {v.pseudoDistance / e.radius, shareOf(m.pseudoDistance / e.moving->referenceRadius())};
}

std::shared_ptr<GffdBinding> bindPoints(std::shared_ptr<const Embedding> embedding, Points rest) {
  auto b = std::make_shared<GffdBinding>();
  b->rest.assign(rest.begin(), rest.end());
  b->level.resize(rest.size());
  const bool removed = embedding->moving != embedding->field;
  if (removed) b->share.resize(rest.size());
  parallelFor(rest.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Value v = rest[i].allFinite() ? bindOne(*embedding, rest[i]) : Value{kFixed, 0};
      b->level[i] = v.level;
      if (removed) b->share[i] = v.share;
    }
  });
  b->embedding = std::move(embedding);
  return b;
}

}  // namespace fielddeform::gffd::detail
