#pragma once

#include <fielddeform/core/rigid.h>
#include <fielddeform/map/pointwise_map.h>
#include <fielddeform/skeleton/edit.h>

#include <optional>
#include <string>

namespace fielddeform::map {

enum class BarrKind : std::uint8_t {
  Scale,    ///< along three perpendicular axes, everywhere
  Stretch,  ///< the range becomes `factor[0]` times as long; beyond it space moves rigidly
  Taper,    ///< sections grow from 1 at `begin` to the factors at `end`, linearly; constant beyond
  Twist,    ///< sections turn about the axis
  Bend,     ///< the axis becomes an arc of the same length, sections turn with it; straight beyond
};
std::string_view toString(BarrKind kind) noexcept;  ///< "scale", "stretch", "taper", "twist", "bend"

/// What the second section axis of a taper does.
enum class TaperLaw : std::uint8_t {
  Linear,         ///< goes linearly to its own factor
  AreaPreserving  ///< is the inverse of the first at every section: areas, and so volumes, are kept exactly
};

/// One deformation of Barr 1984 in a frame of its own. With s the coordinate along `axis` from `pivot`, e1 = about,
/// e2 = axis x about; the section at s = 0 stays where it is (a taper's: keeps its plane).
struct BarrEdit {
  BarrKind kind = BarrKind::Scale;
  Vec3 pivot = Vec3::Zero();     ///< world
  Vec3 axis = Vec3::UnitZ();     ///< unit
  Vec3 about = Vec3::UnitX();    ///< unit, across the axis; a bend turns about it, right-handed
  double begin = 0, end = 1;     ///< of the range, along the axis from the pivot, world, begin < end
  double angle = 0;              ///< twist, bend: between the ends of the range, radians
  Vec3 factor = Vec3::Ones();    ///< > 0. Scale: along e1, e2, axis; taper: of e1, e2; stretch: [0]
  TaperLaw law = TaperLaw::Linear;

  /// @throw std::invalid_argument naming the field, its value and its bound
  void validate() const;
};

/// The edit of a skeleton as one of these, with all choices made; nothing for edits that are not Barr's (moved points,
/// presses, replacements, rigid motions).
/// @throw std::invalid_argument as skeleton::resolve
std::optional<BarrEdit> barrEditOf(const skeleton::Skeleton& rest, const skeleton::Edit& edit);

/// Barr's deformations as a map of space, then a rigid motion about the pivot.
///   scale, stretch, taper   diagonal in (e1, e2, axis)             det J = product of the factors
///   twist                   turn by angle u(s)                     det J = 1: volume is kept exactly
///   bend                    arc with curvature k, section e2 . c   det J = 1 - k (e2' . c) within the range
/// with u(s) the share of the range between the pivot's section and that at s. Normals go by det J J^-T (normal()).
/// [Barr, "Global and local deformations of solid primitives", 1984]
class BarrMap final : public PointwiseMap {
 public:
  /// @param turn, shift  afterwards x -> pivot + shift + turn (x - pivot)
  /// @throw std::invalid_argument
  explicit BarrMap(const BarrEdit& edit, const Quat& turn = Quat::Identity(), const Vec3& shift = Vec3::Zero());

  const BarrEdit& edit() const noexcept { return edit_; }
  const Quat& turn() const noexcept { return turn_; }
  const Vec3& shift() const noexcept { return shift_; }

  Vec3 displacement(const Vec3& rest) const override;
  Mat3 jacobian(const Vec3& rest) const override;
  /// The normal of the deformed surface where `rest` had the normal n: unit length; n itself for n = 0. [Barr, eq. (2.4)]
  Vec3 normal(const Vec3& rest, const Vec3& n) const;
  /// The rest point of an image, in closed form: exact to rounding where the map is one to one (a bend: on the near side of
  /// its centre line of curvature; bends by more than a full turn take the section nearest to the range's middle).
  Vec3 inverse(const Vec3& image) const;

 private:
  double share(double s) const;
  double slope(double s) const;                       // dshare/ds
  Eigen::Vector2d growth(double s, Eigen::Vector2d* derivative) const;  // of a taper's sections
  Vec3 barr(const Vec3& from) const;                  // displacement of pivot + from, without the rigid motion
  Mat3 barrJacobian(const Vec3& from) const;
  Vec3 barrInverse(const Vec3& image) const;          // from the pivot
  Vec3 unbend(const Vec3& image) const;

  BarrEdit edit_;
  Vec3 second_ = Vec3::UnitY();  // e2 = axis x about
  Quat turn_;
  Vec3 shift_;
  bool moved_ = false;           // by turn or shift
};

}  // namespace fielddeform::map
