// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/vec.h"

namespace pounce::io {

/// Three numbers that tell a vertex from others.
using Triple = std::array<std::uint32_t, 3>;

/// Of a place in space; both zeros are one.
inline Triple place_key(Vec3f p) {
  return {std::bit_cast<std::uint32_t>(p.x + 0.0F), std::bit_cast<std::uint32_t>(p.y + 0.0F),
          std::bit_cast<std::uint32_t>(p.z + 0.0F)};
}

/// Numbers equal triples alike, in order of appearance. Open addressing; deterministic.
class TripleSet {
 public:
  std::uint32_t number_of(const Triple& key) {
    if (keys_.size() * 2 >= slots_.size()) grow();
    const std::size_t slot = find(key);
    if (slots_[slot] == kNone) {
      slots_[slot] = static_cast<std::uint32_t>(keys_.size());
      keys_.push_back(key);
    }
    return slots_[slot];
  }
  const std::vector<Triple>& keys() const { return keys_; }

  /// What it takes while it grows, with so many different keys.
  static constexpr std::uint64_t bytes(std::uint64_t keys) {
    return keys * (3 * sizeof(Triple) + 6 * sizeof(std::uint32_t)) + (1U << 14);
  }

 private:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::size_t find(const Triple& key) const {
    std::uint64_t hash = key[0] * 0x9E3779B97F4A7C15ULL;
    hash = (hash ^ (hash >> 32) ^ key[1]) * 0xD6E8FEB86659FD93ULL;
    hash = (hash ^ (hash >> 32) ^ key[2]) * 0xD6E8FEB86659FD93ULL;
    std::size_t slot = (hash ^ (hash >> 32)) & (slots_.size() - 1);
    while (slots_[slot] != kNone && keys_[slots_[slot]] != key)
      slot = (slot + 1) & (slots_.size() - 1);
    return slot;
  }
  void grow() {
    slots_.assign(std::max<std::size_t>(1024, slots_.size() * 2), kNone);
    for (std::uint32_t i = 0; i < keys_.size(); ++i) slots_[find(keys_[i])] = i;
  }

  std::vector<Triple> keys_;
  std::vector<std::uint32_t> slots_;
};

}  // namespace pounce::io
