// SPDX-License-Identifier: Apache-2.0
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <thread>

#include "core/portable_math.h"
#include "io/codec/sample.h"
#include "io/files/output_file.h"
#include "io/image/write.h"
#include "pounce/error.h"
#include "support/failing_file_system.h"
#include "support/memory_file_system.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Matchers::Contains;
using io::ImageWriter;
using io::ImageWriteSpec;

namespace {

/// Samples of any depth, alpha never 0 so that EXR's premultiplied colours come back.
std::vector<std::uint8_t> make_samples(const ImageWriteSpec& spec) {
  std::vector<std::uint8_t> bytes;
  std::uint32_t state = 5;
  for (std::size_t i = 0; i < std::size_t{spec.width} * spec.height * spec.channels; ++i) {
    state = state * 1664525U + 1013904223U;
    const std::uint32_t n = 1 + (state >> 17);
    std::uint8_t out[4] = {};
    const float value = static_cast<float>(n) / 32768;
    const half value_half(value);
    const auto as_u16 = static_cast<std::uint16_t>(n * 2 - 1);
    if (spec.depth == Depth::u8) out[0] = static_cast<std::uint8_t>(n >> 7);
    if (spec.depth == Depth::u16) std::memcpy(out, &as_u16, 2);
    if (spec.depth == Depth::half) std::memcpy(out, &value_half, 2);
    if (spec.depth == Depth::float32) std::memcpy(out, &value, 4);
    bytes.insert(bytes.end(), out, out + io::sample_bytes(spec.depth));
  }
  return bytes;
}

void write(const std::string& path, const ImageWriteSpec& spec,
           const std::vector<std::uint8_t>& samples, std::uint32_t strip = 13) {
  ImageWriter writer(path, spec);
  const std::size_t row = samples.size() / spec.height;
  for (std::uint32_t y = 0; y < spec.height; y += strip) {
    writer.write_rows(std::min(strip, spec.height - y),
                      reinterpret_cast<const std::byte*>(samples.data()) + y * row);
  }
  writer.commit();
}

template <class Work>
std::string failure(ErrorKind kind, const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    CHECK(error.kind() == kind);
    return error.what();
  }
  return "written";
}

std::string failure_of(const std::string& path, ErrorKind kind) {
  return failure(kind, [&] {
    write(path, {8, 8, 3, Depth::u8, false, false}, std::vector<std::uint8_t>(192));
  });
}

std::size_t files_in(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

}  // namespace

TEST_CASE("what is written is read back, sample for sample, in every lossless format",
          "[image][write]") {
  const auto [ending, depth] = GENERATE(table<std::string, Depth>({{".png", Depth::u8},
                                                                   {".png", Depth::u16},
                                                                   {".tif", Depth::u8},
                                                                   {".tiff", Depth::u16},
                                                                   {".TIF", Depth::float32},
                                                                   {".exr", Depth::half},
                                                                   {".exr", Depth::float32}}));
  const std::uint32_t channels = GENERATE(1U, 2U, 3U, 4U);
  CAPTURE(ending, depth_name(depth), channels);
  test::TempFolder folder;
  const ImageWriteSpec spec{53, 37, channels, depth, depth >= Depth::half, channels % 2 == 0};
  const auto samples = make_samples(spec);
  const std::string path = folder.file("a" + ending);
  write(path, spec, samples);
  CHECK(files_in(folder.path()) == 1);

  const io::ImageReader reader(path);
  CHECK(reader.info().width == 53);
  CHECK(reader.info().height == 37);
  CHECK(reader.info().channels == channels);
  CHECK(reader.info().depth == depth);
  CHECK(reader.info().has_alpha == spec.has_alpha);
  CHECK(reader.info().linear == spec.linear);
  const auto read = test::read_all(test::at_path(path), 5);
  if (ending == ".exr" && spec.has_alpha) {
    // Multiplied and divided by alpha: two roundings.
    std::vector<double> before(samples.size() / io::sample_bytes(depth)), after(before.size());
    io::samples_to_double(depth, before.size(), reinterpret_cast<const std::byte*>(samples.data()),
                          before.data());
    io::samples_to_double(depth, after.size(), reinterpret_cast<const std::byte*>(read.data()),
                          after.data());
    const double step = depth == Depth::half ? 1.0 / 1024 : 1.0 / (1 << 23);
    double worst = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      // Products below the smallest normal half lose more.
      const double alpha = before[i / channels * channels + channels - 1];
      const double grain =
          std::max(before[i] * step, depth == Depth::half ? std::ldexp(1, -24) / alpha : 0);
      worst = std::max(worst, std::abs(before[i] - after[i]) / grain);
    }
    CHECK(worst <= 1.5);
  } else {
    CHECK(read == samples);
  }
}

