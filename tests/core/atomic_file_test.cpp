#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <gtest/gtest.h>

#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <thread>

namespace fielddeform {
namespace {

namespace fs = std::filesystem;

class AtomicFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("fielddeform-atomic-" + std::to_string(::getpid()) +
                                           testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string read(const fs::path& p) {
    std::ifstream in(p);
    std::stringstream s;
    s << in.rdbuf();
    return s.str();
  }
  std::size_t files() { return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator())); }
  fs::path folder_;
};

TEST_F(AtomicFileTest, WithoutCommitTheOldFileStaysAndNothingIsLeft) {
  writeTextFile(folder_ / "a.txt", "old");
  {
    AtomicFile file(folder_ / "a.txt");
    file.write("new");
  }
  EXPECT_EQ(read(folder_ / "a.txt"), "old");
  EXPECT_EQ(files(), 1u);
}

TEST_F(AtomicFileTest, CommitReplacesTheFile) {
  writeTextFile(folder_ / "a.txt", "old");
  writeTextFile(folder_ / "a.txt", "new");
  EXPECT_EQ(read(folder_ / "a.txt"), "new");
  EXPECT_EQ(files(), 1u);
}

TEST_F(AtomicFileTest, WritesThroughALink) {
  writeTextFile(folder_ / "a.txt", "old");
  fs::create_symlink(folder_ / "a.txt", folder_ / "link");
  writeTextFile(folder_ / "link", "new");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(read(folder_ / "a.txt"), "new");
}

TEST_F(AtomicFileTest, APipeIsWrittenThroughAndStaysAPipe) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::string got;
  std::thread reader([&] { got = read(pipe); });
  writeTextFile(pipe, "through");
  reader.join();
  EXPECT_EQ(got, "through");
  EXPECT_TRUE(fs::is_fifo(pipe));
  EXPECT_EQ(files(), 1u);
}

TEST_F(AtomicFileTest, MissingFolderIsAnErrorThatNamesTheFile) {
  try {
    AtomicFile file(folder_ / "no" / "a.txt");
    FAIL();
  } catch (const IoError& e) {
    EXPECT_NE(std::string(e.what()).find("a.txt"), std::string::npos);
  }
  EXPECT_THROW(AtomicFile{folder_}, IoError);
}

}  // namespace
}  // namespace fielddeform
