#include <fielddeform/core/error.h>
#include <fielddeform/map/axis_basis.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using Powers = std::array<std::array<double, 4>, 4>;  // [power of 1 - t (2k < degree) or t][function k]

// The functions of a uniform spline over one segment, t in [0, 1].
Powers uniformPowers(int degree) {
  if (degree == 1) return {{{0, 0}, {1, 1}}};
  if (degree == 2) return {{{0, 0.5, 0}, {0, 1, 0}, {0.5, -1, 0.5}}};
  constexpr double s = 1.0 / 6;
  return {{{0, s, s, 0}, {0, 0.5, 0.5, 0}, {0, 0.5, 0.5, 0}, {s, -0.5, -0.5, s}}};
}

void requireNodes(int nodes) {
  if (nodes < 2) throw std::invalid_argument(fmt::format("nodes: {}, must be >= 2 on every axis", nodes));
}

// The functions that do not vanish over [knot[p], knot[p+1]], all as powers of t from 0 to 1 there: de Boor's recurrence with
// polynomials for numbers. `knot` has 2p + 2 entries.
Powers segmentPowers(int p, const double* knot) {
  const double start = knot[p], length = knot[p + 1] - knot[p];
  Powers w{};
  w[0][0] = 1;
  for (int d = 1; d <= p; ++d) {
    Powers next{};
    for (int k = 0; k < d; ++k) {
      // The function k of degree d - 1 spans knot[p - d + 1 + k] .. knot[p + 1 + k]; (u - a)/(b - a) = low + rise t.
      const double a = knot[p - d + 1 + k], b = knot[p + 1 + k];
      const double low = (start - a) / (b - a), rise = length / (b - a);
      for (int m = 0; m < d; ++m) {
        next[m][k + 1] += low * w[m][k];
        next[m + 1][k + 1] += rise * w[m][k];
        next[m][k] += (1 - low) * w[m][k];
        next[m + 1][k] -= rise * w[m][k];
      }
    }
    w = next;
  }
  return w;
}

Powers segmentPowersOfBoth(int p, const double* knot) {
  double mirrored[8];
  for (int i = 0; i < 2 * p + 2; ++i) mirrored[i] = -knot[2 * p + 1 - i];
  Powers w = segmentPowers(p, knot);
  const Powers fromRight = segmentPowers(p, mirrored);
  for (int k = 0; 2 * k < p; ++k)
    for (int m = 0; m <= p; ++m) w[m][k] = fromRight[m][p - k];
  return w;
}

// 1 + 3t + 3t^2 - t^3 = 6x for x in [1/6, 1]: rising and convex. Newton from a cubic that meets the root and its slope at
// both ends, at most 0.035 off: 4e-4, 6e-8, 2e-15, and the last bits.
double rootNearBorder(double x) {
  const double y = std::clamp((6 * x - 1) / 5, 0.0, 1.0);
  double t = ((0.5 * y - 7.0 / 6) * y + 5.0 / 3) * y;
  for (int i = 0; i < 4; ++i) t -= (((3 - t) * t + 3) * t + 1 - 6 * x) / ((6 - 3 * t) * t + 3);
  return t;
}

}  // namespace

std::string_view toString(BasisKind kind) noexcept { return kind == BasisKind::Bernstein ? "bernstein" : "bspline"; }

std::string_view toString(Border border) noexcept {
  return border == Border::Coincident ? "coincident" : border == Border::Free ? "free" : "knots";
}

AxisBasis AxisBasis::bernstein(int nodes) {
  requireNodes(nodes);
  AxisBasis b;
  b.nodes_ = nodes;
  b.degree_ = nodes - 1;
  if (b.degree_ > 3) return b;
  Piece piece;
  // s^3, 3 s^2 (1 - s), and their mirror images
  piece.power = nodes == 2 ? Powers{{{0, 0}, {1, 1}}}
              : nodes == 3 ? Powers{{{0, 0, 0}, {0, 2, 0}, {1, -2, 1}}}
                           : Powers{{{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 3, 3, 0}, {1, -3, -3, 1}}};
  b.pieces_.push_back(piece);
  return b;
}

// The inner segments, each one node spacing long, the first beginning at u = firstAt spacings.
void AxisBasis::makeUniformPiece(double firstAt) {
  Piece piece;
  piece.segments = nodes_ - degree_;
  piece.scale = border_ == Border::Free ? nodes_ - degree_ : nodes_ - 1;
  piece.from = firstAt / piece.scale;
  piece.shift = firstAt;
  piece.power = uniformPowers(degree_);
  pieces_.push_back(piece);
}

