// SPDX-License-Identifier: Apache-2.0
//
// Where a scene is seen from all around, and where a point of space lies in each of these views.
//
// Views are orthographic, from directions that all texels share. Each is a square of tiles around
// the middle of a region of space, which holds the target and is cut along round numbers, so that
// targets of about the same place and size share their scene's views. All views together are one
// tall image, view below view: a colour store holds it.
#pragma once

#include <cstdint>
#include <vector>

#include "core/bounds.h"
#include "core/hash.h"
#include "core/vec.h"
#include "mesh/lattice.h"
#include "store/blocks/colour_store.h"

namespace pounce::views {

/// Pixels of a tile, and with those around it that its neighbours have, too.
inline constexpr int kTileEdge = mesh::kBlockEdge, kApron = store::kApron,
                     kStoredEdge = store::kColourTileEdge;

/// Colours 0..kLargestSplatColour in whole steps of 16 bits.
inline constexpr float kColourSteps = 8191;
inline constexpr float kAlphaSteps = 65535;
/// Depths count from the eye; where nothing is seen there is none.
inline constexpr std::uint16_t kMostDepth = 65534, kNoDepth = 65535;
/// Samples of a pixel of the scene: colours (of what is there), alpha, depth. Of a target: depth.
inline constexpr std::uint32_t kSceneSamples = 5, kTargetSamples = 1;

/// Of a tile as it is stored, decoded.
constexpr std::uint64_t tile_bytes(std::uint32_t samples) {
  return std::uint64_t{kStoredEdge} * kStoredEdge * samples * sizeof(std::uint16_t);
}

/// The axes of a view: unit vectors, at right angles; `forward` leads away from the eye.
struct Frame {
  Vec3f right, down, forward;
};

/// Eyes evenly around: points of a spherical Fibonacci lattice (Swinbank and Purser 2006), whose
/// axis is z. The same bits on every machine.
std::vector<Frame> frames_around(std::uint32_t views);

/// A point in a view: in pixels, whose centres are whole numbers, from the upper left one of the
/// view, and in steps of depth.
struct Seen {
  float x, y, depth;
};

class Grid {
 public:
  /// No view is more tiles across: a region's diagonal is at most 1.3 times its target's, and
  /// pixels are not finer than 1.4 thousandths of that, rounded.
  static constexpr std::uint32_t kMostAcross = 18;

  /// Of a target's box. `edge`: of its texels, finer pixels than which show nothing; pixels are not
  /// finer than 1.4 thousandths of the box's diagonal either (docs/decisions/061-views.md).
  Grid(const Box3f& target, float edge, std::uint32_t views);

  /// Seen from within instead: each view begins at the plane through a point across its direction.
  void begin_within(Vec3f point);

  std::uint32_t views() const { return static_cast<std::uint32_t>(frames_.size()); }
  bool begins_within() const { return !begins_.empty(); }
  /// Of a view from within, in steps of depth: nothing is seen before.
  float begin(std::uint32_t view) const { return begins_[view]; }
  const Frame& frame(std::uint32_t view) const { return frames_[view]; }
  float pixel() const { return pixel_; }                  ///< its edge in space
  std::uint32_t tiles_across() const { return across_; }  ///< of a view, both ways
  std::uint32_t edge() const { return across_ * kTileEdge; }
  Vec3f middle() const { return middle_; }      ///< of the region, and of every view
  float diagonal() const { return diagonal_; }  ///< of the region
  float depth_step() const { return depth_step_; }
  /// Of a distance in space.
  float in_steps(float distance) const { return distance / depth_step_; }

  Seen see(std::uint32_t view, Vec3f point) const {
    const Frame& f = frames_[view];
    const Vec3f from = point - middle_;
    return {dot(f.right, from) * per_pixel_ + middle_pixel_,
            dot(f.down, from) * per_pixel_ + middle_pixel_,
            dot(f.forward, from) * per_step_ + static_cast<float>(kMostDepth / 2)};
  }
  /// The other way round.
  Vec3f place(std::uint32_t view, const Seen& seen) const {
    const Frame& f = frames_[view];
    return middle_ +
           (f.right * (seen.x - middle_pixel_) + f.down * (seen.y - middle_pixel_)) * pixel_ +
           f.forward * ((seen.depth - static_cast<float>(kMostDepth / 2)) * depth_step_);
  }
  /// Does some of the region lie in a tile, with its apron?
  bool has(std::uint32_t view, std::uint32_t tile_x, std::uint32_t tile_y) const;
  std::uint64_t tiles() const;  ///< that some of the region lies in, of all views

  /// The tall image of all views, with so many samples per pixel.
  store::ColourDirectory image(std::uint32_t samples) const;
  /// Its row of tiles.
  std::uint32_t tile_row(std::uint32_t view, std::uint32_t tile_y) const {
    return view * across_ + tile_y;
  }
  void add_to(Hasher& hash) const;  ///< all that decides where a point is seen

 private:
  std::vector<Frame> frames_;
  std::vector<float> begins_;  ///< by view; none: from outside
  Box3f region_;
  Vec3f middle_;
  float diagonal_ = 0, pixel_ = 0, per_pixel_ = 0, middle_pixel_ = 0, depth_step_ = 0,
        per_step_ = 0;
  std::uint32_t across_ = 0;
};

}  // namespace pounce::views
