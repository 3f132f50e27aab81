// SPDX-License-Identifier: Apache-2.0
//
// A mesh is read early where that costs nobody anything; whatever goes wrong is as if it had not
// been tried.
#include "flow/early_mesh.h"

#include <sys/resource.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <new>
#include <thread>

#include "core/input_file.h"
#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/flow/small_target.h"

using namespace pounce;

namespace {

constexpr std::uint64_t kBudget = 16000;  // of which a sixteenth is for both

mesh::Mesh small_mesh() {
  mesh::Mesh mesh;
  mesh.positions = {{1, 2, 3}};
  return mesh;
}

}  // namespace

TEST_CASE("a mesh is read early where there are threads and memory", "[early]") {
  const auto [threads, others, cost, is_read] =
      GENERATE(table<unsigned, std::uint64_t, std::uint64_t, bool>(
          {{2, 600, 400, true}, {2, 600, 401, false}, {2, 1000, 0, false}, {1, 0, 0, false}}));
  CAPTURE(threads, others, cost);
  test::SmallJob job(kBudget, threads);
  bool was_read = false, asked_too_much = false;
  flow::EarlyMesh early(
      job.context, others,
      [&, bytes = cost, left = 1000 - others](std::uint64_t most) {
        asked_too_much = most != left;
        return bytes;
      },
      [&] {
        was_read = true;
        return small_mesh();
      });
  const auto mesh = early.take();
  CHECK(was_read == is_read);
  CHECK_FALSE(asked_too_much);
  REQUIRE(mesh.has_value() == is_read);
  if (mesh) CHECK(mesh->positions == small_mesh().positions);
  CHECK_FALSE(early.take());  // it is there once
}

TEST_CASE("a mesh is read early where the process may have the memory", "[early]") {
  constexpr std::uint64_t kMib = 1 << 20;
  test::SmallJob job(1024 * kMib, 2);  // of which 64 MiB are for both
  const auto is_read = [&job] {
    const auto cost = [](std::uint64_t) { return 6 * kMib; };
    return flow::EarlyMesh(job.context, 0, cost, small_mesh).take().has_value();
  };
  CHECK(is_read());
  rlimit before{};
  REQUIRE(::getrlimit(RLIMIT_DATA, &before) == 0);
  std::uint64_t pages = 0;  // the sixth number: of data
  std::ifstream taken("/proc/self/statm");
  for (int i = 0; i < 6; ++i) taken >> pages;
  // A sixteenth of what is left is less.
  rlimit limit = before;
  limit.rlim_cur = pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGE_SIZE)) + 64 * kMib;
  REQUIRE(::setrlimit(RLIMIT_DATA, &limit) == 0);
  const bool is_read_under_limit = is_read();
  ::setrlimit(RLIMIT_DATA, &before);
  CHECK_FALSE(is_read_under_limit);
}

TEST_CASE("an error of a mesh that is read early is left to who reads it in its turn", "[early]") {
  test::SmallJob job(kBudget, 2);
  const auto fail = []() -> mesh::Mesh { throw Error(ErrorKind::input, "no mesh"); };
  const auto exhaust = []() -> mesh::Mesh { throw std::bad_alloc(); };
  const auto fail_cost = [](std::uint64_t) -> std::uint64_t {
    throw Error(ErrorKind::input, "no mesh");
  };
  const auto cost = [](std::uint64_t) { return std::uint64_t{1}; };
  CHECK_FALSE(flow::EarlyMesh(job.context, 0, cost, fail).take());
  CHECK_FALSE(flow::EarlyMesh(job.context, 0, cost, exhaust).take());
  CHECK_FALSE(flow::EarlyMesh(job.context, 0, fail_cost, small_mesh).take());
  // Nobody asks for it: the job has ended.
  CHECK_NOTHROW(flow::EarlyMesh(job.context, 0, cost, fail));
}

TEST_CASE("a mesh that is read early is of the files that the job reads", "[early]") {
  const test::TempFolder folder;
  const std::string path = folder.file("mesh.obj");
  const auto size = [&] { return open_input(path)->size_bytes(); };
  std::ofstream(path) << "first";
  test::SmallJob job(kBudget, 2);
  REQUIRE(size() == 5);
  std::filesystem::remove(path);
  std::ofstream(path) << "the second";
  std::atomic<std::uint64_t> seen = 0;
  tbb::task_arena(2).execute([&] {
    flow::EarlyMesh early(
        job.context, 0, [](std::uint64_t) { return std::uint64_t{0}; },
        [&] {
          seen = size();
          return small_mesh();
        });
    // This thread does not read, as long as there is another.
    for (int i = 0; i < 2000 && seen == 0; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    CHECK(early.take());
  });
  CHECK(seen == 5);
}
