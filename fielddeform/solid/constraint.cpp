#include <Eigen/QR>
#include <fielddeform/core/error.h>
#include <fielddeform/solid/bezier.h>
#include <fielddeform/solid/constraint.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace fielddeform::solid {
namespace {

using Matrix = Eigen::MatrixXd;
using Terms = std::vector<std::pair<Index, double>>;

/// Equal points together, zeros left out.
Terms collected(const Terms& terms) {
  std::map<Index, double> sum;
  for (const auto& [i, c] : terms) sum[i] += c;
  Terms out;
  for (const auto& [i, c] : sum)
    if (c != 0) out.emplace_back(i, c);
  return out;
}

void append(Terms& to, const Terms& from, double factor) {
  for (const auto& [i, c] : from) to.emplace_back(i, factor * c);
}

/// The r-th derivative across a side at entry e of its layer, by the axis' own direction.
Terms derivativeAcross(const Solid& solid, Side side, std::size_t entry, int order) {
  const bool end = static_cast<std::size_t>(side) % 2 == 1;
  const int n = solid.degree[static_cast<std::size_t>(side) / 2];
  double factor = 1;
  for (int k = 0; k < order; ++k) factor *= n - k;
  Terms out;
  double binomial = 1;
  for (int i = 0; i <= order; ++i) {
    // At the start: sum (-1)^(r-i) C(r, i) P_i; at the end with i counted backwards: (-1)^i.
    const double sign = (end ? i : order - i) % 2 ? -1 : 1;
    out.emplace_back(solid.points[layerOf(solid, side, i).slots[entry]], factor * sign * binomial);
    binomial = binomial * (order - i) / (i + 1);
  }
  return out;
}

}  // namespace

Row fixedPoint(const Object& object, const PointRef& point, const Vec3& at) {
  return {fmt::format("fixed {}", describe(object, point)), combination(object, point), at};
}

Row fixedDifference(const Object& object, const PointRef& a, const PointRef& b, const Vec3& by) {
  Row row{fmt::format("difference {} - {}", describe(object, a), describe(object, b)), {}, by};
  append(row.terms, combination(object, b), 1);
  append(row.terms, combination(object, a), -1);
  row.terms = collected(row.terms);
  return row;
}

Row attached(const Object& object, const PointRef& a, const PointRef& b) {
  Row row = fixedDifference(object, a, b, Vec3::Zero());
  row.name = fmt::format("attached {} - {}", describe(object, a), describe(object, b));
  return row;
}

std::vector<Row> fixedSide(const Object& object, const FaceRef& side, Points points) {
  std::vector<Row> out;
  const Solid& solid = object.solids.at(side.solid);
  for (const std::size_t slot : layerOf(solid, side.side).slots)
    out.push_back({fmt::format("fixed side {}", describe(object, side)), {{solid.points[slot], 1.0}}, points[solid.points[slot]]});
  return out;
}

std::vector<Row> continuity(const Object& object, const Joint& joint) {
  std::vector<Row> out;
  const Solid &a = object.solids[joint.a.solid], &b = object.solids[joint.b.solid];
  const std::vector<std::size_t> match = matching(object, joint);
  const bool sameEnds = static_cast<std::size_t>(joint.a.side) % 2 == static_cast<std::size_t>(joint.b.side) % 2;
  for (int r = 1; r <= joint.continuity; ++r) {
    // Where both faces are starts (or ends) the parameters run against each other.
    const double turn = (sameEnds && r % 2 ? -1 : 1) * std::pow(joint.ratio, r);
    for (std::size_t e = 0; e < match.size(); ++e) {
      Row row{fmt::format("C{} of {} - {}", r, describe(object, joint.a), describe(object, joint.b)), {}, Vec3::Zero()};
      append(row.terms, derivativeAcross(b, joint.b.side, match[e], r), 1);
      append(row.terms, derivativeAcross(a, joint.a.side, e, r), -turn);
      row.terms = collected(row.terms);
      out.push_back(std::move(row));
    }
  }
  return out;
}

std::vector<Row> coonsInside(const Object& object) {
  std::vector<Row> out;
  for (const Solid& solid : object.solids)
    for (const auto& at : innerPoints(solid.degree)) {
      Row row{fmt::format("Coons inside {}", solid.name), {{solid.points[solid.slot(at[0], at[1], at[2])], 1.0}}, Vec3::Zero()};
      for (const auto& [slot, w] : coonsWeights(solid.degree, at)) row.terms.emplace_back(solid.points[slot], -w);
      row.terms = collected(row.terms);
      out.push_back(std::move(row));
    }
  return out;
}

