// SPDX-License-Identifier: Apache-2.0
//
// A cache whose bytes rot: a later run notices and gives the right picture or an error, never
// another picture.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "core/file.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/random_scene.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

struct Job {
  TransferOptions options;
  std::string cache, pristine;
  std::vector<std::byte> expected;
  std::vector<std::string> packs;  ///< relative to the cache
};

Job make_job(const TempFolder& folder) {
  Job job;
  job.cache = folder.file("cache");
  job.pristine = folder.file("pristine");
  job.options = make_random_scene(folder.path().string(), 41);
  job.options.image.size = ImageSize{65, 50};
  job.options.output = folder.file("result.png");
  job.options.resources.threads = 1;
  job.options.resources.memory_bytes = 256 << 20;
  job.options.resources.cache_dir = job.cache;
  transfer(job.options);
  job.expected = read_whole(posix_file_system(), job.options.output);
  std::filesystem::copy(job.cache, job.pristine, std::filesystem::copy_options::recursive);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(job.cache)) {
    if (entry.path().extension() == ".pack")
      job.packs.push_back(std::filesystem::relative(entry.path(), job.cache).string());
  }
  std::sort(job.packs.begin(), job.packs.end());
  return job;
}

void restore(const Job& job) {
  for (const std::string& pack : job.packs) {
    std::filesystem::copy_file(job.pristine + "/" + pack, job.cache + "/" + pack,
                               std::filesystem::copy_options::overwrite_existing);
  }
}

struct Verdicts {
  int rebuilt = 0, refused = 0, unnoticed = 0, wrong = 0;
};

/// Runs the job on a damaged cache. Unnoticed: the right picture without a word (bytes that this
/// job never reads).
void judge(const Job& job, const std::string& pack, Verdicts& verdicts) {
  // Known hits spare a job the surfaces: without them it reads every pack.
  if (pack.find("/hits/") == std::string::npos) std::filesystem::remove_all(job.cache + "/v3/hits");
  std::filesystem::remove(job.options.output);
  try {
    const Report report = transfer(job.options);
    if (read_whole(posix_file_system(), job.options.output) != job.expected) {
      ++verdicts.wrong;
    } else {
      const bool told = std::any_of(
          report.warnings.begin(), report.warnings.end(),
          [](const std::string& w) { return w.find("rebuilding it") != std::string::npos; });
      ++(told ? verdicts.rebuilt : verdicts.unnoticed);
    }
  } catch (const Error& e) {
    ++(e.kind() == ErrorKind::damaged_store ? verdicts.refused : verdicts.wrong);
  }
}

}  // namespace

TEST_CASE("a flipped byte anywhere in a cache never changes the picture", "[flow]") {
  const TempFolder folder;
  const Job job = make_job(folder);
  REQUIRE(job.packs.size() >= 5);  // two images, source and target geometry, hits
  FileSystem& files = posix_file_system();
  for (const std::string& pack : job.packs) {
    const auto pristine = read_whole(files, job.pristine + "/" + pack);
    Verdicts verdicts;
    // Every byte of head and end, where the structure is, and a sample of the payload between.
    const std::size_t stride = std::max<std::size_t>(1, pristine.size() / 80);
    int flips = 0;
    for (std::size_t i = 0; i < pristine.size(); ++i) {
      const bool edge = i < 72 || i + 72 > pristine.size();
      if (!edge && i % stride != 0) continue;
      auto damaged = pristine;
      damaged[i] ^= std::byte{static_cast<unsigned char>(1U << (i % 8))};
      write_whole(files, job.cache + "/" + pack, damaged);
      judge(job, pack, verdicts);
      restore(job);
      ++flips;
    }
    std::printf("FIGURE flipped %s: %d flips, %d rebuilt, %d refused, %d unnoticed, %d wrong\n",
                pack.c_str(), flips, verdicts.rebuilt, verdicts.refused, verdicts.unnoticed,
                verdicts.wrong);
    CAPTURE(pack, verdicts.rebuilt, verdicts.refused, verdicts.unnoticed);
    CHECK(verdicts.wrong == 0);
    CHECK(verdicts.unnoticed == 0);  // this job reads all of its packs
    CHECK(verdicts.rebuilt + verdicts.refused == flips);
  }
}

TEST_CASE("progress does not fall when a job begins again", "[flow]") {
  const TempFolder folder;
  const Job job = make_job(folder);
  FileSystem& files = posix_file_system();
  int restarts = 0;
  for (const std::string& pack : job.packs) {
    auto damaged = read_whole(files, job.pristine + "/" + pack);
    damaged[100] ^= std::byte{1};  // in the first block: it shows once the job is under way
    write_whole(files, job.cache + "/" + pack, damaged);
    Progress progress;
    std::vector<double> fractions;
    int plans = 0;
    progress.on_event = [&](const ProgressEvent& event) {
      fractions.push_back(event.fraction);
      if (event.stage == "read meshes" && event.done == 0) ++plans;
    };
    transfer(job.options, &progress);
    restarts += plans - 1;
    CHECK(std::is_sorted(fractions.begin(), fractions.end()));
    CHECK(fractions.back() == 1);
    restore(job);
  }
  CHECK(restarts > 0);
}

TEST_CASE("cut, emptied, swapped and zeroed packs never change the picture", "[flow]") {
  const TempFolder folder;
  const Job job = make_job(folder);
  FileSystem& files = posix_file_system();
  Verdicts verdicts;
  int cases = 0;
  const auto damage = [&](const std::string& pack, const std::vector<std::byte>& bytes) {
    write_whole(files, job.cache + "/" + pack, bytes);
    judge(job, pack, verdicts);
    restore(job);
    ++cases;
  };
  for (const std::string& pack : job.packs) {
    const auto pristine = read_whole(files, job.pristine + "/" + pack);
    for (std::size_t length = 0; length < pristine.size();
         length += std::max<std::size_t>(512, pristine.size() / 20)) {
      damage(pack, {pristine.begin(), pristine.begin() + static_cast<std::ptrdiff_t>(length)});
    }
    for (std::size_t at = 0; at < pristine.size(); at += 4096) {
      auto zeroed = pristine;
      std::fill_n(zeroed.begin() + static_cast<std::ptrdiff_t>(at),
                  std::min<std::size_t>(4096, pristine.size() - at), std::byte{});
      damage(pack, zeroed);
    }
    // Another pack's content under this name: a stale or misplaced file.
    for (const std::string& other : job.packs) {
      if (other != pack) damage(pack, read_whole(files, job.pristine + "/" + other));
    }
  }
  CAPTURE(cases, verdicts.rebuilt, verdicts.refused, verdicts.unnoticed);
  CHECK(verdicts.wrong == 0);
  CHECK(verdicts.unnoticed == 0);
  CHECK(verdicts.rebuilt + verdicts.refused == cases);
}

}  // namespace pounce::test
