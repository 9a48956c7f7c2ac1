#include <fielddeform/map/space_map.h>

#include <vector>

namespace fielddeform::map {

std::shared_ptr<const Binding> SpaceMap::bindAgain(const Binding*, Points rest) const { return bind(rest); }

std::shared_ptr<const Binding> SpaceMap::bindMidpoints(const Binding&, Points rest,
                                                       std::span<const std::array<Index, 2>> ends) const {
  std::vector<Vec3> middle(ends.size());
  for (std::size_t i = 0; i < ends.size(); ++i) middle[i] = 0.5 * (rest[ends[i][0]] + rest[ends[i][1]]);
  return bind(middle);
}

}  // namespace fielddeform::map
