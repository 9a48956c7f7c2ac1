#include <fielddeform/field/detail/cover.h>

#include <limits>

namespace fielddeform::field::detail {

Lattice latticeOf(const Field& field, double voxel) { return {field.bounds().center(), voxel}; }

std::vector<Cell> coverField(const Field& field, const Lattice& lattice, double reach, double border, const BlockBudget& budget) {
  double widest = 0;
  for (std::size_t i = 0; i < field.primitiveCount(); ++i)
    if (field.weight(i) > 0) widest = std::max(widest, field.radius(i));
  const double more = border * lattice.voxel;
  Box box = field.bounds();
  box.min().array() -= reach * widest + more;
  box.max().array() += reach * widest + more;
  return coverBlocks(lattice, box, budget, [&](const Vec3& centre, double radius) {
    for (std::size_t i = 0; i < field.primitiveCount(); ++i) {
      if (!(field.weight(i) > 0)) continue;
      const PrimitiveHit hit = field.closest(i, centre);
      if (hit.element != kNoIndex && hit.distance <= reach * field.radius(i) + more + radius) return true;
    }
    return false;
  });
}

}  // namespace fielddeform::field::detail
