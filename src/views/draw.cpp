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

constexpr float kNowhere = 1e30F;  // behind every depth

/// Whole numbers in the order of the floats.
std::uint32_t in_order(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return (bits >> 31) != 0 ? ~bits : bits | 0x80000000U;
}

}  // namespace

void Canvas::clear() {
  std::fill(std::begin(through), std::end(through), 1.0F);
  for (int i = 0; clips && i < kPixels; ++i) {
    if (begin[i] == kNowhere) through[i] = -1;  // nothing can be drawn there
  }
  std::memset(colour, 0, sizeof colour);
  std::fill(std::begin(depth), std::end(depth), -1.0F);
}

void Canvas::begin_at(float first) {
  clips = true;
  std::fill(std::begin(begin), std::end(begin), first);
}

void Canvas::begin_before(const std::uint16_t* depths, float gap) {
  clips = true;
  for (int y = 0; y < kStoredEdge; ++y) {
    for (int x = 0; x < kStoredEdge; ++x) {
      const std::uint16_t first = depths[y * kStoredEdge + x];
      begin[at(x, y)] = first == kNoDepth ? kNowhere : static_cast<float>(first) - gap;
    }
  }
}

// --- Gaussians that meet a tile ------------------------------------------------------------------

TileSight::TileSight(const Grid& grid, std::uint32_t view, std::uint32_t tile_x,
                     std::uint32_t tile_y, const DrawOptions& options, const ViewKernels& kernels)
    : kernels_(&kernels), harmonics_(options.harmonics) {
  const Frame frame = grid.frame(view);
  const float per_pixel = 1 / grid.pixel(),
              middle = static_cast<float>(grid.edge() / 2) - 0.5F + kApron;
  const float edge = options.fine_edge * per_pixel, square = std::min(edge * edge, 1.0F);
  const float fine = projection::kFootprint * square,
              footprint = fine + projection::kBoxVariance * (1 - square);
  const TileBounds bounds = {frame.right * per_pixel,
                             frame.down * per_pixel,
                             grid.middle(),
                             middle - static_cast<float>(tile_x * kTileEdge),
                             middle - static_cast<float>(tile_y * kTileEdge),
                             per_pixel * 1.0001F,
                             gaussian::kSplatCutOff * std::sqrt(footprint) * 1.0001F,
                             static_cast<float>(kStoredEdge - 1)};
  view_ = {bounds,        frame.right, frame.down,
           frame.forward, per_pixel,   grid.pixel() / grid.depth_step(),
           fine,          footprint,   options.antialiased};
  basis_ = sh_basis<float>(frame.forward.x, frame.forward.y, frame.forward.z);
}

bool TileSight::meets(const Box3f& box) const {
  const Vec3f half = (box.hi - box.lo) * 0.5F, at = (box.hi + box.lo) * 0.5F - view_.bounds.middle;
  const auto meets = [&](Vec3f axis, float first) {
    const float reach =
        (std::abs(axis.x) * half.x + std::abs(axis.y) * half.y + std::abs(axis.z) * half.z) *
            view_.bounds.per_pixel +
        view_.bounds.margin;
    const float place = dot(axis, at) * view_.per_pixel + first;
    return !(place < -reach) &&
           !(place > view_.bounds.last + reach);  // nor does a box without a middle
  };
  return meets(view_.right, view_.bounds.first_x) && meets(view_.down, view_.bounds.first_y);
}

DepthRange TileSight::depths(const Box3f& box) const {
  const Vec3f half = (box.hi - box.lo) * 0.5F, at = (box.hi + box.lo) * 0.5F - view_.bounds.middle;
  const Vec3f& w = view_.forward;
  const float place = dot(w, at),
              reach = std::abs(w.x) * half.x + std::abs(w.y) * half.y + std::abs(w.z) * half.z;
  // More than rounding takes from either.
  const float slack =
      1e-5F * (reach + std::abs(w.x * at.x) + std::abs(w.y * at.y) + std::abs(w.z * at.z)) +
      1e-5F * length(view_.bounds.middle);
  const float nearest = (place - reach - slack) * view_.per_pixel,
              farthest = (place + reach + slack) * view_.per_pixel;
  // A box may be so large that its middle is beyond what floats hold.
  if (!std::isfinite(nearest) || !std::isfinite(farthest)) return {0, kNoEnd - 1};
  return {in_order(nearest), in_order(farthest)};
}

