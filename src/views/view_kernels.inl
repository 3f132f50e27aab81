// SPDX-License-Identifier: Apache-2.0
//
// Sixteen spheres before a tile, sixteen pixels below an ellipse, sixteen texels in a view:
// compiled once per instruction set with POUNCE_ISA_NAMESPACE set. Pixels are composited as viewers
// do it: alpha = opacity exp(-q / 2), at most 0.99; nothing below 1/255 or beyond the cut-off,
// nothing behind what lets less than 1/255 through.
#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "gaussian/splat_set.h"
#include "surface/target_block.h"
#include "views/draw.h"
#include "views/gather.h"
#include "views/sharpen.h"
#include "views/target_depth.h"

namespace pounce::views::POUNCE_ISA_NAMESPACE {
namespace {

using surface::kLanes;

#include "projection/lanes.inl"

constexpr float kMostAlpha = 0.99F, kLeastAlpha = 1.0F / 255, kLeastThrough = 1.0F / 255;

#include "projection/double_lanes.inl"
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

constexpr std::size_t kAll = std::size_t{kBlocks} * kBlocks;
constexpr int kAsked = 4;  ///< blocks of a row that an ellipse asks at once: up to three too many
constexpr std::size_t kAllAsked = kAll + kAsked - 1;

/// The ellipses that wait for a block: it is blended when there are so many, all in registers.
struct Waiting {
  static constexpr std::uint32_t kMost = 32;
  std::uint32_t ellipse[kAllAsked][kMost];
  std::uint32_t count[kAllAsked] = {};
};

/// Ellipses lie where they were found, not in their order.
constexpr std::uint32_t kAhead = 8;
inline void prefetch(const Ellipse& e) {
  __builtin_prefetch(&e);
  __builtin_prefetch(reinterpret_cast<const char*>(&e + 1) - 1);
}

/// What waits for a block is composited behind what is there. False: nothing behind it will show.
template <bool clips>
bool blend_waiting(std::span<const Ellipse* const> ellipses, const BlockPixels& pixels, int block,
                   Waiting& waiting, Canvas& canvas) {
  const int at = block * kLanes;
  const Floats x = pixels.x + static_cast<float>(block % kBlocks * kBlock),
               y = pixels.y + static_cast<float>(block / kBlocks * kBlock);
  Floats through = load(canvas.through + at), depth = load(canvas.depth + at);
  Floats red = load(canvas.colour[0] + at), green = load(canvas.colour[1] + at),
         blue = load(canvas.colour[2] + at);
  const Floats begin = clips ? load(canvas.begin + at) : all(0.0F);
  const std::uint32_t count = std::exchange(waiting.count[block], 0);
  Ints crossed = all(0);
  bool open = true;
  // No branch on a pixel's fate: it would be wrong every other time, a whole chain of operations
  // late.
  for (std::uint32_t i = 0; i < count && open; ++i) {
    const Ellipse& e = *ellipses[waiting.ellipse[block][i]];
    prefetch(*ellipses[waiting.ellipse[block][std::min(i + kAhead, count - 1)]]);
    const Floats dx = x - e.x, dy = y - e.y;
    const Floats q = (e.xx * dx + (2 * e.xy) * dy) * dx + e.yy * (dy * dy);
    Ints ok = (q <= e.cut_off) & (through >= kLeastThrough);
    Floats alpha = e.opacity * exp_of_minus(select(q <= e.cut_off, q, all(0.0F)) * 0.5F);
    ok = ok & (alpha >= kLeastAlpha);
    const Floats place = e.lean_x * dx + e.lean_y * dy + e.depth;
    if (clips) ok = ok & (place >= begin);
    alpha = select(alpha < kMostAlpha, alpha, all(kMostAlpha));
    alpha = select(ok, alpha, all(0.0F));
    const Floats weight = through * alpha, left = through - weight;
    red = red + weight * e.colour[0];
    green = green + weight * e.colour[1];
    blue = blue + weight * e.colour[2];
    const Ints crosses = (through > 0.5F) & (left <= 0.5F);
    depth = select(crosses, place, depth);
    crossed = crossed | crosses;
    through = left;
    open = any(through >= kLeastThrough);
  }
  constexpr float kMost = kMostDepth;
  Floats within = select(depth > 0.0F, depth, all(0.0F));
  within = select(within < kMost, within, all(kMost));
  store(canvas.depth + at, select(crossed, within, depth));
  store(canvas.through + at, through);
  store(canvas.colour[0] + at, red);
  store(canvas.colour[1] + at, green);
  store(canvas.colour[2] + at, blue);
  return open;
}

/// The blocks of sixteen rows that an ellipse meets: a range each, ends included; none: first >
/// last.
struct BlockRows {
  alignas(64) std::int32_t first[kLanes], last[kLanes];

