// Twenty poses of one rest side by every method that keeps it: bound anew each time, and bound again from the last pose's binding.
// poses_bench [--points N] [--poses N] [--repeats N]
#include <fielddeform/core/random.h>
#include <fielddeform/field/field.h>
#include <fielddeform/map/axial.h>
#include <fielddeform/map/casteljau_skeleton.h>
#include <fielddeform/map/influence.h>
#include <fielddeform/map/skinning.h>
#include <fielddeform/map/wires.h>
#include <fielddeform/skeleton/edit.h>
#include <fmt/format.h>
#include <tests/bench/bench.h>

using namespace fielddeform;

namespace {

using Maker = std::function<std::shared_ptr<const map::SpaceMap>(const map::SkeletonMotion&)>;

skeleton::Skeleton spine() {
  skeleton::Skeleton s;
  s.primitives.emplace_back();
  s.primitives[0].name = "spine";
  s.primitives[0].radius = 1.5;
  for (int i = 0; i <= 64; ++i) s.primitives[0].points.emplace_back(0, 0, -1 + i / 32.0);
  return s;
}

}  // namespace

int main(int argc, char** argv) {
  const auto count = static_cast<std::size_t>(std::stoul(bench::option(argc, argv, "--points", bench::quick() ? "2000" : "100000")));
  const int poses = std::stoi(bench::option(argc, argv, "--poses", bench::quick() ? "3" : "20"));
  const int repeats = std::stoi(bench::option(argc, argv, "--repeats", bench::quick() ? "1" : "3"));
  const ThreadLimit one(1);
  bench::printMachine(repeats);
  std::vector<Vec3> points(count), out(count);
  for (std::size_t i = 0; i < count; ++i)
    points[i] = Vec3(uniform01(1, 3 * i) - 0.5, uniform01(1, 3 * i + 1) - 0.5, 2.4 * uniform01(1, 3 * i + 2) - 1.2);
  const skeleton::Skeleton rest = spine();
  std::vector<map::SkeletonMotion> motions;
  for (int k = 1; k <= poses; ++k) {
    const skeleton::Edit bend{"", skeleton::Bend{.spine = {.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, .angle = 1.5 * k / poses, .about = Vec3(1, 0, 0)}};
    motions.push_back(map::motionOf(skeleton::pairSkeletons(rest, skeleton::applyEdits(rest, {&bend, 1})), "bench"));
  }
  const auto field = std::make_shared<const field::Field>(rest, field::FieldOptions{});
  Progress silent;
  const auto perPose = [&](const Maker& make, bool keep) {
    return 1e9 / static_cast<double>(count) / poses * bench::measure(repeats, [&] {
             std::shared_ptr<const map::Binding> last;
             for (const map::SkeletonMotion& motion : motions) {
               const auto map = make(motion);
               last = keep ? map->bindAgain(last.get(), points) : map->bind(points);
               map->apply(*last, {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
             }
           }).cpu;
  };
  const auto line = [&](const std::string& name, const Maker& make) {
    const double anew = perPose(make, false), again = perPose(make, true);
    fmt::print("{:<34} anew {:7.0f} ns, again {:7.0f} ns a point and pose: {:.1f} times\n", name, anew, again, anew / again);
  };
  const auto zoned = [&](const Maker& make) -> Maker {
    return [make, field](const map::SkeletonMotion& m) { return std::make_shared<map::ZonedMap>(make(m), field, 0.5); };
  };
  const Maker axial = [](const auto& m) { return std::make_shared<map::AxialMap>(m); };
  const Maker lbs = [](const auto& m) { return std::make_shared<map::SkinningMap>(m); };
  const Maker dqs = [](const auto& m) { return std::make_shared<map::SkinningMap>(m, map::SkinOptions{.blend = map::SkinBlend::DualQuaternion}); };
  fmt::print("{} points, {} poses of a line of 65 points, one thread\n", count, poses);
  line("axial", axial);
  line("axial with its zone", zoned(axial));
  line("wires", [](const auto& m) { return std::make_shared<map::WireMap>(m); });
  line("lbs", lbs);
  line("lbs with its zone", zoned(lbs));
  line("dqs with its zone", zoned(dqs));
  line("casteljau", [](const auto& m) { return map::casteljauBy(m); });
  return 0;
}