// What stands outside the inner segments [Hsu et al. 1992, section 3]: with the outer node d0 repeated, the outermost
// segment is d0 + x (d1 - d0) at the distance x (in node spacings) from the border; the cubic one beside it needs a root.
void AxisBasis::makeCoincidentEnds() {
  const double scale = nodes_ - 1, outer = degree_ == 3 ? 1.0 / 6 : 0.5, s = 1.0 / 6;
  const bool cubic = degree_ == 3;
  Piece left, right, leftRoot, rightRoot;
  left.scale = right.scale = leftRoot.scale = rightRoot.scale = scale;
  right.first = rightRoot.first = nodes_ - 1 - degree_;
  right.origin = rightRoot.origin = 1;
  right.shift = -1;  // t = 1 - x
  right.from = (scale - outer) / scale;
  leftRoot.from = outer / scale;
  rightRoot.from = (scale - 1) / scale;
  leftRoot.parameter = Piece::Parameter::RootLeft;
  rightRoot.parameter = Piece::Parameter::RootRight;
  left.power = cubic ? Powers{{{0, 1}, {1, -1}}} : Powers{{{0, 0}, {1, 1}}};
  right.power = cubic ? Powers{{{0, 0, 1, 0}, {0, 0, -1, 1}}} : Powers{{{0, 1, 0}, {0, -1, 1}}};
  leftRoot.power = {{{s, 4 * s, 0}, {0.5, 0, 0}, {0.5, -1, 0}, {-2 * s, 0.5, s}}};
  rightRoot.power = leftRoot.power;
  for (auto& row : rightRoot.power) std::reverse(row.begin(), row.end());
  std::vector<Piece> all{left};
  if (cubic) all.push_back(leftRoot);
  all.insert(all.end(), pieces_.begin(), pieces_.end());
  if (cubic) all.push_back(rightRoot);
  all.push_back(right);
  pieces_ = std::move(all);
}

AxisBasis AxisBasis::bspline(int nodes, int degree, Border border) {
  requireNodes(nodes);
  if (degree < 1 || degree > 3) throw std::invalid_argument(fmt::format("degree: {}, must be 1, 2 or 3", degree));
  if (border == Border::Knots) throw std::invalid_argument("border: knots, must be coincident or free");
  AxisBasis b;
  b.kind_ = BasisKind::BSpline;
  b.border_ = border;
  b.nodes_ = nodes;
  const int p = b.degree_ = std::min(degree, nodes - 1);
  b.makeUniformPiece(border == Border::Free || p == 1 ? 0 : p == 2 ? 0.5 : 1);
  if (border == Border::Coincident && p > 1) b.makeCoincidentEnds();
  return b;
}

AxisBasis AxisBasis::withKnots(int degree, std::vector<double> knots) {
  if (degree < 1 || degree > 3) throw std::invalid_argument(fmt::format("degree: {}, must be 1, 2 or 3", degree));
  const std::size_t p = static_cast<std::size_t>(degree);
  if (knots.size() < 2 * p + 2)
    throw std::invalid_argument(fmt::format("knots: {}, must be >= {} for degree {}", knots.size(), 2 * p + 2, degree));
  const std::size_t nodes = knots.size() - p - 1;
  if (nodes > 0x7FFFFFFF) throw std::invalid_argument("knots: too many");
  for (std::size_t i = 0; i < knots.size(); ++i) {
    requireFinite("knots", knots[i]);
    if (i > 0 && !(knots[i - 1] <= knots[i]))
      throw std::invalid_argument(fmt::format("knots: {} after {}, must not decrease", knots[i], knots[i - 1]));
  }
  if (!(knots[p] < knots[p + 1]) || !(knots[nodes - 1] < knots[nodes]))
    throw std::invalid_argument(fmt::format("knots: an end of the domain more than {} times, must be at most degree + 1", degree + 1));
  for (std::size_t i = p + 1; i + p < nodes; ++i)
    if (!(knots[i] < knots[i + p]))
      throw std::invalid_argument(fmt::format("knots: {} more than {} times, must be at most the degree", knots[i], degree));
  AxisBasis b;
  b.kind_ = BasisKind::BSpline;
  b.border_ = Border::Knots;
  b.degree_ = degree;
  b.nodes_ = static_cast<int>(nodes);
  // Halves, as the difference of two numbers may be beyond double.
  const double start = 0.5 * knots[p], length = 0.5 * knots[nodes] - start;
  std::vector<double> unit(knots.size());
  for (std::size_t i = 0; i < knots.size(); ++i) unit[i] = (0.5 * knots[i] - start) / length;
  for (std::size_t i = 0; i < nodes; ++i) {
    double sum = 0;
    for (std::size_t k = 1; k <= p; ++k) sum += unit[i + k];
    b.rest_.push_back(sum / degree);
  }
  for (std::size_t i = p; i < nodes; ++i) {
    if (!(unit[i] < unit[i + 1])) continue;
    Piece piece;
    piece.from = piece.origin = unit[i];
    piece.scale = 1 / (unit[i + 1] - unit[i]);
    piece.first = static_cast<int>(i - p);
    piece.power = segmentPowersOfBoth(degree, &unit[i - p]);
    bool finite = std::isfinite(piece.scale);
    for (const auto& row : piece.power)
      for (const double c : row) finite = finite && std::isfinite(c);
    if (!finite) throw std::invalid_argument(fmt::format("knots: {} and {} are too near for their neighbours", knots[i], knots[i + 1]));
    b.pieces_.push_back(piece);
  }
  b.knots_ = std::move(knots);
  return b;
}

