// SPDX-License-Identifier: Apache-2.0
//
// Ellipses composited on the pixels of a tile, sixteen at a time: compiled once per instruction set
// with POUNCE_ISA_NAMESPACE set. As viewers do it: alpha = opacity exp(-q / 2), at most 0.99;
// nothing below 1/255 or beyond the cut-off, nothing behind what lets less than 1/255 through.
#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "surface/target_block.h"
#include "views/draw.h"

namespace pounce::views::POUNCE_ISA_NAMESPACE {
namespace {

using surface::kLanes;

#include "projection/lanes.inl"

constexpr float kMostAlpha = 0.99F, kLeastAlpha = 1.0F / 255, kLeastThrough = 1.0F / 255;

#include "projection/exp_lanes.inl"

constexpr int kBlock = Canvas::kBlock, kBlocks = Canvas::kBlocks;
static_assert(kBlock * kBlock == kLanes);

/// Where the pixels of a block lie from its first.
struct BlockPixels {
  BlockPixels() {
    alignas(64) float numbers[2][kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      numbers[0][lane] = static_cast<float>(lane % kBlock);
      numbers[1][lane] = static_cast<float>(lane / kBlock);
    }
    x = load(numbers[0]);
    y = load(numbers[1]);
  }
  Floats x, y;
};

/// One ellipse on a block, `dx` and `dy` from its middle. False: none of the pixels will show what
/// comes behind.
[[gnu::always_inline]] inline bool blend(const Ellipse& e, const Floats& dx, const Floats& dy,
                                         int at, Canvas& canvas) {
  const Floats through = load(canvas.through + at);
  const Floats q = (e.xx * dx + (2 * e.xy) * dy) * dx + e.yy * (dy * dy);
  Ints ok = (q <= e.cut_off) & (through >= kLeastThrough);
  if (!any(ok)) return true;
  Floats alpha = e.opacity * exp_of_minus(select(ok, q, all(0.0F)) * 0.5F);
  ok = ok & (alpha >= kLeastAlpha);
  alpha = select(alpha < kMostAlpha, alpha, all(kMostAlpha));
  alpha = select(ok, alpha, all(0.0F));
  const Floats weight = through * alpha, left = through - weight;
  store(canvas.through + at, left);
  for (int c = 0; c < 3; ++c)
    store(canvas.colour[c] + at, load(canvas.colour[c] + at) + weight * e.colour[c]);
  const Ints crosses = (through > 0.5F) & (left <= 0.5F);
  if (any(crosses)) {
    Floats depth = e.lean_x * dx + e.lean_y * dy + e.depth;
    depth = select(depth > 0.0F, depth, all(0.0F));
    constexpr float kMost = kMostDepth;
    depth = select(depth < kMost, depth, all(kMost));
    store(canvas.depth + at, select(crosses, depth, load(canvas.depth + at)));
  }
  return any(left >= kLeastThrough);
}

/// Whole numbers of blocks between two places, within the tile.
inline int first_block(float low) { return static_cast<int>(std::max(low, 0.0F)) / kBlock; }
inline int last_block(float high) {
  return static_cast<int>(std::min(high, static_cast<float>(kStoredEdge - 1))) / kBlock;
}

bool draw(std::span<const Ellipse* const> ellipses, Canvas& canvas) {
  bool open[kBlocks * kBlocks];
  int left = 0;
  for (int b = 0; b < kBlocks * kBlocks; ++b) {
    open[b] = any(load(canvas.through + b * kLanes) >= kLeastThrough);
    left += open[b] ? 1 : 0;
  }
  const BlockPixels pixels;
  for (const Ellipse* const ellipse : ellipses) {
    const Ellipse& e = *ellipse;
    if (left == 0) return false;
    const float per_xx = 1 / e.xx, lean = e.xy * per_xx,
                curve = e.cut_off / (e.reach_y * e.reach_y);
    // How far it is seen to both sides of its middle line, at a height.
    const auto half = [&](float dy) {
      return std::sqrt(std::max((e.cut_off - curve * dy * dy) * per_xx, 0.0F));
    };
    const int last_y = last_block(e.y + e.reach_y);
    for (int by = first_block(e.y - e.reach_y); by <= last_y; ++by) {
      // Of the rows of blocks between these heights: it is widest where it is, or at the nearest
      // of them. A little more: rounding keeps none out.
      const float above = std::max(static_cast<float>(by * kBlock) - e.y, -e.reach_y),
                  below = std::min(static_cast<float>(by * kBlock + kBlock - 1) - e.y, e.reach_y);
      const float at_right = std::clamp(e.widest_y, above, std::max(above, below)),
                  at_left = std::clamp(-e.widest_y, above, std::max(above, below));
      constexpr float kSlack = 0.02F;
      const float low = e.x - lean * at_left - half(at_left) - kSlack,
                  high = e.x - lean * at_right + half(at_right) + kSlack;
      if (!(high >= 0 && low <= static_cast<float>(kStoredEdge - 1))) continue;
      const Floats dy = pixels.y + (static_cast<float>(by * kBlock) - e.y);
      const int last_x = last_block(high);
      for (int bx = first_block(low); bx <= last_x; ++bx) {
        const int b = by * kBlocks + bx;
        if (!open[b]) continue;
        const Floats dx = pixels.x + (static_cast<float>(bx * kBlock) - e.x);
        if (!blend(e, dx, dy, b * kLanes, canvas)) {
          open[b] = false;
          --left;
        }
      }
    }
  }
  return left > 0;
}

}  // namespace

extern const DrawKernels kDrawKernels;
const DrawKernels kDrawKernels{POUNCE_ISA_NAME, draw};

}  // namespace pounce::views::POUNCE_ISA_NAMESPACE
