#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/core/random.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

namespace fielddeform {
namespace {

JsonDocument parse(std::string text) { return JsonDocument::parse(std::move(text), "f.json"); }

std::string messageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const IoError& e) {
    return e.what();
  }
  return "no error";
}

TEST(Json, ReadsEveryKind) {
  const JsonDocument d = parse(R"({"a": [1, -2.5e3, true, null, "x\ny\u00e9"], "b": {}, "c/~": {"d": [[], [7]]}})");
  const JsonValue root = d.root();
  std::vector<JsonValue> a;
  for (const JsonValue v : root.require("a").array()) a.push_back(v);
  ASSERT_EQ(a.size(), 5u);
  EXPECT_EQ(a[0].number(), 1);
  EXPECT_EQ(a[1].number(), -2500);
  EXPECT_TRUE(a[2].boolean());
  EXPECT_TRUE(a[3].isNull());
  EXPECT_EQ(a[4].string(), "x\ny\u00e9");
  EXPECT_EQ(root.require("b").size(), 0u);
  EXPECT_FALSE(root.find("nothing"));
  std::string keys;
  for (const JsonValue m : root.members()) keys += m.key() + "|";
  EXPECT_EQ(keys, "a|b|c/~|");
  const JsonValue d1 = *(++root.require("c/~").require("d").array().begin());
  EXPECT_EQ((*d1.array().begin()).pointer(), "/c~1~0/d/1/0");
  EXPECT_EQ(d1.text(), "[7]");
  EXPECT_EQ(root.require("c/~").text(), R"({"d": [[], [7]]})");
}

TEST(Json, KeepsTheSignOfZero) {
  const JsonDocument d = parse("[-0, -0.0, 0]");
  std::vector<double> x;
  for (const JsonValue v : d.root().array()) x.push_back(v.number());
  EXPECT_TRUE(std::signbit(x[0]));
  EXPECT_TRUE(std::signbit(x[1]));
  EXPECT_FALSE(std::signbit(x[2]));
}

TEST(Json, SyntaxErrorsGiveLineAndColumn) {
  EXPECT_TRUE(messageOf([] { parse("{\n  \"a\": [1, 2,,]\n}"); }).starts_with("f.json:2:14: ")) << messageOf([] { parse("{\n  \"a\": [1, 2,,]\n}"); });
  EXPECT_TRUE(messageOf([] { parse("[1,\n2"); }).starts_with("f.json:2:2: ")) << messageOf([] { parse("[1,\n2"); });
  EXPECT_TRUE(messageOf([] { parse(""); }).starts_with("f.json:1:1: "));
  EXPECT_TRUE(messageOf([] { parse("[1] 2"); }).starts_with("f.json:1:5: "));
  for (const char* bad : {"{", "[", "nul", "NaN", "[Infinity]", "[1e999]", "[-1e999]", "\"\x80\"", "{\"a\" 1}", "// x\n1", "[1,]", "'a'", "[01]", "\xEF\xBB\xBF", "[\"\\q\"]"})
    EXPECT_THROW(parse(bad), IoError) << bad;
}

TEST(Json, RefusesDuplicateKeysWithBothLines) {
  const std::string m = messageOf([] { parse("{\"a\": 1,\n \"b\": {\"c\": 1, \"d\": [],\n \"c\": {}}}"); });
  EXPECT_EQ(m, "f.json:3:2: the key \"c\" a second time, expected each key once (it stands in line 2)");
  EXPECT_NO_THROW(parse(R"([{"a": 1}, {"a": 1, "b": {"a": 2}}])"));
}

