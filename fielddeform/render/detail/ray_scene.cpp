#include <embree3/rtcore.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/render/detail/ray_scene.h>

#include <new>
#include <stdexcept>
#include <string>

namespace fielddeform::render::detail {
namespace {

using Eigen::Vector3f;
using Eigen::Vector4f;

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};

/// Embree reports by device; errors become exceptions.
void check(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_NONE) return;
  if (error == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
  throw std::runtime_error("Embree: error " + std::to_string(static_cast<int>(error)));
}

template <class T>
T* newBuffer(RTCDevice device, RTCGeometry geometry, RTCBufferType type, RTCFormat format, std::size_t count) {
  T* data = static_cast<T*>(rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(T), count));
  if (!data) {
    rtcReleaseGeometry(geometry);
    check(device);
    throw std::bad_alloc();
  }
  return data;
}

/// What shading needs of a geometry that Embree holds.
struct Part {
  enum class Kind : std::uint8_t { Triangles, Tubes, Spheres } kind;
  std::vector<Vector3f> normals, colors;
  Vector3f color;
  float hidden = 0;
};

}  // namespace

struct RayScene::Impl {
  std::unique_ptr<std::remove_pointer_t<RTCDevice>, DeviceDeleter> device;
  std::unique_ptr<std::remove_pointer_t<RTCScene>, SceneDeleter> scene;
  std::vector<Part> parts;

  void attach(RTCGeometry geometry, Part part) {
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene.get(), geometry, static_cast<unsigned>(parts.size()));
    rtcReleaseGeometry(geometry);
    check(device.get());
    parts.push_back(std::move(part));
  }

  void add(Surface surface) {
    if (surface.corners.empty()) return;
    RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* points =
        newBuffer<Vector3f>(device.get(), geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, surface.points.size());
    std::copy(surface.points.begin(), surface.points.end(), points);
    struct Triangle {
      Index v[3];
    };
    auto* triangles = newBuffer<Triangle>(device.get(), geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3,
                                          surface.corners.size() / 3);
    for (std::size_t c = 0; c < surface.corners.size(); ++c) triangles[c / 3].v[c % 3] = surface.corners[c];
    attach(geometry, {Part::Kind::Triangles, std::move(surface.normals), std::move(surface.colors), surface.color, 0});
  }

  void add(Strokes strokes) {
    if (!strokes.tubes.empty()) {
      RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
      auto* points =
          newBuffer<Vector4f>(device.get(), geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, strokes.tubes.size());
      std::copy(strokes.tubes.begin(), strokes.tubes.end(), points);
      auto* segments =
          newBuffer<Index>(device.get(), geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT, strokes.tubes.size() / 2);
      for (std::size_t i = 0; i < strokes.tubes.size() / 2; ++i) segments[i] = static_cast<Index>(2 * i);
      attach(geometry, {Part::Kind::Tubes, {}, {}, strokes.color, strokes.hidden});
    }
    if (!strokes.spheres.empty()) {
      RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_SPHERE_POINT);
      auto* points = newBuffer<Vector4f>(device.get(), geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4,
                                         strokes.spheres.size());
      std::copy(strokes.spheres.begin(), strokes.spheres.end(), points);
      attach(geometry, {Part::Kind::Spheres, {}, std::move(strokes.sphereColors), strokes.color, strokes.hidden});
    }
  }
};

RayScene::RayScene(std::vector<Surface> surfaces, std::vector<Strokes> strokes) : impl_(std::make_unique<Impl>()) {
  impl_->device.reset(rtcNewDevice(nullptr));
  if (!impl_->device) throw std::runtime_error("Embree: no device");
  impl_->scene.reset(rtcNewScene(impl_->device.get()));
  rtcSetSceneFlags(impl_->scene.get(), RTC_SCENE_FLAG_ROBUST);
  for (Surface& s : surfaces) impl_->add(std::move(s));
  for (Strokes& s : strokes) impl_->add(std::move(s));
  // A tree built by many threads may order its leaves differently from run to run, and then a ray that meets two
  // triangles at the same distance would see either one.
  const ThreadLimit serial(1);
  rtcCommitScene(impl_->scene.get());
  check(impl_->device.get());
}
RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;

bool RayScene::empty() const noexcept { return impl_->parts.empty(); }

bool RayScene::intersect(const Vector3f& origin, const Vector3f& direction, Hit& hit) const {
  if (empty()) return false;
  RTCRayHit query{};
  query.ray.org_x = origin.x(), query.ray.org_y = origin.y(), query.ray.org_z = origin.z();
  query.ray.dir_x = direction.x(), query.ray.dir_y = direction.y(), query.ray.dir_z = direction.z();
  query.ray.tfar = std::numeric_limits<float>::infinity();
  query.ray.mask = 0xFFFFFFFFu;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(impl_->scene.get(), &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;

  const Part& part = impl_->parts[query.hit.geomID];
  const std::size_t primitive = query.hit.primID;
  hit.distance = query.ray.tfar;
  hit.part = query.hit.geomID;
  hit.hidden = part.hidden;
  hit.color = part.color;
  hit.flat = Vector3f(query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z).stableNormalized();
  if (hit.flat.dot(direction) > 0) hit.flat = -hit.flat;
  hit.normal = hit.flat;
  if (part.kind == Part::Kind::Spheres && !part.colors.empty()) hit.color = part.colors[primitive];
  if (part.kind != Part::Kind::Triangles) return true;

  const float u = query.hit.u, v = query.hit.v;
  const auto mix = [&](const std::vector<Vector3f>& at) -> Vector3f {
    return (1 - u - v) * at[3 * primitive] + u * at[3 * primitive + 1] + v * at[3 * primitive + 2];
  };
  if (!part.colors.empty()) hit.color = mix(part.colors);
  const Vector3f smooth = mix(part.normals);
  if (smooth.squaredNorm() > 1e-12f) hit.normal = smooth.normalized();
  if (hit.normal.dot(hit.flat) < 0) hit.normal = -hit.normal;
  // Smoothed normals near a silhouette can look away from the eye: bend them back to just facing it.
  const float facing = hit.normal.dot(direction);
  if (facing > -0.02f) hit.normal = (hit.normal - (facing + 0.02f) * direction).normalized();
  return true;
}

bool RayScene::occluded(const Vector3f& origin, const Vector3f& direction, float reach) const {
  RTCRay ray{};
  ray.org_x = origin.x(), ray.org_y = origin.y(), ray.org_z = origin.z();
  ray.dir_x = direction.x(), ray.dir_y = direction.y(), ray.dir_z = direction.z();
  ray.tfar = reach;
  ray.mask = 0xFFFFFFFFu;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(impl_->scene.get(), &context, &ray);
  return ray.tfar < 0;
}

}  // namespace fielddeform::render::detail
