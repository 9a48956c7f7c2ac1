#include <fielddeform/core/rigid.h>
#include <fielddeform/render/detail/framing.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::render::detail {
namespace {

constexpr double kMargin = 0.92;  // share of a cell that the object may fill

struct Basis {
  Vec3 right, up, forward;
};

std::vector<Vec3> drawnPoints(const View& view) {
  std::vector<Vec3> points;
  for (const Body& body : view.bodies) {
    const auto& positions = positionsOf(body);
    for (const Index v : drawnVertices(body)) points.push_back(positions[v]);
  }
  for (const Overlay& overlay : view.overlays) {
    for (const auto& primitive : overlay.skeleton.primitives) {
      points.insert(points.end(), primitive.points.begin(), primitive.points.end());
    }
  }
  return points;
}

/// Centre and half extent (at least 1e-300 of it) of a box, without overflow for boxes as large as doubles go.
void normaliseBy(const Box& box, ViewFrame& frame) {
  if (box.isEmpty()) return;
  frame.centre = box.min() * 0.5 + box.max() * 0.5;
  const double half = (box.max() * 0.5 - box.min() * 0.5).maxCoeff();
  frame.scale = half > 0 ? half : std::max(1.0, frame.centre.cwiseAbs().maxCoeff());
}

/// Standard deviations along x, y, z over all views, each about its own centre.
Vec3 spread(const std::vector<std::vector<Vec3>>& views, const std::vector<ViewFrame>& frames) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < views.size(); ++i) {
    Vec3 mean = Vec3::Zero(), square = Vec3::Zero();
    const double share = 1 / std::max<double>(1, static_cast<double>(views[i].size()));
    for (const Vec3& p : views[i]) mean += share * frames[i].normalised(p);
    for (const Vec3& p : views[i]) square += share * (frames[i].normalised(p) - mean).cwiseAbs2();
    sum += square;
  }
  return sum.cwiseSqrt();
}

Basis chooseBasis(const Camera& camera, const Vec3& spread) {
  double azimuth = camera.azimuth.value_or(0), elevation = camera.elevation.value_or(0);
  Vec3 up = camera.up ? Vec3(*camera.up / camera.up->cwiseAbs().maxCoeff()).normalized() : Vec3(Vec3::UnitY());
  Vec3 toCamera;
  if (camera.direction) {
    toCamera = -Vec3(*camera.direction / camera.direction->cwiseAbs().maxCoeff()).normalized();
    if (!camera.up && std::abs(toCamera.y()) > 0.999) up = Vec3(0, 0, toCamera.y() > 0 ? -1 : 1);
  } else {
    // Along the smallest extent, across the upward direction; z before x before y on near ties.
    double best = std::numeric_limits<double>::infinity(), others = best;
    for (const int axis : {2, 0, 1}) {
      if (std::abs(up[axis]) > 0.9) continue;
      if (spread[axis] < 0.8 * best) best = spread[axis], toCamera = Vec3::Unit(axis);
      others = std::min(others, spread[axis]);
    }
    const bool lowAndWide = spread.dot(up.cwiseAbs()) < 0.6 * others;
    if (!camera.azimuth) azimuth = 0.5;
    if (!camera.elevation) elevation = lowAndWide ? 1.0 : 0.35;
  }
  toCamera = Eigen::AngleAxisd(azimuth, up) * toCamera;
  Vec3 right = up.cross(toCamera);
  right = right.norm() > 1e-6 ? Vec3(right.normalized()) : anyPerpendicular(toCamera);
  toCamera = (Eigen::AngleAxisd(-elevation, right) * toCamera).normalized();
  return {right, toCamera.cross(right), -toCamera};
}

/// What a camera of direction `basis` needs to see all points: its shift sideways and its distance from the middle
/// (perspective), or the half size of the picture plane (orthographic).
struct Fit {
  double x = 0, y = 0, need = 0;
};

Fit fitPerspective(const std::vector<Vec3>& points, const ViewFrame& frame, const Basis& basis, double tanX,
                   double tanY) {
  double right = -1e300, left = -1e300, top = -1e300, bottom = -1e300, nearest = -1e300, size = 0;
  for (const Vec3& world : points) {
    const Vec3 p = frame.normalised(world);
    const double x = p.dot(basis.right), y = p.dot(basis.up), z = p.dot(basis.forward);
    right = std::max(right, x - tanX * z), left = std::max(left, -x - tanX * z);
    top = std::max(top, y - tanY * z), bottom = std::max(bottom, -y - tanY * z);
    nearest = std::max(nearest, -z), size = std::max(size, p.norm());
  }
  if (points.empty()) return {0, 0, 1 / std::min(tanX, tanY)};
  const double distance = std::max((right + left) / (2 * tanX), (top + bottom) / (2 * tanY));
  // Not inside the object's nearest part, and not on top of a single point.
  return {(right - left) / 2, (top - bottom) / 2, std::max(distance, nearest + std::max(0.25 * size, 0.05))};
}