RowSpace::RowSpace(const std::vector<Row>& rows, std::size_t points, double tolerance) {
  const auto n = static_cast<Eigen::Index>(points), count = static_cast<Eigen::Index>(rows.size());
  Matrix basis(std::min(n, count), n);
  lower_ = Matrix::Zero(count, std::min(n, count));
  Eigen::Index rank = 0;
  for (Eigen::Index r = 0; r < count; ++r) {
    Eigen::RowVectorXd rest = Eigen::RowVectorXd::Zero(n);
    for (const auto& [i, c] : rows[static_cast<std::size_t>(r)].terms) rest[i] += c;
    const double length = rest.norm();
    for (int pass = 0; pass < 2 && rank > 0; ++pass) {  // twice is enough
      const Eigen::RowVectorXd part = rest * basis.topRows(rank).transpose();
      rest -= part * basis.topRows(rank);
      lower_.row(r).head(rank) += part;
    }
    const double left = rest.norm();
    if (!(left > tolerance * length) || rank == basis.rows()) {
      redundant_.push_back(static_cast<std::size_t>(r));
      continue;
    }
    lower_(r, rank) = left;
    basis.row(rank++) = rest / left;
    pivot_.push_back(static_cast<std::size_t>(r));
  }
  basis_ = basis.topRows(rank);
  lower_ = lower_.leftCols(rank).eval();
}

Matrix RowSpace::solve(const std::vector<Row>& rows, const Matrix& values, double size) const {
  Matrix triangle(rank(), rank()), chosen(rank(), 3);
  for (Eigen::Index k = 0; k < rank(); ++k) {
    triangle.row(k) = lower_.row(static_cast<Eigen::Index>(pivot_[static_cast<std::size_t>(k)]));
    chosen.row(k) = values.row(static_cast<Eigen::Index>(pivot_[static_cast<std::size_t>(k)]));
  }
  const Matrix y = rank() ? Matrix(triangle.triangularView<Eigen::Lower>().solve(chosen)) : Matrix(0, 3);
  for (const std::size_t r : redundant_) {
    const auto at = static_cast<Eigen::Index>(r);
    const Eigen::RowVector3d reached = rank() ? Eigen::RowVector3d(lower_.row(at) * y) : Eigen::RowVector3d(Eigen::RowVector3d::Zero());
    double scale = 0;
    for (const auto& [i, c] : rows[r].terms) scale += std::abs(c);
    const double off = (reached - values.row(at)).norm();
    if (off <= 1e-9 * size * std::max(1.0, scale)) continue;
    // The row is a combination of the chosen ones: those in it are named.
    std::vector<std::string> names;
    if (rank()) {
      const Eigen::VectorXd share = triangle.transpose().triangularView<Eigen::Upper>().solve(lower_.row(at).transpose());
      for (Eigen::Index k = 0; k < rank(); ++k) {
        const std::string& name = rows[pivot_[static_cast<std::size_t>(k)]].name;
        if (std::abs(share[k]) > 1e-9 && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
      }
    }
    const std::size_t more = names.size() > 4 ? names.size() - 4 : 0;
    names.resize(names.size() - more);
    throw InfeasibleError(fmt::format("the constraint \"{}\" contradicts {}{} (off by {:.3g})", rows[r].name,
                                      names.empty() ? std::string("itself") : fmt::format("\"{}\"", fmt::join(names, "\", \"")),
                                      more ? fmt::format(" and {} more", more) : "", off));
  }
  return y;
}

Matrix valuesOf(const std::vector<Row>& rows) {
  Matrix out(static_cast<Eigen::Index>(rows.size()), 3);
  for (std::size_t r = 0; r < rows.size(); ++r) out.row(static_cast<Eigen::Index>(r)) = rows[r].value.transpose();
  return out;
}

Matrix residualsOf(const std::vector<Row>& rows, Points points) {
  Matrix out = -valuesOf(rows);
  for (std::size_t r = 0; r < rows.size(); ++r)
    for (const auto& [i, c] : rows[r].terms) out.row(static_cast<Eigen::Index>(r)) += c * points[i].transpose();
  return out;
}

}  // namespace fielddeform::solid
