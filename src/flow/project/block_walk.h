// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

#include "core/bounds.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

inline bool meets(const store::BlockEntry& entry, const std::vector<Box3f>& boxes) {
  for (std::uint32_t i = 0; i < entry.box_count; ++i) {
    for (const Box3f& box : boxes) {
      if (entry.boxes[i].overlaps(box)) return true;
    }
  }
  return false;
}
inline bool meets(const store::SplatEntry& entry, const std::vector<Box3f>& boxes) {
  return std::any_of(boxes.begin(), boxes.end(),
                     [&](const Box3f& box) { return entry.box.overlaps(box); });
}

/// Goes through the blocks of a source that some of the boxes meet, in the order of the store: the
/// join. Holds one part of the index; the cache must outlive it. Not thread-safe.
template <class Cache>
class BlockWalk {
 public:
  using Entry = typename Cache::Entry;
  using Block = typename Cache::Block;

  BlockWalk(const Cache& cache, std::vector<Box3f> boxes)
      : cache_(&cache), boxes_(std::move(boxes)) {
    for (const Box3f& box : boxes_) all_.extend(box);
    find();
  }

  const Box3f& region() const { return all_; }  ///< holds all boxes
  const Entry* entry() const { return done() ? nullptr : &(*index_)[at_]; }
  bool done() const { return tile_ == tiles().size(); }
  void next() {
    ++at_;
    find();
  }

  /// Those of the boxes that meet this entry of the store.
  std::vector<Box3f> boxes_at(const Entry& entry) const {
    std::vector<Box3f> near;
    std::copy_if(boxes_.begin(), boxes_.end(), std::back_inserter(near),
                 [&](const Box3f& box) { return entry.box.overlaps(box); });
    return near;
  }

  /// The next blocks, decoded: as many as cost no more than `most_bytes`, at least one.
  template <class Cost>
  std::vector<std::shared_ptr<const Block>> take(std::uint64_t most_bytes, const Cost& cost) {
    std::vector<std::shared_ptr<const Block>> batch;
    std::uint64_t bytes = 0;
    for (; !done(); next()) {
      bytes += cost(*entry());
      if (!batch.empty() && bytes > most_bytes) break;
      batch.push_back(cache_->block(*entry()));
    }
    return batch;
  }

 private:
  const auto& tiles() const { return cache_->store().directory().tiles; }

  /// Stays, or goes on to the first entry from here that some box meets.
  void find() {
    for (;; ++at_) {
      while (index_ == nullptr || at_ == index_->size()) {
        if (index_ != nullptr) ++tile_;
        index_ = nullptr;
        at_ = 0;
        while (tile_ < tiles().size() && !tiles()[tile_].box.overlaps(all_)) ++tile_;
        if (done()) return;
        index_ = cache_->index(tile_);
      }
      if (meets((*index_)[at_], boxes_)) return;
    }
  }

  const Cache* cache_;
  std::vector<Box3f> boxes_;
  Box3f all_;
  std::shared_ptr<const typename Cache::Index> index_;
  std::uint32_t tile_ = 0;
  std::size_t at_ = 0;
};

}  // namespace pounce::flow
