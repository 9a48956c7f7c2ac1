#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/detail/lanes.h>
#include <fielddeform/volume/detail/mesh_model.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kGrain = 1024;
constexpr std::size_t kDenseEntries = 8u << 20;  // 64 MB

bool isSmall(std::size_t points, std::size_t nodes) { return points * nodes <= kDenseEntries; }

/// Columns x, y, z of values, padded with zeros.
std::vector<double> columns(Points values, std::size_t stride) {
  std::vector<double> out(3 * stride, 0.0);
  for (std::size_t i = 0; i < values.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) out[c * stride + i] = values[i][static_cast<Eigen::Index>(c)];
  return out;
}

}  // namespace

RowMatrix denseBasis(const map::LinearMap& map, const map::Binding& binding) {
  const map::SparseRows rows = map.basis(binding);
  RowMatrix out = RowMatrix::Zero(static_cast<Eigen::Index>(rows.rows()), static_cast<Eigen::Index>(padded(map.nodeCount())));
  parallelFor(rows.rows(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r)
      for (std::size_t k = rows.start[r]; k < rows.start[r + 1]; ++k)
        out(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(rows.column[k])) = rows.value[k];
  });
  return out;
}

MeshModel::MeshModel(const map::LinearMap& map, const Surface& surface, Rims rims)
    : map_(&map),
      binding_(surface.binding),
      nodes_(map.nodeCount()),
      base_(surface.base),
      volume_(surface.base, surface.triangles, surface.region, rims) {
  if (isSmall(base_.size(), nodes_)) basis_ = denseBasis(map, *binding_);
}

MeshModel::MeshModel(RowMatrix basis, std::vector<Vec3> base, std::vector<Index> triangles, std::vector<Index> region, Rims rims)
    : nodes_(static_cast<std::size_t>(basis.cols())), base_(std::move(base)), volume_(base_, std::move(triangles), std::move(region), rims) {
  const auto width = static_cast<Eigen::Index>(padded(nodes_));
  if (basis.cols() != width) {
    RowMatrix wide = RowMatrix::Zero(basis.rows(), width);
    wide.leftCols(basis.cols()) = basis;
    basis = std::move(wide);
  }
  basis_ = std::move(basis);
}

const WedgePlan& MeshModel::plan(std::size_t region) const {
  std::call_once(plans_->once, [&] {
    std::vector<Index> place(base_.size(), kNoIndex), local;
    for (std::size_t r = 0; r < volume_.regionCount(); ++r) {
      const auto own = volume_.vertices(r);
      for (std::size_t k = 0; k < own.size(); ++k) place[own[k]] = static_cast<Index>(k);
      local.clear();
      for (const Index v : volume_.triangles(r)) local.push_back(place[v]);
      plans_->regions.emplace_back(own.size(), local);
    }
  });
  return plans_->regions[region];
}

void MeshModel::positions(Points d, std::vector<Vec3>& x) const {
  x.resize(base_.size());
  if (basis_) return combineRows(d, base_.data(), x);
  map_->combine(*binding_, d, x);
  parallelFor(x.size(), kGrain * 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) x[v] = base_[v] + x[v];
  });
}

void MeshModel::combine(Points p, std::vector<Vec3>& out) const {
  out.resize(base_.size());
  if (!basis_) return map_->combine(*binding_, p, out);
  combineRows(p, nullptr, out);
}

void MeshModel::combineRows(Points p, const Vec3* base, std::vector<Vec3>& out) const {
  const auto stride = static_cast<std::size_t>(basis_->cols());
  const std::vector<double> column = columns(p, stride);
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    dot3Rows(basis_->data() + begin * stride, stride, end - begin, column.data(), base ? base + begin : nullptr, out.data() + begin);
  });
}

void MeshModel::gatherRows(std::size_t count, const Index* vertex, Points g, std::span<Vec3> out) const {
  const auto stride = static_cast<std::size_t>(basis_->cols());
  const std::vector<double> sum = deterministicReduce(
      count, kGrain, std::vector<double>(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<double> part(3 * stride, 0.0);
        const double* rows = vertex ? basis_->data() : basis_->data() + begin * stride;
        addRows(rows, stride, vertex ? vertex + begin : nullptr, end - begin, g.data() + begin, part.data());
        return part;
      },
      [](const std::vector<double>& a, const std::vector<double>& b) {
        if (a.empty()) return b;
        std::vector<double> c(a);
        for (std::size_t i = 0; i < c.size(); ++i) c[i] += b[i];
        return c;
      });
  for (std::size_t i = 0; i < nodes_; ++i)
    out[i] = sum.empty() ? Vec3(Vec3::Zero()) : Vec3(sum[i], sum[stride + i], sum[2 * stride + i]);
}

void MeshModel::gather(Points g, std::span<Vec3> out) const {
  if (!basis_) return map_->gather(*binding_, g, out);
  gatherRows(g.size(), nullptr, g, out);
}

void MeshModel::gatherRegion(Points g, std::size_t region, std::span<Vec3> out) const {
  const auto own = volume_.vertices(region);
  if (basis_) return gatherRows(own.size(), own.size() == base_.size() ? nullptr : own.data(), g, out);
  if (own.size() == base_.size()) return map_->gather(*binding_, g, out);
  std::vector<Vec3> all(base_.size(), Vec3::Zero());
  for (std::size_t k = 0; k < own.size(); ++k) all[own[k]] = g[k];
  map_->gather(*binding_, all, out);
}

