#include <fielddeform/core/detail/simd.h>
#include <fielddeform/map/detail/lattice_kernel.h>

#include <algorithm>

namespace fielddeform::map::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

using fielddeform::detail::Two, fielddeform::detail::Four, fielddeform::detail::Eight;

// The vectors of each level, no wider than its registers: compilers split wider ones badly. `Wide` is for where eight
// numbers stand side by side.
struct Baseline {
  using Pack = Two;
  using Wide = Two;
};
struct Avx2 {
  using Pack = Four;
  using Wide = Four;
};
struct Avx512 {
  using Pack = Four;
  using Wide = Eight;
};

#define PACK(pointer) (*reinterpret_cast<const Pack*>(pointer))
#define PACK_OUT(pointer) (*reinterpret_cast<Pack*>(pointer))

struct WeightTask {
  std::array<const double*, 3> power, offset, sign;
  std::size_t count;
  const double* t;
  const Cell* cell;
  double* weight;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void weightsKernel(const WeightTask& task) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8, packs = 4 / lanes;
  const double* t = task.t;
  const Cell* cell = task.cell;
  double* weight = task.weight;
  for (std::size_t a = 0; a < 3; ++a) {
    Pack offset[packs], sign[packs];
    for (std::size_t k = 0; k < packs; ++k) {
      offset[k] = PACK(task.offset[a] + k * lanes);
      sign[k] = PACK(task.sign[a] + k * lanes);
    }
    const double* powers = task.power[a];
    for (std::size_t p = 0, n = task.count; p < n; ++p) {
      const double* c = powers + 16 * static_cast<std::size_t>(cell[p].piece[a]);
      for (std::size_t k = 0; k < packs; ++k, c += lanes) {
        const Pack x = offset[k] + sign[k] * t[3 * p + a];
        PACK_OUT(weight + 12 * p + 4 * a + k * lanes) = ((PACK(c + 12) * x + PACK(c + 8)) * x + PACK(c + 4)) * x + PACK(c);
      }
    }
  }
}

struct SumTask {
  const Shape& shape;
  std::size_t count;
  const Cell* cell;
  const double* weight;
  const double* in;  // values of the nodes, or of the points
  double* rows;      // scratch
  double* out;
};

// Weights of the rows of nodes along the first axis.
FIELDDEFORM_SIMD_INLINE void rowWeights(const double* wj, const double* wk, std::size_t sj, std::size_t sk, double* rows) {
  for (std::size_t k = 0; k < sk; ++k)
    for (std::size_t j = 0; j < sj; ++j) rows[k * sj + j] = wj[j] * wk[k];
}

struct Rows {
  const double* weight;
  std::size_t sj, sk, strideJ, strideK;
};

// acc += the columns of C nodes that begin at v, weighted; C = 4.
template <class L>
FIELDDEFORM_SIMD_INLINE void sumFour(const Rows& rows, const double* v, double* acc) {
  using Pack = typename L::Pack;
  using Wide = typename L::Wide;
  constexpr int lanes = sizeof(Pack) / 8, skip = sizeof(Wide) / 8, n = (12 - skip) / lanes;
  Wide first{};
  Pack rest[n] = {};
  const double* weight = rows.weight;
#pragma GCC unroll 1
  for (std::size_t k = 0; k < rows.sk; ++k, v += rows.strideK, weight += rows.sj)
    for (std::size_t j = 0; j < rows.sj; ++j) {
      const double* row = v + j * rows.strideJ;
      const double w = weight[j];
      first += *reinterpret_cast<const Wide*>(row) * w;
      for (int q = 0; q < n; ++q) rest[q] += PACK(row + skip + q * lanes) * w;
    }
  *reinterpret_cast<Wide*>(acc) = first;
  for (int q = 0; q < n; ++q) PACK_OUT(acc + skip + q * lanes) = rest[q];
}

