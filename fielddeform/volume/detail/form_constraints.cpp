#include <fielddeform/volume/detail/constraints.h>

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

/// Rows of some vertices, the region's triangles renumbered.
struct Part {
  RowMatrix basis;
  std::vector<Index> triangles;
};
Part partOf(const MeshModel& model, std::size_t region, bool extra) {
  const auto own = model.volume().vertices(region);
  const auto n = static_cast<Eigen::Index>(model.nodes());
  const Vec3& centre = model.volume().centre(region);
  Part part{RowMatrix(static_cast<Eigen::Index>(own.size()), n + (extra ? 3 : 0)), {}};
  std::vector<Index> place(model.base().size(), kNoIndex);
  for (std::size_t k = 0; k < own.size(); ++k) {
    const auto r = static_cast<Eigen::Index>(k);
    part.basis.row(r).head(n) = model.basis()->row(own[k]).head(n);
    if (extra) part.basis.row(r).tail<3>() = (model.base()[own[k]] - centre).transpose();
    place[own[k]] = static_cast<Index>(k);
  }
  for (const Index v : model.volume().triangles(region)) part.triangles.push_back(place[v]);
  return part;
}

}  // namespace

FormConstraints::FormConstraints(std::vector<Form> forms, std::vector<VolumeTarget> volumes, std::size_t nodes)
    : forms_(std::move(forms)), volumes_(std::move(volumes)), nodes_(nodes) {}

FormConstraints FormConstraints::ofMesh(const MeshModel& model, Points restNodes, std::vector<VolumeTarget> volumes) {
  // Fewer nodes than three make no form of their own.
  const bool extra = model.nodes() < 3 || !reproduces(model, restNodes);
  std::vector<Form> forms;
  for (const VolumeTarget& v : volumes) {
    const Part part = partOf(model, v.region, extra);
    std::vector<Vec3> rest(restNodes.begin(), restNodes.end());
    for (Vec3& p : rest) p = extra ? Vec3(Vec3::Zero()) : Vec3(p - model.volume().centre(v.region));
    if (extra)
      for (int c = 0; c < 3; ++c) rest.push_back(Vec3::Unit(c));
    forms.push_back({CubicForm::ofMesh(part.basis, part.triangles), std::move(rest)});
  }
  return FormConstraints(std::move(forms), std::move(volumes), model.nodes());
}

const std::vector<Vec3>& FormConstraints::at(Points d, std::size_t k) {
  x_ = forms_[k].rest;
  for (std::size_t i = 0; i < d.size(); ++i) x_[i] += d[i];
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
  jacobian.resize(static_cast<Eigen::Index>(3 * nodes_), count());
  for (std::size_t k = 0; k < forms_.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    g_.resize(forms_[k].form.nodes());
    c[column] = (forms_[k].form.gradient(at(d, k), g_) - volumes_[k].target) / volumes_[k].scale;
    for (std::size_t i = 0; i < nodes_; ++i) jacobian.col(column).segment<3>(3 * static_cast<Eigen::Index>(i)) = g_[i] / volumes_[k].scale;
  }
}

void FormConstraints::addHessian(Points d, const Vector& multiplier, std::span<const Index> rows, Matrix& h) {
  for (std::size_t k = 0; k < forms_.size(); ++k) {
    std::vector<Index> all(rows.begin(), rows.end());
    all.resize(forms_[k].form.nodes(), kNoIndex);
    forms_[k].form.addHessian(at(d, k), multiplier[static_cast<Eigen::Index>(k)] / volumes_[k].scale, all, h);
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
