// SPDX-License-Identifier: Apache-2.0
//
// What has to hold while a written image waits for the disk, and when it cannot get its name.
#include "flow/write/pending_outputs.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/flow/small_target.h"

using namespace pounce;
using namespace pounce::flow;

namespace {

namespace fs = std::filesystem;
using Files = std::vector<std::unique_ptr<io::OutputFile>>;

constexpr Hash128 kPackKey{7, 8};

/// Files that are whole; each holds its own name.
Files written(const std::vector<std::string>& paths) {
  Files files;
  for (const std::string& path : paths) {
    files.push_back(std::make_unique<io::OutputFile>(path));
    std::fwrite(path.data(), 1, path.size(), files.back()->stream());
    files.back()->close();
  }
  return files;
}

std::string content(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Nothing gets this name: a folder comes in its place once the file is written.
Files without_a_name(const std::string& path) {
  Files files = written({path});
  fs::create_directories(path + "/inside");
  return files;
}

struct DiskJob : test::SmallJob {
  explicit DiskJob(const std::string& folder) : SmallJob(64 << 20) {
    context.files = &posix_file_system();
    context.scratch_folder = folder;
    context.keeps_results_after = {};
  }
  const std::vector<std::string>& outputs() const { return context.report.outputs; }

  /// What a later run would go on with.
  std::unique_ptr<job::StepPack> kept_pack() {
    const job::StepPack::Earlier none{[](auto&&...) { return false; }, [](auto) { return false; }};
    auto pack = std::make_unique<job::StepPack>(context, store::PackKind::results, kPackKey, none);
    const std::vector<std::byte> bytes(100);
    pack->writer().append(store::ChunkKind::record, bytes, 100);
    pack->commit();
    REQUIRE(pack->is_kept());
    return pack;
  }
  bool is_pack_left() { return job::StepPack::find(context, kPackKey) != nullptr; }
};

/// Does another job get to make this output within five seconds?
bool becomes_free(const std::string& output) {
  for (int tries = 0; tries < 500; ++tries) {
    if (job::OutputClaim::take({output})) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

TEST_CASE("pending images get their names in order, and are reported once they have them") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  const std::string a = folder.file("a.png"), m = folder.file("m.png"), b = folder.file("b.png");
  PendingOutputs pending(job.context);
  pending.add({written({m, a}), {}});
  pending.add({written({b}), {}});
  CHECK(job.outputs().empty());
  pending.wait();
  // An image before its coverage, whose name comes first.
  CHECK(job.outputs() == std::vector{a, m, b});
  for (const std::string& path : job.outputs()) CHECK(content(path) == path);
  pending.wait();
  CHECK(job.outputs().size() == 3);
}

TEST_CASE("no more images wait for the disk than a few") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  PendingOutputs pending(job.context);
  for (int i = 0; i < 20; ++i) {
    pending.add({written({folder.file(std::to_string(i))}), {}});
    CHECK(i + 1 - static_cast<int>(job.outputs().size()) <= 3);
  }
  pending.wait();
  CHECK(job.outputs().size() == 20);
}

TEST_CASE("a step's claim ends when its images are there, whatever the job does meanwhile") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  const std::string path = folder.file("a.png");
  PendingOutputs pending(job.context);
  std::optional<job::OutputClaim> claim = job::OutputClaim::take({path});
  REQUIRE(claim);
  CHECK_FALSE(job::OutputClaim::take({path}));
  pending.add({written({path}), claim});
  claim.reset();
  REQUIRE(becomes_free(path));
  CHECK(fs::exists(path));
}

TEST_CASE("what a later run goes on with stays until the images are there") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  const std::string path = folder.file("a.png");
  PendingOutputs pending(job.context);
  pending.add({written({path}), {}});
  pending.end_step(job.kept_pack());
  // The next step's scratch files come on top of it.
  pending.begin_step();
  CHECK(fs::exists(path));
  CHECK_FALSE(job.is_pack_left());
  CHECK(job.outputs() == std::vector{path});
}

