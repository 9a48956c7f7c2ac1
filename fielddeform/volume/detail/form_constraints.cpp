#include <fielddeform/volume/detail/constraints.h>
#include <fielddeform/volume/detail/lanes.h>

#include <numeric>

namespace fielddeform::volume::detail {
namespace {

/// Whether the surface's base is the combination of the rest nodes by a partition of unity (to rounding): then the nodes alone
/// make the form.
bool reproduces(const MeshModel& model, Points restNodes) {
  const RowMatrix& basis = *model.basis();
  Box box;
  for (const Vec3& p : model.base()) box.extend(p);
  const double bound = 1e-13 * (box.isEmpty() ? 0 : box.sizes().norm());
  for (Eigen::Index v = 0; v < basis.rows(); ++v) {
    const Vec3& wanted = model.base()[static_cast<std::size_t>(v)];
    Vec3 sum = Vec3::Zero();
    double unity = 0;
    for (std::size_t i = 0; i < model.nodes(); ++i) {
      const double phi = basis(v, static_cast<Eigen::Index>(i));
      sum += phi * (restNodes[i] - wanted);
      unity += phi;
    }
    if (!(std::abs(unity - 1) <= 1e-13) || !(sum.norm() <= 10 * bound)) return false;
  }
  return true;
}

/// Rows of a region's vertices: some nodes' columns, then (where there is a base) its three coordinates about the centre, padded.
RowMatrix rowsOf(const MeshModel& model, std::size_t region, std::span<const Index> nodes, Points base) {
  const auto own = model.volume().vertices(region);
  const Vec3& centre = model.volume().centre(region);
  const RowMatrix& basis = *model.basis();
  const std::size_t n = nodes.size(), width = n + (base.empty() ? 0 : 3), wide = padded(width);
  RowMatrix rows(static_cast<Eigen::Index>(own.size()), static_cast<Eigen::Index>(wide));
  const auto stride = static_cast<std::size_t>(basis.cols());
  for (std::size_t k = 0; k < own.size(); ++k) {
    const double* from = basis.data() + own[k] * stride;
    double* to = rows.data() + k * wide;
    for (std::size_t i = 0; i < n; ++i) to[i] = from[nodes[i]];
    for (std::size_t c = 0; c < width - n; ++c) to[n + c] = base[own[k]][static_cast<Eigen::Index>(c)] - centre[static_cast<Eigen::Index>(c)];
    for (std::size_t i = width; i < wide; ++i) to[i] = 0;
  }
  return rows;
}

/// @param rest  of `nodes`, about the origin of the base, or about the region's centre if there is none
FormConstraints::Form formOf(const MeshModel& model, std::size_t region, std::span<const Index> nodes, Points base, std::vector<Vec3> rest) {
  const RowMatrix rows = rowsOf(model, region, nodes, base);
  std::vector<Index> node(nodes.begin(), nodes.end());
  for (int c = 0; c < 3 && !base.empty(); ++c) rest.push_back(Vec3::Unit(c)), node.push_back(kNoIndex);
  return {CubicForm::ofPlan(model.plan(region), rows.data(), node.size()), std::move(rest), std::move(node)};
}

}  // namespace

FormConstraints::FormConstraints(std::vector<Form> forms, std::vector<VolumeTarget> volumes, std::size_t nodes)
    : forms_(std::move(forms)), volumes_(std::move(volumes)), nodes_(nodes) {}

FormConstraints FormConstraints::ofMesh(const MeshModel& model, Points restNodes, std::vector<VolumeTarget> volumes) {
  // Fewer nodes than three make no form of their own.
  const bool extra = model.nodes() < 3 || !reproduces(model, restNodes);
  std::vector<Index> all(model.nodes());
  std::iota(all.begin(), all.end(), Index{0});
  std::vector<Form> forms;
  for (const VolumeTarget& v : volumes) {
    std::vector<Vec3> rest(restNodes.begin(), restNodes.end());
    for (Vec3& p : rest) p = extra ? Vec3(Vec3::Zero()) : Vec3(p - model.volume().centre(v.region));
    forms.push_back(formOf(model, v.region, all, extra ? Points(model.base()) : Points(), std::move(rest)));
  }
  return FormConstraints(std::move(forms), std::move(volumes), model.nodes());
}

FormConstraints FormConstraints::ofFree(const MeshModel& model, Points positions, Points start, std::span<const Index> free, std::vector<VolumeTarget> volumes) {
  std::vector<Vec3> rest;
  for (const Index i : free) rest.push_back(-start[i]);  // the surface at the start holds these already
  std::vector<Form> forms;
  for (const VolumeTarget& v : volumes) forms.push_back(formOf(model, v.region, free, positions, rest));
  return FormConstraints(std::move(forms), std::move(volumes), model.nodes());
}

const std::vector<Vec3>& FormConstraints::at(Points d, std::size_t k) {
  x_ = forms_[k].rest;
  for (std::size_t i = 0; i < x_.size(); ++i)
    if (forms_[k].node[i] != kNoIndex) x_[i] += d[forms_[k].node[i]];
  return x_;
}

void FormConstraints::values(Points d, Vector& c) {
  ++evaluations;
  c.resize(count());
  for (std::size_t k = 0; k < forms_.size(); ++k)
    c[static_cast<Eigen::Index>(k)] = (forms_[k].form.value(at(d, k)) - volumes_[k].target) / volumes_[k].scale;
}

void FormConstraints::derivatives(Points d, Vector& c, Matrix& jacobian) {
  ++evaluations;
  c.resize(count());
  jacobian.setZero(static_cast<Eigen::Index>(3 * nodes_), count());
  for (std::size_t k = 0; k < forms_.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    g_.resize(forms_[k].form.nodes());
    c[column] = (forms_[k].form.gradient(at(d, k), g_) - volumes_[k].target) / volumes_[k].scale;
    for (std::size_t i = 0; i < g_.size(); ++i)
      if (const Index node = forms_[k].node[i]; node != kNoIndex)
        jacobian.col(column).segment<3>(3 * static_cast<Eigen::Index>(node)) = g_[i] / volumes_[k].scale;
  }
}

void FormConstraints::addHessian(Points d, const Vector& multiplier, std::span<const Index> rows, Matrix& h) {
  for (std::size_t k = 0; k < forms_.size(); ++k) {
    rows_.clear();
    for (const Index node : forms_[k].node) rows_.push_back(node == kNoIndex ? kNoIndex : rows[node]);
    forms_[k].form.addHessian(at(d, k), multiplier[static_cast<Eigen::Index>(k)] / volumes_[k].scale, rows_, h);
  }
}

void FormConstraints::linearize(Points d, const Vector& multiplier) {
  const auto size = static_cast<Eigen::Index>(3 * nodes_);
  hessian_.setZero(size, size);
  std::vector<Index> rows(nodes_);
  for (std::size_t i = 0; i < nodes_; ++i) rows[i] = static_cast<Index>(i);
  addHessian(d, multiplier, rows, hessian_);
}

void FormConstraints::hessianTimes(Points p, std::span<Vec3> out) {
  const Eigen::Map<const Vector> from(p[0].data(), static_cast<Eigen::Index>(3 * nodes_));
  Eigen::Map<Vector>(out[0].data(), static_cast<Eigen::Index>(3 * nodes_)) = hessian_ * from;
}

}  // namespace fielddeform::volume::detail