// sum += the columns of C nodes that begin at v, weighted.
template <int C, class L>
FIELDDEFORM_SIMD_INLINE void addColumns(const Rows& rows, const double* v, const double* wi, double* sum) {
  double acc[3 * C] = {};
  if constexpr (C == 4) sumFour<L>(rows, v, acc);
  else
    for (std::size_t k = 0; k < rows.sk; ++k)
      for (std::size_t j = 0; j < rows.sj; ++j) {
        const double* row = v + k * rows.strideK + j * rows.strideJ;
        for (int e = 0; e < 3 * C; ++e) acc[e] += row[e] * rows.weight[k * rows.sj + j];
      }
  for (int e = 0; e < 3; ++e) {
    double s = acc[e] * wi[0];
    for (int i = 1; i < C; ++i) s += acc[3 * i + e] * wi[i];
    sum[e] += s;
  }
}

// Cubic: four functions on every axis, so that loops have constant lengths.
template <bool Cubic, class L>
FIELDDEFORM_SIMD_INLINE void combineKernel(const SumTask& task) {
  const Shape& s = task.shape;
  const std::size_t si = Cubic ? 4 : s.support[0], sj = Cubic ? 4 : s.support[1], sk = Cubic ? 4 : s.support[2];
  const std::size_t stride = Cubic ? 12 : s.stride, atJ = Cubic ? 4 : s.at[1], atK = Cubic ? 8 : s.at[2];
  const std::size_t strideJ = 3 * s.nodes[0], strideK = strideJ * s.nodes[1];
  double few[16];
  double* rowWeight = Cubic ? few : task.rows;
  const Rows rows{rowWeight, sj, sk, strideJ, strideK};
  for (std::size_t p = 0; p < task.count; ++p) {
    const double* w = task.weight + p * stride;
    const double* v = task.in + 3 * static_cast<std::size_t>(task.cell[p].first);
    rowWeights(w + atJ, w + atK, sj, sk, rowWeight);
    double sum[3] = {0, 0, 0};
    std::size_t i = 0;
    for (; i + 4 <= si; i += 4) addColumns<4, L>(rows, v + 3 * i, w + i, sum);
    if (si - i == 3) addColumns<3, L>(rows, v + 3 * i, w + i, sum);
    if (si - i == 2) addColumns<2, L>(rows, v + 3 * i, w + i, sum);
    if (si - i == 1) addColumns<1, L>(rows, v + 3 * i, w + i, sum);
    for (int e = 0; e < 3; ++e) task.out[3 * p + e] = sum[e];
  }
}

template <class L>
FIELDDEFORM_SIMD_INLINE void cubicKernel(const SumTask& task) { combineKernel<true, L>(task); }
template <class L>
FIELDDEFORM_SIMD_INLINE void anyKernel(const SumTask& task) { combineKernel<false, L>(task); }

template <int C, class L>
FIELDDEFORM_SIMD_INLINE void scatterColumns(const Rows& rows, double* v, const double* wi, const double* value) {
  using Pack = typename L::Pack;
  double in[3 * C];
  for (int i = 0; i < C; ++i)
    for (int e = 0; e < 3; ++e) in[3 * i + e] = value[e] * wi[i];
  for (std::size_t k = 0; k < rows.sk; ++k)
    for (std::size_t j = 0; j < rows.sj; ++j) {
      double* row = v + k * rows.strideK + j * rows.strideJ;
      const double w = rows.weight[k * rows.sj + j];
      if constexpr (C == 4)
        for (std::size_t e = 0; e < 12; e += sizeof(Pack) / 8) PACK_OUT(row + e) += PACK(in + e) * w;
      else
        for (int e = 0; e < 3 * C; ++e) row[e] += in[e] * w;
    }
}

template <class L>
FIELDDEFORM_SIMD_INLINE void scatterKernel(const SumTask& task) {
  const Shape& s = task.shape;
  const std::size_t si = s.support[0];
  const std::size_t strideJ = 3 * s.nodes[0], strideK = strideJ * s.nodes[1];
  const Rows rows{task.rows, s.support[1], s.support[2], strideJ, strideK};
  for (std::size_t p = 0; p < task.count; ++p) {
    const double* w = task.weight + p * s.stride;
    double* v = task.out + 3 * static_cast<std::size_t>(task.cell[p].first);
    const double* value = task.in + 3 * p;
    rowWeights(w + s.at[1], w + s.at[2], s.support[1], s.support[2], task.rows);
    std::size_t i = 0;
    for (; i + 4 <= si; i += 4) scatterColumns<4, L>(rows, v + 3 * i, w + i, value);
    if (si - i == 3) scatterColumns<3, L>(rows, v + 3 * i, w + i, value);
    if (si - i == 2) scatterColumns<2, L>(rows, v + 3 * i, w + i, value);
    if (si - i == 1) scatterColumns<1, L>(rows, v + 3 * i, w + i, value);
  }
}