Fit fitOrthographic(const std::vector<Vec3>& points, const ViewFrame& frame, const Basis& basis, double aspect) {
  Eigen::AlignedBox2d box;
  for (const Vec3& world : points) {
    const Vec3 p = frame.normalised(world);
    box.extend(Eigen::Vector2d(p.dot(basis.right), p.dot(basis.up)));
  }
  if (box.isEmpty()) return {0, 0, 1};
  const Eigen::Vector2d centre = box.center(), half = box.sizes() / 2;
  return {centre.x(), centre.y(), std::max({half.y(), half.x() / aspect, 0.02})};
}

/// Largest half extents across the views, as seen (normalised units).
Eigen::Vector2d seenSize(const std::vector<std::vector<Vec3>>& views, const std::vector<ViewFrame>& frames,
                         const Basis& basis) {
  Eigen::Vector2d size(0, 0);
  for (std::size_t i = 0; i < views.size(); ++i) {
    Eigen::AlignedBox2d box;
    for (const Vec3& world : views[i]) {
      const Vec3 p = frames[i].normalised(world);
      box.extend(Eigen::Vector2d(p.dot(basis.right), p.dot(basis.up)));
    }
    if (!box.isEmpty()) size = size.cwiseMax(Eigen::Vector2d(box.sizes() / 2));
  }
  if (!(size.maxCoeff() > 0)) return {1, 1};
  return size.cwiseMax(0.02 * size.maxCoeff());
}

/// Cells in rows and columns, label bands below them, the legend at the right.
void placeCells(const Picture& picture, const Eigen::Vector2d& object, Sheet& sheet) {
  const int count = static_cast<int>(std::max<std::size_t>(1, sheet.views.size()));
  const double aspect = std::clamp(object.x() / object.y(), 0.4, 2.6);
  bool legend = false, labels = false;
  for (const View& view : picture.views) {
    labels |= !view.label.empty();
    for (const Body& body : view.bodies) legend |= showsScalars(body);
  }
  const double text = std::clamp(0.0135 * picture.width, 7.0, 24.0);
  const int legendWidth = legend ? std::min(static_cast<int>(9 * text), picture.width / 3) : 0;
  const int band = labels ? static_cast<int>(std::lround(2.8 * text)) : 0;
  const int width = picture.width - legendWidth;
  const auto rowsFor = [&](int columns) { return (count + columns - 1) / columns; };
  const auto heightFor = [&](int columns) { return rowsFor(columns) * (width / (columns * aspect) + band); };
  const auto merit = [&](int columns) {
    const double holes = static_cast<double>(rowsFor(columns) * columns - count) / count;
    if (!picture.height) return -std::abs(std::log(picture.width / heightFor(columns) / 1.5)) - holes;
    const double cellHeight = static_cast<double>(*picture.height) / rowsFor(columns) - band;
    return std::min(width / (columns * object.x()), cellHeight / object.y());
  };
  int columns = std::min(picture.columns.value_or(1), count);
  if (!picture.columns) {
    for (int c = 2; c <= count; ++c) {
      if (merit(c) > merit(columns) + 1e-9) columns = c;
    }
  }
  const int rows = rowsFor(columns);
  sheet.width = picture.width;
  sheet.height =
      picture.height
          ? *picture.height
          : std::clamp(static_cast<int>(std::lround(std::min(heightFor(columns), 1.25 * picture.width))), 16, 16384);
  sheet.capitalHeight = static_cast<float>(text);
  const int cellWidth = std::max(1, width / columns), cellHeight = std::max(1, sheet.height / rows - band);
  for (std::size_t i = 0; i < sheet.views.size(); ++i) {
    const int column = static_cast<int>(i) % columns, row = static_cast<int>(i) / columns;
    sheet.views[i].cell = {column * width / columns, row * sheet.height / rows, cellWidth, cellHeight};
  }
  if (legend) sheet.legend = {width, 0, legendWidth, sheet.height};
}

