#pragma once

#include <fielddeform/skeleton/skeleton.h>

#include <variant>

/// Edits of a skeleton as data. docs/skeleton.md has the formulas.
namespace fielddeform::skeleton {

/// The straight line that bend, twist, taper and stretch work along. Its coordinate runs from 0 to 1 over the extent of
/// the edited primitives at rest. Sections of the range [from, to] change; beyond it the space moves rigidly.
struct Spine {
  std::optional<Vec3> axis{};   ///< direction, any length > 0; absent: the rule of "auto" (principal_axes.h)
  std::optional<Vec3> pivot{};  ///< the line passes through it and its section stays; absent: at `from`, through the centroid
  double from = 0;            ///< 0 <= from < to
  double to = 1;              ///< to <= 1
};

/// The line becomes an arc of the same length, sections turn with it. [Barr 1984, centred on the spine]
struct Bend {
  Spine spine;
  std::optional<double> angle{};   ///< between the ends of the range, radians, right-handed about `about`
  std::optional<double> radius{};  ///< of the arc, world units, not 0, negative: the other way; instead of the angle
  std::optional<Vec3> about{};     ///< axis of the turn, not along the spine (made perpendicular); absent: auto
};
/// Sections turn about the line; polylines take up the turn as roll.
struct Twist {
  Spine spine;
  double angle = 0;              ///< between the ends of the range, radians, right-handed about the axis
};
/// Sections are scaled about the line, from 1 at `from` to `factor` at `to`; radii with them. The pivot's place along the
/// line has no meaning here.
struct Taper {
  Spine spine;
  double factor = 1;             ///< > 0
};
/// The range becomes `factor` times as long; sections keep their size.
struct Stretch {
  Spine spine;
  double factor = 1;             ///< > 0
};
struct Translate {
  Vec3 by = Vec3::Zero();        ///< world
};
struct Rotate {
  double angle = 0;              ///< radians, right-handed
  std::optional<Vec3> axis{};      ///< absent: auto
  std::optional<Vec3> pivot{};     ///< absent: the centroid
};
/// Scales along x, y, z. Three equal factors scale the radii, too; unequal ones leave them.
struct Scale {
  Vec3 factor = Vec3::Ones();    ///< each > 0
  std::optional<Vec3> pivot{};     ///< absent: the centroid
};
/// Moves some points of one primitive.
struct MovePoints {
  std::vector<Index> points;     ///< each at most once
  std::vector<Vec3> by;          ///< world; one for all points, or one each
};
/// Points beyond a plane are moved onto it, along its normal.
struct Press {
  Vec3 point = Vec3::Zero();     ///< on the plane, world
  Vec3 normal = Vec3::UnitZ();   ///< towards the side that is pressed away, any length > 0
  double softness = 0;           ///< world units, >= 0: points nearer to the plane than this give way gradually
};
/// Puts another primitive in one's place, under the old name. Same type and point count: its points correspond.
struct Replace {
  Primitive with;
};

struct Edit {
  std::string primitive;         ///< name; empty: all primitives together (not for MovePoints and Replace)
  std::variant<Bend, Twist, Taper, Stretch, Translate, Rotate, Scale, MovePoints, Press, Replace> operation;
};

/// The word for an edit's operation: "bend", "twist", "taper", "stretch", "translate", "rotate", "scale", "move", "press",
/// "replace".
std::string_view operationName(const Edit& edit) noexcept;

/// Fills in all that is absent (axes, pivots, the angle of a bend given by radius) from the rest skeleton.
/// @throw std::invalid_argument naming the edit and the value: unknown primitive, not finite, out of range
std::vector<Edit> resolve(const Skeleton& rest, std::span<const Edit> edits);

/// The skeleton after all edits, one after the other, each on the result of those before. Axes, pivots and extents are
/// those of the rest skeleton. Points keep their order and number, so that pairSkeletons(rest, result) matches them.
/// @throw std::invalid_argument as resolve; for a taper or uniform scale of a primitive without radius (fillRadius)
Skeleton applyEdits(const Skeleton& rest, std::span<const Edit> edits);

/// The pose at time t: 0 is the rest skeleton and 1 is applyEdits, both bit for bit; in between every edit's own parameter
/// (angle, factor, displacement) has grown in proportion.
/// @param t  in [0, 1]
Skeleton applyEditsAt(const Skeleton& rest, std::span<const Edit> edits, double t);

/// Gives every primitive without radius this one. @param radius world units, > 0
void fillRadius(Skeleton& skeleton, double radius);

/// Splits polyline segments evenly until none is longer than maxLength; roll and radii are interpolated. Used on the rest
/// skeleton, so that a straight line of two points can be bent.
/// @throw std::invalid_argument if maxLength is not > 0, or more than 10 million points would be needed
Skeleton subdivide(const Skeleton& skeleton, double maxLength);

/// One edit as a map of all space: what applyEdits does to points. Bend, Twist, Taper, Stretch, Translate, Rotate, Scale,
/// Press.
class EditMap {
 public:
  /// @param t  in [0, 1], as applyEditsAt
  /// @throw std::invalid_argument as resolve, and for MovePoints and Replace
  EditMap(const Skeleton& rest, const Edit& edit, double t = 1);

  Vec3 operator()(const Vec3& x) const;
  /// How far the section at x has turned: angle (radians) about turnAxis(). 0 for operations that do not turn.
  double turnAngle(const Vec3& x) const;
  const Vec3& turnAxis() const noexcept { return about_; }
  /// By how much the cross-section at x is scaled. 1 for operations that keep it.
  double spread(const Vec3& x) const;

 private:
  enum class Kind : std::uint8_t { Bend, Twist, Taper, Stretch, Translate, Rotate, Scale, Press };
  double along(const Vec3& x) const { return axis_.dot(x - pivot_); }
  Vec3 displacement(const Vec3& x) const;
  Vec3 bend(double s, const Vec3& across) const;
  double share(double s) const;  // of the range, between the pivot's section and that at s
  Kind kind_ = Kind::Translate;
  Vec3 pivot_ = Vec3::Zero(), axis_ = Vec3::UnitZ(), about_ = Vec3::UnitZ(), vector_ = Vec3::Zero();
  double begin_ = 0, end_ = 1;   // of the range, along the axis from the pivot, world
  double amount_ = 0, time_ = 1;
};

}  // namespace fielddeform::skeleton