  /// From row `top` on; `rows`: the lanes' numbers.
  void set(const Ellipse& e, const Floats& rows, int top) {
    const float per_xx = 1 / e.xx, lean = e.xy * per_xx,
                curve = e.cut_off / (e.reach_y * e.reach_y);
    const auto larger = [](const Floats& a, const Floats& b) { return select(a < b, b, a); };
    const auto smaller = [](const Floats& a, const Floats& b) { return select(b < a, b, a); };
    // Between these heights its middle line leans from one side to the other, and it is no wider to
    // both sides of that than where it is nearest to its middle. A little more: rounding keeps none
    // out.
    const Floats height =
        rows * static_cast<float>(kBlock) + (static_cast<float>(top * kBlock) - e.y);
    const Floats above = larger(height, all(-e.reach_y)),
                 below = larger(above,
                                smaller(height + static_cast<float>(kBlock - 1), all(e.reach_y)));
    const Floats nearest = smaller(larger(above, all(0.0F)), below);
    const Floats half =
        square_root(larger((e.cut_off - curve * (nearest * nearest)) * per_xx, all(0.0F)));
    const Floats at_top = lean * above, at_bottom = lean * below;
    constexpr float kSlack = 0.02F, kLast = kStoredEdge - 1, kPerBlock = 1.0F / kBlock;
    // What is no number is nowhere.
    const Floats left = (e.x - kSlack) - larger(at_top, at_bottom) - half,
                 right = (e.x + kSlack) - smaller(at_top, at_bottom) + half;
    const Floats low = select(left <= kLast + kBlock, larger(left, all(0.0F)), all(kLast + kBlock)),
                 high = select(right >= 0.0F, smaller(right, all(kLast)), all(-1.0F));
    store(first, to_int(low * kPerBlock));
    store(last, select(high >= 0.0F, to_int(high * kPerBlock), all(-1)));
  }
};

template <bool clips>
bool draw(std::span<const Ellipse* const> ellipses, Canvas& canvas) {
  Waiting waiting;
  std::uint32_t open[kAllAsked] = {};  // 1: something behind what is there may show
  std::uint32_t left = 0;
  for (std::size_t b = 0; b < kAll; ++b) {
    open[b] = any(load(canvas.through + b * kLanes) >= kLeastThrough) ? 1 : 0;
    left += open[b];
  }
  const BlockPixels pixels;
  const Floats numbers = pixels.y * static_cast<float>(kBlock) + pixels.x;
  BlockRows rows;
  const auto blend = [&](std::size_t b) {
    if (blend_waiting<clips>(ellipses, pixels, static_cast<int>(b), waiting, canvas)) return;
    open[b] = 0;
    --left;
  };
  for (std::uint32_t i = 0; i < ellipses.size() && left > 0; ++i) {
    const Ellipse& e = *ellipses[i];
    prefetch(*ellipses[std::min<std::size_t>(i + kAhead, ellipses.size() - 1)]);
    constexpr float kLast = kStoredEdge - 1;
    const int end = static_cast<int>(std::min(e.y + e.reach_y, kLast)) / kBlock + 1;
    for (int by = static_cast<int>(std::max(e.y - e.reach_y, 0.0F)) / kBlock, top = -kLanes;
         by < end; ++by) {
      if (by >= top + kLanes) rows.set(e, numbers, top = by);
      // How many blocks and whether they are open nobody can foresee: some at a time are asked
      // without a branch, and some wait nowhere.
      const int last = rows.last[by - top];
      for (int bx = rows.first[by - top]; bx <= last; bx += kAsked) {
        for (int k = 0; k < kAsked; ++k) {
          const auto b = static_cast<std::size_t>(by * kBlocks + bx + k);
          waiting.ellipse[b][waiting.count[b]] = i;
          waiting.count[b] += bx + k <= last ? open[b] : 0;
          if (waiting.count[b] == Waiting::kMost) blend(b);
        }
      }
    }
  }
  for (std::size_t b = 0; b < kAll; ++b) {
    if (waiting.count[b] > 0) blend(b);
  }
  return left > 0;
}

bool draw(std::span<const Ellipse* const> ellipses, Canvas& canvas) {
  return canvas.clips ? draw<true>(ellipses, canvas) : draw<false>(ellipses, canvas);
}

#include "views/depth_lanes.inl"
#include "views/ellipse_lanes.inl"
#include "views/gather_lanes.inl"
#include "views/sharpen_lanes.inl"

unsigned meet(const float* x, const float* y, const float* z, const float* radius,
              const TileBounds& b) {
  const Floats dx = load(x) - b.middle.x, dy = load(y) - b.middle.y, dz = load(z) - b.middle.z;
  const Floats reach = load(radius) * b.per_pixel + b.margin;
  const auto along = [&](Vec3f axis) { return dx * axis.x + dy * axis.y + dz * axis.z; };
  const Floats u = along(b.right) + b.first_x, v = along(b.down) + b.first_y;
  return bits((u + reach >= 0.0F) & (u - reach <= b.last) & (v + reach >= 0.0F) &
              (v - reach <= b.last));
}

}  // namespace

extern const ViewKernels kViewKernels;
const ViewKernels kViewKernels{POUNCE_ISA_NAME, meet,        show,  colour, draw,
                               sharpen,         draw_depths, place, sees,   gather};

}  // namespace pounce::views::POUNCE_ISA_NAMESPACE
