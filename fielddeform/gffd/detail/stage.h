#pragma once

#include <fielddeform/gffd/detail/axial.h>
#include <fielddeform/gffd/detail/axial_lines.h>
#include <fielddeform/gffd/detail/correction.h>
#include <fielddeform/gffd/detail/correspondence.h>
#include <fielddeform/gffd/detail/displacement_grid.h>
#include <fielddeform/gffd/detail/lines_field.h>
#include <fielddeform/gffd/detail/mls.h>
#include <fielddeform/gffd/options.h>

#include <memory>
#include <optional>
#include <vector>

namespace fielddeform::gffd::detail {

/// What the rest skeleton alone decides; shared by every pose that moves the same primitives.
struct Embedding {
  std::shared_ptr<const field::Field> field;   ///< of the whole rest skeleton: the values that are kept
  std::shared_ptr<const field::Field> moving;  ///< of its moving part; the same object if nothing is removed; may be null
  std::vector<Index> movingIndex;              ///< the rest primitives that are not removed
  double radius = 0;                           ///< R of `field`
  std::optional<LinesField> lines;             ///< `field` by blocks, where it is of that kind
  std::optional<LinesField> movingLines;       ///< `moving` likewise, where it is another field
  bool surfaces = false;                       ///< a mesh is among its primitives
  std::optional<CellFrame> cells;              ///< of the moving part; absent where there can be none
};

/// The value a bound point keeps, in units of R, and its share of influence.
struct Value {
  double level = 0;   ///< D / R at rest
  double share = 0;   ///< s = clamp(1 - D_moving / R, 0, 1)
};

/// Points on their way through the poses, with the values that they keep: fields sampled in grids follow them.
struct Around {
  std::vector<Vec3> points;
  std::vector<Value> values;
};

/// One pose change: predictor and corrector from one skeleton to the next.
class Stage {
 public:
  /// @param around  if given, the posed field is sampled near where these points are predicted, and they move there
  Stage(const Embedding& embedding, const skeleton::SkeletonPair& pair, const Options& options, Around* around = nullptr);
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  /// The motion of space near a point, by the predictor.
  /// @param level  the point's D / R; saves a search where it alone tells that the skeleton is far
  LocalMotion motionAt(const Vec3& point, double level) const;
  /// Displacements of a block of points, to rounding those of motionAt: by vector instructions where the skeleton allows,
  /// and the same bytes with any of them and in any company. For stages with a grid.
  /// @param level  the points' D / R, negative where it is not known
  /// @param weight  what the falloff leaves each point, > 0; null: 1
  /// @param out  may be `points`
  void displacementsAt(const Block& points, std::size_t count, const double* level, const double* weight, Block& out) const;
  /// min_i |d_i| / r_i of a block of points. For stages with a grid.
  void nearnessAt(const Block& points, std::size_t count, double* out) const;
  Tracked track(const Vec3& rest, const Value& value) const;
  /// The prediction of a point whose falloff leaves it `weight`.
  Vec3 predict(const Vec3& rest, const Value& value, double weight) const;
  /// The displacement by a motion of which the falloff leaves `weight`, > 0.
  static Vec3 part(const LocalMotion& motion, double weight);
  /// Corrects a finite prediction.
  Tracked settle(const Vec3& predicted, const Value& value, double weight) const;
  /// The same, one evaluation at a time. @param here  the posed field's value at the prediction
  Correction correction(const Vec3& predicted, const field::FieldValue& here, const Value& value, double weight) const;
  /// |D - D*| at a position of a point that started at `rest`.
  double residual(const Vec3& rest, const Value& value, const Vec3& position) const;

  /// The share of the displacement that the falloff leaves a point.
  double weight(const Value& value) const;
  bool hasFalloff() const noexcept { return options_.falloff == Falloff::On && !options_.strictValue; }

  const field::Field& posedField() const noexcept { return *posed_; }
  double radius() const noexcept { return radius_; }        ///< R of the posed field
  double tolerance() const noexcept { return tolerance_; }  ///< world
  bool corrects() const noexcept { return options_.corrector; }
  /// The closest-frame predictor; null where another predicts, or a rigid motion carries all.
  const AxialPredictor* axial() const noexcept { return options_.predictor == Predictor::Axial && !rigid_ ? &*axial_ : nullptr; }
  /// The predictor's grid; null where every point is predicted by itself.
  const DisplacementGrid* grid() const noexcept { return grid_.get(); }
  /// The posed field by blocks; null if it is of another kind.
  const LinesField* lines() const noexcept { return lines_ ? &*lines_ : nullptr; }
  /// A rigid motion that carries the whole moving part to 1e-12 of its size, if there is one.
  const std::optional<Rigid>& rigid() const noexcept { return rigid_; }

 private:
  static constexpr double kNear = 0.3;  // radii: nearer than this the closest frame takes over from mls

  void samplePosed(const skeleton::Skeleton& posed, Around* around);
  void makeGrid(const Embedding& embedding, const skeleton::SkeletonPair& pair, const skeleton::SampledPair& samples,
                const skeleton::Skeleton& rest);
  void findRigid(const skeleton::SampledPair& samples, const MovingPart& part, const skeleton::SkeletonPair& pair);

  Options options_;
  std::shared_ptr<const field::Field> posed_;
  std::optional<MlsPredictor> mls_;
  std::optional<AxialPredictor> axial_;
  std::optional<AxialLines> axialLines_;
  std::optional<Rigid> rigid_;
  std::unique_ptr<const DisplacementGrid> grid_;
  std::optional<LinesField> lines_;
  double radius_ = 0;     // R of the posed field
  double tolerance_ = 0;  // world
  bool levelBoundsNearness_ = false;
};

}  // namespace fielddeform::gffd::detail
