#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/detail/moments.h>
#include <fielddeform/volume/moments.h>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kGrain = 2048;

/// The point of a vertex about the region's centre, with its derivative where one is asked for.
struct Plain {
  Points x;
  Vec3 centre;
  Triple<double> operator()(Index v) const {
    const Vec3 p = x[v] - centre;
    return {p.x(), p.y(), p.z()};
  }
};
struct Along {
  Points x, p;
  Vec3 centre;
  Triple<Dual> operator()(Index v) const {
    const Vec3 at = x[v] - centre, d = p[v];
    return {Dual(at.x(), d.x()), Dual(at.y(), d.y()), Dual(at.z(), d.z())};
  }
};

template <class T, class Point>
Totals<T> totals(const SurfaceVolume& surface, std::size_t region, const Point& point) {
  const auto triangles = surface.triangles(region);
  return deterministicReduce(
      triangles.size() / 3, kGrain, Totals<T>(),
      [&](std::size_t begin, std::size_t end) {
        Totals<T> sum;
        for (std::size_t t = begin; t < end; ++t) addTriangle(point(triangles[3 * t]), point(triangles[3 * t + 1]), point(triangles[3 * t + 2]), sum);
        return sum;
      },
      [](Totals<T> a, const Totals<T>& b) {
        a.volume += b.volume;
        for (std::size_t k = 0; k < 3; ++k) a.first[k] += b.first[k];
        for (std::size_t k = 0; k < 6; ++k) a.second[k] += b.second[k];
        return a;
      });
}

double wanted(double value) { return value; }
double wanted(const Dual& value) { return value.d; }

template <class T, class Point>
void gradient(const SurfaceVolume& surface, std::size_t region, const Point& point, const TotalsWeight<T>& w, std::span<Vec3> out) {
  const auto own = surface.vertices(region);
  parallelFor(own.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const Triple<T> a = point(own[k]);
      Vec3 sum = Vec3::Zero();
      surface.forEachCorner(own[k], [&](Index b, Index c, Index r) {
        if (r != region) return;
        const Triple<T> g = cornerGradient(w, a, point(b), point(c));
        sum += Vec3(wanted(g[0]), wanted(g[1]), wanted(g[2]));
      });
      out[k] = sum;
    }
  });
}

}  // namespace

Totals<double> regionTotals(const SurfaceVolume& surface, Points x, std::size_t region) {
  return totals<double>(surface, region, Plain{x, surface.centre(region)});
}
Totals<Dual> regionTotals(const SurfaceVolume& surface, Points x, Points p, std::size_t region) {
  return totals<Dual>(surface, region, Along{x, p, surface.centre(region)});
}
void regionGradient(const SurfaceVolume& surface, Points x, std::size_t region, const TotalsWeight<double>& w, std::span<Vec3> out) {
  gradient<double>(surface, region, Plain{x, surface.centre(region)}, w, out);
}
void regionGradient(const SurfaceVolume& surface, Points x, Points p, std::size_t region, const TotalsWeight<Dual>& w, std::span<Vec3> out) {
  gradient<Dual>(surface, region, Along{x, p, surface.centre(region)}, w, out);
}

}  // namespace fielddeform::volume::detail

namespace fielddeform::volume {

SolidMoments solidMoments(const SurfaceVolume& surface, Points x, std::size_t region) {
  const auto t = detail::regionTotals(surface, x, region);
  SolidMoments out;
  out.volume = t.volume;
  const Vec3 mean = Vec3(t.first[0], t.first[1], t.first[2]) / t.volume;
  out.centre = surface.centre(region) + mean;
  Mat3 second;
  second << t.second[0], t.second[5], t.second[4], t.second[5], t.second[1], t.second[3], t.second[4], t.second[3], t.second[2];
  out.spread = second / t.volume - mean * mean.transpose();
  return out;
}

}  // namespace fielddeform::volume