namespace {

constexpr int kFinestGrid = 256;

/// Cells of a grid of n along the longest side: for each used vertex its cluster, in the order of the cells.
std::vector<Index> clusterOf(Points x, const std::vector<bool>& used, const Box& box, int n, std::size_t& count) {
  const double cell = std::max(box.sizes().maxCoeff() / n, 1e-300);
  std::array<std::size_t, 3> size;
  for (int c = 0; c < 3; ++c) size[static_cast<std::size_t>(c)] = std::min<std::size_t>(static_cast<std::size_t>(box.sizes()[c] / cell) + 1, static_cast<std::size_t>(n));
  std::vector<Index> of(size[0] * size[1] * size[2], kNoIndex), out(x.size(), kNoIndex);
  for (std::size_t v = 0; v < x.size(); ++v) {
    if (!used[v]) continue;
    std::size_t key = 0;
    for (int c = 0; c < 3; ++c) {
      const std::size_t most = size[static_cast<std::size_t>(c)] - 1;
      key = key * (most + 1) + static_cast<std::size_t>(std::clamp((x[v][c] - box.min()[c]) / cell, 0.0, static_cast<double>(most)));
    }
    of[key] = 0;
    out[v] = static_cast<Index>(key);
  }
  count = 0;
  for (Index& k : of)
    if (k != kNoIndex) k = static_cast<Index>(count++);
  for (Index& k : out)
    if (k != kNoIndex) k = of[k];
  return out;
}

/// The coarsest of a few grids with at least so many clusters; their number grows with the square of the grid's.
std::vector<Index> enoughClusters(Points x, const std::vector<bool>& used, std::size_t vertices, std::size_t& count) {
  Box box;
  for (std::size_t v = 0; v < x.size(); ++v)
    if (used[v]) box.extend(x[v]);
  for (int n = 8;;) {
    std::vector<Index> out = clusterOf(x, used, box, n, count);
    if (count >= vertices || n == kFinestGrid) return out;
    const double guess = 0.9 * n * std::sqrt(static_cast<double>(vertices) / static_cast<double>(std::max<std::size_t>(count, 1)));
    n = std::min(kFinestGrid, std::max(n + n / 4, static_cast<int>(std::min(guess, 256.0))));
  }
}

/// The vertex of each cluster that is nearest to the cluster's mean.
std::vector<Index> representatives(Points x, const std::vector<Index>& cluster, std::size_t count) {
  std::vector<Vec3> mean(count, Vec3::Zero());
  std::vector<double> weight(count, 0), best(count, std::numeric_limits<double>::infinity());
  std::vector<Index> out(count, kNoIndex);
  for (std::size_t v = 0; v < x.size(); ++v)
    if (cluster[v] != kNoIndex) mean[cluster[v]] += x[v], weight[cluster[v]] += 1;
  for (std::size_t k = 0; k < count; ++k) mean[k] /= weight[k];
  for (std::size_t v = 0; v < x.size(); ++v) {
    if (cluster[v] == kNoIndex) continue;
    const double distance = (x[v] - mean[cluster[v]]).squaredNorm();
    if (distance < best[cluster[v]]) best[cluster[v]] = distance, out[cluster[v]] = static_cast<Index>(v);
  }
  return out;
}

/// Rows of the basis at some vertices.
RowMatrix rowsAt(const map::LinearMap& map, const Surface& surface, const MeshModel& fine, const std::vector<Index>& vertex) {
  const auto count = static_cast<Eigen::Index>(vertex.size());
  RowMatrix out = RowMatrix::Zero(count, static_cast<Eigen::Index>(fine.nodes()));
  if (fine.basis()) {
    for (Eigen::Index r = 0; r < count; ++r) out.row(r) = fine.basis()->row(static_cast<Eigen::Index>(vertex[static_cast<std::size_t>(r)])).head(out.cols());
    return out;
  }
  const map::SparseRows rows = map.basisAt(*surface.binding, vertex);
  for (std::size_t r = 0; r < rows.rows(); ++r)
    for (std::size_t k = rows.start[r]; k < rows.start[r + 1]; ++k)
      out(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(rows.column[k])) = rows.value[k];
  return out;
}

}  // namespace

MeshModel clustered(const map::LinearMap& map, const Surface& surface, const MeshModel& fine, std::size_t vertices, Rims rims) {
  std::vector<bool> used(surface.base.size(), false);
  for (const Index v : surface.triangles) used[v] = true;
  std::size_t count = 0;
  const std::vector<Index> cluster = enoughClusters(surface.base, used, vertices, count);
  const std::vector<Index> vertex = representatives(surface.base, cluster, count);
  std::vector<Index> triangles, region;
  for (std::size_t t = 0; t < surface.triangles.size() / 3; ++t) {
    const Index r = surface.region.empty() ? 0 : surface.region[t];
    const Index a = cluster[surface.triangles[3 * t]], b = cluster[surface.triangles[3 * t + 1]], c = cluster[surface.triangles[3 * t + 2]];
    if (r == kNoIndex || a == b || b == c || c == a) continue;
    triangles.insert(triangles.end(), {a, b, c});
    region.push_back(r);
  }
  // A region may vanish; one triangle twice, once turned, keeps it as one of volume 0.
  const std::size_t regions = fine.volume().regionCount();
  std::vector<bool> present(regions, false);
  for (const Index r : region) present[r] = true;
  for (std::size_t r = 0; r < regions && count >= 3; ++r)
    if (!present[r]) triangles.insert(triangles.end(), {0, 1, 2, 0, 2, 1}), region.insert(region.end(), 2, static_cast<Index>(r));
  std::vector<Vec3> base;
  for (const Index v : vertex) base.push_back(surface.base[v]);
  return MeshModel(rowsAt(map, surface, fine, vertex), std::move(base), std::move(triangles), std::move(region), rims);
}

}  // namespace fielddeform::volume::detail
