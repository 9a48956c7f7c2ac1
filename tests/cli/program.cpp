#include "program.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <sstream>

namespace fielddeform::cli_test {
namespace {

namespace fs = std::filesystem;

int start(const fs::path& folder, const std::vector<std::string>& arguments, const fs::path& out, const fs::path& err) {
  std::vector<const char*> argv{FIELDDEFORM_PROGRAM};
  for (const std::string& a : arguments) argv.push_back(a.c_str());
  argv.push_back(nullptr);
  const int pid = ::fork();
  if (pid != 0) return pid;
  const auto redirect = [](const fs::path& file, int to) {
    const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(fd, to);
  };
  redirect(out, STDOUT_FILENO);
  redirect(err, STDERR_FILENO);
  if (::chdir(folder.c_str()) == 0) ::execv(FIELDDEFORM_PROGRAM, const_cast<char**>(argv.data()));
  ::_exit(127);
}

int waitFor(int pid) {
  int status = 0;
  ::waitpid(pid, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

// Beside the scratch folders, so that a folder's listing shows the program's files alone.
fs::path captureFile(const char* which) {
  return fs::temp_directory_path() / ("fielddeform_cli_" + std::to_string(::getpid()) + which);
}

}  // namespace

Scratch::Scratch() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  path_ = fs::temp_directory_path() / ("fielddeform_" + std::string(test->test_suite_name()) + "_" + test->name() + "_" +
                                       std::to_string(::getpid()));
  fs::remove_all(path_);
  fs::create_directories(path_);
}

Scratch::~Scratch() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::vector<std::string> Scratch::files() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(path_))
    names.push_back(fs::relative(entry.path(), path_).string());
  std::sort(names.begin(), names.end());
  return names;
}

Result run(const fs::path& folder, const std::vector<std::string>& arguments) {
  const fs::path out = captureFile(".out"), err = captureFile(".err");
  Result result;
  result.code = waitFor(start(folder, arguments, out, err));
  result.out = readFile(out);
  result.err = readFile(err);
  fs::remove(out);
  fs::remove(err);
  return result;
}

Background::Background(const fs::path& folder, const std::vector<std::string>& arguments)
    : pid_(start(folder, arguments, "/dev/null", "/dev/null")) {}

Background::~Background() {
  if (pid_ > 0) interrupt(SIGKILL);
}

int Background::interrupt(int signal) {
  ::kill(pid_, signal);
  return wait();
}

int Background::wait() {
  code_ = waitFor(pid_);
  pid_ = -1;
  return code_;
}

std::string readFile(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void writeFile(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

std::string barPly(int segments) {
  std::ostringstream out;
  out << "ply\nformat ascii 1.0\ncomment a bar\nelement vertex " << 4 * (segments + 1)
      << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
         "property uchar blue\nelement face "
      << 4 * segments + 2 << "\nproperty list uchar int vertex_indices\nend_header\n";
  const int x[] = {0, 1, 1, 0}, y[] = {0, 0, 1, 1};
  for (int s = 0; s <= segments; ++s)
    for (int k = 0; k < 4; ++k)
      out << 0.25 * x[k] << ' ' << 0.25 * y[k] << ' ' << 4.0 * s / segments << " 200 " << 10 * k << " 30\n";
  for (int s = 0; s < segments; ++s)
    for (int k = 0; k < 4; ++k) {
      const int a = 4 * s + k, b = 4 * s + (k + 1) % 4;
      out << "4 " << a << ' ' << b << ' ' << b + 4 << ' ' << a + 4 << '\n';
    }
  const int last = 4 * segments;
  out << "4 3 2 1 0\n4 " << last << ' ' << last + 1 << ' ' << last + 2 << ' ' << last + 3 << '\n';
  return out.str();
}

}  // namespace fielddeform::cli_test
