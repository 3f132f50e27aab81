// SPDX-License-Identifier: Apache-2.0
//
// External sort. Runs hold consecutive rows of the file and are sorted stably; a merge takes the
// earlier run first where keys are equal. So the result is that of one stable sort of the whole
// file, however the runs were cut, which is what makes the store independent of budget and threads.
//
// Runs are merged in groups of neighbours, which keeps that order; two runs that are not neighbours
// must never be merged before what is between them.
//
// A scene that is little of the budget is one run, or a few, that stay in memory. Else runs are
// scratch: they are read once and soon. They are not compressed, and keys are not stored,
// since the lattice computes them again from what was spilled.
#include "sorting/splat_sort.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <limits>

#include "core/bytes.h"
#include "store/pack/codec.h"

namespace pounce::sorting {
namespace {

using store::Splat;

// A merge holds one chunk per run: 76 KiB, so that hundreds of runs merge in few MiB.
constexpr std::size_t kRunChunk = 1024;
constexpr std::size_t kChunkHeader = 8;
constexpr std::size_t kPlainBytes = offsetof(Splat, normal);  // records without normals
static_assert(sizeof(Splat) == kPlainBytes + sizeof(Vec3f) && sizeof(Splat) == 17 * sizeof(float));
constexpr std::size_t kAhead = 16;  // Gaussians to fetch before they are wanted: a run is no cache
constexpr std::uint64_t kNoKey = std::numeric_limits<std::uint64_t>::max();

/// Of a Gaussian with a normal.
constexpr std::size_t record_bytes(std::uint32_t lobes) {
  return sizeof(Splat) + store::lobe_bytes(lobes);
}

/// The order by key is random in memory, and a run is usually larger than the processor's caches. A
/// Gaussian may span two cache lines, so both ends are fetched.
void prefetch(const Splat& splat) {
  __builtin_prefetch(&splat);
  __builtin_prefetch(reinterpret_cast<const std::byte*>(&splat + 1) - 1);
}

constexpr int kDigitBits = 11;
constexpr std::size_t kDigits = (64 + kDigitBits - 1) / kDigitBits;
constexpr std::size_t kDigitValues = std::size_t{1} << kDigitBits;

}  // namespace

std::uint64_t SplatRuns::splats() const {
  std::uint64_t sum = 0;
  for (const SplatRun& run : runs) sum += run.splats;
  return sum;
}

std::uint64_t SplatRuns::size_bytes() const {
  std::uint64_t sum = runs.capacity() * sizeof(SplatRun);
  for (const SplatRun& run : runs) sum += run.chunks.capacity() * sizeof(store::ChunkRef);
  return sum;
}

void sort_by_key(PageVector<KeyedSplat>& splats, PageVector<KeyedSplat>& scratch) {
  // Least significant digit first; digits that are the same everywhere are skipped.
  // A radix sort is stable by itself, and its memory is known beforehand.
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

/// Gaussians on their way into the pack: their number, the records without normals, then, if any
/// has one, all normals, then all harmonics.
class SplatRunWriter::Chunk {
 public:
  Chunk(SplatRunWriter& writer, SplatRun& run) : writer_(writer), run_(run) {
    bytes_.resize(kChunkHeader + kRunChunk * record_bytes(writer.lobes_));
    sh_.resize(kRunChunk * halves());
  }
  /// `sh`: its coefficients, if there are any.
  void add(const Splat& splat, const std::uint16_t* sh) {
    std::memcpy(&bytes_[kChunkHeader + count_ * kPlainBytes], &splat, kPlainBytes);
    normals_[count_] = splat.normal;
    if (halves() > 0) std::copy_n(sh, halves(), &sh_[count_ * halves()]);
    has_normals_ |= splat.normal != Vec3f{};
    if (++count_ == kRunChunk) flush();
  }
  void flush() {
    if (count_ == 0) return;
    std::memcpy(bytes_.data(), &count_, kChunkHeader);
    std::size_t size = kChunkHeader + count_ * kPlainBytes;
    if (has_normals_) {
      std::memcpy(&bytes_[size], normals_.data(), count_ * sizeof(Vec3f));
      size += count_ * sizeof(Vec3f);
    }
    if (halves() > 0) {
      const std::size_t sh_bytes = count_ * store::lobe_bytes(writer_.lobes_);
      std::memcpy(&bytes_[size], sh_.data(), sh_bytes);
      size += sh_bytes;
    }
    // Where in the pack a chunk lands does not matter: each run has a list of its own chunks.
    const std::lock_guard lock(writer_.mutex_);
    run_.chunks.push_back(writer_.pack_->append(
        store::ChunkKind::block, std::span(bytes_).first(size), static_cast<std::uint32_t>(size)));
    run_.splats += count_;
    count_ = 0;
    has_normals_ = false;
  }

 private:
  std::size_t halves() const { return std::size_t{3} * writer_.lobes_; }

  SplatRunWriter& writer_;
  SplatRun& run_;
  PageVector<std::byte> bytes_;
  PageVector<std::uint16_t> sh_;
  std::array<Vec3f, kRunChunk> normals_;
  std::uint64_t count_ = 0;
  bool has_normals_ = false;
};

SplatRunWriter::SplatRunWriter(job::JobContext& job, std::uint32_t lobes)
    : job_(job), lobes_(lobes), pack_(job.scratch->create(store::PackKind::splats, Hash128{})) {}

std::uint64_t SplatRunWriter::write_bytes(std::uint32_t lobes) {
  return 2 * round_to_pages(kChunkHeader + kRunChunk * record_bytes(lobes)) +
         round_to_pages(kRunChunk * store::lobe_bytes(lobes));
}

SplatRun SplatRunWriter::write(const store::SplatRows& rows, std::span<const KeyedSplat> order) {
  const PageVector<Splat>& splats = rows.splats;
  const std::size_t halves = std::size_t{3} * lobes_;
  SplatRun run;
  Chunk chunk(*this, run);
  for (std::size_t i = 0; i < order.size(); ++i) {
    prefetch(splats[order[std::min(i + kAhead, order.size() - 1)].index]);
    chunk.add(splats[order[i].index], rows.sh.data() + order[i].index * halves);
  }
  chunk.flush();
  return run;
}

SplatRun SplatRunWriter::write(SplatMerge& merge) {
  SplatRun run;
  Chunk chunk(*this, run);
  store::SplatRows one{lobes_, {}, {}};
  std::uint64_t key;
  while (merge.next(one, key)) {
    chunk.add(one.splats.front(), one.sh.data());
    one.splats.clear();
    one.sh.clear();
  }
  chunk.flush();
  return run;
}

std::shared_ptr<store::PackReader> SplatRunWriter::finish() {
  const std::vector<std::byte> nothing(1);
  pack_->finish(
      store::append_payload(*pack_, store::ChunkKind::directory, nothing, job_.compressor()));
  return publish_scratch(job_, std::move(pack_));
}

/// Where a merge stands in one run.
struct SplatMerge::Cursor {
  const SplatRun* run = nullptr;
  std::size_t next = 0;  ///< chunk, or of the order of a run in memory
  std::size_t at = 0;
  PageVector<Splat> splats;
  PageVector<std::uint16_t> sh;
  PageVector<std::uint64_t> keys;
};

std::uint64_t SplatMerge::cursor_bytes(std::uint32_t lobes) {
  return round_to_pages(kRunChunk * sizeof(Splat)) +
         round_to_pages(kRunChunk * store::lobe_bytes(lobes)) +
         round_to_pages(kRunChunk * sizeof(std::uint64_t)) + 512;
}

SplatMerge::SplatMerge(const store::SplatLattice& lattice, std::uint32_t lobes,
                       std::shared_ptr<store::PackReader> pack, std::span<const SplatRun> runs)
    : lattice_(lattice), lobes_(lobes), pack_(std::move(pack)), cursors_(runs.size()) {
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
  if (cursor.run->held) return refill(*cursor.run->held, cursor);
  if (cursor.next == cursor.run->chunks.size()) return;
  const store::StoredChunk chunk =
      pack_->read(cursor.run->chunks[cursor.next++], store::ChunkKind::block);
  ByteReader in(chunk.payload(), pack_->name() + ": run");
  // Checked although the file is the process's own: a disk may return other bytes than were
  // written.
  const auto count = in.get<std::uint64_t>();
  if (count > kRunChunk) in.fail("has more Gaussians than a chunk holds");
  const bool has_normals = in.left() == count * record_bytes(lobes_);
  if (!has_normals && in.left() != count * (record_bytes(lobes_) - sizeof(Vec3f)))
    in.fail("has a different size than its count states");
  cursor.splats.resize(count);
  cursor.keys.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    Splat& s = cursor.splats[i];
    std::memcpy(static_cast<void*>(&s), in.take(kPlainBytes).data(), kPlainBytes);
    s.normal = {};
    cursor.keys[i] = lattice_.key(s);
  }
  if (has_normals) {
    for (Splat& s : cursor.splats) in.get_span(std::span(&s.normal, 1));
  }
  cursor.sh.resize(count * 3 * lobes_);
  if (lobes_ > 0) in.get_span(std::span(cursor.sh));
}

void SplatMerge::refill(const SortedSplats& held, Cursor& cursor) {
  const std::span order =
      std::span(held.order)
          .subspan(cursor.next, std::min(kRunChunk, held.order.size() - cursor.next));
  cursor.next += order.size();
  cursor.splats.clear();
  cursor.sh.clear();
  const std::size_t halves = std::size_t{3} * lobes_;
  for (std::size_t i = 0; i < order.size(); ++i) {
    prefetch(held.rows.splats[order[std::min(i + kAhead, order.size() - 1)].index]);
    const KeyedSplat& own = order[i];
    cursor.keys.push_back(own.key);
    cursor.splats.push_back(held.rows.splats[own.index]);
    const auto sh = held.rows.sh.begin() + static_cast<std::ptrdiff_t>(own.index * halves);
    cursor.sh.insert(cursor.sh.end(), sh, sh + static_cast<std::ptrdiff_t>(halves));
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
    // Equal keys: the lower run wins, as it comes first in the file.
    if (keys_[other] < keys_[winner] || (keys_[other] == keys_[winner] && other < winner)) {
      tree_[node] = winner;
      winner = other;
    }
  }
  tree_[0] = winner;
}

bool SplatMerge::next(store::SplatRows& out, std::uint64_t& key) {
  const std::uint32_t winner = tree_[0];
  if (keys_[winner] == kNoKey) return false;
  Cursor& cursor = cursors_[winner];
  key = keys_[winner];
  out.splats.push_back(cursor.splats[cursor.at]);
  if (lobes_ > 0) {
    const std::uint16_t* const sh = cursor.sh.data() + cursor.at * 3 * lobes_;
    out.sh.insert(out.sh.end(), sh, sh + std::size_t{3} * lobes_);
  }
  ++cursor.at;
  if (cursor.at == cursor.keys.size()) refill(cursor);
  keys_[winner] = cursor.keys.empty() ? kNoKey : cursor.keys[cursor.at];
  replay(winner);
  return true;
}

SplatRuns merge_to_fan_in(job::JobContext& job, const store::SplatLattice& lattice,
                          std::uint32_t lobes, SplatRuns runs, std::size_t fan_in) {
  while (runs.runs.size() > fan_in) {
    SplatRuns merged;
    SplatRunWriter writer(job, lobes);
    for (std::size_t first = 0; first < runs.runs.size(); first += fan_in) {
      const std::size_t count = std::min(fan_in, runs.runs.size() - first);
      SplatMerge merge(lattice, lobes, runs.pack, std::span(runs.runs).subspan(first, count));
      merged.runs.push_back(writer.write(merge));
      job.meter.advance(0);  // stops here if the caller asked to
    }
    merged.pack = writer.finish();
    runs = std::move(merged);
  }
  return runs;
}

}  // namespace pounce::sorting
