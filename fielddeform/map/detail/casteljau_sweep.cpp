#include <fielddeform/map/detail/casteljau_sweep.h>
#include <fielddeform/numeric/cubic.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::map::detail {
namespace {

using Vectors = std::vector<Triple<double>>;

/// Adds a Bezier polygon of lower degree to one of `out.size() - 1`, its degree raised.
void addElevated(std::span<const Vec3> polygon, Vectors& out) {
  Vectors now;
  for (const Vec3& p : polygon) now.push_back({p.x(), p.y(), p.z()});
  while (now.size() < out.size()) {
    const double n = static_cast<double>(now.size());
    Vectors next(now.size() + 1);
    for (std::size_t i = 0; i < next.size(); ++i)
      for (std::size_t c = 0; c < 3; ++c) {
        const double a = static_cast<double>(i) / n;
        next[i][c] = (i > 0 ? a * now[i - 1][c] : 0) + (i < now.size() ? (1 - a) * now[i][c] : 0);
      }
    now = std::move(next);
  }
  for (std::size_t i = 0; i < out.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) out[i][c] += now[i][c];
}

Vectors handles(const std::vector<std::vector<Vec3>>& levels, std::size_t degree) {
  Vectors out(degree, Triple<double>{0, 0, 0});
  for (const std::vector<Vec3>& level : levels)
    if (!level.empty()) addElevated(level, out);
  return out;
}

Vectors difference(const Vectors& a, const Vectors& b) {
  Vectors out(a.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) out[i][c] = a[i][c] - b[i][c];
  return out;
}

bool allZero(const Vectors& v) {
  return std::all_of(v.begin(), v.end(), [](const auto& p) { return p[0] == 0 && p[1] == 0 && p[2] == 0; });
}

/// Value and derivative of a Bezier polygon at u in [0, 1].
void evaluate(const Vectors& polygon, double u, double* b, Vec3& value, Vec3& slope) {
  value.setZero(), slope.setZero();
  const std::size_t n = polygon.size() - 1;
  const auto at = [&](std::size_t i) { return Vec3(polygon[i][0], polygon[i][1], polygon[i][2]); };
  if (n > 0) {
    bernstein(n - 1, u, 1 - u, b);
    for (std::size_t i = 0; i < n; ++i) slope += b[i] * (at(i + 1) - at(i));
    slope *= static_cast<double>(n);
  }
  bernstein(n, u, 1 - u, b);
  for (std::size_t i = 0; i <= n; ++i) value += b[i] * at(i);
}

double triple(const Vec3& a, const Vec3& b, const Vec3& c) { return a.dot(b.cross(c)); }
double inPlane(const SweepFrame& f, const Vec3& x) { return triple(x - f.c, f.s, f.t); }

/// The sign change between a and b, to the last bit.
double root(const Sweep& sweep, const Vec3& x, double a, double b, double ga, double gb) {
  for (int i = 0; i < 200 && std::nextafter(a, b) != b; ++i) {
    // Regula falsi where it shrinks the bracket, halving on every third step.
    double m = i % 3 == 2 ? 0.5 * (a + b) : (ga * b - gb * a) / (ga - gb);
    if (!(m > a && m < b)) m = 0.5 * (a + b);
    if (!(m > a && m < b)) break;
    const double g = inPlane(SweepFrame(sweep, m), x);
    if (g == 0) return m;
    if ((g < 0) == (ga < 0)) a = m, ga = g;
    else b = m, gb = g;
  }
  return std::abs(ga) < std::abs(gb) ? a : b;
}

class Search {
 public:
  explicit Search(const Vec3& x) : x_(x) { best_.distance = std::numeric_limits<double>::infinity(); }

  void inside(const Sweep& sweep, std::size_t piece) {
    const std::size_t steps = 4 * sweep.degree + 4;
    double before = 0;
    for (std::size_t k = 0; k <= steps; ++k) {
      const double u = static_cast<double>(k) / static_cast<double>(steps), g = inPlane(SweepFrame(sweep, u), x_);
      if (g == 0) take(sweep, piece, u);
      else if (k > 0 && before != 0 && (g < 0) != (before < 0))
        take(sweep, piece, root(sweep, x_, static_cast<double>(k - 1) / static_cast<double>(steps), u, before, g));
      before = g;
    }
  }

  /// Beyond an end all is linear in u, so that the condition is a cubic.
  void beyond(const Sweep& sweep, std::size_t piece, double end) {
    const SweepFrame f(sweep, end);
    const Vec3 a = x_ - f.c, b = -f.dc;
    const auto roots = numeric::cubicRoots({triple(a, f.s, f.t), triple(b, f.s, f.t) + triple(a, f.ds, f.t) + triple(a, f.s, f.dt),
                                            triple(b, f.ds, f.t) + triple(b, f.s, f.dt) + triple(a, f.ds, f.dt), triple(b, f.ds, f.dt)});
    for (const double r : roots)
      if (end == 0 ? r < 0 : r > 0) take(sweep, piece, end + r);
  }

  const SweepPlace& best() const { return best_; }

 private:
  void take(const Sweep& sweep, std::size_t piece, double u) {
    const SweepFrame f(sweep, u);
    const Vec3 d = x_ - f.c;
    const double distance = d.norm();
    if (!(distance < best_.distance)) return;
    const double ss = f.s.squaredNorm(), tt = f.t.squaredNorm(), st = f.s.dot(f.t), area = ss * tt - st * st;
    if (!(area > 1e-20 * ss * tt)) return;
    const double ds = d.dot(f.s), dt = d.dot(f.t);
    best_ = {piece, Vec3(u, (ds * tt - dt * st) / area, (dt * ss - ds * st) / area), distance, true};
  }

  Vec3 x_;
  SweepPlace best_;
};

}  // namespace

Sweep::Sweep(const CasteljauPiece& piece) : degree(piece.points.size() - 1) {
  for (const Vec3& p : piece.points) c.push_back({p.x(), p.y(), p.z()});
  s = handles(piece.s, degree);
  t = handles(piece.t, degree);
}

bool Sweep::isZero() const { return allZero(c) && allZero(s) && allZero(t); }

Sweep operator-(const Sweep& a, const Sweep& b) {
  Sweep out = a;
  out.c = difference(a.c, b.c), out.s = difference(a.s, b.s), out.t = difference(a.t, b.t);
  return out;
}

SweepFrame::SweepFrame(const Sweep& sweep, double u) {
  std::array<double, kMaxCasteljauDegree + 1> b;
  const double inside = std::clamp(u, 0.0, 1.0);
  evaluate(sweep.c, inside, b.data(), c, dc);
  evaluate(sweep.s, inside, b.data(), s, ds);
  evaluate(sweep.t, inside, b.data(), t, dt);
  if (u != inside) c += (u - inside) * dc, s += (u - inside) * ds, t += (u - inside) * dt;
}

Mat3 SweepFrame::jacobian(double v, double w) const {
  Mat3 j;
  j.col(0) = dc + v * ds + w * dt;
  j.col(1) = s;
  j.col(2) = t;
  return j;
}

SweepPlace locate(const std::vector<Sweep>& curve, const Vec3& x, bool beyondEnds) {
  Search search(x);
  for (std::size_t k = 0; k < curve.size(); ++k) search.inside(curve[k], k);
  if (beyondEnds) {
    search.beyond(curve.front(), 0, 0);
    search.beyond(curve.back(), curve.size() - 1, 1);
  }
  return search.best();
}

}  // namespace fielddeform::map::detail
