// SPDX-License-Identifier: Apache-2.0
//
// While an image is decoded, other threads make what needs no image. Nobody can tell by the report
// or by what is said of what is wrong.
#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "core/file.h"
#include "flow/stores/build_stores.h"
#include "flow/transfer_plan.h"
#include "io/image/read.h"
#include "job/run_job.h"
#include "pounce/cache.h"
#include "pounce/error.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/many_threads.h"
#include "support/random_scene.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

TransferOptions job_of(const TempFolder& folder, unsigned threads) {
  TransferOptions options = make_random_scene(folder.path().string(), 21);
  options.output = folder.file("out.<CHANNEL>.png");
  options.resources.use_cache = false;
  options.resources.threads = threads;
  options.resources.memory_bytes = std::uint64_t{1} << 30;
  return options;
}

double cpu_of(const Report& report, const std::string& stage) {
  const auto found = std::find_if(report.stages.begin(), report.stages.end(),
                                  [&](const StageTime& time) { return time.name == stage; });
  return found == report.stages.end() ? 0 : found->cpu_s;
}

mesh::ImageRef image_at(const std::string& path) {
  mesh::ImageRef image;
  image.path = image.label = path;
  return image;
}

/// What the transfer says of what is wrong with it.
std::string said_by(const TransferOptions& options) {
  try {
    transfer(options);
  } catch (const Error& e) {
    return error_kind_name(e.kind()) + std::string(": ") + e.what();
  }
  return {};
}

void cut_short(const std::string& path) {
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
}

}  // namespace

TEST_CASE("what needs no image is made beside images where there are threads and memory",
          "[flow]") {
  const TempFolder folder;
  const TransferOptions options = job_of(folder, 1);
  const mesh::ImageRef image = image_at(folder.file("colour0.png"));
  const ImageTrust trust;
  const io::ImageInfo info = io::ImageReader(image, trust).info();
  const flow::ColourRequest request{&image, &info, mesh::Wrap::repeat, mesh::Wrap::repeat, nullptr,
                                    trust,  0};
  const auto [threads, lacks_memory, images, is_made] =
      GENERATE(table<unsigned, bool, std::size_t, bool>(
          {{2, false, 1, true}, {2, true, 1, false}, {1, false, 1, false}, {2, false, 0, false}}));
  CAPTURE(threads, lacks_memory, images);
  Resources resources = options.resources;
  resources.threads = threads;
  job::JobRun run(nullptr);
  const auto job = job::open_job(resources, options.output, nullptr, false, false, run);
  const std::vector<flow::ColourRequest> requests(images, request);
  const std::vector<Hash128> keys(images, Hash128{1, 2});
  bool ran = false;
  const std::uint64_t room = job->budget.limit() - flow::colour_least_bytes(request);
  flow::BesideImages beside{[&] { ran = true; }, room + (lacks_memory ? 1 : 0)};
  const auto columns = flow::colour_stores(*job, requests, keys, &beside);
  CHECK(ran == is_made);
  CHECK(beside.is_made == is_made);
  REQUIRE(columns.size() == images);
  for (const flow::FoundColumn& column : columns) CHECK(column.store != nullptr);
  CHECK(run.report.images_decoded == images);
}

TEST_CASE("an image is there for others although what is made beside it fails", "[flow]") {
  const TempFolder folder;
  TransferOptions options = job_of(folder, 2);
  options.resources.use_cache = true;
  options.resources.cache_dir = folder.file("cache");
  const mesh::ImageRef image = image_at(folder.file("colour0.png"));
  const ImageTrust trust;
  const io::ImageInfo info = io::ImageReader(image, trust).info();
  const std::vector<flow::ColourRequest> requests{
      {&image, &info, mesh::Wrap::repeat, mesh::Wrap::repeat, nullptr, trust, 0}};
  const std::vector<Hash128> keys{{1, 2}};
  job::JobRun run(nullptr);
  const auto job = job::open_job(options.resources, options.output, nullptr, false, false, run);
  const auto is_there = [&] { return !cache_list(options.resources.cache_dir).empty(); };
  flow::BesideImages beside{[&] {
                              for (int i = 0; i < 5000 && !is_there(); ++i)
                                std::this_thread::sleep_for(std::chrono::milliseconds(1));
                              throw Error(ErrorKind::input, "beside");
                            },
                            1};
  CHECK_THROWS_WITH(flow::colour_stores(*job, requests, keys, &beside), "beside");
  CHECK(is_there());
}

