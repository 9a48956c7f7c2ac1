#include <fielddeform/core/parallel.h>
#include <fielddeform/core/rounding.h>
#include <fielddeform/mesh/detail/triangle.h>
#include <fielddeform/mesh/measures.h>
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace fielddeform::mesh {
namespace {

constexpr std::size_t kGrain = 4096;

/// Brings points to a box of about unit size around 0. The scale is a power of two, so that nothing is rounded by it,
/// and sums neither overflow nor depend on the model's units.
class UnitFrame {
 public:
  explicit UnitFrame(Points positions) {
    const Box box = boundingBox(positions);
    if (box.isEmpty()) return;
    const double largest = std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff());
    const int outer = largest > 0 ? std::ilogb(largest) + 1 : 0;
    const Vec3 size = scaled(box.max(), -outer) - scaled(box.min(), -outer);
    exponent_ = size.maxCoeff() > 0 ? outer + std::ilogb(size.maxCoeff()) + 1 : outer;
    centre_ = 0.5 * (scaled(box.min(), -outer) + scaled(box.max(), -outer));
    centre_ = scaled(centre_, outer - exponent_);
    factor_ = std::ldexp(1.0, -exponent_);
    direct_ = std::isnormal(factor_);
  }
  Vec3 operator()(const Vec3& p) const {
    return direct_ ? Vec3(p * factor_ - centre_) : Vec3(scaled(p, -exponent_) - centre_);
  }
  Vec3 back(const Vec3& p) const { return scaled(p + centre_, exponent_); }
  double back(double value, int power) const { return std::ldexp(value, power * exponent_); }

 private:
  static Vec3 scaled(const Vec3& p, int e) { return {std::ldexp(p.x(), e), std::ldexp(p.y(), e), std::ldexp(p.z(), e)}; }

  Vec3 centre_ = Vec3::Zero();
  int exponent_ = 0;
  double factor_ = 1;
  bool direct_ = true;
};

void checkCount(const Mesh& mesh, Points positions) {
  if (positions.size() != mesh.vertexCount())
    throw std::invalid_argument(fmt::format("{} positions, expected {}", positions.size(), mesh.vertexCount()));
}

bool faceIsFinite(const Mesh& mesh, Points positions, std::size_t f) {
  for (const Index v : mesh.face(f))
    if (!positions[v].allFinite()) return false;
  return true;
}

/// Sum of term(a, b, c) over the triangles of all finite faces; point(v) gives the position to use.
template <class Value, class Point, class Term>
Value sumTriangles(const Mesh& mesh, Points positions, Value zero, Point&& point, Term&& term) {
  return deterministicReduce(
      mesh.faceCount(), kGrain, zero,
      [&](std::size_t begin, std::size_t end) {
        Value sum = zero;
        for (std::size_t f = begin; f < end; ++f)
          if (faceIsFinite(mesh, positions, f))
            mesh.forEachTriangle(f, [&](Index a, Index b, Index c) { sum += term(point(a), point(b), point(c)); });
        return sum;
      },
      [](const Value& a, const Value& b) { return Value(a + b); });
}

double triangleArea(const Vec3& a, const Vec3& b, const Vec3& c) { return 0.5 * detail::areaVector(a, b, c).norm(); }
double sixthVolume(const Vec3& a, const Vec3& b, const Vec3& c) { return a.dot(b.cross(c)) / 6; }

Vec3 toFloat(const Vec3& p) { return {roundToFloat(p.x()), roundToFloat(p.y()), roundToFloat(p.z())}; }

/// Mean and covariance of the finite points, in the frame's units: what stands in for a surface without area.
void pointMoments(Points positions, const UnitFrame& frame, Vec3& mean, Mat3& covariance) {
  std::size_t count = 0;
  Vec3 sum = Vec3::Zero();
  for (const Vec3& p : positions)
    if (p.allFinite()) sum += frame(p), ++count;
  if (count == 0) return;
  mean = sum / static_cast<double>(count);
  for (const Vec3& p : positions)
    if (p.allFinite()) covariance += (frame(p) - mean) * (frame(p) - mean).transpose();
  covariance /= static_cast<double>(count);
}

std::string whyNoVolume(const EdgeCounts& edges) {
  std::string why;
  const auto say = [&](std::size_t count, const char* what) {
    if (count) why += fmt::format("{}{} {}{}", why.empty() ? "" : ", ", count, what, count == 1 ? "" : "s");
  };
  if (edges.edges == 0) return "no faces";
  say(edges.boundary, "boundary edge");
  say(edges.open - edges.boundary, "open non-manifold edge");
  say(edges.inconsistent, "inconsistently oriented edge");
  return why;
}

MaybeVolume volumeOf(const Mesh& mesh, Points positions, const EdgeCounts& edges, bool rounded) {
  checkCount(mesh, positions);
  if (std::string why = whyNoVolume(edges); !why.empty()) return {std::nullopt, std::move(why)};
  const std::size_t bad = deterministicReduce(
      mesh.faceCount(), kGrain, std::size_t{0},
      [&](std::size_t begin, std::size_t end) {
        std::size_t count = 0;
        for (std::size_t f = begin; f < end; ++f) count += !faceIsFinite(mesh, positions, f);
        return count;
      },
      std::plus<>());
  if (bad) return {std::nullopt, fmt::format("{} face{} with non-finite coordinates", bad, bad == 1 ? "" : "s")};
  const UnitFrame frame(positions);
  const double sum = sumTriangles(
      mesh, positions, 0.0, [&](Index v) { return frame(rounded ? toFloat(positions[v]) : positions[v]); }, sixthVolume);
  const double value = frame.back(sum, 3);
  if (!std::isfinite(value)) return {std::nullopt, "too large for a double"};
  return {value, {}};
}

}  // namespace