void aim(ViewFrame& frame, const Camera& camera, const Basis& basis, const Fit& fit, const Eigen::Vector2d& tangents) {
  const double aspect = static_cast<double>(frame.cell.width) / frame.cell.height;
  Vec3 eye = fit.x * basis.right + fit.y * basis.up;
  if (camera.projection == Projection::Perspective) {
    eye -= fit.need * basis.forward;
    frame.halfWidth = static_cast<float>(tangents.x() / camera.zoom);
    frame.halfHeight = static_cast<float>(tangents.y() / camera.zoom);
    frame.pixel = static_cast<float>(2 * fit.need * tangents.y() / camera.zoom / frame.cell.height);
  } else {
    eye -= 4 * basis.forward;  // all points lie within sqrt(3) of the middle
    const double half = fit.need / kMargin / camera.zoom;
    frame.halfHeight = static_cast<float>(half);
    frame.halfWidth = static_cast<float>(half * aspect);
    frame.pixel = static_cast<float>(2 * half / frame.cell.height);
  }
  frame.projection = camera.projection;
  frame.eye = eye.cast<float>();
  frame.right = basis.right.cast<float>(), frame.up = basis.up.cast<float>(),
  frame.forward = basis.forward.cast<float>();
}

/// Centre and scale of every view, as the framing wants them shared.
void normalise(const std::vector<std::vector<Vec3>>& views, Framing framing, std::vector<ViewFrame>& frames) {
  Box all;
  double scale = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Box box = mesh::boundingBox(views[i]);
    normaliseBy(box, frames[i]);
    if (!box.isEmpty()) scale = std::max(scale, frames[i].scale), all.extend(box);
  }
  ViewFrame shared;
  normaliseBy(all, shared);
  for (ViewFrame& frame : frames) {
    if (framing == Framing::SameCamera) frame.centre = shared.centre, frame.scale = shared.scale;
    if (framing == Framing::SameScale && scale > 0) frame.scale = scale;
  }
}

}  // namespace

std::vector<Index> drawnVertices(const Body& body) {
  const mesh::Mesh& mesh = *body.mesh;
  const auto& positions = positionsOf(body);
  const bool onlyPoints = mesh.cornerCount() == 0 && mesh.lines().empty() && mesh.loosePoints().empty();
  std::vector<char> used(mesh.vertexCount(), onlyPoints);
  for (const Index v : mesh.corners()) used[v] = 1;
  for (const auto& line : mesh.lines()) {
    for (const Index v : line.vertices) used[v] = 1;
  }
  for (const Index v : mesh.loosePoints()) used[v] = 1;
  std::vector<Index> out;
  for (std::size_t v = 0; v < used.size(); ++v) {
    if (used[v] && positions[v].allFinite()) out.push_back(static_cast<Index>(v));
  }
  return out;
}

Sheet layOutSheet(const Picture& picture) {
  Sheet sheet;
  sheet.views.resize(picture.views.size());
  std::vector<std::vector<Vec3>> points;
  for (const View& view : picture.views) points.push_back(drawnPoints(view));
  const Camera& camera = picture.camera;
  if (camera.framing == Framing::SameCamera) {  // all see everything
    std::vector<Vec3> all;
    for (const auto& p : points) all.insert(all.end(), p.begin(), p.end());
    for (auto& p : points) p = all;
  }
  normalise(points, camera.framing, sheet.views);
  const Basis basis = chooseBasis(camera, spread(points, sheet.views));
  placeCells(picture, seenSize(points, sheet.views, basis), sheet);

  std::vector<Fit> fits;
  Eigen::Vector2d tangents(1, 1);
  double need = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ViewFrame& frame = sheet.views[i];
    const double aspect = static_cast<double>(frame.cell.width) / frame.cell.height;
    const double longer = std::tan(camera.fieldOfView / 2);
    tangents = {longer * std::min(1.0, aspect), longer * std::min(1.0, 1 / aspect)};
    fits.push_back(camera.projection == Projection::Perspective
                       ? fitPerspective(points[i], frame, basis, kMargin * tangents.x(), kMargin * tangents.y())
                       : fitOrthographic(points[i], frame, basis, aspect));
    if (!points[i].empty()) need = std::max(need, fits.back().need);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (camera.framing != Framing::Each && need > 0) fits[i].need = need;
    aim(sheet.views[i], camera, basis, fits[i], tangents);
  }
  return sheet;
}

}  // namespace fielddeform::render::detail
