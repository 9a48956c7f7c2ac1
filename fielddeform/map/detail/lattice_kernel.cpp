#include <fielddeform/core/detail/simd.h>
#include <fielddeform/map/detail/lattice_kernel.h>

#include <algorithm>

namespace fielddeform::map::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

// Four and eight numbers at any address.
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
typedef double Eight __attribute__((vector_size(64), aligned(8), may_alias));

#define FOUR(pointer) (*reinterpret_cast<const Four*>(pointer))
#define EIGHT(pointer) (*reinterpret_cast<const Eight*>(pointer))

struct WeightTask {
  std::array<const double*, 3> power, offset, sign;
  std::size_t count;
  const double* t;
  const Cell* cell;
  double* weight;
};

FIELDDEFORM_SIMD_INLINE void weightsKernel(const WeightTask& task) {
  for (std::size_t a = 0; a < 3; ++a) {
    const Four offset = FOUR(task.offset[a]), sign = FOUR(task.sign[a]);
    for (std::size_t p = 0; p < task.count; ++p) {
      const double* c = task.power[a] + 16 * static_cast<std::size_t>(task.cell[p].piece[a]);
      const Four x = offset + sign * task.t[3 * p + a];
      *reinterpret_cast<Four*>(task.weight + 12 * p + 4 * a) = ((FOUR(c + 12) * x + FOUR(c + 8)) * x + FOUR(c + 4)) * x + FOUR(c);
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

// sum += the columns of C nodes that begin at v, weighted.
template <int C, bool Wide>
FIELDDEFORM_SIMD_INLINE void addColumns(const Rows& rows, const double* v, const double* wi, double* sum) {
  double acc[3 * C] = {};
  if constexpr (C == 4 && Wide) {
    Eight a{};
    Four b{};
    for (std::size_t k = 0; k < rows.sk; ++k)
      for (std::size_t j = 0; j < rows.sj; ++j) {
        const double* row = v + k * rows.strideK + j * rows.strideJ;
        const double w = rows.weight[k * rows.sj + j];
        a += EIGHT(row) * w;
        b += FOUR(row + 8) * w;
      }
    *reinterpret_cast<Eight*>(acc) = a;
    *reinterpret_cast<Four*>(acc + 8) = b;
  } else if constexpr (C == 4) {
    Four a{}, b{}, c{};
    for (std::size_t k = 0; k < rows.sk; ++k)
      for (std::size_t j = 0; j < rows.sj; ++j) {
        const double* row = v + k * rows.strideK + j * rows.strideJ;
        const double w = rows.weight[k * rows.sj + j];
        a += FOUR(row) * w;
        b += FOUR(row + 4) * w;
        c += FOUR(row + 8) * w;
      }
    *reinterpret_cast<Four*>(acc) = a;
    *reinterpret_cast<Four*>(acc + 4) = b;
    *reinterpret_cast<Four*>(acc + 8) = c;
  } else {
    for (std::size_t k = 0; k < rows.sk; ++k)
      for (std::size_t j = 0; j < rows.sj; ++j) {
        const double* row = v + k * rows.strideK + j * rows.strideJ;
        for (int e = 0; e < 3 * C; ++e) acc[e] += row[e] * rows.weight[k * rows.sj + j];
      }
  }
  for (int e = 0; e < 3; ++e) {
    double s = acc[e] * wi[0];
    for (int i = 1; i < C; ++i) s += acc[3 * i + e] * wi[i];
    sum[e] += s;
  }
}

// Cubic: four functions on every axis, so that loops have constant lengths.
template <bool Cubic, bool Wide>
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
    for (; i + 4 <= si; i += 4) addColumns<4, Wide>(rows, v + 3 * i, w + i, sum);
    if (si - i == 3) addColumns<3, Wide>(rows, v + 3 * i, w + i, sum);
    if (si - i == 2) addColumns<2, Wide>(rows, v + 3 * i, w + i, sum);
    if (si - i == 1) addColumns<1, Wide>(rows, v + 3 * i, w + i, sum);
    for (int e = 0; e < 3; ++e) task.out[3 * p + e] = sum[e];
  }
}

template <int C>
FIELDDEFORM_SIMD_INLINE void scatterColumns(const Rows& rows, double* v, const double* wi, const double* value) {
  double in[3 * C];
  for (int i = 0; i < C; ++i)
    for (int e = 0; e < 3; ++e) in[3 * i + e] = value[e] * wi[i];
  for (std::size_t k = 0; k < rows.sk; ++k)
    for (std::size_t j = 0; j < rows.sj; ++j) {
      double* row = v + k * rows.strideK + j * rows.strideJ;
      const double w = rows.weight[k * rows.sj + j];
      if constexpr (C == 4) {
        *reinterpret_cast<Four*>(row) = FOUR(row) + FOUR(in) * w;
        *reinterpret_cast<Four*>(row + 4) = FOUR(row + 4) + FOUR(in + 4) * w;
        *reinterpret_cast<Four*>(row + 8) = FOUR(row + 8) + FOUR(in + 8) * w;
      } else {
        for (int e = 0; e < 3 * C; ++e) row[e] += in[e] * w;
      }
    }
}

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
    for (; i + 4 <= si; i += 4) scatterColumns<4>(rows, v + 3 * i, w + i, value);
    if (si - i == 3) scatterColumns<3>(rows, v + 3 * i, w + i, value);
    if (si - i == 2) scatterColumns<2>(rows, v + 3 * i, w + i, value);
    if (si - i == 1) scatterColumns<1>(rows, v + 3 * i, w + i, value);
  }
}

