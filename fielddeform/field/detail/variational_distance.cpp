#include <fielddeform/field/detail/distance_source.h>

#include <stdexcept>

namespace fielddeform::field::detail {
std::unique_ptr<DistanceSource> makeVariationalDistance(const PrimitiveDistance&, const skeleton::Primitive&,
                                                        const VariationalOptions&, DistanceReport&) {
  throw std::runtime_error("not yet");
}
}  // namespace fielddeform::field::detail
