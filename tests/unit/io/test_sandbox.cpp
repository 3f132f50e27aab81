// SPDX-License-Identifier: Apache-2.0
//
// Whatever a decoder does in its process, the job gets an error of that image, and the next image
// is decoded.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <thread>

#include "io/image/write.h"
#include "io/sandbox/decoder_process.h"
#include "io/sandbox/sandboxed_decoder.h"
#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Contains;

namespace {

/// While this lives, images are decoded by the program of that name.
class Program {
 public:
  explicit Program(const char* name) {
    io::DecoderProcess::use_program(std::string(POUNCE_BUILD_DIR) + "/" + name);
  }
  ~Program() { io::DecoderProcess::use_program(std::string(POUNCE_BUILD_DIR) + "/pounce-decoder"); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
};

/// Can this machine confine a process? If not, that is said, and there is nothing to try.
bool can_confine() {
  auto process = io::DecoderProcess::take(false);
  const bool can = process != nullptr;
  io::DecoderProcess::give_back(std::move(process));
  if (!can) std::puts("SKIPPED: the sandbox (the kernel confines no process here)");
  return can;
}

mesh::ImageRef some_image(const std::string& label) {
  return test::in_memory(test::make_png(1, 1, 8, 0, false, std::string("\0\x05", 2)), label);
}

struct Outcome {
  std::string error;
  ErrorKind kind = ErrorKind::internal;
  double seconds = 0;
};

Outcome decode(const std::string& label) {
  Outcome outcome;
  const auto start = std::chrono::steady_clock::now();
  try {
    io::ImageReader reader(some_image(label), {{}, Sandbox::on});
    std::vector<std::byte> rows(16);
    reader.read_rows(4, rows.data());
  } catch (const Error& e) {
    outcome.error = e.what();
    outcome.kind = e.kind();
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  outcome.seconds = took.count();
  return outcome;
}

}  // namespace

TEST_CASE("a decoder that does harm ends as an error of its image, and no other",
          "[image][sandbox]") {
  if (!can_confine()) return;
  const Program bad("bad_decoder");
  const auto [how, what] =
      GENERATE(table<std::string, std::string>({{"open", "asked the system"},
                                                {"create", "asked the system"},
                                                {"network", "asked the system"},
                                                {"fork", "asked the system"},
                                                {"exec", "asked the system"},
                                                {"thread", "asked the system"},
                                                {"kill", "asked the system"},
                                                {"crash", "signal 11"},
                                                {"rows-crash", "signal 11"},
                                                {"abort", "signal 6"},
                                                {"end", "ended with status 0"},
                                                {"allocate", "more memory"},
                                                {"refuse", "refuse: the file is damaged"},
                                                {"too-wide", "70000 x 70000"},
                                                {"no-channels", "its decoder"}}));
  CAPTURE(how);
  const Outcome outcome = decode(how);
  CHECK_THAT(outcome.error, Contains(how) && Contains(what));
  CHECK(outcome.kind == ErrorKind::input);
  CHECK(outcome.seconds < 5);
  CHECK(!std::filesystem::exists("/tmp/pounce-bad-decoder"));
  CHECK(decode("well").error.empty());
}

TEST_CASE("a decoder that does not come to an end is ended", "[image][sandbox]") {
  if (!can_confine()) return;
  const Program bad("bad_decoder");
  const std::string how = GENERATE("loop", "rows-loop");
  const Outcome outcome = decode(how);
  CHECK_THAT(outcome.error, Contains(how) && Contains("does not come to an end"));
  CHECK(outcome.kind == ErrorKind::input);
  CHECK(outcome.seconds > 15);
  CHECK(outcome.seconds < 120);
}

TEST_CASE("samples and facts are those of a decoder in this process", "[image][sandbox]") {
  if (!can_confine()) return;
  const test::TempFolder folder;
  const auto [ending, depth] = GENERATE(table<std::string, Depth>({{".png", Depth::u16},
                                                                   {".jpg", Depth::u8},
                                                                   {".tif", Depth::float32},
                                                                   {".exr", Depth::half}}));
  CAPTURE(ending);
  const std::string path = folder.file("a" + ending);
  {
    io::ImageWriteSpec spec{70, 900, 3, depth, depth >= Depth::half, false};
    spec.chromaticities = kRec709;
    io::ImageWriter writer(path, spec);
    std::vector<std::byte> row(std::size_t{70} * 3 * 4);
    for (std::uint32_t y = 0; y < 900; ++y) {
      for (std::size_t i = 0; i < row.size(); ++i)
        row[i] = static_cast<std::byte>((i * 5 + y) % 60);
      writer.write_rows(1, row.data());
    }
    writer.commit();
  }
  const auto read = [&](Sandbox sandbox, std::uint32_t strip) {
    io::ImageReader reader(path, {{}, sandbox});
    std::vector<std::byte> rows(reader.row_bytes() * 900);
    for (std::uint32_t y = 0; y < 900; y += strip)
      reader.read_rows(std::min(strip, 900 - y), rows.data() + y * reader.row_bytes());
    return std::tuple(rows, reader.info().names, reader.info().colours.primaries,
                      reader.info().levels, reader.info().linear);
  };
  CHECK(read(Sandbox::on, 900) == read(Sandbox::off, 7));
  CHECK(read(Sandbox::on, 13) == read(Sandbox::off, 900));
}

TEST_CASE("several images at once have a process each", "[image][sandbox]") {
  if (!can_confine()) return;
  const test::TempFolder folder;
  const std::string path = folder.file("a.png");
  test::write_file(path, test::make_png(2, 2, 8, 0, false, std::string("\0\1\2\0\3\4", 6)));
  std::vector<std::vector<std::byte>> all(6, std::vector<std::byte>(4));
  std::vector<std::thread> threads;
  for (auto& rows : all) {
    threads.emplace_back([&] {
      for (int i = 0; i < 20; ++i) {
        io::ImageReader reader(path, {{}, Sandbox::on});
        reader.read_rows(1, rows.data());
        reader.read_rows(1, rows.data() + 2);
      }
    });
  }
  for (auto& thread : threads) thread.join();
  for (const auto& rows : all)
    CHECK(rows == std::vector<std::byte>{std::byte{1}, std::byte{2}, std::byte{3}, std::byte{4}});
}

TEST_CASE("without the program images are decoded here, unless that is not wanted",
          "[image][sandbox]") {
  const Program none("no-such-program");
  const test::TempFolder folder;
  io::ImageWriter writer(folder.file("a.exr"), {1, 1, 1, Depth::half, true, false});
  writer.write_rows(1, std::vector<std::byte>(2).data());
  writer.commit();
  CHECK(io::ImageReader(folder.file("a.exr")).info().width == 1);
  CHECK_THROWS_WITH(io::ImageReader(folder.file("a.exr"), {{}, Sandbox::on}),
                    Contains("--sandbox on") && Contains("pounce-decoder"));
}
