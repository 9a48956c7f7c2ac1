#include "cases.h"

#include "marching_tetrahedra.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace fielddeform::tests {
namespace {

using skeleton::Primitive;
using skeleton::PrimitiveType;
constexpr double kPi = std::numbers::pi;

double linspace(double from, double to, int count, int i) {
  return i == count - 1 ? to : from + (to - from) / (count - 1) * i;
}

template <class F>
std::vector<Vec3> transformed(Points points, F&& map) {
  std::vector<Vec3> out;
  out.reserve(points.size());
  for (const Vec3& p : points) out.push_back(map(p));
  return out;
}

void add(skeleton::Skeleton& skeleton, PrimitiveType type, std::vector<Vec3> points, double radius) {
  Primitive primitive;
  primitive.name = "primitive" + std::to_string(skeleton.primitives.size());
  primitive.type = type;
  primitive.points = std::move(points);
  primitive.radius = radius;
  skeleton.primitives.push_back(std::move(primitive));
}

/// The posed skeleton of a case whose one map moves everything.
template <class F>
skeleton::Skeleton posedBy(const skeleton::Skeleton& rest, F&& map) {
  skeleton::Skeleton posed = rest;
  for (Primitive& p : posed.primitives) p.points = map(p.points);
  return posed;
}

/// Sets skeleton and ideal by the map (points -> points) that the case stands for.
template <class F>
void poseAll(Case& c, F&& map) {
  c.posed = posedBy(c.rest, map);
  c.ideal = map(c.mesh.positions());
}

void bendCase(Case& c, double angle) {
  c.mesh = makeCapsule();
  add(c.rest, PrimitiveType::Polyline, verticalLine(33, 2), 0.6);
  poseAll(c, [&](Points p) { return bendMap(p, angle); });
}

void twistCase(Case& c, int lines, double angle) {
  c.mesh = makeCapsule({.square = 0.1});
  const double o = 0.12;
  const double offsets[4][2] = {{o, 0}, {-o, 0}, {0, o}, {0, -o}};
  for (int i = 0; i < lines; ++i) {
    add(c.rest, PrimitiveType::Polyline, verticalLine(49, 2, offsets[i][0], offsets[i][1]), 0.5);
  }
  poseAll(c, [&](Points p) { return twistMap(p, angle); });
}

void stretchCase(Case& c, double t) {
  c.mesh = makeCapsule();
  add(c.rest, PrimitiveType::Polyline, verticalLine(33, 2), 0.6);
  poseAll(c, [&](Points points) {
    return transformed(points,
                       [&](const Vec3& p) { return Vec3(p.x(), p.y(), p.z() + t * std::clamp(p.z(), -1.0, 1.0)); });
  });
}

void rigidCase(Case& c, const Vec3& rotationVector, double t) {
  c.mesh = makeCapsule();
  std::vector<Vec3> wave;
  for (int i = 0; i < 25; ++i) {
    const double z = linspace(-1, 1, 25, i);
    wave.emplace_back(0.12 * std::sin(3 * z), 0.08 * std::cos(2 * z), z);
  }
  add(c.rest, PrimitiveType::Polyline, std::move(wave), 0.7);
  add(c.rest, PrimitiveType::Points, {Vec3(0.15, 0.1, 0.4)}, 0.5);
  const double angle = rotationVector.norm();
  Mat3 turn = Mat3::Identity();
  if (angle > 0) turn = Eigen::AngleAxisd(angle * t, rotationVector / angle).toRotationMatrix();
  const Vec3 shift = t * Vec3(0.8, 0.3, 0.5);
  poseAll(c,
          [&](Points points) { return transformed(points, [&](const Vec3& p) -> Vec3 { return turn * p + shift; }); });
}

double distanceToPolyline(const std::vector<Vec3>& line, const Vec3& p) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Vec3 d = line[i + 1] - line[i];
    const double t = std::clamp((p - line[i]).dot(d) / d.squaredNorm(), 0.0, 1.0);
    best = std::min(best, (line[i] + t * d - p).norm());
  }
  return best;
}

