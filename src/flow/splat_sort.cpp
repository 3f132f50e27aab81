// SPDX-License-Identifier: Apache-2.0
//
// External sort. Runs hold consecutive rows of the file and are sorted stably; a merge takes the
// earlier run first where keys are equal. So the result is that of one stable sort of the whole
// file, however the runs were cut, which is what makes the store independent of budget and threads.
#include "flow/splat_sort.h"

#include <algorithm>
#include <array>
#include <limits>

#include "tiles/chunk_payload.h"

namespace pounce::flow {
namespace {

using tiles::Splat;
using tiles::SplatBlock;

// A merge holds one decoded chunk per run. 1024 Gaussians are one page per column: the smallest
// chunk that wastes nothing, so that hundreds of runs merge in few MiB.
constexpr std::size_t kRunChunk = 1024;
constexpr std::uint64_t kNoKey = std::numeric_limits<std::uint64_t>::max();

constexpr int kDigitBits = 11;
constexpr std::size_t kDigits = (64 + kDigitBits - 1) / kDigitBits;
constexpr std::size_t kDigitValues = std::size_t{1} << kDigitBits;

float size_of(const Vec3f& sigma) { return std::max({sigma.x, sigma.y, sigma.z}); }

}  // namespace

std::uint64_t SplatRuns::splats() const {
  std::uint64_t sum = 0;
  for (const SplatRun& run : runs) sum += run.splats;
  return sum;
}

std::uint64_t SplatRuns::size_bytes() const {
  std::uint64_t sum = runs.capacity() * sizeof(SplatRun);
  for (const SplatRun& run : runs) sum += run.chunks.capacity() * sizeof(tiles::ChunkRef);
  return sum;
}

void sort_by_key(PageVector<KeyedSplat>& splats, PageVector<KeyedSplat>& scratch) {
  // Least significant digit first; digits that are the same everywhere are skipped.
  std::vector<std::array<std::uint32_t, kDigitValues>> counts(kDigits);
  for (const KeyedSplat& s : splats) {
    for (std::size_t d = 0; d < kDigits; ++d)
      ++counts[d][s.key >> (d * kDigitBits) & (kDigitValues - 1)];
  }
  scratch.resize(splats.size());
  for (std::size_t d = 0; d < kDigits; ++d) {
    auto& begin = counts[d];
    const auto digit = [&](const KeyedSplat& s) {
      return s.key >> (d * kDigitBits) & (kDigitValues - 1);
    };
    if (splats.empty() || begin[digit(splats.front())] == splats.size()) continue;
    std::uint32_t sum = 0;
    for (std::uint32_t& count : begin) {
      const std::uint32_t here = count;
      count = sum;
      sum += here;
    }
    for (const KeyedSplat& s : splats) scratch[begin[digit(s)]++] = s;
    splats.swap(scratch);
  }
}

SplatRunWriter::SplatRunWriter(JobContext& job)
    : job_(job), pack_(job.scratch->create(tiles::PackKind::splats, Hash128{})) {}

std::uint64_t SplatRunWriter::write_bytes() {
  // Gaussians, their columns, those encoded and compressed.
  const std::uint64_t columns = SplatBlock::decoded_bytes(kRunChunk, true);
  return round_to_pages(kRunChunk * sizeof(Splat)) + 4 * columns;
}

SplatRun SplatRunWriter::write(const std::function<bool(Splat&)>& next) {
  SplatRun run;
  PageVector<Splat> splats;
  splats.reserve(kRunChunk);
  SplatBlock block;
  std::vector<std::byte> raw, stored;
  for (bool more = true; more;) {
    Splat splat;
    more = next(splat);
    if (more) splats.push_back(splat);
    if (splats.size() < (more ? kRunChunk : 1)) continue;
    block.assign(splats);
    tiles::encode(block, raw);
    job_.compressor().compress(raw, stored, tiles::kScratchLevel);
    {
      const std::lock_guard lock(mutex_);
      run.chunks.push_back(
          pack_->append(tiles::ChunkKind::block, stored, static_cast<std::uint32_t>(raw.size())));
    }
    run.splats += splats.size();
    splats.clear();
  }
  return run;
}

std::shared_ptr<tiles::PackReader> SplatRunWriter::finish() {
  const std::vector<std::byte> nothing(1);
  pack_->finish(
      tiles::append_payload(*pack_, tiles::ChunkKind::directory, nothing, job_.compressor()));
  return job_.scratch->publish(std::move(pack_));
}

/// Where a merge stands in one run.
struct SplatMerge::Cursor {
  const SplatRun* run = nullptr;
  std::size_t next_chunk = 0;
  std::size_t at = 0;
  SplatBlock block;
  PageVector<std::uint64_t> keys;
};

std::uint64_t SplatMerge::cursor_bytes() {
  return SplatBlock::decoded_bytes(kRunChunk, true) +
         round_to_pages(kRunChunk * sizeof(std::uint64_t)) + 512;
}

SplatMerge::SplatMerge(JobContext& job, const tiles::SplatLattice& lattice,
                       std::shared_ptr<tiles::PackReader> pack, std::span<const SplatRun> runs)
    : job_(job), lattice_(lattice), pack_(std::move(pack)), cursors_(runs.size()) {
  keys_.assign(std::max<std::size_t>(runs.size(), 1), kNoKey);
  tree_.assign(keys_.size(), std::numeric_limits<std::uint32_t>::max());
  for (std::size_t r = 0; r < runs.size(); ++r) {
    cursors_[r].run = &runs[r];
    refill(cursors_[r]);
    keys_[r] = cursors_[r].keys.empty() ? kNoKey : cursors_[r].keys[0];
  }
  for (std::size_t r = keys_.size(); r-- > 0;) replay(r);
}

SplatMerge::~SplatMerge() = default;

void SplatMerge::refill(Cursor& cursor) {
  cursor.at = 0;
  cursor.keys.clear();
  if (cursor.next_chunk == cursor.run->chunks.size()) return;
  const auto raw = tiles::read_payload(*pack_, cursor.run->chunks[cursor.next_chunk++],
                                       tiles::ChunkKind::block, job_.compressor());
  cursor.block = tiles::decode_splats(raw, pack_->name() + ": block");
  const SplatBlock& b = cursor.block;
  cursor.keys.resize(b.size());
  for (std::size_t i = 0; i < b.size(); ++i) {
    cursor.keys[i] = lattice_.key({b.mean[0][i], b.mean[1][i], b.mean[2][i]},
                                  size_of({b.sigma[0][i], b.sigma[1][i], b.sigma[2][i]}));
  }
}

/// Takes a cursor up the tree of losers: each inner node keeps the one that lost there.
void SplatMerge::replay(std::size_t leaf) {
  constexpr std::uint32_t kNobody = std::numeric_limits<std::uint32_t>::max();
  auto winner = static_cast<std::uint32_t>(leaf);
  for (std::size_t node = (leaf + keys_.size()) / 2; node > 0; node /= 2) {
    const std::uint32_t other = tree_[node];
    if (other == kNobody) {  // while the tree is made: wait here for an opponent
      tree_[node] = winner;
      return;
    }
    if (keys_[other] < keys_[winner] || (keys_[other] == keys_[winner] && other < winner)) {
      tree_[node] = winner;
      winner = other;
    }
  }
  tree_[0] = winner;
}

bool SplatMerge::next(Splat& splat, std::uint64_t& key) {
  const std::uint32_t winner = tree_[0];
  if (keys_[winner] == kNoKey) return false;
  Cursor& cursor = cursors_[winner];
  key = keys_[winner];
  splat = cursor.block.splat(cursor.at++);
  if (cursor.at == cursor.keys.size()) refill(cursor);
  keys_[winner] = cursor.keys.empty() ? kNoKey : cursor.keys[cursor.at];
  replay(winner);
  return true;
}

SplatRuns merge_to_fan_in(JobContext& job, const tiles::SplatLattice& lattice, SplatRuns runs,
                          std::size_t fan_in) {
  while (runs.runs.size() > fan_in) {
    SplatRuns merged;
    SplatRunWriter writer(job);
    for (std::size_t first = 0; first < runs.runs.size(); first += fan_in) {
      const std::size_t count = std::min(fan_in, runs.runs.size() - first);
      SplatMerge merge(job, lattice, runs.pack, std::span(runs.runs).subspan(first, count));
      std::uint64_t key;
      merged.runs.push_back(writer.write([&](Splat& splat) { return merge.next(splat, key); }));
      job.meter.advance(0);  // stops here if the caller asked to
    }
    merged.pack = writer.finish();
    runs = std::move(merged);
  }
  return runs;
}

}  // namespace pounce::flow