BasisKind AxisBasis::kind() const noexcept { return kind_; }
Border AxisBasis::border() const noexcept { return border_; }
int AxisBasis::degree() const noexcept { return degree_; }
int AxisBasis::nodes() const noexcept { return nodes_; }
int AxisBasis::support() const noexcept { return degree_ + 1; }

std::vector<double> AxisBasis::knots() const {
  if (kind_ == BasisKind::Bernstein || !knots_.empty()) return knots_;
  const int controls = border_ == Border::Coincident ? nodes_ + 2 * (degree_ - 1) : nodes_;
  std::vector<double> uniform;
  for (int i = 0; i < controls + degree_ + 1; ++i) uniform.push_back(i);
  return uniform;
}

double AxisBasis::restNode(int i) const {
  if (i < 0 || i >= nodes_) throw std::invalid_argument(fmt::format("node: {}, must be in [0, {}]", i, nodes_ - 1));
  if (!rest_.empty()) return rest_[static_cast<std::size_t>(i)];
  return border_ == Border::Free ? (i - 0.5 * (degree_ - 1)) / (nodes_ - degree_) : static_cast<double>(i) / (nodes_ - 1);
}

bool AxisBasis::operator==(const AxisBasis& o) const {
  return kind_ == o.kind_ && border_ == o.border_ && degree_ == o.degree_ && nodes_ == o.nodes_ && knots_ == o.knots_ &&
         rest_ == o.rest_;
}

AxisBasis::Values AxisBasis::evaluate(double u) const {
  Values v;
  v.weight.resize(static_cast<std::size_t>(support()));
  v.slope.resize(v.weight.size());
  v.first = evaluate(u, v.weight.data(), v.slope.data());
  return v;
}

namespace {

double clamped(double u) { return u > 0 ? std::min(u, 1.0) : 0; }  // no number at all: 0

// All Bernstein polynomials of a degree, by de Casteljau's recurrence: sums of products of numbers in [0, 1].
void bernsteinWeights(int degree, double u, double* w, double* slope) {
  const double v = 1 - u;
  w[0] = 1;
  for (int d = 1; d <= degree; ++d) {
    if (slope && d == degree)
      for (int k = 0; k <= d; ++k) slope[k] = d * ((k > 0 ? w[k - 1] : 0) - (k < d ? w[k] : 0));
    w[d] = u * w[d - 1];
    for (int k = d - 1; k > 0; --k) w[k] = v * w[k] + u * w[k - 1];
    w[0] = v * w[0];
  }
}

}  // namespace

int AxisBasis::evaluate(double u, double* weight, double* slope) const {
  if (!curve_.empty()) return evaluateCurve(clamped(u), weight, slope);
  if (pieces_.empty()) {
    bernsteinWeights(degree_, clamped(u), weight, slope);
    return 0;
  }
  const Place place = locate(u);
  evaluate(place, weight, slope);
  return place.first;
}

AxisBasis::Place AxisBasis::locate(double u) const {
  u = clamped(u);
  if (!curve_.empty()) return {0, evaluateCurve(u, nullptr, nullptr), u};
  auto it = std::upper_bound(pieces_.begin() + 1, pieces_.end(), u, [](double x, const Piece& p) { return x < p.from; });
  const Piece& piece = *--it;
  Place place;
  place.piece = static_cast<int>(it - pieces_.begin());
  double t = (u - piece.origin) * piece.scale - piece.shift;
  if (piece.parameter == Piece::Parameter::RootLeft) t = rootNearBorder(t);
  if (piece.parameter == Piece::Parameter::RootRight) t = 1 - rootNearBorder(-t);
  const int segment = piece.segments == 1 ? 0 : std::clamp(static_cast<int>(t), 0, piece.segments - 1);
  place.first = piece.first + segment;
  place.t = t - segment;
  return place;
}

void AxisBasis::evaluate(const Place& place, double* weight, double* slope) const {
  const Piece& piece = pieces_[static_cast<std::size_t>(place.piece)];
  double rise = piece.scale;
  if (piece.parameter != Piece::Parameter::Straight) {
    const double root = piece.parameter == Piece::Parameter::RootLeft ? place.t : 1 - place.t;
    rise /= 0.5 * ((2 - root) * root + 1);
  }
  for (int k = 0; k <= degree_; ++k) {
    const bool leftHalf = 2 * k < degree_;
    const double x = leftHalf ? 1 - place.t : place.t;
    const auto c = [&](int m) { return piece.power[m][k]; };
    weight[k] = ((c(3) * x + c(2)) * x + c(1)) * x + c(0);
    if (slope) slope[k] = ((3 * c(3) * x + 2 * c(2)) * x + c(1)) * (leftHalf ? -rise : rise);
  }
}

}  // namespace fielddeform::map
