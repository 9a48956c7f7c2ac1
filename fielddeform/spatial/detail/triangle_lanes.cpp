#include <fielddeform/core/detail/simd.h>
#include <fielddeform/spatial/detail/simplex_inline.h>
#include <fielddeform/spatial/detail/triangle_lanes.h>

#include <limits>

namespace fielddeform::spatial::detail {
namespace {

using fielddeform::detail::Avx2, fielddeform::detail::Avx512, fielddeform::detail::Baseline;
using fielddeform::detail::SimdLevel, fielddeform::detail::simdLevel;

// Every sum below stands in the order of simplex_inline.h.
template <class L>
struct Lanes3 {
  typename L::Pack x, y, z;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void dotWith(const Lanes3<L>& a, const double* b, typename L::Pack& out) {
  out = (a.x * b[0] + a.y * b[1]) + a.z * b[2];
}

// a - s b
template <class L>
FIELDDEFORM_SIMD_INLINE void subtract(Lanes3<L>& a, const typename L::Pack& s, const double* b) {
  a.x = a.x - s * b[0];
  a.y = a.y - s * b[1];
  a.z = a.z - s * b[2];
}

template <class L>
FIELDDEFORM_SIMD_INLINE void from(const Lanes3<L>& q, const double* corner, Lanes3<L>& out) {
  out.x = q.x - corner[0];
  out.y = q.y - corner[1];
  out.z = q.z - corner[2];
}

template <class Mask>
FIELDDEFORM_SIMD_INLINE bool anyOf(const Mask& mask) {
  long long bits = 0;
  for (std::size_t i = 0; i < sizeof(Mask) / 8; ++i) bits |= mask[i];
  return bits != 0;
}

// As onEdge(). @param pa, pb  query minus the ends
template <class L>
struct EdgeLanes {
  typename L::Pack square, t;
  Lanes3<L> offset;

  FIELDDEFORM_SIMD_INLINE void find(const Lanes3<L>& pa, const Lanes3<L>& pb, const double* ab, double length2) {
    using Pack = typename L::Pack;
    Pack along;
    dotWith<L>(pa, ab, along);
    t = along / length2;
    const Pack s = 1 - t;
    const auto early = t < 0.5, before = along > 0, after = along < length2;
    const Pack zero = {}, one = zero + 1.0;
    offset.x = early ? Pack(pa.x - t * ab[0]) : Pack(pb.x + s * ab[0]);
    offset.y = early ? Pack(pa.y - t * ab[1]) : Pack(pb.y + s * ab[1]);
    offset.z = early ? Pack(pa.z - t * ab[2]) : Pack(pb.z + s * ab[2]);
    offset.x = after ? offset.x : pb.x;
    offset.y = after ? offset.y : pb.y;
    offset.z = after ? offset.z : pb.z;
    t = after ? t : one;
    offset.x = before ? offset.x : pa.x;
    offset.y = before ? offset.y : pa.y;
    offset.z = before ? offset.z : pa.z;
    t = before ? t : zero;
    square = (offset.x * offset.x + offset.y * offset.y) + offset.z * offset.z;
  }
};

// As onTriangle().
template <class L>
struct TriangleLanes {
  using Pack = typename L::Pack;
  Pack square, u, v, w;
  Lanes3<L> offset;

  FIELDDEFORM_SIMD_INLINE void find(const TriangleTest& t, const Lanes3<L>& q) {
    const Pack zero = {};
    square = zero + std::numeric_limits<double>::infinity();
    u = zero + 1.0;
    v = w = zero;
    from<L>(q, t.a, offset);
    const Lanes3<L> pa = offset;
    auto acrossA = zero == zero, acrossB = acrossA, acrossC = acrossA;
    if (t.plane) {
      onPlane(t, pa);
      const auto within = (u >= 0) & (v >= 0) & (w >= 0);
      if (!t.thin) {
        acrossA = u < kOnEdge;
        acrossB = v < kOnEdge;
        acrossC = w < kOnEdge;
      }
      const Pack here = (offset.x * offset.x + offset.y * offset.y) + offset.z * offset.z;
      square = within ? here : square;
    }
    Lanes3<L> pb, pc;
    from<L>(q, t.b, pb);
    from<L>(q, t.c, pc);
    EdgeLanes<L> e;
    if (anyOf(acrossC)) {
      e.find(pa, pb, t.ab, t.ab2);
      take(acrossC & (e.square < square), e, Pack(1 - e.t), e.t, zero);
    }
    if (anyOf(acrossB)) {
      e.find(pa, pc, t.ac, t.ac2);
      take(acrossB & (e.square < square), e, Pack(1 - e.t), zero, e.t);
    }
    if (anyOf(acrossA)) {
      e.find(pb, pc, t.bc, t.bc2);
      take(acrossA & (e.square < square), e, zero, Pack(1 - e.t), e.t);
    }
  }

 private:
  FIELDDEFORM_SIMD_INLINE void onPlane(const TriangleTest& t, const Lanes3<L>& pa) {
    const Lanes3<L> pc{pa.y * t.ac[2] - pa.z * t.ac[1], pa.z * t.ac[0] - pa.x * t.ac[2], pa.x * t.ac[1] - pa.y * t.ac[0]};
    const Lanes3<L> bp{t.ab[1] * pa.z - t.ab[2] * pa.y, t.ab[2] * pa.x - t.ab[0] * pa.z, t.ab[0] * pa.y - t.ab[1] * pa.x};
    dotWith<L>(pc, t.n, v);
    dotWith<L>(bp, t.n, w);
    v *= t.inverse;
    w *= t.inverse;
    subtract<L>(offset, v, t.ab);
    subtract<L>(offset, w, t.ac);
    if (t.refined) t.swap ? refine(t, w, v) : refine(t, v, w);
    u = (1 - v) - w;
  }

