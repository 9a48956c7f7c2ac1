#include <fielddeform/gffd/detail/lines_field.h>
#include <fielddeform/numeric/elementary.h>

#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kRounding = 1 + 1e-9;
constexpr double kSlopeFloor = 0.05;  // as in field::Field

}  // namespace

std::optional<LinesField> LinesField::of(const skeleton::Skeleton& skeleton, const field::FieldOptions& options,
                                         double reference) {
  if (options.distance.kind != field::Distance::Exact || options.extension != field::Extension::Linear) return std::nullopt;
  if (options.potential != skeleton::Potential::Exponential) return std::nullopt;
  LinesField f;
  for (const auto& p : skeleton.primitives) {
    if (!(p.weight > 0)) continue;
    if (p.type == skeleton::PrimitiveType::Mesh || !p.radius || !p.pointRadius.empty()) return std::nullopt;
    if (p.potential.value_or(options.potential) != options.potential) return std::nullopt;
    if (!(*p.radius > 1e-100) || !(*p.radius < 1e100)) return std::nullopt;
    for (const Vec3& x : p.points)
      if (!(x.array().abs() < 1e100).all()) return std::nullopt;  // one by one: a maximum may leave a NaN out
    f.lines_.push_back({{*p.radius, p.weight, p.weight == 1}, LineFinder(p)});
  }
  if (f.lines_.empty()) return std::nullopt;
  f.sharpness_ = options.sharpness;
  f.end_ = numeric::exp(-options.sharpness);
  f.slopeFloor_ = kSlopeFloor * (1 - f.end_) / options.sharpness;
  f.reference_ = reference;
  return f;
}

void LinesField::evaluate(const Block& points, std::size_t count, LineValues& out) const {
  Vec3 centre;
  double radius = 0;
  ballOf(points, count, centre, radius);
  LineHits hits;
  if (lines_.size() == 1 && lines_[0].term.plain) {
    lines_[0].finder.find(lines_[0].finder.nearby(centre, radius), points, count, hits);
    oneLine(hits, lines_[0].term.radius, reference_, out);
    return;
  }
  LineSums sums{};
  for (const Line& line : lines_) {
    const LineFinder::Nearby near = line.finder.nearby(centre, radius);
    if (near.least > line.term.radius * kRounding) continue;  // adds nothing to any of them
    line.finder.find(near, points, count, hits);
    addLine(hits, line.term, sharpness_, end_, sums);
  }
  finishLines(sums, sharpness_, end_, slopeFloor_, reference_, out);
}

}  // namespace fielddeform::gffd::detail
