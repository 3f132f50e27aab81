// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <vector>

#include "flow/stores/block_readers.h"

namespace pounce::flow {

/// Smaller versions of a job's images, each half as wide and high as the one before (rounded up):
/// columns of their own, found in the cache or made from the level before when they are first asked
/// for. Thread-safe.
class ColourLevels {
 public:
  explicit ColourLevels(job::JobContext& job) : job_(job) {}
  /// `column` is an image's own, `key` that of all of it; it must outlive this. Before any other
  /// use.
  void add(const ColourCache& column, const Hash128& key);

  /// Level 1 or above of an image. Whoever asks first makes it; the others wait. Needs making_bytes
  /// of memory under the caller's lease. Throws as building a store does.
  const ColourCache& get(const ColourCache& column, std::uint32_t level);
  static std::uint64_t making_bytes(std::uint64_t tile_bytes) { return 6 * tile_bytes; }

 private:
  struct Levels {
    Hash128 key;
    std::vector<std::unique_ptr<ColourCache>> made;  ///< from level 1 on; never grows
    std::atomic<std::uint32_t> count{0};             ///< of those that are there
  };
  std::unique_ptr<ColourCache> make(const ColourCache& before, const Hash128& key,
                                    std::uint32_t level);

  job::JobContext& job_;
  std::map<const ColourCache*, Levels> images_;
};

}  // namespace pounce::flow