TEST(Json, ValueErrorsGivePointerAndLine) {
  const JsonDocument d = parse("{\"x\": [1,\n  {\"radius\": -1, \"n\": 1.5, \"word\": \"bnd\"}]}");
  const JsonValue item = *(++d.root().require("x").array().begin());
  EXPECT_EQ(messageOf([&] { item.require("radius").positive(); }), "f.json:2: /x/1/radius: -1, expected a number > 0");
  EXPECT_EQ(messageOf([&] { item.require("n").integer(0, 9); }), "f.json:2: /x/1/n: 1.5, expected a whole number from 0 to 9");
  EXPECT_EQ(messageOf([&] { item.require("word").word({"bend", "twist"}); }),
            "f.json:2: /x/1/word: \"bnd\", expected \"bend\", \"twist\"; did you mean \"bend\"?");
  EXPECT_EQ(messageOf([&] { item.require("missing"); }), "f.json:2: /x/1: no key \"missing\", expected one");
  EXPECT_EQ(messageOf([&] { item.allowKeys({"radius", "n", "words"}); }),
            "f.json:2: /x/1/word: unknown key, expected \"radius\", \"n\", \"words\"; did you mean \"words\"?");
  EXPECT_THROW(item.array(), IoError);
  EXPECT_THROW(d.root().require("x").array(3), IoError);
  EXPECT_THROW(d.root().require("x").find("a"), IoError);
  EXPECT_THROW(d.root().require("x").vec3(), IoError);
  EXPECT_THROW(d.root().number(), IoError);
}

TEST(Json, ChecksFormatAndVersion) {
  EXPECT_EQ(parse(R"({"format": "f", "version": 1})").requireFormat("f", 2), 1);
  for (const char* bad : {R"({"format": "g", "version": 1})", R"({"format": "f", "version": 3})", R"({"format": "f", "version": 0})",
                          R"({"format": "f"})", R"({"version": 1})", R"([])", R"({"format": 1, "version": 1})", R"({"format": "f", "version": 1.5})"})
    EXPECT_THROW(parse(bad).requireFormat("f", 2), IoError) << bad;
}

TEST(Json, DeepNestingNeitherRecursesNorGrowsFast) {
  const std::size_t n = 1000000;
  EXPECT_THROW(parse(std::string(n, '[')), IoError);
  const JsonDocument d = parse(std::string(n, '[') + std::string(n, ']'));
  EXPECT_EQ(d.root().text().size(), 2 * n);
}

TEST(Json, NumbersAreShortestAndReadBackTheSame) {
  EXPECT_EQ(shortestNumber(0.1), "0.1");
  EXPECT_EQ(shortestNumber(-0.0), "-0.0");
  EXPECT_EQ(shortestNumber(1e300), "1e+300");
  EXPECT_THROW(shortestNumber(std::numeric_limits<double>::quiet_NaN()), std::invalid_argument);
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const double x = std::bit_cast<double>(splitmix64(7, i));
    if (!std::isfinite(x)) continue;
    const JsonDocument d = parse(std::string(1, '[').append(shortestNumber(x)).append(1, ']'));
    EXPECT_EQ(std::bit_cast<std::uint64_t>((*d.root().array().begin()).number()), std::bit_cast<std::uint64_t>(x)) << x;
  }
}

TEST(Json, WriterOutputReadsBack) {
  JsonWriter w;
  w.beginObject().member("a", 1).member("s", "q\"\\\n\x01\xFF\u00e9").member("t", true).key("n").null();
  w.key("list").beginArray(JsonLayout::Inline).value(Vec3(1, 2.5, -3)).beginObject().member("z", std::uint64_t{9}).end().end();
  w.key("empty").beginArray().end().key("lines").beginArray().value(1).value(2).end().end();
  EXPECT_EQ(w.text(), "{\n  \"a\": 1,\n  \"s\": \"q\\\"\\\\\\n\\u0001\xEF\xBF\xBD\u00e9\",\n  \"t\": true,\n  \"n\": null,\n"
                      "  \"list\": [[1, 2.5, -3], {\"z\": 9}],\n  \"empty\": [],\n  \"lines\": [\n    1,\n    2\n  ]\n}\n");
  EXPECT_EQ(parse(w.text()).root().require("s").string(), "q\"\\\n\x01\xEF\xBF\xBD\u00e9");
}

TEST(Json, ClosestWordForgivesSmallSlipsOnly) {
  const std::vector<std::string_view> words = {"radius", "roll_deg", "rotation", "bend"};
  EXPECT_EQ(closestWord("raduis", words), "radius");
  EXPECT_EQ(closestWord("role_deg", words), "roll_deg");
  EXPECT_EQ(closestWord("bnd", words), "bend");
  EXPECT_EQ(closestWord("colour", words), "");
  EXPECT_EQ(closestWord("", words), "");
  EXPECT_EQ(closestWord("x", {}), "");
}

}  // namespace
}  // namespace fielddeform
