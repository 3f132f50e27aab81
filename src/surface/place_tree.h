// SPDX-License-Identifier: Apache-2.0
//
// Places of a surface by where they are: a balanced k-d tree.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"
#include "surface/strewn_places.h"

namespace pounce::surface {

/// Immutable, so any number of threads may ask it at once.
class PlaceTree {
 public:
  explicit PlaceTree(std::span<const Place> places);

  /// The nearest place less than `most` away whose normal and `normal` have a cosine of at least
  /// `facing`; of several that are as near the first of the span. Null if there is none.
  const Place* nearest(Vec3f point, Vec3f normal, float facing, float most) const;

 private:
  struct Node {
    Place place;
    std::uint32_t number = 0;  ///< in the span
    std::uint8_t axis = 0;     ///< across which its range is split
  };
  struct Query;
  void split(std::size_t first, std::size_t last);
  void search(std::size_t first, std::size_t last, Query& query) const;

  /// The middle of a range is its node; those before it are not beyond it along its axis, those
  /// behind it not before.
  std::vector<Node> nodes_;
};

}  // namespace pounce::surface