TEST_CASE("a target's first page is vectorized ahead unless others may make it", "[flow]") {
  const TempFolder folder;
  TransferOptions options = job_of(folder, 2);
  options.skip_existing = GENERATE(false, true);
  job::JobRun run(nullptr);
  const auto job = job::open_job(options.resources, options.output, nullptr, false, false, run);
  job->tile_cap_bytes = mesh::kTileCapBytes;
  flow::TransferPlan plan(*job, options, {});
  plan.make(0.1);
  flow::PlannedTarget& target = plan.target(0);
  const flow::BesideImages ahead =
      flow::vectorizing_ahead(*job, plan.policy(), plan.source().plan(), target);
  REQUIRE((ahead.make != nullptr) == !options.skip_existing);
  if (!ahead.make) return;
  CHECK(ahead.least_bytes > 0);
  ahead.make();
  REQUIRE(target.ahead);
  CHECK(target.ahead->step == planning::Step{0, 0});
  CHECK(target.ahead->store->directory().texels > 0);
  // It is taken and not made again.
  const std::uint64_t written = run.report.tiles_written;
  plan.source().build({0, 1}, plan.detail(), {});
  const std::uint64_t with_source = run.report.tiles_written;
  CHECK(with_source > written);
  {
    flow::PendingOutputs pending(*job);
    transfer_to(*job, plan.policy(), plan.source(), target, pending, {0, 1},
                flow::OthersWork::await);
  }
  CHECK_FALSE(target.ahead);
  const Report alone = transfer(job_of(folder, 1));
  CHECK(run.report.target_tiles == alone.target_tiles);
  CHECK(run.report.tiles_written == alone.tiles_written);
}

TEST_CASE("a job with threads counts what one without counts", "[flow]") {
  const TempFolder folder;
  const Report alone = transfer(job_of(folder, 1));
  REQUIRE(alone.target_tiles > 0);
  for (const unsigned threads : {2U, 5U}) {
    CAPTURE(threads);
    const Report beside = transfer(job_of(folder, threads));
    CHECK(beside.source_tiles == alone.source_tiles);
    CHECK(beside.target_tiles == alone.target_tiles);
    CHECK(beside.tiles_written == alone.tiles_written);
    CHECK(beside.images_decoded == alone.images_decoded);
    CHECK(beside.source_gaussians == alone.source_gaussians);
    CHECK(beside.source_filtered == alone.source_filtered);
    CHECK(beside.source_store_bytes == alone.source_store_bytes);
    CHECK(beside.target_store_bytes == alone.target_store_bytes);
    CHECK(beside.inputs == alone.inputs);
    CHECK(beside.warnings == alone.warnings);
    // Its time is that of its own stage, wherever it ran.
    CHECK(cpu_of(beside, "vectorize") > 0);
  }
}

TEST_CASE("what is wrong is said alike with threads and without", "[flow]") {
  const TempFolder folder;
  const TransferOptions whole = job_of(folder, 1);
  REQUIRE(said_by(whole).empty());
  std::vector<std::string> inputs;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    const std::string ending = entry.path().extension().string();
    const bool is_made = entry.path().filename().string().starts_with("out.");
    if (!is_made && (ending == ".png" || ending == ".obj" || ending == ".glb"))
      inputs.push_back(entry.path().string());
  }
  REQUIRE(inputs.size() >= 3);
  std::size_t refused = 0;
  for (const std::string& input : inputs) {
    const std::vector<std::byte> bytes = read_whole(posix_file_system(), input);
    cut_short(input);
    TransferOptions options = whole;
    const std::string alone = said_by(options);
    refused += alone.empty() ? 0 : 1;
    // Which of two threads comes first changes from time to time.
    for (int time = 0; time < 10; ++time) {
      options.resources.threads = 2 + time % 3;
      CAPTURE(input, options.resources.threads);
      CHECK(said_by(options) == alone);
    }
    std::ofstream(input, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
  CHECK(refused >= 2);
  CHECK(said_by(whole).empty());
}

}  // namespace pounce::test
