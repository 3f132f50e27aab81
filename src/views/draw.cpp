// SPDX-License-Identifier: Apache-2.0
#include "views/draw.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/directions.h"
#include "projection/splat_packet.h"

namespace pounce::views {

namespace {

constexpr float kLeastAlpha = 1.0F / 255;  // of what viewers draw

/// Whole numbers in the order of the floats.
std::uint32_t in_order(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return (bits >> 31) != 0 ? ~bits : bits | 0x80000000U;
}

/// At most 0.05 above the logarithm of a number from 1 on: of its exponent, and two tangents of the
/// logarithm for what is left.
float log_bound(float x) {
  int exponent;
  const float m = 2 * std::frexp(x, &exponent);  // 1..2
  constexpr float kLog2 = 0.69314722F, kLog15 = 0.40546513F;
  return static_cast<float>(exponent - 1) * kLog2 + std::min(m - 1, kLog15 + (m - 1.5F) / 1.5F);
}

}  // namespace

void Canvas::clear() {
  std::fill(std::begin(through), std::end(through), 1.0F);
  std::memset(colour, 0, sizeof colour);
  std::fill(std::begin(depth), std::end(depth), -1.0F);
}

// --- Gaussians that meet a tile ------------------------------------------------------------------

TileSight::TileSight(const Grid& grid, std::uint32_t view, std::uint32_t tile_x,
                     std::uint32_t tile_y, const DrawOptions& options, const ViewKernels& kernels)
    : kernels_(&kernels),
      frame_(grid.frame(view)),
      per_pixel_(1 / grid.pixel()),
      depth_per_pixel_(grid.pixel() / grid.depth_step()),
      options_(options) {
  const float middle = static_cast<float>(grid.edge() / 2) - 0.5F + kApron;
  const float edge = options.fine_edge * per_pixel_, square = std::min(edge * edge, 1.0F);
  fine_ = projection::kFootprint * square;
  footprint_ = fine_ + projection::kBoxVariance * (1 - square);
  bounds_ = {frame_.right * per_pixel_,
             frame_.down * per_pixel_,
             grid.middle(),
             middle - static_cast<float>(tile_x * kTileEdge),
             middle - static_cast<float>(tile_y * kTileEdge),
             per_pixel_ * 1.0001F,
             gaussian::kSplatCutOff * std::sqrt(footprint_) * 1.0001F,
             static_cast<float>(kStoredEdge - 1)};
  basis_ = sh_basis<float>(frame_.forward.x, frame_.forward.y, frame_.forward.z);
}

bool TileSight::meets(const Box3f& box) const {
  const Vec3f half = (box.hi - box.lo) * 0.5F, at = (box.hi + box.lo) * 0.5F - bounds_.middle;
  const auto meets = [&](Vec3f axis, float first) {
    const float reach =
        (std::abs(axis.x) * half.x + std::abs(axis.y) * half.y + std::abs(axis.z) * half.z) *
            bounds_.per_pixel +
        bounds_.margin;
    const float place = dot(axis, at) * per_pixel_ + first;
    return !(place < -reach) && !(place > bounds_.last + reach);  // nor does a box without a middle
  };
  return meets(frame_.right, bounds_.first_x) && meets(frame_.down, bounds_.first_y);
}

DepthRange TileSight::depths(const Box3f& box) const {
  const Vec3f half = (box.hi - box.lo) * 0.5F, at = (box.hi + box.lo) * 0.5F - bounds_.middle;
  const Vec3f& w = frame_.forward;
  const float place = dot(w, at),
              reach = std::abs(w.x) * half.x + std::abs(w.y) * half.y + std::abs(w.z) * half.z;
  // More than rounding takes from either.
  const float slack =
      1e-5F * (reach + std::abs(w.x * at.x) + std::abs(w.y * at.y) + std::abs(w.z * at.z)) +
      1e-5F * length(bounds_.middle);
  const float nearest = (place - reach - slack) * per_pixel_,
              farthest = (place + reach + slack) * per_pixel_;
  // A box may be so large that its middle is beyond what floats hold.
  if (!std::isfinite(nearest) || !std::isfinite(farthest)) return {0, kNoEnd - 1};
  return {in_order(nearest), in_order(farthest)};
}

void TileSight::add(const gaussian::SplatSet& set, std::uint64_t first, Slab& slab) const {
  constexpr std::size_t kOfOne = surface::kLanes;
  // Sixteen spheres of a level are those of one sphere of the level above.
  const auto visit = [&](const gaussian::SplatSpheres& spheres, std::size_t begin,
                         const auto& use) {
    unsigned met = kernels_->meet(&spheres.centre[0][begin], &spheres.centre[1][begin],
                                  &spheres.centre[2][begin], &spheres.radius[begin], bounds_);
    const std::size_t left = spheres.count - begin;
    if (left < kOfOne) met &= (1U << left) - 1;
    for (; met != 0; met &= met - 1) use(begin + static_cast<std::size_t>(std::countr_zero(met)));
  };
  for (std::size_t top = 0; top < set.levels[2].count; top += kOfOne) {
    visit(set.levels[2], top, [&](std::size_t a) {
      visit(set.levels[1], a * kOfOne, [&](std::size_t b) {
        visit(set.levels[0], b * kOfOne, [&](std::size_t i) { add(set, i, first + i, slab); });
      });
    });
  }
}

void TileSight::add(const gaussian::SplatSet& set, std::size_t i, std::uint64_t number,
                    Slab& slab) const {
  const gaussian::SplatShape& g = set.shapes[i];
  const Vec3f from = Vec3f{g.mean[0], g.mean[1], g.mean[2]} - bounds_.middle;
  const float along = dot(frame_.forward, from) * per_pixel_;
  Ellipse e;
  e.order = {in_order(along), number};
  if (!slab.wants(e.order)) return;
  const float square = per_pixel_ * per_pixel_;
  const auto covariance = [&](std::size_t c) { return set.covariance[c][i] * square; };
  const float sxx = covariance(0), sxy = covariance(1), sxz = covariance(2), syy = covariance(3),
              syz = covariance(4), szz = covariance(5);
  const auto times = [&](Vec3f v) {
    return Vec3f{sxx * v.x + sxy * v.y + sxz * v.z, sxy * v.x + syy * v.y + syz * v.z,
                 sxz * v.x + syz * v.y + szz * v.z};
  };
  const Vec3f su = times(frame_.right), sv = times(frame_.down);
  const float uu = dot(frame_.right, su), uv = dot(frame_.right, sv), vv = dot(frame_.down, sv);
  // By the Gaussian's axes nothing cancels, however thin it is (projection/splat_kernels.inl).
  float squares[3], variances[3];
  for (int k = 0; k < 3; ++k) {
    const float cosine = dot(frame_.forward, Vec3f{g.axis[k][0], g.axis[k][1], g.axis[k][2]});
    squares[k] = cosine * cosine;
    variances[k] = g.variance[k] * square;
  }
  const auto det = [&](float f) {
    const float g0 = variances[0] + f, g1 = variances[1] + f, g2 = variances[2] + f;
    return squares[0] * (g1 * g2) + squares[1] * (g0 * g2) + squares[2] * (g0 * g1);
  };
  const float whole = det(footprint_), fine = det(fine_);
  e.opacity = g.alpha;
  if (options_.antialiased) e.opacity *= std::sqrt(det(0) / fine);
  if (footprint_ > fine_) e.opacity *= std::sqrt(fine / whole);  // its integral stays
  if (!(e.opacity >= kLeastAlpha)) return;
  // Beyond that its alpha falls below the least.
  e.cut_off = std::min(gaussian::kSplatCutOff * gaussian::kSplatCutOff,
                       2 * log_bound(e.opacity / kLeastAlpha) + 0.001F);
  e.x = dot(frame_.right, from) * per_pixel_ + bounds_.first_x;
  e.y = dot(frame_.down, from) * per_pixel_ + bounds_.first_y;
  e.reach_x = std::sqrt((uu + footprint_) * e.cut_off);
  e.reach_y = std::sqrt((vv + footprint_) * e.cut_off);
  constexpr float kLast = kStoredEdge - 1;
  if (!(e.x + e.reach_x >= 0 && e.x - e.reach_x <= kLast)) return;
  if (!(e.y + e.reach_y >= 0 && e.y - e.reach_y <= kLast)) return;
  e.xx = (vv + footprint_) / whole;
  e.xy = -uv / whole;
  e.yy = (uu + footprint_) / whole;
  // So large that floats do not hold its shape: nothing is known of where it is.
  if (!std::isfinite(whole) || !std::isfinite(1 / e.xx) || !std::isfinite(1 / e.yy)) return;
  const float wu = dot(frame_.forward, su), wv = dot(frame_.forward, sv);
  e.depth = along * depth_per_pixel_ + static_cast<float>(kMostDepth / 2);
  e.lean_x = (wu * e.xx + wv * e.xy) * depth_per_pixel_;
  e.lean_y = (wu * e.xy + wv * e.yy) * depth_per_pixel_;
  for (int c = 0; c < 3; ++c) {
    float colour = g.colour[c];
    const std::int32_t lobes = options_.harmonics ? g.lobes : 0;
    for (std::int32_t k = 0; k < lobes; ++k)
      colour += basis_[static_cast<std::size_t>(k) + 1] * g.sh[3 * k + c];
    e.colour[c] = std::clamp(colour, 0.0F, gaussian::kLargestSplatColour);
  }
  slab.add(e);
}

// --- a tile -------------------------------------------------------------------------------------

bool draw_tile(
    const TileSight& sight, std::vector<NearBlock> blocks,
    const std::function<std::shared_ptr<const gaussian::SplatSet>(const NearBlock&)>& block,
    const ViewKernels& kernels, Slab& slab, Canvas& canvas) {
  std::sort(blocks.begin(), blocks.end(), [](const NearBlock& a, const NearBlock& b) {
    return std::pair(a.depths.nearest, a.first) < std::pair(b.depths.nearest, b.first);
  });
  bool any = false;
  // False: nothing behind what is nearer than that will show.
  const auto draw = [&](std::uint32_t depth) {
    const auto ellipses = slab.nearer_than(depth);
    if (!any && !ellipses.empty()) canvas.clear();
    any = any || !ellipses.empty();
    const bool is_open = ellipses.empty() || kernels.draw(ellipses, canvas);
    slab.drop();
    return is_open;
  };
  slab.clear();
  do {
    for (const NearBlock& near : blocks) {
      if (!slab.wants(near.depths)) continue;
      if (slab.is_full() && !draw(near.depths.nearest)) return any;
      sight.add(*block(near), near.first, slab);
    }
    if (!draw(kNoEnd)) return any;
  } while (slab.again());
  return any;
}

// --- what is stored ------------------------------------------------------------------------------

std::vector<std::byte> samples_of(const Canvas& canvas) {
  std::vector<std::byte> out(std::size_t{kStoredEdge} * kStoredEdge * kSceneSamples *
                             sizeof(std::uint16_t));
  std::byte* at = out.data();
  for (int y = 0; y < kStoredEdge; ++y) {
    for (int x = 0; x < kStoredEdge; ++x) {
      const int i = Canvas::at(x, y);
      const float alpha = 1 - canvas.through[i];
      std::uint16_t samples[kSceneSamples] = {0, 0, 0, 0, kNoDepth};
      if (alpha > 0) {
        for (int c = 0; c < 3; ++c) {
          const float colour = std::min(canvas.colour[c][i] / alpha, gaussian::kLargestSplatColour);
          samples[c] = static_cast<std::uint16_t>(colour * kColourSteps + 0.5F);
        }
        samples[3] = static_cast<std::uint16_t>(alpha * kAlphaSteps + 0.5F);
      }
      if (canvas.depth[i] >= 0) samples[4] = static_cast<std::uint16_t>(canvas.depth[i] + 0.5F);
      std::memcpy(at, samples, sizeof samples);
      at += sizeof samples;
    }
  }
  return out;
}

}  // namespace pounce::views
