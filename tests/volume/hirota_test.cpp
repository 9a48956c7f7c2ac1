#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/preserve.h>
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/support/volume_cases.h"
#include "tests/volume/volume_testing.h"

namespace fielddeform::volume {
namespace {

using tests::VolumeCase;

Result solve(const VolumeCase& c, const Options& options = {}) {
  Progress progress;
  return preserve(c.problem, options, progress);
}

TEST(Hirota, Scratch) {
  for (const VolumeCase& c : {tests::torusCompression(4096), tests::torusStretch(4096), tests::clubCompression(4), tests::clubBent(170, 4)}) {
    for (const Solver solver : {Solver::Exact, Solver::AugmentedLagrangian, Solver::Projection})
      for (const Minimiser m : {Minimiser::ConjugateGradients, Minimiser::Lbfgs}) {
        if (solver != Solver::AugmentedLagrangian && m == Minimiser::Lbfgs) continue;
        for (const bool multi : {true, false}) {
          Options o;
          o.solver = solver;
          o.augmentedLagrangian.minimiser = m;
          o.augmentedLagrangian.multiLevel = multi;
          o.exact.twoGrid = multi;
          const Result r = solve(c, o);
          std::printf("%-26s %-20s %d %d E %.6f -> %.6f  dev %.2e opt %.1e it %d evals %d saddles %d proj %.1e est %.1e %s %s\n", c.name.c_str(), std::string(toString(solver)).c_str(), m == Minimiser::Lbfgs, multi,
                      r.report.energyBefore, r.report.energy, r.report.volumes[0].deviation(), r.report.optimality, r.report.iterations, r.report.meshEvaluations, r.report.saddles, r.report.projection, r.report.errorEstimate,
                      std::string(toString(r.report.outcome)).c_str(), r.report.message.c_str());
          for (const auto& l : r.report.levels)
            std::printf("      %6zu tri %4d steps %2d outer %4d ev  dX %.4f E %.5f dev %.1e lambda %.3f mu %.2f  %.2f ms\n", l.triangles, l.steps, l.outer, l.evaluations, l.change, l.energy, l.deviation, l.multiplier, l.penalty, l.seconds * 1e3);
        }
      }
  }
}

}  // namespace
}  // namespace fielddeform::volume
