#pragma once

#include <fielddeform/gffd/detail/binding.h>
#include <fielddeform/gffd/evaluation.h>

#include <array>

namespace fielddeform::gffd::detail {

/// Predictions and corrections of up to kSize points that lie near one another in their order: the same bytes as
/// Stage::predict() and Stage::settle() of each, with shared searches.
class BlockSettler {
 public:
  static constexpr std::size_t kSize = 64;
  explicit BlockSettler(const Stage& stage) : stage_(stage) {}

  struct Point {
    Vec3 start;          ///< predict: at rest; settle: predicted, finite
    Value value;
    double weight = 1;   ///< that the falloff leaves it
    std::span<const field::Foot> feet = {};  ///< predict: on the moving part's primitives, if they are known; settle: unused
  };
  /// Only where the stage has axial(). @param to  not finite where the prediction fails
  void predict(std::span<const Point> points, std::span<Vec3> to);
  void settle(std::span<const Point> points, std::span<Tracked> out);

 private:
  const Stage& stage_;
  AxialPredictor::Searches rest_;
  field::SearchHints posed_;
  std::array<Vec3, kSize> position_;
  std::array<LocalMotion, kSize> motion_;
  std::array<field::FieldValue, kSize> value_;
  std::array<Correction, kSize> correction_;
  std::array<std::uint32_t, kSize> open_;
};

/// Tracks the movable points block by block: the bytes of Stage::track() of each. The stage has axial(), the embedding cells.
void trackByBlocks(const Stage& stage, const GffdBinding& binding, map::MapOutput out, Progress& progress);

}  // namespace fielddeform::gffd::detail