#undef FOUR
#undef EIGHT

void weightsBaseline(const WeightTask& t) { weightsKernel(t); }
FIELDDEFORM_SIMD_AVX2 void weightsAvx2(const WeightTask& t) { weightsKernel(t); }
FIELDDEFORM_SIMD_AVX512 void weightsAvx512(const WeightTask& t) { weightsKernel(t); }
void cubicBaseline(const SumTask& t) { combineKernel<true, false>(t); }
FIELDDEFORM_SIMD_AVX2 void cubicAvx2(const SumTask& t) { combineKernel<true, false>(t); }
FIELDDEFORM_SIMD_AVX512 void cubicAvx512(const SumTask& t) { combineKernel<true, true>(t); }
void combineBaseline(const SumTask& t) { combineKernel<false, false>(t); }
FIELDDEFORM_SIMD_AVX2 void combineAvx2(const SumTask& t) { combineKernel<false, false>(t); }
FIELDDEFORM_SIMD_AVX512 void combineAvx512(const SumTask& t) { combineKernel<false, true>(t); }
void scatterBaseline(const SumTask& t) { scatterKernel(t); }
FIELDDEFORM_SIMD_AVX2 void scatterAvx2(const SumTask& t) { scatterKernel(t); }
FIELDDEFORM_SIMD_AVX512 void scatterAvx512(const SumTask& t) { scatterKernel(t); }

template <class Task>
void dispatch(const Task& task, void (*baseline)(const Task&), void (*avx2)(const Task&), void (*avx512)(const Task&)) {
  switch (simdLevel()) {
    case SimdLevel::Avx512: return avx512(task);
    case SimdLevel::Avx2: return avx2(task);
    case SimdLevel::Baseline: return baseline(task);
  }
}

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
  dispatch(task, weightsBaseline, weightsAvx2, weightsAvx512);
}

void combine(const Shape& shape, std::size_t count, const Cell* cell, const double* weight, const Vec3* values, double* rows,
             Vec3* out) {
  const SumTask task{shape, count, cell, weight, values->data(), rows, out->data()};
  if (shape.support == std::array<std::size_t, 3>{4, 4, 4}) dispatch(task, cubicBaseline, cubicAvx2, cubicAvx512);
  else dispatch(task, combineBaseline, combineAvx2, combineAvx512);
}

void scatter(const Shape& shape, std::size_t count, const Cell* cell, const double* weight, const Vec3* points, double* rows,
             Vec3* sums) {
  const SumTask task{shape, count, cell, weight, points->data(), rows, sums->data()};
  dispatch(task, scatterBaseline, scatterAvx2, scatterAvx512);
}

}  // namespace fielddeform::map::detail
