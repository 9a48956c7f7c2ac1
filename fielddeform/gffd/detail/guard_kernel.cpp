#include <fielddeform/core/detail/simd.h>
#include <fielddeform/gffd/detail/guard_kernel.h>

namespace fielddeform::gffd::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

constexpr float kSliver = 1e-6f;  // sine squared
constexpr float kTiny = 1e-30f;   // below, products have left the normal range

struct SuspectTask {
  const GuardEdges& edges;
  const GuardBounds& bounds;
  std::int32_t* suspect;
};

FIELDDEFORM_SIMD_INLINE void suspectKernel(const SuspectTask& task) {
  const GuardEdges& e = task.edges;
  const float cosine = task.bounds.cosineSquared, stretch = task.bounds.stretchSquared;
  for (std::size_t i = 0; i < kGuardBlock; ++i) {
    const float ax = e.q1[0][i], ay = e.q1[1][i], az = e.q1[2][i], bx = e.q2[0][i], by = e.q2[1][i], bz = e.q2[2][i];
    const float cx = e.x1[0][i], cy = e.x1[1][i], cz = e.x1[2][i], dx = e.x2[0][i], dy = e.x2[1][i], dz = e.x2[2][i];
    const float nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
    const float mx = cy * dz - cz * dy, my = cz * dx - cx * dz, mz = cx * dy - cy * dx;
    const float a2 = ax * ax + ay * ay + az * az, b2 = bx * bx + by * by + bz * bz;
    const float c2 = cx * cx + cy * cy + cz * cz, d2 = dx * dx + dy * dy + dz * dz;
    const float ux = bx - ax, uy = by - ay, uz = bz - az, vx = dx - cx, vy = dy - cy, vz = dz - cz;
    const float u2 = ux * ux + uy * uy + uz * uz, v2 = vx * vx + vy * vy + vz * vz;
    const float n2 = nx * nx + ny * ny + nz * nz, m2 = mx * mx + my * my + mz * mz, nm = nx * mx + ny * my + nz * mz;
    const float product = n2 * m2;
    // Bitwise: no branches between lanes.
    const bool known = static_cast<int>(n2 > kSliver * (a2 * b2)) & static_cast<int>(m2 > kSliver * (c2 * d2)) & static_cast<int>(n2 > kTiny) &
                       static_cast<int>(m2 > kTiny) & static_cast<int>(product > kTiny);
    const bool turned = !(static_cast<int>(nm > 0) & static_cast<int>(nm * nm > cosine * product));
    const bool kept = static_cast<int>(c2 < stretch * a2) & static_cast<int>(d2 < stretch * b2) & static_cast<int>(v2 < stretch * u2);
    task.suspect[i] = static_cast<int>(known) & static_cast<int>(!turned) & static_cast<int>(kept) ? 0 : 1;
  }
}

void suspectBaseline(const SuspectTask& task) { suspectKernel(task); }
FIELDDEFORM_SIMD_AVX2 void suspectAvx2(const SuspectTask& task) { suspectKernel(task); }
FIELDDEFORM_SIMD_AVX512 void suspectAvx512(const SuspectTask& task) { suspectKernel(task); }

}  // namespace

void findSuspects(const GuardEdges& edges, const GuardBounds& bounds, std::int32_t* suspect) {
  const SuspectTask task{edges, bounds, suspect};
  switch (simdLevel()) {
    case SimdLevel::Avx512: return suspectAvx512(task);
    case SimdLevel::Avx2: return suspectAvx2(task);
    case SimdLevel::Baseline: return suspectBaseline(task);
  }
}

}  // namespace fielddeform::gffd::detail
