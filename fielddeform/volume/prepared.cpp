#include <Eigen/QR>
#include <fielddeform/core/error.h>
#include <fielddeform/volume/detail/prepared.h>
#include <fmt/format.h>

#include <cmath>

namespace fielddeform::volume {
namespace {

double largestExtent(Points base, const std::vector<Index>& triangles) {
  Box box;
  for (const Index v : triangles) box.extend(base[v]);
  return box.isEmpty() ? 0 : box.sizes().maxCoeff();
}

/// Mean diagonal entry of the energy's Hessian at rest over the free nodes, times size^2, as a power of two.
double energyUnitOf(const Energy& energy, const std::vector<Index>& free, double size) {
  const SparseMatrix h = energy.hessian(std::vector<Vec3>(energy.nodeCount(), Vec3::Zero()));
  double sum = 0;
  for (const Index i : free)
    for (int c = 0; c < 3; ++c) sum += std::abs(h.coeff(3 * static_cast<Eigen::Index>(i) + c, 3 * static_cast<Eigen::Index>(i) + c));
  const double mean = free.empty() ? 0 : sum / (3.0 * static_cast<double>(free.size()));
  return mean > 0 ? std::ldexp(1.0, std::ilogb(mean)) * size * size : size * size;
}

}  // namespace

Prepared::Impl::Impl(Problem p) : problem(std::move(p)) {
  problem.validate();
  for (const Surface& s : problem.coarser) levels.emplace_back(*problem.map, s, problem.rims);
  levels.emplace_back(*problem.map, problem.surface, problem.rims);
  for (const auto& level : levels) {
    baseVolume.push_back(level.volume().values(level.base()));
    if (level.volume().regionCount() != fine().volume().regionCount())
      throw std::invalid_argument("coarser: a level has other regions than the surface");
  }
  if (problem.rims == Rims::Refuse)
    for (std::size_t r = 0; r < baseVolume.back().size(); ++r)
      if (!(baseVolume.back()[r] > 0))
        throw InfeasibleError(fmt::format("the volume of {} is {:.6g}, not positive: its faces are turned inwards, or it is flat",
                                          baseVolume.back().size() > 1 ? fmt::format("region {}", r) : "the mesh", baseVolume.back()[r]));
  extent = largestExtent(problem.surface.base, problem.surface.triangles);
  if (!(extent > 0)) throw InfeasibleError("the surface is a single point: it has no volume");
  size = std::ldexp(1.0, std::ilogb(extent));

  const std::size_t n = problem.map->nodeCount();
  rowOf.assign(n, 0);
  for (const Index i : problem.constraints.pinned) rowOf[i] = kNoIndex;
  for (std::size_t i = 0; i < n; ++i)
    if (rowOf[i] != kNoIndex) rowOf[i] = static_cast<Index>(free.size()), free.push_back(static_cast<Index>(i));
  energyUnit = energyUnitOf(*problem.energy, free, size);
  if (fine().basis() && std::min(n, free.size() + 3) <= detail::kFormNodes)
    for (std::size_t r = 0; r < fine().volume().regionCount(); ++r) fine().plan(r);

  if (!problem.constraints.points || problem.constraints.points->position.empty()) return;
  const auto rows = map::SparseRows(problem.map->basis(*problem.constraints.points->binding));
  const auto count = static_cast<Eigen::Index>(rows.rows()), width = static_cast<Eigen::Index>(free.size());
  pinnedWeights.assign(rows.rows() * n, 0.0);
  pointRows.setZero(count, width);
  for (std::size_t q = 0; q < rows.rows(); ++q)
    for (std::size_t k = rows.start[q]; k < rows.start[q + 1]; ++k) {
      pinnedWeights[q * n + rows.column[k]] = rows.value[k];
      if (rowOf[rows.column[k]] != kNoIndex) pointRows(static_cast<Eigen::Index>(q), static_cast<Eigen::Index>(rowOf[rows.column[k]])) = rows.value[k];
    }
  if (width == 0) return;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(pointRows.transpose());
  qr.setThreshold(1e-10);
  const Eigen::Index rank = qr.rank();
  pointBasis = (qr.householderQ() * Eigen::MatrixXd::Identity(width, rank)).transpose();
  // rows^T P = Q R, so Q^T x = R1^-T (P^T value)_1.
  Eigen::MatrixXd chosen = Eigen::MatrixXd::Zero(rank, count);
  for (Eigen::Index k = 0; k < rank; ++k) chosen(k, qr.colsPermutation().indices()[k]) = 1;
  pointValue = qr.matrixR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>().transpose().solve(chosen);
}

detail::Core Prepared::Impl::core(Points start, double load) const {
  detail::Core core;
  core.problem = &problem;
  core.free = free, core.rowOf = rowOf;
  core.start.assign(start.begin(), start.end());
  core.size = size, core.energyUnit = energyUnit, core.extent = extent;
  if (pointRows.rows() == 0) return core;
  const PointTargets& points = *problem.constraints.points;
  const std::size_t n = rowOf.size();
  Eigen::MatrixXd value(pointRows.rows(), 3);
  for (std::size_t q = 0; q < points.position.size(); ++q) {
    Vec3 move = load * (points.position[q] - points.base[q]);
    for (std::size_t i = 0; i < n; ++i)
      if (rowOf[i] == kNoIndex) move -= pinnedWeights[q * n + i] * start[i];
    value.row(static_cast<Eigen::Index>(q)) = move.transpose() / size;
  }
  core.linear.rows = pointBasis;
  core.linear.value = pointBasis.rows() ? Eigen::MatrixXd(pointValue * value) : Eigen::MatrixXd(0, 3);
  const Eigen::MatrixXd reached = pointBasis.rows() ? Eigen::MatrixXd(pointRows * pointBasis.transpose() * core.linear.value) : Eigen::MatrixXd(Eigen::MatrixXd::Zero(value.rows(), 3));
  const double gap = (reached - value).cwiseAbs().maxCoeff();
  if (!(gap <= 1e-9 * std::max(1.0, value.cwiseAbs().maxCoeff())))
    throw InfeasibleError(fmt::format("the {} point targets contradict each other over {} free nodes (off by {:.3g} of the size): refine the "
                                      "lattice or free more nodes", points.position.size(), free.size(), gap * size / extent));
  return core;
}

double Prepared::Impl::wantedVolume(std::size_t region, std::span<const double> wanted) const {
  const auto& given = wanted.empty() ? std::span<const double>(problem.constraints.volume) : wanted;
  return given.empty() ? baseVolume.back()[region] : given[region];
}

std::vector<detail::VolumeTarget> Prepared::Impl::targets(std::size_t level, std::span<const double> wanted, double load) const {
  std::vector<detail::VolumeTarget> out;
  for (std::size_t r = 0; r < baseVolume.back().size(); ++r) {
    const double fineBase = baseVolume.back()[r], want = wantedVolume(r, wanted);
    if (std::isnan(want)) continue;
    const bool open = problem.rims == Rims::Fixed;
    if (!std::isfinite(want) || (!open && !(want > 0)))
      throw InfeasibleError(fmt::format("the target volume of region {} is {:.6g}, expected a positive number", r, want));
    const double reached = fineBase + load * (want - fineBase);
    const double base = baseVolume[level][r];
    // A coarser mesh keeps the same share of its own volume; of an open one only changes mean anything.
    const double target = level + 1 == levels.size() ? reached : open ? base + (reached - fineBase) : base * (reached / fineBase);
    const double least = 1e-6 * extent * extent * extent;
    out.push_back({r, target, open ? std::max(std::abs(target), least) : std::max(std::abs(target), 1e-300)});
  }
  return out;
}

Prepared::Prepared(Problem problem) : impl_(std::make_shared<const Impl>(std::move(problem))) {}
const Problem& Prepared::problem() const noexcept { return impl_->problem; }

}  // namespace fielddeform::volume
