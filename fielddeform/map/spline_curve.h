#pragma once

#include <fielddeform/core/types.h>

#include <memory>
#include <vector>

namespace fielddeform::map {

/// The cubic B-spline curve through points, C2: natural ends (no curvature there), or periodic if closed.
/// Its parameter is given, so that a rest and a posed curve correspond; chordParameters() of the rest points is usual.
/// Immutable, safe to use from many threads.
class SplineCurve {
 public:
  /// @param points     #P by 3, at least 2 (closed: 3), finite
  /// @param parameter  #P ascending (closed: #P+1, the last where the curve comes back to points[0])
  /// @throw std::invalid_argument
  SplineCurve(Points points, bool closed, std::vector<double> parameter);
  ~SplineCurve();
  SplineCurve(SplineCurve&&) noexcept;
  SplineCurve& operator=(SplineCurve&&) noexcept;

  /// Where the polygon's points stand along it: 0, then the chords' lengths added up (closed: one more, back to the start).
  static std::vector<double> chordParameters(Points points, bool closed);

  bool closed() const noexcept { return closed_; }
  const std::vector<double>& parameter() const noexcept { return parameter_; }
  double begin() const noexcept { return parameter_.front(); }
  double end() const noexcept { return parameter_.back(); }

  struct Place {
    Vec3 point, first, second;  ///< world; derivatives by the parameter
  };
  /// @param t  clamped to the curve (closed: taken modulo its length)
  Place at(double t) const;

  struct Foot {
    double t = 0;
    bool inside = false;  ///< the curve goes on at both sides: the offset is perpendicular to it
  };
  /// The closest point of the curve: by the polygon of eight chords a span, then exactly.
  Foot closest(const Vec3& x) const;

 private:
  struct Search;
  std::size_t spanAt(double& t) const;
  std::vector<Vec3> points_, curvature_;  // one a parameter
  std::vector<double> parameter_;
  bool closed_ = false;
  std::unique_ptr<const Search> search_;
};

}  // namespace fielddeform::map
