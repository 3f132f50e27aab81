// SPDX-License-Identifier: Apache-2.0
//
// What all stages of a running job share.
//
// The destructor completes the report, since a job may end at any line: what is known only at the
// end, such as times, peaks and notes of the cache, is in the report of a job that failed, too.
#include "job/job_context.h"

#include <algorithm>
#include <filesystem>
#include <span>

#include "core/input_file.h"
#include "core/page_pool.h"

namespace pounce::job {

namespace {

Hash128 hash_of(JobContext& job, const ReadFile& file) {
  // In pieces, under a lease: a scene may be larger than memory.
  constexpr std::uint64_t kPiece = 1 << 17;
  const runtime::Lease lease(job.budget, kPiece, "hashing the inputs");
  PageVector<std::byte> bytes(std::min(kPiece, file.size_bytes()));
  Hasher hash;
  for (std::uint64_t at = 0; at < file.size_bytes(); at += bytes.size()) {
    const auto piece =
        std::span(bytes).first(std::min<std::uint64_t>(bytes.size(), file.size_bytes() - at));
    file.read(at, piece);
    hash.add(std::span<const std::byte>(piece));
    job.meter.advance(0);  // stops here if the caller asked to
  }
  return hash.digest();
}

}  // namespace

Hash128 file_hash(JobContext& job, const std::string& path) {
  return job.content_hash(path, 0, 0, [&] { return hash_of(job, *open_input(path)); });
}

std::uint64_t size_on_disk(const std::vector<std::string>& files) {
  std::uint64_t bytes = 0;
  for (const std::string& file : files) {
    std::error_code failed;
    const std::uint64_t size = std::filesystem::file_size(file, failed);
    if (!failed) bytes += size;
  }
  return bytes;
}

JobContext::~JobContext() {
  try {
    report.threads = threads;
    report.stages = clock.times();
    for (StageTime& stage : report.stages) {
      if (stage.name == "decode") stage.cached = report.images_decoded == 0;
    }
    if (stores != nullptr) {
      for (std::string& note : stores->take_notes()) report.warnings.push_back(std::move(note));
    }
    if (!plan_only) report.output_bytes = size_on_disk(report.outputs);
    if (scratch_account != nullptr) report.temp_peak_bytes = scratch_account->peak_bytes();
    report.memory_budget_bytes = budget.limit();
    report.leased_peak_bytes = budget.leased_peak();
    report.peak_rss_bytes = peak_rss_bytes();
  } catch (const std::bad_alloc&) {
    // The job has ended already; its report says less.
  }
}

std::unique_ptr<store::PackReader> JobContext::find_pack(store::PackKind kind, const Hash128& key) {
  std::string warning;
  auto pack = stores->find(kind, key, &warning);
  // The wait is over, with a pack or with the claim to make it: its time stops, and progress goes
  // on.
  waiting.reset();
  meter.resume();
  if (!warning.empty()) report.warnings.push_back(warning);
  return pack;
}

void JobContext::count_store(const store::PackReader& pack, bool cached) {
  if (!cached) report.bytes_written += pack.size_bytes();
}

std::unique_ptr<store::PackReader> publish_scratch(JobContext& job,
                                                   std::unique_ptr<store::PackWriter> writer) {
  return job.scratch->publish(std::move(writer));
}

ScratchPack::~ScratchPack() { job_.scratch->discard(kind_, key_); }

}  // namespace pounce::job
