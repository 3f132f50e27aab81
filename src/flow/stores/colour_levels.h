// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
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
  /// The last level of an image: it fits into a few texels.
  static std::uint32_t last_level(const store::ColourDirectory& image);
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

/// What a level says of itself before it is made.
store::ColourDirectory level_of(const store::ColourDirectory& image, std::uint32_t level);

/// How the texels of a level's row (or column) come from those of the level before: texel i is the
/// mean of `count` texels from `first` on, weighted.
struct LevelSpan {
  std::uint32_t first = 0, count = 0;
  std::array<std::uint32_t, 3> weights{};
};
/// `size` texels become (size + 1) / 2 of equal width. The weights of each are `level_total(size)`.
LevelSpan level_span(std::uint32_t i, std::uint32_t size);
std::uint32_t level_total(std::uint32_t size);

}  // namespace pounce::flow
