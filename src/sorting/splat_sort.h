// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "job/job_context.h"
#include "store/blocks/splat_block.h"
#include "store/blocks/splat_store.h"
#include "store/pack/pack.h"

namespace pounce::sorting {

struct KeyedSplat {
  std::uint64_t key;
  std::uint32_t index;
};

/// Gaussians and the order of their keys, in memory.
struct SortedSplats {
  store::SplatRows rows;
  PageVector<KeyedSplat> order;  ///< of some of the rows
};

/// Gaussians in the order of their keys, in chunks of a scratch pack or in memory.
struct SplatRun {
  std::vector<store::ChunkRef> chunks;
  std::shared_ptr<const SortedSplats> held;  ///< instead of chunks
  std::uint64_t splats = 0;
};

/// Runs in the order of the file they came from: a Gaussian of an earlier run goes before one of a
/// later run that has the same key.
struct SplatRuns {
  std::shared_ptr<store::PackReader> pack;  ///< none: all are in memory
  std::vector<SplatRun> runs;
  std::uint64_t splats() const;
  std::uint64_t size_bytes() const;  ///< memory of the lists of chunks
};

/// Stable. `scratch` takes as much memory as `splats`.
void sort_by_key(PageVector<KeyedSplat>& splats, PageVector<KeyedSplat>& scratch);

class SplatMerge;

/// A scratch pack of runs that several threads write at once. The place of a chunk does not matter.
/// What is written is read once and soon, so it is not compressed: that would save a sixth.
class SplatRunWriter {
 public:
  /// `lobes`: of the harmonics of every Gaussian.
  SplatRunWriter(job::JobContext& job, std::uint32_t lobes);
  /// Appends those of `rows` that `order` names, in that order. Thread-safe.
  SplatRun write(const store::SplatRows& rows, std::span<const KeyedSplat> order);
  /// Appends all that is left of a merge. Thread-safe.
  SplatRun write(SplatMerge& merge);
  std::shared_ptr<store::PackReader> finish();
  /// Memory that one call of write() takes.
  static std::uint64_t write_bytes(std::uint32_t lobes);

 private:
  class Chunk;

  job::JobContext& job_;
  const std::uint32_t lobes_;
  std::mutex mutex_;  ///< guards pack_
  std::unique_ptr<store::PackWriter> pack_;
};

/// Merges runs into one sequence, ordered by key and then by run.
class SplatMerge {
 public:
  SplatMerge(const store::SplatLattice& lattice, std::uint32_t lobes,
             std::shared_ptr<store::PackReader> pack, std::span<const SplatRun> runs);
  ~SplatMerge();
  /// Appends the next Gaussian and tells its key; false at the end.
  bool next(store::SplatRows& out, std::uint64_t& key);
  /// Memory per run that is merged at once, beside what a run in memory holds.
  static std::uint64_t cursor_bytes(std::uint32_t lobes);

 private:
  struct Cursor;
  void refill(Cursor& cursor);
  void refill(const SortedSplats& held, Cursor& cursor);
  void replay(std::size_t leaf);

  const store::SplatLattice& lattice_;
  const std::uint32_t lobes_;
  std::shared_ptr<store::PackReader> pack_;
  std::vector<Cursor> cursors_;
  std::vector<std::uint64_t> keys_;  ///< of the cursors; the largest number there is once it ended
  std::vector<std::uint32_t> tree_;  ///< losers; [0] is the winner
};

/// Merges groups of `fan_in` neighbouring runs until no more than that are left.
SplatRuns merge_to_fan_in(job::JobContext& job, const store::SplatLattice& lattice,
                          std::uint32_t lobes, SplatRuns runs, std::size_t fan_in);

}  // namespace pounce::sorting
