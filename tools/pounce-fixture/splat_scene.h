// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "recipes.h"
#include "surface.h"
#include "texture_pattern.h"

namespace pounce::fixture {

/// What the splats of a scene are: every row of the file is of one kind, and how many there are of
/// each is known exactly.
struct SplatCounts {
  std::uint64_t surface = 0;   ///< flat discs along the surface, with its colours
  std::uint64_t needles = 0;   ///< the same place and colour, but long and thin
  std::uint64_t interior = 0;  ///< hidden below the surface, in the complement of its colours
  std::uint64_t floaters = 0;  ///< large, grey to bright, outside
  std::uint64_t haze = 0;      ///< large, nearly transparent, just outside
  std::uint64_t broken = 0;    ///< of each of kBrokenKinds
};
/// NaN in a column, all zeros as rotation, an infinite scale, a place 1e7 away, opacity -12.
inline constexpr std::uint64_t kBrokenKinds = 5;

/// The scene that options describe, one row at a time. A row depends on the options and its index
/// alone. Thread-safe.
class SplatScene {
 public:
  /// Throws Error(usage) if nothing is left for the surface.
  explicit SplatScene(const SplatOptions& options);

  const SplatCounts& counts() const { return counts_; }
  /// Mean distance of neighbouring means on the surface, in the scene's units.
  double spacing() const { return spacing_; }
  /// Standard deviation of the surface's means along its normals, in the scene's units.
  double noise() const { return noise_; }
  /// Columns of a row: x y z, nx ny nz, f_dc, f_rest, opacity, scale, rot.
  std::size_t columns() const { return 17 + rest_; }
  std::size_t rest_columns() const { return rest_; }
  /// Fills row `index` (below options.count); `row` has columns() values.
  void fill(std::uint64_t index, std::span<float> row) const;

  /// The picture on the scene's shape, sRGB-coded: the head's pattern, or on the sphere broad waves
  /// (no period below a twelfth of a turn), which some 10,000 splats can carry.
  Rgb colour(Vec3d direction) const;

 private:
  struct Draw;
  enum class Kind { surface, needle, interior, floater, haze };
  struct Splat;

  Kind kind_of(std::uint64_t rank) const;
  Splat place(Kind kind, Draw& draw) const;

  HeadSurface surface_;
  bool is_sphere_;
  std::uint64_t count_, seed_, stride_;
  std::size_t rest_;
  SplatCounts counts_;
  double spacing_ = 0, noise_ = 0;
};

}  // namespace pounce::fixture