/// Pseudo-distance of the exponential blend with k = 4 and one radius, extended beyond it.
double pseudoDistance(const skeleton::Skeleton& skeleton, double radius, const Vec3& p) {
  const double k = 4;
  double sum = 0, nearest = std::numeric_limits<double>::infinity();
  for (const Primitive& primitive : skeleton.primitives) {
    const double x = k * distanceToPolyline(primitive.points, p) / radius;
    if (x < k) sum += std::exp(-x) - std::exp(-k);
    nearest = std::min(nearest, x);
  }
  return radius / k * (sum > 0 ? -std::log(sum + std::exp(-k)) : nearest);
}

std::vector<Vec3> branchLine(double angle) {
  std::vector<Vec3> line;
  for (int i = 0; i < 17; ++i) {
    const double s = linspace(0, 1, 17, i);
    line.emplace_back(s * std::sin(angle), 0, s * std::cos(angle));
  }
  return line;
}

void branchCase(Case& c, double t) {
  std::vector<Vec3> trunk;
  for (int i = 0; i < 17; ++i) trunk.emplace_back(0, 0, linspace(-1, 0, 17, i));
  add(c.rest, PrimitiveType::Polyline, trunk, 0.5);
  add(c.rest, PrimitiveType::Polyline, branchLine(0.6), 0.5);
  add(c.rest, PrimitiveType::Polyline, branchLine(-0.6), 0.5);
  c.posed = c.rest;
  c.posed.primitives[2].points = branchLine(-0.6 - 0.7 * t);
  c.mesh = marchingTetrahedra(Box(Vec3(-1.4, -0.7, -1.5), Vec3(1.4, 0.7, 1.4)), 56,
                              [&](const Vec3& p) { return pseudoDistance(c.rest, 0.5, p) - 0.2; });
}

void addShell(Case& c, const mesh::Mesh& shell, double radius) {
  add(c.rest, PrimitiveType::Mesh, shell.positions(), radius);
  Primitive& primitive = c.rest.primitives.back();
  primitive.closed = true;
  for (std::size_t f = 0; f < shell.faceCount(); ++f) {
    const auto face = shell.face(f);
    primitive.faces.emplace_back(face.begin(), face.end());
  }
}

mesh::Mesh boxCage(double halfWidth, double halfLength, int rings) {
  std::vector<Vec3> points;
  std::vector<Index> corners;
  for (int i = 0; i < rings; ++i) {
    const double z = linspace(-halfLength, halfLength, rings, i);
    for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
      points.emplace_back(halfWidth * x, halfWidth * y, z);
  }
  for (Index i = 0; i + 1 < static_cast<Index>(rings); ++i) {
    for (Index j = 0; j < 4; ++j) {
      const Index a = 4 * i + j, b = 4 * i + (j + 1) % 4;
      corners.insert(corners.end(), {a, b, b + 4, a, b + 4, a + 4});
    }
  }
  const Index m = static_cast<Index>(4 * (rings - 1));
  corners.insert(corners.end(), {0, 2, 1, 0, 3, 2, m, m + 1, m + 2, m, m + 2, m + 3});
  return {std::move(points), std::move(corners)};
}

void cageCase(Case& c, double angle) {
  c.mesh = makeCapsule({.length = 1.6});
  addShell(c, boxCage(0.35, 1.2, 9), 0.4);
  poseAll(c, [&](Points p) { return bendMap(p, angle, 2.4); });
}

void lodCase(Case& c, double angle) {
  c.mesh = makeCapsule({.length = 1.6, .radius = 0.3});
  addShell(c, makeCapsule({.length = 1.6, .radius = 0.24, .around = 10, .along = 16, .bump = 0, .square = 0.1}), 0.3);
  poseAll(c, [&](Points p) { return twistMap(p, angle, 1.6); });
}

}  // namespace

const std::vector<std::string>& caseNames() {
  static const std::vector<std::string> names{"bend90",     "bend180",    "twist4_180", "twist4_360",
                                              "twist2_180", "stretch2",   "trans",      "rottrans",
                                              "branch",     "cagebend90", "lodtwist180"};
  return names;
}