struct AddTask {
  std::size_t count;
  const double *rest, *displacement;
  double* out;
  bool finite = true;
};

// Where nothing is added, not even the sign of a zero changes.
template <class L>
FIELDDEFORM_SIMD_INLINE void addKernel(AddTask& task) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  Pack wrong{};
  std::size_t i = 0;
  for (; i + lanes <= task.count; i += lanes) {
    const Pack x = PACK(task.rest + i), d = PACK(task.displacement + i), y = d == 0 ? x : x + d;
    PACK_OUT(task.out + i) = y;
    wrong += y - y;  // 0, or no number
  }
  double sum = 0;
  for (std::size_t k = 0; k < lanes; ++k) sum += wrong[k];
  for (; i < task.count; ++i) {
    const double y = task.displacement[i] == 0 ? task.rest[i] : task.rest[i] + task.displacement[i];
    task.out[i] = y;
    sum += y - y;
  }
  task.finite = sum == 0;
}

FIELDDEFORM_LEVELS(pieceWeights, const WeightTask, weightsKernel)
FIELDDEFORM_LEVELS(combineCubic, const SumTask, cubicKernel)
FIELDDEFORM_LEVELS(combineAny, const SumTask, anyKernel)
FIELDDEFORM_LEVELS(scatterAny, const SumTask, scatterKernel)
FIELDDEFORM_LEVELS(addAll, AddTask, addKernel)

#undef PACK
#undef PACK_OUT

}  // namespace

PieceTable::PieceTable(const std::array<AxisBasis, 3>& axes) {
  for (std::size_t a = 0; a < 3; ++a) {
    for (const AxisBasis::Piece& piece : axes[a].pieces())
      for (const auto& row : piece.power) power[a].insert(power[a].end(), row.begin(), row.end());
    for (int k = 0; k < 4; ++k) {
      const bool leftHalf = 2 * k < axes[a].degree();
      offset[a][k] = leftHalf ? 1 : 0;
      sign[a][k] = leftHalf ? -1 : 1;
    }
  }
}

Shape::Shape(const std::array<AxisBasis, 3>& axes) {
  for (std::size_t a = 0; a < 3; ++a) {
    nodes[a] = static_cast<std::size_t>(axes[a].nodes());
    support[a] = static_cast<std::size_t>(axes[a].support());
    at[a] = stride;
    stride += std::max<std::size_t>(4, support[a]);
  }
}

void pieceWeights(const PieceTable& table, std::size_t count, const Vec3* t, const Cell* cell, double* weight) {
  WeightTask task{{}, {}, {}, count, t->data(), cell, weight};
  for (std::size_t a = 0; a < 3; ++a) {
    task.power[a] = table.power[a].data();
    task.offset[a] = table.offset[a].data();
    task.sign[a] = table.sign[a].data();
  }
  pieceWeights(task);
}

void combine(const Shape& shape, std::size_t count, const Cell* cell, const double* weight, const Vec3* values, double* rows,
             Vec3* out) {
  const SumTask task{shape, count, cell, weight, values->data(), rows, out->data()};
  if (shape.support == std::array<std::size_t, 3>{4, 4, 4}) combineCubic(task);
  else combineAny(task);
}

void scatter(const Shape& shape, std::size_t count, const Cell* cell, const double* weight, const Vec3* points, double* rows,
             Vec3* sums) {
  const SumTask task{shape, count, cell, weight, points->data(), rows, sums->data()};
  scatterAny(task);
}

bool addDisplacements(std::size_t count, const Vec3* rest, const Vec3* displacement, Vec3* out) {
  AddTask task{3 * count, rest->data(), displacement->data(), out->data()};
  addAll(task);
  return task.finite;
}

}  // namespace fielddeform::map::detail
