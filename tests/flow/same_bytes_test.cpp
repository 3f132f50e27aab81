// SPDX-License-Identifier: Apache-2.0
//
// Same input, same bytes: whatever the budget, the threads, the tile cap, the cache, the
// instruction set, the stripes.
#include <catch2/catch.hpp>
#include <filesystem>
#include <map>
#include <random>
#include <string>

#include "core/file.h"
#include "flow/transfer.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/many_threads.h"
#include "support/memory_file_system.h"
#include "support/random_scene.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

constexpr std::uint64_t kMiB = 1 << 20;
constexpr std::uint64_t kPlenty = 1024 * kMiB;

using Files = std::map<std::string, std::vector<std::byte>>;

/// Runs the transfer into a folder of its own and hands out every file it wrote.
Files run(TransferOptions options, const TempFolder& folder, const job::TestKnobs& knobs = {}) {
  const std::string out = folder.file("out");
  std::filesystem::remove_all(out);
  std::filesystem::create_directory(out);
  options.output = out + "/result.<CHANNEL>.png";
  options.image.coverage_output = out + "/coverage.<CHANNEL>.png";
  const Report report = flow::transfer(options, knobs);
  if (options.resources.threads != 0) CHECK(report.threads == options.resources.threads);
  Files files;
  for (const auto& entry : std::filesystem::directory_iterator(out)) {
    files[entry.path().filename().string()] =
        read_whole(posix_file_system(), entry.path().string());
  }
  return files;
}

std::uint64_t least_memory(TransferOptions options, const TempFolder& folder,
                           const job::TestKnobs& knobs = {}) {
  options.output = folder.file("planned.<CHANNEL>.png");
  options.resources.memory_bytes = kPlenty;
  return flow::plan(options, knobs).least_memory_bytes;
}

TransferOptions scene(const TempFolder& folder, std::uint32_t seed) {
  TransferOptions options = make_random_scene(folder.path().string(), seed);
  options.resources.use_cache = false;
  options.resources.memory_bytes = kPlenty;
  return options;
}

Files in_core(TransferOptions options, const TempFolder& folder) {
  options.resources.threads = 1;
  const auto in_memory = test::make_memory_file_system();
  return run(options, folder, {.files = in_memory.get()});
}

}  // namespace

TEST_CASE("streamed runs give the bytes of the in-core run", "[flow]") {
  const std::uint32_t seed = GENERATE(21U, 22U, 24U);
  const TempFolder folder;
  TransferOptions options = scene(folder, seed);
  const Files expected = in_core(options, folder);
  REQUIRE(expected.size() == 4);  // two channels and their coverage
  for (const unsigned threads : {1U, 2U, 3U, 8U}) {
    for (const std::uint64_t tile_cap :
         {std::uint64_t{1}, std::uint64_t{20000}, std::uint64_t{0}}) {
      options.resources.threads = threads;
      const job::TestKnobs knobs{.tile_cap_bytes = tile_cap, .stripe_rows = threads == 3 ? 7U : 0U};
      const std::uint64_t least = least_memory(options, folder, knobs);
      for (const std::uint64_t memory : {least, 2 * least, kPlenty}) {
        options.resources.memory_bytes = memory;
        CAPTURE(seed, threads, tile_cap, memory);
        options.resources.use_cache = false;
        CHECK(run(options, folder, knobs) == expected);
        options.resources.use_cache = true;
        options.resources.cache_dir = folder.file("cache");
        std::filesystem::remove_all(options.resources.cache_dir);
        CHECK(run(options, folder, knobs) == expected);  // cold
        CHECK(run(options, folder, knobs) == expected);  // warm
      }
    }
  }
}