Case makeCase(const std::string& name, double t) {
  Case c;
  c.name = name;
  if (name == "bend90")
    bendCase(c, kPi / 2 * t);
  else if (name == "bend180")
    bendCase(c, kPi * t);
  else if (name == "twist4_180")
    twistCase(c, 4, kPi * t);
  else if (name == "twist4_360")
    twistCase(c, 4, 2 * kPi * t);
  else if (name == "twist2_180")
    twistCase(c, 2, kPi * t);
  else if (name == "stretch2")
    stretchCase(c, t);
  else if (name == "trans")
    rigidCase(c, Vec3::Zero(), t);
  else if (name == "rottrans")
    rigidCase(c, 2.2 * Vec3(1, 0.5, 2).normalized(), t);
  else if (name == "branch")
    branchCase(c, t);
  else if (name == "cagebend90")
    cageCase(c, kPi / 2 * t);
  else if (name == "lodtwist180")
    lodCase(c, kPi * t);
  else
    throw std::invalid_argument("case: no case is named '" + name + "'");
  return c;
}

mesh::Mesh makeCapsule(const CapsuleOptions& o) {
  const double quarter = kPi * o.radius / 2, half = o.length / 2;
  std::vector<Vec3> points;
  std::vector<Index> corners;
  for (int i = 0; i < o.along; ++i) {  // rings evenly spaced along the profile's arc
    const double arc = linspace(0, 1, o.along + 2, i + 1) * (o.length + kPi * o.radius);
    double z, r;
    if (arc < quarter) {
      z = -half - o.radius * std::cos(arc / o.radius), r = o.radius * std::sin(arc / o.radius);
    } else if (arc < quarter + o.length) {
      z = -half + (arc - quarter), r = o.radius;
    } else {
      const double theta = (arc - quarter - o.length) / o.radius;
      z = half + o.radius * std::sin(theta), r = o.radius * std::cos(theta);
    }
    for (int j = 0; j < o.around; ++j) {
      const double phi = j * 2 * kPi / o.around;
      const double bumped = r * (1 + o.bump * std::sin(5 * z) * std::cos(3 * phi) + o.square * std::cos(4 * phi));
      points.emplace_back(bumped * std::cos(phi), bumped * std::sin(phi), z);
    }
  }
  const Index around = static_cast<Index>(o.around), along = static_cast<Index>(o.along);
  const auto at = [&](Index i, Index j) { return i * around + j % around; };
  for (Index i = 0; i + 1 < along; ++i) {
    for (Index j = 0; j < around; ++j) {
      corners.insert(corners.end(),
                     {at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  const Index bottom = static_cast<Index>(points.size());
  points.emplace_back(0, 0, -half - o.radius);
  points.emplace_back(0, 0, half + o.radius);
  for (Index j = 0; j < around; ++j) {
    corners.insert(corners.end(), {bottom, at(0, j + 1), at(0, j), bottom + 1, at(along - 1, j), at(along - 1, j + 1)});
  }
  return {std::move(points), std::move(corners)};
}

std::vector<Vec3> verticalLine(int count, double length, double x, double y) {
  std::vector<Vec3> line;
  for (int i = 0; i < count; ++i) line.emplace_back(x, y, linspace(-length / 2, length / 2, count, i));
  return line;
}

std::vector<Vec3> bendMap(Points points, double angle, double length) {
  const double radius = length / std::max(angle, 1e-9);
  return transformed(points, [&](const Vec3& p) {
    const double along = std::clamp(p.z(), -length / 2, length / 2), beyond = p.z() - along, theta = along / radius;
    return Vec3(radius * (1 - std::cos(theta)) + p.x() * std::cos(theta) + beyond * std::sin(theta), p.y(),
                radius * std::sin(theta) - p.x() * std::sin(theta) + beyond * std::cos(theta));
  });
}

std::vector<Vec3> twistMap(Points points, double angle, double length) {
  return transformed(points, [&](const Vec3& p) {
    const double turn = angle * std::clamp(p.z(), -length / 2, length / 2) / length, c = std::cos(turn),
                 s = std::sin(turn);
    return Vec3(c * p.x() - s * p.y(), s * p.x() + c * p.y(), p.z());
  });
}

}  // namespace fielddeform::tests
