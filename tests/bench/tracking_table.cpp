// Prints the closed-form cases by every tracker: converged share, flipped faces or folds, mean distance to the ideal,
// greatest edge stretch. Usage: tracking_table [CASE...]
#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>
#include <fmt/format.h>
#include <tests/support/cases.h>

#include <chrono>
#include <cstdio>

using namespace fielddeform;

namespace {

struct Row {
  const char* name;
  gffd::Options options;
};

std::vector<Row> rows() {
  using gffd::Predictor;
  return {{"gradient", {.predictor = Predictor::Gradient}},
          {"warp", {.predictor = Predictor::Warp}},
          {"axial", {.predictor = Predictor::Axial, .guard = false}},
          {"mls", {.predictor = Predictor::Mls, .guard = false}},
          {"auto", {.predictor = Predictor::Auto}}};
}

// Faces turned against the ideal map's own.
std::size_t flippedAgainst(const mesh::Mesh& mesh, Points ideal, Points posed) {
  std::size_t count = 0;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f)
    mesh.forEachTriangle(f, [&](Index a, Index b, Index c) {
      const Vec3 n = (posed[b] - posed[a]).cross(posed[c] - posed[a]), m = (ideal[b] - ideal[a]).cross(ideal[c] - ideal[a]);
      count += n.dot(m) < 0;
    });
  return count;
}

void print(const tests::Case& c, const Row& row) {
  const auto start = std::chrono::steady_clock::now();
  const auto pair = skeleton::pairSkeletons(c.rest, c.posed);
  const gffd::ResolvedOptions resolved = gffd::resolve(row.options, c.mesh, pair);
  const gffd::GffdMap map(resolved);
  const auto binding = map.bind(c.mesh.positions());
  Progress silent;
  const gffd::Deformed d = gffd::deform(c.mesh, map, *binding, silent);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const StatusCounts n = countStatuses(d.status);
  double mean = 0, worst = 0;
  for (std::size_t i = 0; i < c.ideal.size(); ++i) {
    const double e = (d.position[i] - c.ideal[i]).norm();
    mean += e / static_cast<double>(c.ideal.size());
    worst = std::max(worst, e);
  }
  const mesh::StretchReport stretch = mesh::edgeStretch(mesh::EdgeTable(c.mesh), c.mesh.positions(), d.position);
  std::size_t within = 0, inside = 0;  // the prototype counts what a 1e-4 of a unit residual leaves
  for (std::size_t i = 0; i < n.size(); ++i) inside += n[i];
  for (const float r : d.residual) within += r <= 1e-4f;
  fmt::print("{:12} {:9} {:6.2f} % conv ({:6.2f}) fixed {} lim {} | flips {:5} folds {:4} | mean {:.4g} max {:.3g} | stretch {:.3g} | {:.2f} s {} {}\n",
             c.name, row.name, 100.0 * static_cast<double>(n[1]) / static_cast<double>(inside),
             100.0 * static_cast<double>(within) / static_cast<double>(d.residual.size()), n[0], n[2],
             c.ideal.empty() ? 0 : flippedAgainst(c.mesh, c.ideal, d.position), d.folds, mean, worst, stretch.max, seconds,
             gffd::toString(d.map.resolved().options.predictor), d.retry);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> names(argv + 1, argv + argc);
  if (names.empty()) names = tests::caseNames();
  for (const std::string& name : names) {
    const tests::Case c = tests::makeCase(name);
    for (const Row& row : rows()) print(c, row);
  }
}
