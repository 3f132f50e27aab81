// SPDX-License-Identifier: Apache-2.0
//
// What jobs on splat scenes lease against what they allocate: never less, and not much more. The
// linker sends the pool's calls here (--wrap, see CMakeLists.txt).
#include <malloc.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <new>

#include "core/page_pool.h"
#include "flow/transfer.h"
#include "gaussian/splat_set.h"
#include "support/random.h"
#include "support/splat_ply_builder.h"
#include "support/test_data.h"

namespace {

/// Bytes that are allocated now, and the most at once since the last count_anew().
std::atomic<std::int64_t> now{0}, most{0};

void count(std::int64_t bytes) {
  const std::int64_t after = now += bytes;
  for (std::int64_t before = most; after > before && !most.compare_exchange_weak(before, after);) {
  }
}

}  // namespace

extern "C" {
void* __real__ZN6pounce8PagePool8allocateEm(pounce::PagePool* pool, std::size_t bytes);
void __real__ZN6pounce8PagePool7releaseEPvm(pounce::PagePool* pool, void* at, std::size_t bytes);
void* __wrap__ZN6pounce8PagePool8allocateEm(pounce::PagePool* pool, std::size_t bytes) {
  void* const at = __real__ZN6pounce8PagePool8allocateEm(pool, bytes);
  count(static_cast<std::int64_t>(pounce::round_to_pages(bytes)));
  return at;
}
void __wrap__ZN6pounce8PagePool7releaseEPvm(pounce::PagePool* pool, void* at, std::size_t bytes) {
  count(-static_cast<std::int64_t>(pounce::round_to_pages(bytes)));
  __real__ZN6pounce8PagePool7releaseEPvm(pool, at, bytes);
}
}

void* operator new(std::size_t bytes) {
  void* const at = std::malloc(bytes);
  if (at == nullptr) throw std::bad_alloc();
  count(static_cast<std::int64_t>(malloc_usable_size(at)));
  return at;
}
void operator delete(void* at) noexcept {
  if (at != nullptr) count(-static_cast<std::int64_t>(malloc_usable_size(at)));
  std::free(at);
}
void operator delete(void* at, std::size_t) noexcept { operator delete(at); }

namespace pounce::test {
namespace {

constexpr double kMiB = 1 << 20;
/// What of a job's allocations is nobody's lease: options, the graph, the report, images'
/// libraries.
constexpr double kBeside = 1.5 * kMiB;
/// A piece has room for profiles before it knows that it needs none.
constexpr double kMostOverUsed = 1.55, kMostOverUsedByViews = 2;

struct Bytes {
  double leased = 0, used = 0;  ///< at most, at once
};

Bytes run(const TransferOptions& options) {
  const std::int64_t before = now;
  most = before;
  const Report report = flow::transfer(options, {});
  return {static_cast<double>(report.leased_peak_bytes), static_cast<double>(most - before)};
}

/// A sheet of Gaussians and a plane with UVs where it lies.
TransferOptions sheet(const TempFolder& folder, int count, int sh_columns) {
  Random random(5);
  SplatPlyBuilder ply;
  ply.columns = SplatPlyBuilder::usual_columns(sh_columns, false);
  for (int i = 0; i < count; ++i) {
    auto row = SplatPlyBuilder::usual_row(random.between(0.0, 1.0));
    row["y"] = random.between(0.0, 1.0);
    row["z"] = random.between(-0.001, 0.001);
    for (const char* scale : {"scale_0", "scale_1", "scale_2"})
      row[scale] = random.between(-6.5, -5.5);
    ply.rows.push_back(row);
  }
  TransferOptions options;
  options.source = folder.file("scene.ply");
  ply.write(options.source);
  options.targets = {folder.file("target.obj")};
  std::ofstream(options.targets[0]) << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
                                       "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
  options.output = folder.file("out.png");
  options.image.size = ImageSize{256, 256};
  options.resources.cache_dir = folder.file("cache");
  options.resources.threads = 1;
  return options;
}

/// The first job sorts the scene; the second has it in the cache, but not its results. `kept`: what
/// the budget may keep of decoded blocks beside the leases of pieces that hold them, too.
void check_leases(TransferOptions options, std::uint64_t memory, std::uint64_t kept) {
  options.resources.memory_bytes = memory;
  for (const char* job : {"sorts", "projects"}) {
    std::filesystem::remove_all(options.resources.cache_dir + "/v3/results");
    const Bytes bytes = run(options);
    CAPTURE(job, look_name(options.splats.look), options.splats.rays, memory, bytes.leased / kMiB,
            bytes.used / kMiB);
    CHECK(bytes.used <= bytes.leased + kBeside);
    // A row of views is leased as if none of its tiles could be compressed.
    const double most = options.splats.look == Look::around ? kMostOverUsedByViews : kMostOverUsed;
    CHECK(bytes.leased - static_cast<double>(kept) <= most * bytes.used);
  }
}

TEST_CASE("a splat job leases what it uses, and little more", "[flow]") {
  constexpr int kSplats = 40000;
  const TempFolder folder;
  const bool has_harmonics = GENERATE(false, true);
  const Look look = GENERATE(Look::normal, Look::around);
  TransferOptions options = sheet(folder, kSplats, has_harmonics ? 45 : 0);
  options.splats.look = look;
  const std::uint32_t lobes = !has_harmonics ? 0 : look == Look::normal ? 8 : 15;
  const std::uint64_t scene = gaussian::SplatSet::most_bytes(kSplats, lobes);
  for (const unsigned rays : {0U, 3U}) {
    // What no view sees may want all rays, and here every texel is seen.
    if (look == Look::around && rays > 0) continue;
    options.splats.rays = rays;
    options.resources.memory_bytes = 1ULL << 30;
    const std::uint64_t least = flow::plan(options, {}).least_memory_bytes;
    std::filesystem::remove_all(folder.file("cache"));
    check_leases(options, least, 0);
    check_leases(options, std::uint64_t{1} << 30, scene);
  }
}

}  // namespace
}  // namespace pounce::test
