// SPDX-License-Identifier: Apache-2.0
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "io/files/output_file.h"
#include "support/test_data.h"

using namespace pounce;
namespace fs = std::filesystem;

namespace {

double seconds_of(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

void write_output(const std::string& path) {
  io::OutputFile file(path);
  std::fputs("new", file.stream());
  file.commit();
}

std::string content(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

TEST_CASE("many outputs do not list a large folder each", "[output]") {
  const test::TempFolder folder;
  for (int i = 0; i < 20000; ++i) std::ofstream(folder.file(std::to_string(i)));
  const std::string left = folder.file(".last.png.123-0.tmp");
  std::ofstream(left).put('x');
  double listing_s = 0;
  for (int i = 0; i < 3; ++i) {
    listing_s = std::max(listing_s, seconds_of([&] {
                           for (const auto& entry : fs::directory_iterator(folder.path()))
                             REQUIRE(!entry.path().filename().string().empty());
                         }));
  }
  const double outputs_s = seconds_of([&] {
    for (int i = 0; i < 200; ++i) io::OutputFile(folder.file("o" + std::to_string(i) + ".png"));
  });
  CHECK(outputs_s < 50 * listing_s);
  REQUIRE(fs::exists(left));
  io::OutputFile(folder.file("last.png"));
  CHECK(!fs::exists(left));
}

TEST_CASE("what a process left is removed whatever its mode", "[output]") {
  const test::TempFolder folder;
  const std::string left = folder.file(".o.png.123-0.tmp"), others = folder.file(".p.png.1-1.tmp");
  for (const mode_t mode : {0444U, 0600U, 0644U}) {
    std::ofstream(left).put('x');
    std::ofstream(others).put('x');
    ::chmod(left.c_str(), mode);
    // A new listing may have to wait: a folder made anew can have the number of one that was large.
    for (int i = 0; i < 500 && fs::exists(left); ++i) {
      write_output(folder.file("o.png"));
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    CHECK(!fs::exists(left));
    CHECK(fs::exists(others));
  }
}

TEST_CASE("while a file is written it does not have the mode of what it replaces", "[output]") {
  const test::TempFolder folder;
  const std::string path = folder.file("o.png");
  std::ofstream(path) << "old";
  for (const mode_t mode : {0444U, 0600U, 0664U}) {
    ::chmod(path.c_str(), mode);
    io::OutputFile file(path);
    struct stat status {};
    for (int descriptor = 3; descriptor < 64; ++descriptor) {  // its own: locked, and no name
      if (::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) && status.st_nlink == 0 &&
          status.st_size == 0)
        CHECK((status.st_mode & 07777U) == 0600);
    }
    std::fputs("new", file.stream());
    file.commit();
    REQUIRE(::stat(path.c_str(), &status) == 0);
    CHECK((status.st_mode & 07777U) == mode);
    CHECK(content(path) == "new");
  }
}

TEST_CASE("a folder that another job removes meanwhile is made again", "[output]") {
  const test::TempFolder folder;
  const std::string above = folder.file("above"), inner = above + "/inner";
  fs::create_directories(inner);  // by another job
  {
    io::OutputFile file(inner + "/o.png");
    REQUIRE(::rmdir(inner.c_str()) == 0);
    REQUIRE(::rmdir(above.c_str()) == 0);
    std::fputs("new", file.stream());
    file.commit();
  }
  CHECK(content(inner + "/o.png") == "new");
  {
    io::OutputFile file(inner + "/p.png");
    fs::remove_all(above);
  }
  CHECK(!fs::exists(above));
}
