// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace pounce::io {

inline constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Indices of a corner of a face, from 0.
// No material is in it: faces of two materials share vertices where the file's indices say so.
struct CornerKey {
  std::uint32_t position = kNone, texcoord = kNone, normal = kNone;
  bool operator==(const CornerKey&) const = default;
};

/// Numbers equal corners alike, in order of appearance. Most positions have few corners, which a
/// chain per position finds where a file's neighbours are: in the cache, unlike a hash table. What
/// is beyond kMostChained, as at the pole of a fan, goes to a table. Deterministic.
class CornerSet {
 public:
  void reserve(std::size_t corners, std::size_t positions) {
    keys_.reserve(corners);
    next_.reserve(corners);
    first_.reserve(positions);
  }
  std::uint32_t number_of(const CornerKey& key) {
    if (key.position >= first_.size()) first_.resize(std::size_t{key.position} + 1, kNone);
    std::uint32_t* link = &first_[key.position];
    for (int chained = 0; chained < kMostChained; ++chained) {
      if (*link == kNone) {
        *link = static_cast<std::uint32_t>(keys_.size());
        return add(key);  // may move `link`
      }
      if (keys_[*link] == key) return *link;
      link = &next_[*link];
    }
    return crowded(key);
  }
  const std::vector<CornerKey>& keys() const { return keys_; }

 private:
  static constexpr int kMostChained = 8;

  std::uint32_t add(const CornerKey& key) {
    keys_.push_back(key);
    next_.push_back(kNone);
    return static_cast<std::uint32_t>(keys_.size() - 1);
  }
  std::uint32_t crowded(const CornerKey& key) {
    if (crowded_ * 2 >= slots_.size()) grow();
    std::uint32_t& slot = slot_of(key);
    if (slot == kNone) {
      slot = add(key);
      ++crowded_;
    }
    return slot;
  }
  static std::size_t hash(const CornerKey& key) {
    std::uint64_t h = key.position * 0x9E3779B97F4A7C15ULL;
    h = (h ^ (h >> 32) ^ key.texcoord) * 0xD6E8FEB86659FD93ULL;
    h = (h ^ (h >> 32) ^ key.normal) * 0xD6E8FEB86659FD93ULL;
    return h ^ (h >> 32);
  }
  /// Its own, or the free one where it belongs. Open addressing.
  std::uint32_t& slot_of(const CornerKey& key) {
    std::size_t slot = hash(key) & (slots_.size() - 1);
    while (slots_[slot] != kNone && keys_[slots_[slot]] != key)
      slot = (slot + 1) & (slots_.size() - 1);
    return slots_[slot];
  }
  // Twice as many slots; keys stay where they are, so numbers do not change.
  void grow() {
    const std::vector<std::uint32_t> old =
        std::exchange(slots_, std::vector(std::max<std::size_t>(1024, slots_.size() * 2), kNone));
    for (const std::uint32_t i : old) {
      if (i != kNone) slot_of(keys_[i]) = i;
    }
  }

  std::vector<CornerKey> keys_;
  std::vector<std::uint32_t> first_;  ///< by position
  std::vector<std::uint32_t> next_;   ///< by corner: another one of its position
  std::vector<std::uint32_t> slots_;  ///< of the crowded ones
  std::size_t crowded_ = 0;
};

}  // namespace pounce::io