  FIELDDEFORM_SIMD_INLINE void refine(const TriangleTest& t, Pack& onE, Pack& onF) {
    for (int i = 0; i < 3; ++i) {
      Pack de, df;
      dotWith<L>(offset, t.along, de);
      de /= t.along2;
      subtract<L>(offset, de, t.along);
      dotWith<L>(offset, t.across, df);
      df /= t.across2;
      subtract<L>(offset, df, t.across);
      onE += de - df * t.share;
      onF += df;
    }
  }

  template <class Mask>
  FIELDDEFORM_SIMD_INLINE void take(const Mask& better, const EdgeLanes<L>& e, const Pack& a, const Pack& b, const Pack& c) {
    square = better ? e.square : square;
    offset.x = better ? e.offset.x : offset.x;
    offset.y = better ? e.offset.y : offset.y;
    offset.z = better ? e.offset.z : offset.z;
    u = better ? a : u;
    v = better ? b : v;
    w = better ? c : w;
  }
};

struct NearestTask {
  const TriangleTest* tests;
  std::size_t testCount;
  const LaneQueries& queries;
  std::size_t count;
  LaneHits& hits;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void nearestKernel(const NearestTask& task) {
  using Pack = typename L::Pack;
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    Lanes3<L> q, d;
    q.x = *reinterpret_cast<const Pack*>(task.queries.x + p);
    q.y = *reinterpret_cast<const Pack*>(task.queries.y + p);
    q.z = *reinterpret_cast<const Pack*>(task.queries.z + p);
    from<L>(q, task.queries.centre.data(), d);
    const Pack zero = {};
    Pack square = zero + std::numeric_limits<double>::infinity(), element = square, u = zero, v = zero, w = zero;
    Lanes3<L> offset{zero, zero, zero};
    for (std::size_t i = 0; i < task.testCount; ++i) {
      const TriangleTest& t = task.tests[i];
      Pack least;
      dotWith<L>(d, t.offset, least);
      least += t.least;
      if (!anyOf(least <= square)) continue;
      TriangleLanes<L> hit;
      hit.find(t, q);
      const auto better = (hit.square < square) | ((hit.square == square) & (t.element < element));
      square = better ? hit.square : square;
      element = better ? Pack(zero + t.element) : element;
      offset.x = better ? hit.offset.x : offset.x;
      offset.y = better ? hit.offset.y : offset.y;
      offset.z = better ? hit.offset.z : offset.z;
      u = better ? hit.u : u;
      v = better ? hit.v : v;
      w = better ? hit.w : w;
    }
    *reinterpret_cast<Pack*>(task.hits.square + p) = square;
    *reinterpret_cast<Pack*>(task.hits.element + p) = element;
    *reinterpret_cast<Pack*>(task.hits.x + p) = offset.x;
    *reinterpret_cast<Pack*>(task.hits.y + p) = offset.y;
    *reinterpret_cast<Pack*>(task.hits.z + p) = offset.z;
    *reinterpret_cast<Pack*>(task.hits.u + p) = u;
    *reinterpret_cast<Pack*>(task.hits.v + p) = v;
    *reinterpret_cast<Pack*>(task.hits.w + p) = w;
  }
}

void nearestBaseline(const NearestTask& task) { nearestKernel<Baseline>(task); }
FIELDDEFORM_SIMD_AVX2 void nearestAvx2(const NearestTask& task) { nearestKernel<Avx2>(task); }
FIELDDEFORM_SIMD_AVX512 void nearestAvx512(const NearestTask& task) { nearestKernel<Avx512>(task); }

void store(const Vec3& from, double* to) {
  for (int k = 0; k < 3; ++k) to[k] = from[k];
}

}  // namespace

TriangleTest makeTest(const Vec3& a, const Vec3& b, const Vec3& c, Index element) noexcept {
  TriangleTest t{};
  const Vec3 ab = b - a, ac = c - a, bc = c - b, n = ab.cross(ac);
  store(a, t.a);
  store(b, t.b);
  store(c, t.c);
  store(ab, t.ab);
  store(ac, t.ac);
  store(bc, t.bc);
  store(n, t.n);
  t.ab2 = square(ab);
  t.ac2 = square(ac);
  t.bc2 = square(bc);
  t.element = static_cast<double>(element);
  const double n2 = square(n);
  t.inverse = 1 / n2;
  t.thin = !(n2 > kThin * t.ab2 * t.ac2);
  t.plane = n2 > kFlat * t.ab2 * t.ac2 && n2 > 0;
  if (!t.plane || !t.thin) return t;
  t.swap = t.ac2 > t.ab2;
  const Vec3 &e = t.swap ? ac : ab, &f = t.swap ? ab : ac;
  t.along2 = square(e);
  t.share = dot(e, f) / t.along2;
  const Vec3 across = f - t.share * e;
  t.across2 = square(across);
  t.refined = t.across2 > 0;
  store(e, t.along);
  store(across, t.across);
  return t;
}

void nearestTriangles(const TriangleTest* tests, std::size_t testCount, const LaneQueries& queries, std::size_t count, LaneHits& hits) {
  const NearestTask task{tests, testCount, queries, count, hits};
  switch (simdLevel()) {
    case SimdLevel::Avx512: return nearestAvx512(task);
    case SimdLevel::Avx2: return nearestAvx2(task);
    case SimdLevel::Baseline: return nearestBaseline(task);
  }
}

}  // namespace fielddeform::spatial::detail
