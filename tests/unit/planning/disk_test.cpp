// SPDX-License-Identifier: Apache-2.0
//
// The forecast of space on disk: bounds, so each is compared with the bytes that it must hold, and
// how parts add up.
#include "planning/disk.h"

#include <catch2/catch.hpp>

#include "shading/result_block.h"

using namespace pounce;
using namespace pounce::planning;

namespace {

io::ImageInfo image_info(std::uint32_t side) {
  io::ImageInfo info;
  info.width = info.height = side;
  info.channels = 3;
  info.depth = Depth::u8;
  return info;
}

/// 4x4 tiles of 68x68 texels of three bytes.
constexpr std::uint64_t kColumnBytes = 16 * 68 * 68 * 3;

TEST_CASE("stores go into the cache or into scratch files, never into both") {
  DiskPlan keeps(true, 0), passes(false, 0);
  for (DiskPlan* plan : {&keeps, &passes}) plan->add_column(image_info(256));
  const std::uint64_t bytes = keeps.forecast().cache_bytes;
  CHECK(bytes >= kColumnBytes);
  CHECK(bytes <= kColumnBytes + kColumnBytes / 20 + (16 << 10));  // a bound, but no wild one
  CHECK(keeps.forecast().scratch_bytes == 0);
  CHECK(passes.forecast().cache_bytes == 0);
  CHECK(passes.forecast().scratch_bytes == bytes);
  CHECK(keeps.forecast().output_bytes == 0);
}

TEST_CASE("what the cache may not take is forecast for scratch files, too") {
  DiskPlan limited(true, 1000), wide(true, 1ULL << 40);
  for (DiskPlan* plan : {&limited, &wide}) plan->add_column(image_info(256));
  CHECK(limited.forecast().cache_bytes == 1000);
  CHECK(limited.forecast().scratch_bytes >= kColumnBytes);
  CHECK(wide.forecast().cache_bytes >= kColumnBytes);
  CHECK(wide.forecast().scratch_bytes == 0);
}

TEST_CASE("stores add up; of what comes and goes the largest counts") {
  DiskPlan once(true, 0), twice(true, 0);
  once.add_splats(1000, 0, 500);
  twice.add_splats(1000, 0, 500);
  twice.add_splats(1000, 0, 500);
  CHECK(twice.forecast().cache_bytes == 2 * once.forecast().cache_bytes);
  CHECK(twice.forecast().scratch_bytes == once.forecast().scratch_bytes);
  // While runs are merged both generations are there, beside the scene unpacked.
  CHECK(once.forecast().scratch_bytes == 2 * once.forecast().cache_bytes + 500);
}

TEST_CASE("scratch is stored as it is where all of it fits its limits so") {
  constexpr std::uint64_t kMemory = 800ULL << 20, kAny = UINT64_MAX, kShare = 100ULL << 20;
  DiskPlan plan(false, 0);
  plan.add_column(image_info(256));
  const std::uint64_t needed = plan.forecast().scratch_bytes;
  CHECK(plan.plain_bytes(needed, kAny, kMemory) == kShare);
  CHECK(plan.plain_bytes(0, kAny, kMemory) == kShare);  // no limit
  CHECK(plan.plain_bytes(needed - 1, kAny, kMemory) == 0);
  CHECK(plan.plain_bytes(needed, needed, kMemory) == kShare);
  CHECK(plan.plain_bytes(needed, needed - 1, kMemory) == 0);  // ulimit -f
  CHECK(plan.plain_bytes(needed, kAny, 800) == 32ULL << 20);
}

TEST_CASE("what a later run alone needs gets what the forecast leaves of a limit") {
  DiskPlan plan(false, 0);
  plan.add_column(image_info(256));
  plan.add_splats(1000, 0, 500);
  const std::uint64_t needed = plan.forecast().scratch_bytes;
  CHECK(plan.spare_bytes(needed + 100) == 100);
  CHECK(plan.spare_bytes(needed) == 0);
  CHECK(plan.spare_bytes(1) == 0);
  CHECK(plan.spare_bytes(0) == UINT64_MAX);  // no limit
}

TEST_CASE("an image seen in levels takes a third more, kept in part first half as much again") {
  const auto stores = [](bool levels, bool in_part) {
    DiskPlan plan(true, 0);
    if (levels)
      plan.add_seen_column(image_info(4096), in_part);
    else
      plan.add_column(image_info(4096));
    return static_cast<double>(plan.forecast().cache_bytes);
  };
  const double plain = stores(false, false);
  CHECK(stores(true, false) / plain == Approx(4.0 / 3).epsilon(0.02));
  CHECK(stores(true, true) - stores(true, false) == Approx(plain / 2).epsilon(0.001));
}

/// A target of one 256x256 image of three bytes a texel, in one pass.
struct OneImage {
  SourcePlan plan;
  TargetPlan target;
  mesh::Mesh mesh;

  OneImage() {
    plan.channels.resize(1);
    plan.channels[0].size = {256, 256};
    plan.channels[0].format.channels = 3;
    plan.passes.resize(1);
    plan.passes[0].size = {256, 256};
    plan.passes[0].channels = {0};
    target.requests.resize(1);
    target.images = {{ImageOutput{}}};
    target.images[0][0].path = "a.png";
  }
  DiskForecast forecast(bool is_model = false) const {
    DiskPlan disk(true, 0);
    disk.add_target(
        plan, target, mesh, is_model,
        [](const ImageOutput&, const shading::TexelFormat&) -> std::uint64_t { return 0; });
    return disk.forecast();
  }
};

TEST_CASE("results that a cache keeps add up by page") {
  OneImage job;
  const std::uint64_t without = job.forecast().cache_bytes;
  job.plan.passes[0].keeps_results = true;
  const std::uint64_t one = job.forecast().cache_bytes - without;
  CHECK(one >= 256 * 256 * 3 + 16 * shading::kMaskBytes);
  CHECK(one <= 256 * 256 * 3 + 16 * shading::kMaskBytes + (32 << 10));
  job.target.images[0].push_back(job.target.images[0][0]);
  CHECK(job.forecast().cache_bytes - without == 2 * one);
}

TEST_CASE("outputs are the images that are written and their masks") {
  OneImage job;
  constexpr std::uint64_t kImage = 256 * 256 * 3, kMask = 256 * 256;
  const DiskForecast image = job.forecast();
  CHECK(image.output_bytes >= kImage);
  CHECK(image.output_bytes <= kImage + kImage / 20 + (64 << 10));
  CHECK(image.scratch_bytes >= kImage);  // its results
  job.target.images[0][0].coverage_path = "mask.png";
  CHECK(job.forecast().output_bytes >= image.output_bytes + kMask);
  job.target.images[0][0].keep = true;
  CHECK(job.forecast().output_bytes == 0);
}

TEST_CASE("a model's images pass through a scratch file into it") {
  const OneImage job;
  const DiskForecast image = job.forecast(), model = job.forecast(true);
  CHECK(model.scratch_bytes == image.scratch_bytes + image.output_bytes);
  CHECK(model.output_bytes > image.output_bytes);
}

TEST_CASE("a note is made where scratch files may come to take more than they are allowed") {
  DiskForecast disk;
  disk.scratch_bytes = 2000;
  CHECK(scratch_note(disk).empty());  // no limit
  disk.scratch_limit_bytes = 2000;
  CHECK(scratch_note(disk).empty());
  disk.scratch_limit_bytes = 1999;
  CHECK(scratch_note(disk).find("--max-temp") != std::string::npos);
}

}  // namespace