TEST_CASE("every instruction set gives the same bytes", "[flow]") {
  const std::uint32_t seed = GENERATE(range(25U, 31U));
  const TempFolder folder;
  TransferOptions options = scene(folder, seed);
  const Files expected = in_core(options, folder);
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    CAPTURE(seed, isa);
    try {
      const auto made = run(options, folder, {.isa = isa});  // CHECK would keep what it throws
      CHECK(made == expected);
    } catch (const Error& e) {
      CHECK(e.kind() == ErrorKind::usage);  // this processor has no such kernels
      CHECK(std::string(isa) != "sse2");
    }
  }
}

TEST_CASE("any budget gives the same bytes or names the least, which then works", "[flow]") {
  const TempFolder folder;
  TransferOptions options = scene(folder, 31);
  options.resources.threads = 2;
  const Files expected = in_core(options, folder);
  std::mt19937 random(7);
  int refused = 0;
  for (int i = 0; i < 30; ++i) {
    // Spread evenly over the orders of magnitude from 1 to 256 MiB.
    const double exponent = 8.0 * static_cast<double>(random()) / 4294967296.0;
    options.resources.memory_bytes = static_cast<std::uint64_t>(std::exp2(exponent) * kMiB);
    CAPTURE(options.resources.memory_bytes);
    std::string message;
    Files files;
    const int kind = error_kind([&] { files = run(options, folder); }, &message);
    if (kind == 0) {
      CHECK(files == expected);
      continue;
    }
    ++refused;
    CHECK(kind == exit_status(ErrorKind::budget));
    CAPTURE(message);
    const std::string before = "run it with --memory ";
    const std::size_t at = message.find(before);
    REQUIRE(at != std::string::npos);
    const std::uint64_t named = std::stoull(message.substr(at + before.size()));
    CHECK(message.substr(at).find("MiB") != std::string::npos);
    TransferOptions again = options;
    again.resources.memory_bytes = named * kMiB;
    CHECK(again.resources.memory_bytes > options.resources.memory_bytes);
    CHECK(run(again, folder) == expected);
  }
  CHECK(refused > 3);
  CHECK(refused < 27);
}

TEST_CASE("a cancelled job says so and leaves nothing behind", "[flow]") {
  const TempFolder folder;
  TransferOptions options = scene(folder, 32);
  const Files expected = in_core(options, folder);
  const std::string out = folder.file("cancelled"), cache = folder.file("cache");
  std::filesystem::create_directory(out);
  options.output = out + "/result.<CHANNEL>.png";
  options.resources.use_cache = true;
  options.resources.cache_dir = cache;
  options.resources.threads = GENERATE(1U, 3U);
  int cancelled = 0;
  for (int stop_at = 1;; ++stop_at) {
    Progress progress;
    int events = 0;
    progress.on_event = [&](const ProgressEvent&) {
      if (++events == stop_at) progress.cancel();
    };
    const int kind = error_kind([&] { transfer(options, &progress); });
    CAPTURE(stop_at, kind);
    if (events < stop_at) {  // it ended before we could stop it
      CHECK(kind == 0);
      break;
    }
    if (kind != 0) {
      CHECK(kind == exit_status(ErrorKind::cancelled));
      ++cancelled;
    }
    // A first channel's image may be whole already; nothing may be there in part.
    for (const auto& entry : std::filesystem::directory_iterator(out)) {
      const std::string name = entry.path().filename().string();
      REQUIRE(expected.count(name) == 1);
      CHECK(read_whole(posix_file_system(), entry.path().string()) == expected.at(name));
      std::filesystem::remove(entry.path());
    }
    for (const auto& entry : std::filesystem::recursive_directory_iterator(cache)) {
      const std::string name = entry.path().filename().string();
      const std::string ending = entry.path().extension().string();
      CAPTURE(name);
      CHECK((entry.is_directory() || name == "space.lock" || ending == ".pack" ||
             ending == ".label" || entry.path().parent_path().filename() == "locks"));
    }
  }
  CHECK(cancelled > 5);
  options.output.clear();
  CHECK(run(options, folder) == expected);
}

}  // namespace pounce::test
