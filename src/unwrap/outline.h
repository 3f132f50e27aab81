// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "core/vec.h"
#include "unwrap/charts.h"

namespace pounce::unwrap {

/// The tangent of half of 45 degrees: with tangents of half angles no function of the library
/// decides where charts go.
inline constexpr double kEighth = 0.41421356237309505;

struct Turn {
  double cosine = 1, sine = 0;
  Vec2d of(Vec2d p) const { return {cosine * p.x - sine * p.y, sine * p.x + cosine * p.y}; }
  Turn quarter(int times) const {
    Turn turn = *this;
    for (; times > 0; --times) turn = {-turn.sine, turn.cosine};
    return turn;
  }
};

struct Box {
  Vec2d low, high;
  double width() const { return high.x - low.x; }
  double height() const { return high.y - low.y; }
};

/// The edges around a chart, in the direction of their triangles.
struct Outline {
  std::vector<std::pair<Vec2d, Vec2d>> edges;
  double length() const;
  Box box(const Turn& turn) const;
  /// The turn, by less than half of one, in which the box is smallest, and lies.
  Turn best_turn() const;
};
Outline outline_of(const Chart& chart);

}  // namespace pounce::unwrap
