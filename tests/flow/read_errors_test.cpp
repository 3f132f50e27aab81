// SPDX-License-Identifier: Apache-2.0
//
// A disk that fails once, at any of a job's reads of an input, must end the job: an output that
// says another job than it is of is worse than none. This program has a pread() of its own.
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>
#include <filesystem>
#include <fstream>

#include "io/files/finished_output.h"
#include "pounce/error.h"
#include "support/test_data.h"
#include "support/transfer_job.h"

namespace {

std::atomic<ino_t> watched{0};
std::atomic<int> reads{0}, failing{-1};

}  // namespace

extern "C" ssize_t pread(int file, void* out, size_t count, off_t offset) {
  struct stat status {};
  if (watched != 0 && fstat(file, &status) == 0 && status.st_ino == watched && reads++ == failing) {
    errno = EIO;
    return -1;
  }
  return syscall(SYS_pread64, file, out, count, offset);
}

namespace pounce {
namespace {

/// Nothing where the job did its work, else what it died of.
std::string ended_by(const TransferOptions& options, const std::string& input, int read) {
  std::filesystem::remove(options.output);
  struct stat status {};
  REQUIRE(::stat(input.c_str(), &status) == 0);
  reads = 0;
  failing = read;
  watched = status.st_ino;
  std::string said;
  try {
    transfer(options);
  } catch (const Error& e) {
    said = error_kind_name(e.kind()) + std::string(": ") + e.what();
  }
  watched = 0;
  return said;
}

}  // namespace

TEST_CASE("every read of an input that fails ends the job", "[flow]") {
  const test::TempFolder folder;
  for (const char* name : {"source", "target"}) {
    std::ofstream(folder.file(name + std::string(".obj")))
        << "mtllib source.mtl\nusemtl skin\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\n"
           "vt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
  }
  std::ofstream(folder.file("source.mtl")) << "newmtl skin\nmap_Kd skin.ppm\n";
  std::ofstream(folder.file("skin.ppm"), std::ios::binary) << "P6\n2 2\n255\n"
                                                           << "abcdefghijkl";
  TransferOptions options = test::transfer_job(folder.file("source.obj"), folder.file("target.obj"),
                                               folder.file("o.png"), 64);
  options.image.size = ImageSize{16, 16};
  options.resources.threads = 1;
  options.channels.transferred = {Channel::base_color};
  transfer(options);
  const auto job = io::read_job(options.output);
  REQUIRE(job);
  for (const char* name : {"source.obj", "target.obj", "skin.ppm"}) {
    const std::string input = folder.file(name);
    REQUIRE(ended_by(options, input, -1).empty());
    const int count = reads;
    CAPTURE(name, count);
    REQUIRE(count > 0);
    for (int read = 0; read < count; ++read) {
      CAPTURE(read);
      const std::string said = ended_by(options, input, read);
      CHECK(said.starts_with("storage: "));
      CHECK(said.find(std::filesystem::path(input).filename().string()) != std::string::npos);
      CHECK_FALSE(std::filesystem::exists(options.output));
    }
  }
}

}  // namespace pounce