TEST_CASE("a JPEG keeps full colour resolution at quality 95", "[image][write]") {
  // Red and blue columns of one texel each: with halved colour resolution they would be one purple.
  test::TempFolder folder;
  std::vector<std::uint8_t> samples;
  for (int i = 0; i < 32 * 32; ++i) {
    const bool red = i % 2 == 0;
    samples.insert(samples.end(), {static_cast<std::uint8_t>(red ? 200 : 40), 60,
                                   static_cast<std::uint8_t>(red ? 40 : 200)});
  }
  write(folder.file("a.jpg"), {32, 32, 3, Depth::u8, false, false}, samples);
  const auto read = test::read_all(test::at_path(folder.file("a.jpg")));
  int worst = 0;
  for (std::size_t i = 0; i < samples.size(); ++i)
    worst = std::max(worst, std::abs(int{samples[i]} - int{read[i]}));
  CHECK(worst <= 12);
}

TEST_CASE(
    "the same samples give the same bytes at another time, by other strips, under another name",
    "[image][write]") {
  test::TempFolder first, second;
  const auto [ending, depth] = GENERATE(table<std::string, Depth>(
      {{".png", Depth::u16}, {".jpg", Depth::u8}, {".tif", Depth::u8}, {".exr", Depth::half}}));
  CAPTURE(ending);
  const ImageWriteSpec spec{64, 50, 3, depth, depth >= Depth::half, false};
  const auto samples = make_samples(spec);
  write(first.file("a" + ending), spec, samples, 50);
  std::this_thread::sleep_for(
      std::chrono::milliseconds(1100));  // the formats' clocks tick in seconds
  write(second.file("other" + ending), spec, samples, 3);
  CHECK(test::read_file(first.file("a" + ending)) ==
        test::read_file(second.file("other" + ending)));
}

TEST_CASE("without commit nothing appears and what was there stays", "[image][write]") {
  const auto [ending, depth] = GENERATE(table<std::string, Depth>(
      {{".png", Depth::u8}, {".jpg", Depth::u8}, {".tif", Depth::u8}, {".exr", Depth::half}}));
  const std::uint32_t rows = GENERATE(0U, 1U, 8U);
  CAPTURE(ending, rows);
  test::TempFolder folder;
  const std::string path = folder.file("a" + ending);
  const ImageWriteSpec spec{8, 8, 1, depth, false, false};
  const std::vector<std::uint8_t> samples(8 * 8 * io::sample_bytes(depth));
  test::write_file(path, "old");
  {
    ImageWriter writer(path, spec);
    writer.write_rows(rows, reinterpret_cast<const std::byte*>(samples.data()));
    if (rows < 8) CHECK_THROWS_AS(writer.commit(), Error);
  }
  CHECK(test::read_file(path) == "old");
  CHECK(files_in(folder.path()) == 1);
  write(path, spec, samples);
  CHECK(test::read_all(test::at_path(path)).size() == samples.size());
  CHECK(files_in(folder.path()) == 1);
}

TEST_CASE("folders that are missing are made, and go again with a file that fails",
          "[image][write]") {
  test::TempFolder folder;
  {
    io::OutputFile whole(folder.file("new/deep/a.txt"));
    whole.commit();
    io::OutputFile given_up(folder.file("no/deep/a.txt"));
    CHECK(std::filesystem::exists(folder.file("no/deep")));
  }
  CHECK(std::filesystem::exists(folder.file("new/deep/a.txt")));
  CHECK_FALSE(std::filesystem::exists(folder.file("no")));
}

TEST_CASE("what cannot be written is named", "[image][write]") {
  test::TempFolder folder;
  std::ofstream(folder.file("file")) << "x";
  CHECK_THAT(failure_of(folder.file("file/new/a.png"), ErrorKind::storage),
             Contains(folder.file("file/new")));
  std::filesystem::create_directory(folder.file("b.png"));
  CHECK_THAT(failure_of(folder.file("b.png"), ErrorKind::storage), Contains("not a regular file"));
  CHECK_THAT(failure_of("/proc/a.png", ErrorKind::storage), Contains("/proc/a.png"));
}

