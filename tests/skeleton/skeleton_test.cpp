#include <fielddeform/skeleton/skeleton.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace fielddeform::skeleton {
namespace {

Primitive line(std::string name, std::size_t count = 3) {
  Primitive p;
  p.name = std::move(name);
  for (std::size_t i = 0; i < count; ++i) p.points.push_back(Vec3(0, 0, static_cast<double>(i)));
  return p;
}

Skeleton skeletonOf(std::vector<Primitive> primitives) { return {std::move(primitives), {}}; }

TEST(SkeletonPairs, GoByNameThenVertexCount) {
  Primitive points = line("c");
  points.type = PrimitiveType::Points;
  const SkeletonPair pair = pairSkeletons(skeletonOf({line("a"), line("b"), line("c"), line("d")}),
                                          skeletonOf({line("e"), points, line("b", 4), line("a")}));
  ASSERT_EQ(pair.pairs.size(), 5u);
  const auto expect = [&](std::size_t i, PairKind kind, Index rest, Index posed) {
    EXPECT_EQ(toString(pair.pairs[i].kind), toString(kind)) << i;
    EXPECT_EQ(pair.pairs[i].rest, rest) << i;
    EXPECT_EQ(pair.pairs[i].posed, posed) << i;
  };
  expect(0, PairKind::Matched, 0, 3);
  expect(1, PairKind::Replaced, 1, 2);
  expect(2, PairKind::Replaced, 2, 1);
  expect(3, PairKind::Removed, 3, kNoIndex);
  expect(4, PairKind::Added, kNoIndex, 0);
}

TEST(SkeletonPairs, ExplicitPairsOverrideNames) {
  const Skeleton rest = skeletonOf({line("a"), line("b")}), posed = skeletonOf({line("a"), line("b")});
  const std::vector<NamedPair> crossed = {{"a", "b"}};
  const SkeletonPair pair = pairSkeletons(rest, posed, crossed);
  ASSERT_EQ(pair.pairs.size(), 3u);
  EXPECT_EQ(pair.pairs[0].posed, 1u);
  EXPECT_EQ(pair.pairs[1].kind, PairKind::Removed);  // its namesake is free, but "b" was given away
  EXPECT_EQ(pair.pairs[2].kind, PairKind::Added);
}

TEST(SkeletonPairs, RefuseUnknownAndRepeatedNames) {
  const Skeleton s = skeletonOf({line("a"), line("b")});
  for (const std::vector<NamedPair>& bad :
       {std::vector<NamedPair>{{"x", "a"}}, {{"a", "x"}}, {{"a", "a"}, {"a", "b"}}, {{"a", "b"}, {"b", "b"}}})
    EXPECT_THROW(pairSkeletons(s, s, bad), std::invalid_argument);
}

TEST(SkeletonValidate, AcceptsWhatIsAllowed) {
  Primitive p = line("tip", 1);
  p.type = PrimitiveType::Points;
  p.rotation = Quat(0, 1, 0, 0);
  Primitive m = line("shell");
  m.type = PrimitiveType::Mesh;
  m.faces = {{0, 1, 2}};
  Primitive l = line("spine");
  l.closed = true;
  l.radius = 2;
  l.pointRadius = {1, 2, 3};
  l.roll = {0, -7, 100};
  l.weight = 0;
  EXPECT_NO_THROW(validate(skeletonOf({p, m, l})));
}

TEST(SkeletonValidate, NamesWhatIsWrong) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const std::function<void(Primitive&)>& spoil, const std::string& word) {
    Primitive p = line("spine");
    spoil(p);
    try {
      validate(skeletonOf({p}));
      ADD_FAILURE() << "accepted: " << word;
    } catch (const std::invalid_argument& e) {
      EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
    }
  };
  refused([](Primitive& p) { p.name.clear(); }, "no name");
  refused([](Primitive& p) { p.points.resize(1); }, "1 points");
  refused([&](Primitive& p) { p.points[1].y() = nan; }, "point 1");
  refused([](Primitive& p) { p.radius = 0; }, "radius is 0");
  refused([&](Primitive& p) { p.radius = nan; }, "radius is nan");
  refused([](Primitive& p) { p.pointRadius = {1}; }, "1 point radii for 3");
  refused([](Primitive& p) { p.pointRadius = {1, 1, -1}; }, "point 2");
  refused([](Primitive& p) { p.roll = {1}; }, "1 roll angles");
  refused([&](Primitive& p) { p.roll = {1, nan, 1}; }, "point 1");
  refused([](Primitive& p) { p.weight = -1; }, "weight is -1");
  refused([](Primitive& p) { p.rotation = Quat::Identity(); }, "rotation");
  refused([](Primitive& p) { p.faces = {{0, 1, 2}}; }, "only a mesh");
  refused([](Primitive& p) { p.type = PrimitiveType::Mesh; }, "no faces");
  refused([](Primitive& p) { p.type = PrimitiveType::Mesh, p.faces = {{0, 1}}; }, "face 0 has 2");
  refused([](Primitive& p) { p.type = PrimitiveType::Mesh, p.faces = {{0, 1, 2}, {0, 1, 3}}; }, "face 1 uses point 3");
  refused([](Primitive& p) { p.type = PrimitiveType::Points, p.closed = true; }, "closed");
  refused([](Primitive& p) { p.type = PrimitiveType::Points, p.rotation = Quat(0, 0, 0, 0); }, "length 0");
  EXPECT_THROW(validate(skeletonOf({line("a"), line("a")})), std::invalid_argument);
  EXPECT_THROW(validate(Skeleton{}), std::invalid_argument);
}

TEST(Skeleton, WordsOfPotentialsReadBack) {
  for (const Potential p : {Potential::Exponential, Potential::Gaussian, Potential::Metaball, Potential::SoftObject})
    EXPECT_EQ(potentialFromString(toString(p)), p);
  EXPECT_FALSE(potentialFromString("Gaussian"));
}

}  // namespace
}  // namespace fielddeform::skeleton
