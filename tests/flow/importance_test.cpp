// SPDX-License-Identifier: Apache-2.0
#include "sorting/importance.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <thread>

#include "support/bytes.h"
#include "support/test_data.h"

namespace pounce::sorting {
namespace {

/// Gaussians of growing sizes. Reading takes longer than progress stays silent, so that the first
/// that is said of it is said when all are read.
class SlowSource : public gaussian::GaussianSource {
 public:
  std::uint64_t count() const override { return 100; }
  std::uint32_t lobes() const override { return 0; }
  void read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
            store::SplatCounts&) const override {
    std::this_thread::sleep_for(std::chrono::milliseconds(250));
    for (std::uint64_t i = first; i < first + count; ++i) {
      const auto size = static_cast<float>(i + 1);
      out.splats.push_back({});
      out.splats.back().alpha = 1;
      out.splats.back().sigma = {size, size, size};
    }
  }
  std::uint64_t read_bytes() const override { return 0; }
  PageVector<store::Splat> sample() const override { return {}; }
};

TEST_CASE("a wish to stop is heard while the most important Gaussians are looked for", "[flow]") {
  const bool stops = GENERATE(false, true);
  const test::TempFolder folder;
  Progress progress;
  progress.on_event = [&](const ProgressEvent& event) {
    if (stops && event.done == 100) progress.cancel();
  };
  job::JobRun run(&progress);
  job::JobContext job(64 << 20, run);
  job.files = &posix_file_system();
  job.scratch_folder = folder.path().string();
  const SlowSource source;
  job.meter.begin("count", source.count(), "Gaussians", 1);
  std::uint64_t left_out = 0;
  const int kind =
      test::error_kind([&] { left_out = ImportanceCut(job, source, {}, 10, 1000).left_out(); });
  CHECK(kind == (stops ? static_cast<int>(ErrorKind::cancelled) : 0));
  CHECK(left_out == (stops ? 0 : 90));
  CHECK(job.budget.leased() == 0);
}

}  // namespace
}  // namespace pounce::sorting