TEST_CASE("a disk that is full is reported with its reason and leaves nothing", "[image][write]") {
  // A limit on file sizes stands in for the disk.
  const std::string ending = GENERATE(".png", ".jpg", ".tif", ".exr");
  CAPTURE(ending);
  test::TempFolder folder;
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit tight = before;
  tight.rlim_cur = 20000;
  setrlimit(RLIMIT_FSIZE, &tight);
  std::string message = "written";
  ErrorKind kind{};
  const ImageWriteSpec spec{600, 600, 3, ending == ".exr" ? Depth::half : Depth::u8, false, false};
  const auto samples = make_samples(spec);
  try {
    write(folder.file("a" + ending), spec, samples);
  } catch (const Error& error) {
    message = error.what();
    kind = error.kind();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, old_handler);
  CHECK(kind == ErrorKind::storage);
  CHECK_THAT(message, Contains(folder.file("a" + ending)) && Contains("File too large"));
  CHECK(files_in(folder.path()) == 0);
}

TEST_CASE("what a format cannot hold is said before anything is written", "[image][write]") {
  const ImageWriteSpec rgb{8, 8, 3, Depth::u8, false, false};
  ImageWriteSpec rgba = rgb, wide = rgb, half_rgb = rgb;
  rgba.channels = 4;
  wide.width = 65501;
  half_rgb.depth = Depth::half;
  CHECK(io::why_not_writable("a.png", rgb).empty());
  CHECK(io::why_not_writable("a.JPG", rgb).empty());
  CHECK_THAT(io::why_not_writable("a.gif", rgb),
             Contains(".png") && Contains(".exr") && Contains("a.gif"));
  CHECK_THAT(io::why_not_writable("png", rgb), Contains(".png"));
  CHECK_THAT(io::why_not_writable("a.jpg", rgba), Contains("alpha"));
  CHECK_THAT(io::why_not_writable("a.jpg", wide), Contains("65500"));
  CHECK(io::why_not_writable("a.png", wide).empty());
  CHECK_THAT(io::why_not_writable("a.png", half_rgb),
             Contains("half") && Contains("8-bit or 16-bit"));
  CHECK_THAT(failure_of("a.gif", ErrorKind::usage), Contains("a.gif"));
  CHECK(io::writable_depth("a.png", Depth::float32) == Depth::u16);
  CHECK(io::writable_depth("a.jpeg", Depth::u16) == Depth::u8);
  CHECK(io::writable_depth("a.exr", Depth::u8) == Depth::half);
  CHECK(io::writable_depth("a.exr", Depth::float32) == Depth::float32);
  CHECK(io::writable_depth("a.tif", Depth::half) == Depth::float32);
}

TEST_CASE("a PNG at the end of a scratch file has the bytes of one with a name", "[image][write]") {
  test::TempFolder folder;
  const Depth depth = GENERATE(Depth::u8, Depth::u16);
  const ImageWriteSpec spec{300, 200, 4, depth, false, true};
  const auto samples = make_samples(spec);
  write(folder.file("a.png"), spec, samples);
  const auto files = test::make_memory_file_system();
  const auto scratch = files->create_scratch(".");
  scratch->append(std::as_bytes(std::span("before", 6)));
  ImageWriter writer(*scratch, spec);
  writer.write_rows(spec.height, reinterpret_cast<const std::byte*>(samples.data()));
  writer.commit();
  std::string bytes(scratch->size_bytes(), '\0');
  scratch->reader()->read(0, std::as_writable_bytes(std::span(bytes)));
  CHECK(bytes.substr(0, 6) == "before");
  CHECK(bytes.substr(6) == test::read_file(folder.file("a.png")));
  CHECK(failure(ErrorKind::usage, [&] {
          ImageWriter(*scratch, {4, 4, 3, Depth::half, true, false});
        }).find("8-bit or 16-bit integers, not half") != std::string::npos);
}

namespace {

/// Work that is done when somebody waits for it, or meanwhile; counts what is under way.
class LaterWork final : public BegunWork {
 public:
  LaterWork(std::launch when, std::function<void()> work, int& now)
      : now_(now), done_(std::async(when, std::move(work))) {
    ++now_;
  }
  ~LaterWork() override { --now_; }
  void wait() override { done_.get(); }

