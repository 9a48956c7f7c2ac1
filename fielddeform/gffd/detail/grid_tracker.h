#pragma once

#include <fielddeform/gffd/detail/binding.h>
#include <fielddeform/gffd/evaluation.h>

namespace fielddeform::gffd::detail {

/// Predicts from the stage's grid, corrects block by block. The stage has a grid; outputs as GffdMap::apply.
/// Vertices in cells that the grid does not serve and those within a falloff are predicted by Stage::displacementsAt;
/// corrections that a Newton step does not settle take the stage's exact path, vertex by vertex.
/// Movable vertices only: the others are left as they are.
EvaluationCounts trackByGrid(const Stage& stage, const GffdBinding& binding, map::MapOutput out, Progress& progress);

}  // namespace fielddeform::gffd::detail