SurfaceMoments surfaceMoments(const Mesh& mesh, Points positions) {
  checkCount(mesh, positions);
  const UnitFrame frame(positions);
  const auto point = [&](Index v) { return frame(positions[v]); };
  using Vec4 = Eigen::Vector4d;
  const Vec4 first = sumTriangles(mesh, positions, Vec4(Vec4::Zero()), point, [](const Vec3& a, const Vec3& b, const Vec3& c) {
    const double s = triangleArea(a, b, c);
    return Vec4((a + b + c).homogeneous().cwiseProduct(Vec4(s / 3, s / 3, s / 3, s)));
  });
  SurfaceMoments out;
  Vec3 mean = Vec3::Zero();
  Mat3 covariance = Mat3::Zero();
  if (first.w() > 0) {
    mean = first.head<3>() / first.w();
    // Over a triangle the mean of x x^T is (aa^T + bb^T + cc^T + ss^T) / 12 with s = a + b + c.
    covariance = sumTriangles(mesh, positions, Mat3(Mat3::Zero()), point, [&](const Vec3& a, const Vec3& b, const Vec3& c) {
      const Vec3 p = a - mean, q = b - mean, r = c - mean, s = p + q + r;
      return Mat3(triangleArea(a, b, c) / 12 *
                  (p * p.transpose() + q * q.transpose() + r * r.transpose() + s * s.transpose()));
    });
    covariance /= first.w();
  } else {
    pointMoments(positions, frame, mean, covariance);
  }
  out.area = frame.back(first.w(), 2);
  out.centroid = boundingBox(positions).isEmpty() ? mean : frame.back(mean);
  for (int i = 0; i < 9; ++i) out.covariance.data()[i] = frame.back(covariance.data()[i], 2);
  return out;
}

double area(const Mesh& mesh, Points positions) {
  checkCount(mesh, positions);
  const UnitFrame frame(positions);
  return frame.back(sumTriangles(mesh, positions, 0.0, [&](Index v) { return frame(positions[v]); }, triangleArea), 2);
}

double signedVolumeSum(const Mesh& mesh, Points positions) {
  checkCount(mesh, positions);
  const UnitFrame frame(positions);
  return frame.back(sumTriangles(mesh, positions, 0.0, [&](Index v) { return frame(positions[v]); }, sixthVolume), 3);
}

MaybeVolume volume(const Mesh& mesh, Points positions, const EdgeCounts& edges) {
  return volumeOf(mesh, positions, edges, false);
}

MaybeVolume volume(const Mesh& mesh, Points positions) {
  return volume(mesh, positions, countEdges(EdgeTable(mesh)));
}

std::vector<Vec3> asWritten(const Mesh& mesh, Points positions) {
  std::vector<Vec3> out(positions.begin(), positions.end());
  if (mesh.positionType() == ScalarType::Float32)
    for (Vec3& p : out) p = toFloat(p);
  return out;
}

MaybeVolume volumeAsWritten(const Mesh& mesh, Points positions, const EdgeCounts& edges) {
  return volumeOf(mesh, positions, edges, mesh.positionType() == ScalarType::Float32);
}

std::vector<ComponentMeasures> componentMeasures(const Mesh& mesh, Points positions, const Components& components) {
  checkCount(mesh, positions);
  const UnitFrame frame(positions);
  const std::size_t count = components.count();
  std::vector<ComponentMeasures> out(count);
  // Each component is centred on one of its own vertices: far from the others, the common centre would cost digits.
  std::vector<Vec3> origin(count);
  std::vector<double> sum(count, 0.0);
  std::vector<std::size_t> bad(count, 0);
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    const Index c = components.ofFace[f];
    if (c == kNoIndex) continue;
    ComponentMeasures& m = out[c];
    ++m.faces;
    if (!faceIsFinite(mesh, positions, f)) {
      ++bad[c];
      continue;
    }
    if (m.faces - bad[c] == 1) origin[c] = frame(positions[mesh.face(f)[0]]);
    mesh.forEachTriangle(f, [&](Index i, Index j, Index k) {
      const Vec3 p = frame(positions[i]) - origin[c], q = frame(positions[j]) - origin[c],
                 r = frame(positions[k]) - origin[c];
      m.area += triangleArea(p, q, r);
      sum[c] += sixthVolume(p, q, r);
    });
  }
  for (std::size_t c = 0; c < count; ++c) {
    out[c].edges = components.edges[c];
    out[c].area = frame.back(out[c].area, 2);
    std::string why = whyNoVolume(out[c].edges);
    if (why.empty() && bad[c]) why = fmt::format("{} faces with non-finite coordinates", bad[c]);
    if (why.empty()) out[c].volume.value = frame.back(sum[c], 3);
    out[c].volume.reason = std::move(why);
  }
  return out;
}

}  // namespace fielddeform::mesh
