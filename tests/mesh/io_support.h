#pragma once

#include <fielddeform/core/error.h>
#include <fielddeform/mesh/io.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

/// Helpers of the format tests.
namespace fielddeform::mesh {

inline Mesh parse(const std::string& bytes, const std::string& name, const ReadOptions& options = {},
                  ReadReport* report = nullptr) {
  // A block of exactly this size: a sanitizer sees a read behind its end, which a string's final zero would hide.
  const std::vector<char> block(bytes.begin(), bytes.end());
  return readMesh(std::span<const char>(block.data(), block.size()), name, options, report);
}

/// The message of the IoError that reading gives; empty if there is none.
inline std::string errorOf(const std::string& bytes, const std::string& name, const ReadOptions& options = {}) {
  try {
    (void)parse(bytes, name, options);
  } catch (const IoError& e) {
    return e.what();
  }
  return "";
}

/// Reads and writes in the same format.
inline std::string roundTrip(const std::string& bytes, const std::string& name, const WriteOptions& options = {}) {
  const Mesh mesh = parse(bytes, name);
  return meshBytes(mesh, *formatOf(mesh), options);
}

/// Equal in everything that a mesh holds, NaN equal to itself.
inline void expectSame(const Mesh& a, const Mesh& b) {
  ASSERT_EQ(a.vertexCount(), b.vertexCount());
  EXPECT_EQ(std::memcmp(a.positions().data(), b.positions().data(), a.vertexCount() * sizeof(Vec3)), 0);
  EXPECT_EQ(a.corners(), b.corners());
  EXPECT_EQ(a.offsets(), b.offsets());
  EXPECT_EQ(a.loosePoints(), b.loosePoints());
  ASSERT_EQ(a.lines().size(), b.lines().size());
  for (std::size_t i = 0; i < a.lines().size(); ++i) EXPECT_EQ(a.lines()[i].vertices, b.lines()[i].vertices);
  ASSERT_EQ(a.attributes().size(), b.attributes().size());
  for (std::size_t i = 0; i < a.attributes().size(); ++i) {
    const Attribute &x = a.attributes()[i], &y = b.attributes()[i];
    EXPECT_EQ(x.name, y.name);
    EXPECT_EQ(x.on, y.on);
    EXPECT_EQ(x.width, y.width);
    EXPECT_EQ(x.onSplit, y.onSplit);
    EXPECT_EQ(x.indices, y.indices);
    EXPECT_EQ(x.listOffsets, y.listOffsets);
    EXPECT_EQ(x.data.index(), y.data.index());
    EXPECT_TRUE(x.data == y.data) << x.name;
  }
}

/// A folder with in/ and out/deep/, gone at the end.
class Folder {
 public:
  Folder() : path_(std::filesystem::path(testing::TempDir()) / ("formats_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(path_ / "in");
    std::filesystem::create_directories(path_ / "out" / "deep");
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  void put(const std::string& name, const std::string& text) const { std::ofstream(path_ / name) << text; }
  std::string get(const std::string& name) const {
    std::ifstream in(path_ / name);
    return {std::istreambuf_iterator<char>(in), {}};
  }

 private:
  std::filesystem::path path_;
};

/// Bytes of a scalar, in either order.
template <class T>
std::string bytesOf(T value, bool big = false) {
  std::string s(sizeof(T), '\0');
  std::memcpy(s.data(), &value, sizeof(T));
  return big ? std::string(s.rbegin(), s.rend()) : s;
}

}  // namespace fielddeform::mesh
