#pragma once

#include <fielddeform/skeleton/edit.h>
#include <fielddeform/skeleton/principal_axes.h>

namespace fielddeform::skeleton::detail {

// The primitives an edit names; all for an empty name.
// @throw std::invalid_argument if there is none
std::vector<Index> targetsOf(const Skeleton& rest, const Edit& edit);

// An edit whose optional values are all there, and the world extent of its range.
struct Prepared {
  Edit edit;
  double begin = 0, end = 0;  // from the pivot along the axis, world
};

Prepared prepare(const Skeleton& rest, const Edit& edit);

}  // namespace fielddeform::skeleton::detail
