#pragma once

#include <fielddeform/map/detail/lattice_kernel.h>
#include <fielddeform/map/lattice.h>

namespace fielddeform::map::detail {

/// What becomes of a bound point.
enum class PointKind : std::uint8_t { Inside, Extended, Kept, Invalid };

struct LatticeBinding final : Binding {
  std::size_t size() const override { return points.size(); }
  bool isView() const noexcept { return t.size() != points.size(); }
  std::shared_ptr<const LatticeModel> model;
  Points points;               // those of `rest`, or the caller's: then all of what follows is empty, and found for a block at a time
  std::vector<Vec3> rest;
  std::vector<Vec3> t;         // places among the pieces, or clamped box coordinates of axes without pieces
  std::vector<Cell> cell;      // empty if there is but one
  std::vector<PointKind> kind;
  std::vector<bool> special;   // a block: has a point that is not Inside
};

/// The geometry of a lattice: everything but the displacements.
class LatticeModel {
 public:
  explicit LatticeModel(const Lattice& lattice);  // @throw std::invalid_argument

  const Lattice& lattice() const noexcept { return lattice_; }  // without displacements
  const std::vector<Vec3>& rest() const noexcept { return rest_; }
  const Shape& shape() const noexcept { return shape_; }
  bool oneCell() const noexcept { return oneCell_; }

  // Memory of one thread, for so many points at a time.
  struct Scratch {
    explicit Scratch(const LatticeModel& model, std::size_t points = kBlock);
    std::vector<double> weight, slope, rows;
    std::vector<Vec3> t;
    std::vector<Cell> cell;
    std::vector<PointKind> kind;
  };

  void bind(LatticeBinding& binding, std::size_t begin, std::size_t end) const;
  /// Weights of at most kBlock points from `begin`, a multiple of kBlock. Zero for points that are kept or invalid.
  void weights(const LatticeBinding& binding, std::size_t begin, std::size_t count, Scratch& scratch) const;
  /// The same for any points.
  void weightsOf(const LatticeBinding& binding, std::span<const Index> points, Scratch& scratch) const;
  /// Cells of the points that weights() was called for.
  const Cell* cells(const LatticeBinding& binding, std::size_t begin, const Scratch& scratch) const;
  /// Cell::first of one point.
  Index firstNode(const LatticeBinding& binding, std::size_t point) const;
  /// Weights and slopes (by box coordinates) of one point; false if it is kept or invalid.
  bool place(const Vec3& x, Cell& cell, double* weight, double* slope) const;
  /// Derivative of the sum of weighted values by box coordinates; its rows are the values' coordinates.
  Mat3 derivative(const Cell& cell, const double* weight, const double* slope, const Vec3* values) const;
  Mat3 boxDerivative() const { return toBox_ * scale_; }
  std::size_t row(const Cell& cell, std::size_t j, std::size_t k) const {
    return cell.first + shape_.nodes[0] * (j + shape_.nodes[1] * k);
  }

 private:
  Vec3 boxPoint(const Vec3& x) const { return toBox_ * ((x - lattice_.box.origin) * scale_); }
  PointKind locate(const Vec3& x, Vec3& t, Cell& cell) const;
  void weightsAt(const Vec3& t, double* weight) const;
  void extend(const Vec3& rest, double* weight) const;
  void finish(PointKind kind, const Vec3& rest, double* weight) const;
  void weightsOfView(const LatticeBinding& binding, std::size_t begin, std::size_t count, Scratch& scratch) const;

  Lattice lattice_;
  std::vector<Vec3> rest_;
  Shape shape_;
  PieceTable table_;
  bool pieces_ = false;    // every axis has (few enough) pieces
  bool oneCell_ = false;   // the same for every point
  Mat3 toBox_ = Mat3::Identity();  // of world differences times scale_, a power of two
  double scale_ = 1;
};

}  // namespace fielddeform::map::detail