TEST_CASE("an image that cannot get its name fails the job and keeps what was made") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  const std::string good = folder.file("good.png"), bad = folder.file("bad.png"),
                    later = folder.file("later.png");
  {
    PendingOutputs pending(job.context);
    pending.add({written({good}), {}});
    pending.add({without_a_name(bad), {}});
    pending.end_step(job.kept_pack());
    try {
      pending.wait();
      FAIL("nothing was thrown");
    } catch (const Error& e) {
      CHECK(e.kind() == ErrorKind::storage);
      CHECK(std::string(e.what()).starts_with("cannot write " + bad + ": "));
    }
    CHECK(job.outputs() == std::vector{good});
    pending.add({written({later}), {}});
  }
  // The job has failed; what is whole is an output all the same.
  CHECK(job.outputs() == std::vector{good, later});
  CHECK(job.is_pack_left());
  // No temporary file, and no lock.
  CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 4);
}

TEST_CASE("of an image's files those are reported that got their names") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  const std::string mask = folder.file("m.png"), bad = folder.file("bad.png");
  Files files = written({mask});
  for (auto& file : without_a_name(bad)) files.push_back(std::move(file));
  PendingOutputs pending(job.context);
  pending.add({std::move(files), {}});
  CHECK_THROWS_AS(pending.wait(), Error);
  CHECK(job.outputs() == std::vector{mask});
}

TEST_CASE("the claim of an image outlasts the step that failed, until its image is there or not") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  const std::string bad = folder.file("bad.png");
  PendingOutputs pending(job.context);
  pending.add({without_a_name(bad), job::OutputClaim::take({bad})});
  const std::string next = folder.file("next.png");
  pending.add({written({next}), {}});
  while (!fs::exists(next)) std::this_thread::yield();  // then the thread is done with the first
  CHECK_FALSE(job::OutputClaim::take({bad}));
  CHECK_THROWS_AS(pending.finish(), Error);
  CHECK(job::OutputClaim::take({bad}));
  // It was said once.
  pending.add({written({folder.file("a.png")}), {}});
  CHECK_NOTHROW(pending.finish());
}

TEST_CASE("an image that is whole comes even if one before it did not") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  PendingOutputs pending(job.context);
  pending.add({without_a_name(folder.file("bad.png")), {}});
  std::vector<std::string> all;
  for (const char* name : {"1", "2", "3"}) all.push_back(folder.file(name));
  pending.add({written({all[0]}), {}});
  pending.add({written({all[1]}), {}});
  CHECK_THROWS_AS(pending.add({written({all[2]}), {}}), Error);
  pending.wait();
  CHECK(job.outputs() == all);
}

TEST_CASE("without a thread of their own images are there at once") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  job.run.has_spare_thread = false;
  const std::string path = folder.file("a.png"), bad = folder.file("bad.png");
  PendingOutputs pending(job.context);
  pending.add({written({path}), job::OutputClaim::take({path})});
  CHECK(fs::exists(path));
  CHECK(job::OutputClaim::take({path}));
  pending.add({without_a_name(bad), {}});
  CHECK_THROWS_AS(pending.wait(), Error);
  CHECK(job.outputs() == std::vector{path});
}

TEST_CASE("a second attempt knows what was painted in place, once it is there") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  PendingOutputs pending(job.context);
  const std::string mask = folder.file("m.png"), bad = folder.file("bad.png");
  Files files = written({mask});
  for (auto& file : without_a_name(bad)) files.push_back(std::move(file));
  pending.add({std::move(files), {}, true});
  CHECK_THROWS_AS(pending.wait(), Error);
  CHECK_FALSE(job.run.painted_in_place);
  pending.add({written({folder.file("a.png")}), {}, true});
  pending.wait();
  CHECK(job.run.painted_in_place);
}

TEST_CASE("the report takes back what was told of an image that got no name") {
  const test::TempFolder folder;
  DiskJob job(folder.path());
  Report& report = job.context.report;
  const std::string bad = folder.file("bad.png"), good = folder.file("good.png");
  report.udims = {1001, 1002};
  report.channels = {{"baseColor", 2, {}}};
  TargetReport& target = report.targets.emplace_back();
  for (const auto& [path, udim] : {std::pair{bad, 1001}, std::pair{good, 1002}}) {
    ImageReport& image = target.images.emplace_back();
    image.path = path;
    image.channel = "baseColor";
    image.udim = udim;
    image.state = "written";
  }
  PendingOutputs pending(job.context);
  pending.add({without_a_name(bad), {}});
  pending.add({written({good}), {}});
  CHECK_THROWS_AS(pending.finish(), Error);
  CHECK(target.images[0].state == "not written");
  CHECK(target.images[1].state == "written");
  CHECK(report.channels[0].images == 1);
  CHECK(report.udims == std::vector{1002});
  CHECK(report.outputs == std::vector{good});
}

}  // namespace
