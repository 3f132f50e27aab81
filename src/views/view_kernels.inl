// SPDX-License-Identifier: Apache-2.0
//
// Sixteen spheres before a tile, sixteen pixels below an ellipse, sixteen texels in a view:
// compiled once per instruction set with POUNCE_ISA_NAMESPACE set. Pixels are composited as viewers
// do it: alpha = opacity exp(-q / 2), at most 0.99; nothing below 1/255 or beyond the cut-off,
// nothing behind what lets less than 1/255 through.
#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "surface/target_block.h"
#include "views/draw.h"
#include "views/gather.h"

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

unsigned meet(const float* x, const float* y, const float* z, const float* radius,
              const TileBounds& b) {
  const Floats dx = load(x) - b.middle.x, dy = load(y) - b.middle.y, dz = load(z) - b.middle.z;
  const Floats reach = load(radius) * b.per_pixel + b.margin;
  const auto along = [&](Vec3f axis) { return dx * axis.x + dy * axis.y + dz * axis.z; };
  const Floats u = along(b.right) + b.first_x, v = along(b.down) + b.first_y;
  return bits((u + reach >= 0.0F) & (u - reach <= b.last) & (v + reach >= 0.0F) &
              (v - reach <= b.last));
}

unsigned place(const PlaceFrame& f, const surface::TexelPacket& packet, PlacePacket& out) {
  const Floats cosine = all(0.0F) - (load(packet.nx) * f.forward.x + load(packet.ny) * f.forward.y +
                                     load(packet.nz) * f.forward.z);
  store(out.cosine, cosine);
  const Ints faces = cosine >= kLeastCosine;
  const unsigned found = bits(faces);
  if (found == 0) return 0;
  const Floats x = load(packet.px) - f.middle.x, y = load(packet.py) - f.middle.y,
               z = load(packet.pz) - f.middle.z;
  const auto along = [&](Vec3f axis) { return x * axis.x + y * axis.y + z * axis.z; };
  store(out.x, along(f.right) + f.middle_pixel);
  store(out.y, along(f.down) + f.middle_pixel);
  store(out.depth, along(f.forward) * f.per_step + f.middle_depth);
  store(out.weight, select(faces, to_int(cosine * cosine * kWeightSteps + 0.5F), all(0)));
  return found;
}

}  // namespace

extern const ViewKernels kViewKernels;
const ViewKernels kViewKernels{POUNCE_ISA_NAME, meet, draw, place};

}  // namespace pounce::views::POUNCE_ISA_NAMESPACE
