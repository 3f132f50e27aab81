// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "surface/target_block.h"

namespace pounce::surface {

/// Texels of a block that lie together, fewer than fill their packets, until they are joined with
/// what else lies there: of neighbours in the image where charts meet, many are on other sides of
/// the object, and neighbours there are anywhere in the block.
class ChartFragments {
 public:
  /// At most 64 texels, in the order in which packets shall have them.
  void add(std::span<const std::uint16_t> texels);
  /// Calls add_group(texels) with all of them, at most 64 at a time: fragments in an order of
  /// space, joined if they lie near and face alike. If that makes more than `most_packets` of
  /// sixteen texels, fragments are joined that lie farther apart, at last wherever they are and
  /// whatever they face. No more than 3/32 packets per texel and one are ever made, so
  /// `most_packets` must be that at least.
  void join(const TargetBlock& maps, std::size_t most_packets,
            const std::function<void(std::span<const std::uint16_t>)>& add_group);
  /// Of so many texels, at most.
  static constexpr std::uint64_t most_bytes(std::uint64_t texels) {
    return 2 * texels * (sizeof(Fragment) + sizeof(std::uint16_t)) +  // twice: they grow
           2 * (texels + 1) * sizeof(std::uint16_t);                  // cuts, old and new
  }

 private:
  struct Fragment {
    std::uint64_t key = 0;               ///< place on a curve through space
    std::uint16_t first = 0, count = 0;  ///< of texels_
  };
  void sort(const TargetBlock& maps);
  /// The first fragment of each group, and the end.
  std::vector<std::uint16_t> cut(const TargetBlock& maps, float far) const;
  std::size_t packets_of(std::span<const std::uint16_t> cuts) const;
  TargetBlock::Texel first_of(const TargetBlock& maps, const Fragment& fragment) const {
    return maps.texel(texels_[fragment.first]);
  }

  std::vector<Fragment> fragments_;
  std::vector<std::uint16_t> texels_;
};

}  // namespace pounce::surface