void TileSight::add(const gaussian::SplatColumns& set, std::uint64_t first, Slab& slab) const {
  constexpr std::size_t kOfOne = surface::kLanes;
  // Sixteen spheres of a level are those of one sphere of the level above.
  const auto met_of = [&](const gaussian::SplatSpheres& spheres, std::size_t begin) {
    const unsigned met =
        kernels_->meet(&spheres.centre[0][begin], &spheres.centre[1][begin],
                       &spheres.centre[2][begin], &spheres.radius[begin], view_.bounds);
    const std::size_t left = spheres.count - begin;
    return left < kOfOne ? met & ((1U << left) - 1) : met;
  };
  const auto visit = [&](std::size_t level, std::size_t begin, const auto& use) {
    for (unsigned met = met_of(set.levels[level], begin); met != 0; met &= met - 1)
      use((begin + static_cast<std::size_t>(std::countr_zero(met))) * kOfOne);
  };
  for (std::size_t top = 0; top < set.levels[2].count; top += kOfOne) {
    visit(2, top, [&](std::size_t a) {
      visit(1, a, [&](std::size_t b) {
        const unsigned met = met_of(set.levels[0], b);
        if (met != 0) add_sixteen(set, b, met, first + b, slab);
      });
    });
  }
}

void TileSight::add_sixteen(const gaussian::SplatColumns& set, std::size_t begin, unsigned met,
                            std::uint64_t first, Slab& slab) const {
  Ellipse shown[surface::kLanes];
  std::size_t lanes[surface::kLanes], count = 0;
  const Ellipse* at = shown;
  for (unsigned left = kernels_->show(set, begin, met, view_, shown); left != 0;
       left &= left - 1, ++at) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    const Order order{in_order(at->depth), first + i};
    if (!slab.wants(order)) continue;
    shown[count] = *at;
    shown[count].order = order;
    lanes[count++] = i;
  }
  if (count == 0) return;
  float colours[3][surface::kLanes];
  const std::size_t lobes = harmonics_ ? set.lobes : 0;
  kernels_->colour(set, begin, std::span(basis_).subspan(1, lobes), colours);
  for (std::size_t k = 0; k < count; ++k) {
    Ellipse& e = shown[k];
    e.depth = e.depth * view_.depth_per_pixel + static_cast<float>(kMostDepth / 2);
    for (int c = 0; c < 3; ++c) e.colour[c] = colours[c][lanes[k]];
    slab.add(e);
  }
}

// --- a tile -------------------------------------------------------------------------------------

bool draw_tile(
    const TileSight& sight, std::vector<NearBlock> blocks,
    const std::function<std::shared_ptr<const gaussian::SplatColumns>(const NearBlock&)>& block,
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

std::vector<std::byte> samples_of(const Canvas& canvas, Sharpener& sharpener) {
  const auto alpha_of = [](float through) { return through < 0 ? 0 : 1 - through; };
  PixelRows& pixels = sharpener.pixels();
  for (int y = 0; y < kStoredEdge; ++y) {
    for (int x = 0; x < kStoredEdge; ++x) {
      const int i = Canvas::at(x, y);
      const std::size_t at = PixelRows::at(x, y);
      pixels.depth[at] = canvas.depth[i] >= 0 ? canvas.depth[i] : PixelRows::kNoDepth;
      const float alpha = alpha_of(canvas.through[i]);
      for (int c = 0; c < 3; ++c)
        pixels.colour[c][at] =
            alpha > 0 ? std::min(canvas.colour[c][i] / alpha, gaussian::kLargestSplatColour) : 0;
    }
  }
  const PixelRows& shown = sharpener.sharpened();
  std::vector<std::byte> out(std::size_t{kStoredEdge} * kStoredEdge * kSceneSamples *
                             sizeof(std::uint16_t));
  std::byte* to = out.data();
  for (int y = 0; y < kStoredEdge; ++y) {
    for (int x = 0; x < kStoredEdge; ++x) {
      const int i = Canvas::at(x, y);
      const float alpha = alpha_of(canvas.through[i]);
      std::uint16_t samples[kSceneSamples] = {0, 0, 0, 0, kNoDepth};
      if (alpha > 0) {
        for (int c = 0; c < 3; ++c)
          samples[c] = static_cast<std::uint16_t>(
              shown.colour[c][PixelRows::at(x, y)] * kColourSteps + 0.5F);
        samples[3] = static_cast<std::uint16_t>(alpha * kAlphaSteps + 0.5F);
      }
      if (canvas.depth[i] >= 0) samples[4] = static_cast<std::uint16_t>(canvas.depth[i] + 0.5F);
      std::memcpy(to, samples, sizeof samples);
      to += sizeof samples;
    }
  }
  return out;
}

}  // namespace pounce::views
