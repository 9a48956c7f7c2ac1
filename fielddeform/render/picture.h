#pragma once

#include <fielddeform/mesh/mesh.h>
#include <fielddeform/render/color_map.h>
#include <fielddeform/render/image.h>
#include <fielddeform/skeleton/skeleton.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

/// What to draw: views side by side, seen by one camera.
namespace fielddeform::render {

inline constexpr Color kClay{0.75f, 0.735f, 0.715f};

/// A mesh in a view. Faces are drawn shaded from both sides, its lines as tubes, its loose points (a mesh without
/// faces and lines: all its points) as small spheres. Faces with a non-finite vertex are left out.
struct Body {
  std::shared_ptr<const mesh::Mesh> mesh{};
  std::vector<Vec3> positions{};  ///< #V, world, in place of the mesh's own; empty: the mesh's own
  std::optional<Color> color{};  ///< one colour; absent: scalars if given, else the mesh's "color" attribute, else clay
  std::vector<double> scalars{};  ///< #V or #F (#V if both agree), shown by Picture::scalars; NaN is drawn grey
  double creaseAngle = 0.7;       ///< radians, in [0, pi]: edges that turn by more look sharp; 0 is flat, pi is smooth
  double edgeWidth = 0;           ///< draw the edges of the faces this wide, in thousandths of the view; 0: do not
};

/// A skeleton drawn over a view: points as spheres, polylines and the edges of meshes as tubes. What lies inside or
/// behind a body shines through.
struct Overlay {
  skeleton::Skeleton skeleton{};
  Color color{0.80f, 0.20f, 0.05f};
  double thickness = 1;  ///< factor on the tubes' default radius, > 0
  double hidden = 0.75;  ///< opacity of what a body hides, in [0, 1]
};

struct View {
  std::vector<Body> bodies{};
  std::vector<Overlay> overlays{};
  std::string label{};  ///< written under the view; UTF-8 (Latin letters, digits, signs; others as a box)
};

enum class Projection : std::uint8_t { Perspective, Orthographic };

/// How the views share the camera. The direction is common to all in each case.
enum class Framing : std::uint8_t {
  SameScale,   ///< each object in the middle of its view, all at one scale: compare shapes
  SameCamera,  ///< one camera for all: compare places
  Each,        ///< each object fills its view
};

/// Automatic camera: up is y; it looks along the object's smallest extent, z before x on near ties (y only for what
/// lies flat), then turns by azimuth and elevation. Turntable angles, so that up stays up.
struct Camera {
  std::optional<Vec3> direction{};  ///< world, from the camera into the scene, any length > 0; then azimuth, elevation
                                    ///< start from it and default to 0
  std::optional<Vec3> up{};         ///< world, any length > 0
  std::optional<double>
      azimuth{};  ///< radians, the camera moves to its right (counter-clockwise from above); automatic: 0.5
  std::optional<double> elevation{};  ///< radians, the camera moves up; automatic: 0.35
  double zoom = 1;                    ///< > 1 is closer; the object fills the view at 1
  Projection projection = Projection::Perspective;
  double fieldOfView = 0.42;  ///< radians, in (0, 3), of a view's longer side; perspective only
  Framing framing = Framing::SameScale;
};

/// How numbers become colours; one legend bar at the picture's right if any body has scalars.
struct ScalarStyle {
  ColorMap map = ColorMap::Viridis;
  std::optional<double> low{}, high{};  ///< absent: the smallest and largest finite value of all views
  std::string label{};                  ///< the quantity and its unit; may be empty
};

struct Quality {
  int samples = 4;     ///< camera rays a pixel, in [1, 64]; edges take four times as many
  int ambient = 6;     ///< ambient occlusion rays per camera ray, in [0, 256]; 0: no occlusion
  int shadows = 2;     ///< shadow rays per camera ray, in [0, 64]; 0: no shadows
  bool smooth = true;  ///< filter the remaining noise within even surfaces
};

struct Picture {
  std::vector<View> views{};
  int width = 1200;              ///< pixels, in [16, 16384]
  std::optional<int> height{};   ///< pixels, in [16, 16384]; absent: what the objects' shape needs
  std::optional<int> columns{};  ///< views in a row, >= 1; absent: what shows the objects largest
  Color background{0.965f, 0.965f, 0.97f};
  Camera camera{};
  ScalarStyle scalars{};
  Quality quality{};

  /// @throw std::invalid_argument naming the field, its value and its bound
  void validate() const;
};

}  // namespace fielddeform::render