 private:
  int& now_;
  std::future<void> done_;
};

}  // namespace

TEST_CASE("a PNG has the same bytes whenever its blocks are encoded", "[image][write]") {
  constexpr int kMostAtOnce = 6;
  const test::TempFolder folder;
  const Depth depth = GENERATE(Depth::u8, Depth::u16);
  const std::uint32_t strip = GENERATE(1U, 13U, 64U, 203U);
  const std::launch when = GENERATE(std::launch::async, std::launch::deferred);
  CAPTURE(depth_name(depth), strip);
  const ImageWriteSpec spec{3000, 203, 3, depth, false, false};
  const auto samples = make_samples(spec);
  write(folder.file("here.png"), spec, samples);

  int now = 0, most = 0;
  {
    ImageWriter writer(folder.file("later.png"), spec, [&](std::function<void()> work) {
      auto later = std::make_unique<LaterWork>(when, std::move(work), now);
      most = std::max(most, now);
      return later;
    });
    const std::size_t row = samples.size() / spec.height;
    for (std::uint32_t y = 0; y < spec.height; y += strip) {
      // Rows that are gone once they were handed over.
      const std::uint32_t count = std::min(strip, spec.height - y);
      std::vector<std::byte> rows(count * row);
      std::memcpy(rows.data(), samples.data() + y * row, rows.size());
      writer.write_rows(count, rows.data());
      std::fill(rows.begin(), rows.end(), std::byte{0xCC});
    }
    writer.commit();
  }
  CHECK(now == 0);
  CHECK(most == kMostAtOnce);
  CHECK(test::read_file(folder.file("later.png")) == test::read_file(folder.file("here.png")));
}

TEST_CASE("a PNG whose encoding fails does not appear, and waits for all that was begun",
          "[image][write]") {
  const test::TempFolder folder;
  const ImageWriteSpec spec{3000, 203, 3, Depth::u8, false, false};
  int now = 0, begun = 0;
  CHECK(failure(ErrorKind::storage, [&] {
          ImageWriter writer(folder.file("a.png"), spec, [&](std::function<void()> work) {
            if (++begun == 3) work = [] { throw Error(ErrorKind::storage, "no memory"); };
            return std::make_unique<LaterWork>(std::launch::async, std::move(work), now);
          });
          const auto samples = make_samples(spec);
          writer.write_rows(spec.height, reinterpret_cast<const std::byte*>(samples.data()));
        }) == "no memory");
  CHECK(now == 0);
  CHECK(files_in(folder.path()) == 0);
}

TEST_CASE("a scratch file that fails ends the encoding with its reason", "[image][write]") {
  const auto real = test::make_memory_file_system();
  const ImageWriteSpec spec{512, 512, 4, Depth::u8, false, true};
  const auto samples = make_samples(spec);
  test::FailingFileSystem files(*real);
  const auto encode = [&] {
    const auto scratch = files.create_scratch(".");
    ImageWriter writer(*scratch, spec);
    for (std::uint32_t y = 0; y < spec.height; ++y) {
      writer.write_rows(1, reinterpret_cast<const std::byte*>(samples.data()) + y * 2048);
    }
    writer.commit();
  };
  encode();
  const std::uint64_t calls = files.calls();
  REQUIRE(calls > 10);
  for (std::uint64_t at = 1; at <= calls; ++at) {
    files.restart({at, false, true});
    CAPTURE(at);
    CHECK(failure(ErrorKind::storage, encode) != "written");
  }
}

TEST_CASE("a PNG that is given up says nothing on the standard error output", "[image]") {
  const test::TempFolder folder;
  const std::string said = folder.file("stderr");
  for (const std::uint32_t rows : {0U, 1U, 500U}) {
    std::fflush(stderr);
    const int kept = ::dup(2);
    REQUIRE(std::freopen(said.c_str(), "w", stderr) != nullptr);
    {
      const io::ImageWriteSpec spec{1000, 1000, 3, Depth::u8, false, false};
      io::ImageWriter writer(folder.file("a.png"), spec);
      const std::vector<std::byte> row(3000);
      for (std::uint32_t y = 0; y < rows; ++y) writer.write_rows(1, row.data());
    }
    std::fflush(stderr);
    ::dup2(kept, 2);
    ::close(kept);
    CHECK(test::read_file(said).empty());
  }
}
