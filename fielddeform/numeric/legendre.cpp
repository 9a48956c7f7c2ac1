#include <fielddeform/numeric/legendre.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace fielddeform::numeric {

Quadrature gaussLegendre(int n) {
  if (n < 1 || n > 200) throw std::invalid_argument("n is " + std::to_string(n) + ", expected 1 to 200");
  Quadrature q;
  q.point.resize(static_cast<std::size_t>(n)), q.weight.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    // Newton from Tricomi's estimate on [-1, 1].
    double x = std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5)), derivative = 1;
    for (int step = 0; step < 20; ++step) {
      double p = 1, before = 0;
      for (int k = 1; k <= n; ++k) {
        const double next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
        before = p, p = next;
      }
      derivative = n * (x * p - before) / (x * x - 1);
      const double dx = p / derivative;
      x -= dx;
      if (std::abs(dx) < 1e-16) break;
    }
    const auto place = static_cast<std::size_t>(n - 1 - i);  // ascending
    q.point[place] = 0.5 * (1 + x);
    q.weight[place] = 1 / ((1 - x * x) * derivative * derivative);
  }
  return q;
}

void shiftedLegendre(double u, std::span<double> out) {
  const double x = 2 * u - 1;
  if (out.empty()) return;
  out[0] = 1;
  if (out.size() > 1) out[1] = x;
  for (std::size_t k = 2; k < out.size(); ++k) {
    const auto n = static_cast<double>(k);
    out[k] = ((2 * n - 1) * x * out[k - 1] - (n - 1) * out[k - 2]) / n;
  }
}

void shiftedLegendreIntegrals(double u, std::span<double> out) {
  // d/dx (P_{k+1} - P_{k-1}) = (2 k + 1) P_k, and both ends agree at x = -1 up to sign.
  std::vector<double> p(out.size() + 1);
  shiftedLegendre(u, p);
  if (!out.empty()) out[0] = u;
  for (std::size_t k = 1; k < out.size(); ++k) out[k] = (p[k + 1] - p[k - 1]) / (2 * (2 * static_cast<double>(k) + 1));
}

}  // namespace fielddeform::numeric
