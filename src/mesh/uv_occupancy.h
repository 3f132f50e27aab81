// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/page_pool.h"
#include "core/vec.h"

namespace pounce::mesh {

/// The UV triangles that claim texels of one image, of whatever size: what padding must not paint
/// over. Kept small (32 bytes a triangle) because it outlives the mesh. A texel is occupied when a
/// triangle covers its centre, by the rule and the arithmetic of the target's raster.
class UvOccupancy {
 public:
  /// UVs as Mesh has them, v down. Only the part in [tile_u, tile_u + 1) x [tile_v, tile_v + 1)
  /// counts.
  void add(const std::array<Vec2f, 3>& uv, std::int32_t tile_u, std::int32_t tile_v);
  /// Every part of the triangle counts, wrapped into one image. One that spans more than 65536
  /// periods is left out (and covers the image whole many times over; bin_triangles() refuses it).
  void add_wrapped(const std::array<Vec2f, 3>& uv);
  /// To be called once, after the last add.
  void finish();
  std::uint64_t size_bytes() const { return triangles_.capacity() * sizeof(Triangle); }

  /// Rows of one image of that size, from top to bottom.
  class Rows {
   public:
    Rows(const UvOccupancy& occupancy, std::uint32_t width, std::uint32_t height)
        : occupancy_(occupancy), width_(width), height_(height) {}
    /// The next `count` rows: sets occupied[row * width + x] to 1 or 0.
    void next(std::uint32_t count, std::uint8_t* occupied);

   private:
    const UvOccupancy& occupancy_;
    std::uint32_t width_, height_;
    std::uint32_t row_ = 0;
    std::size_t upcoming_ = 0;           ///< triangles before it have begun
    std::vector<std::uint32_t> active_;  ///< begun and not yet ended
  };

 private:
  struct Triangle {
    std::array<Vec2f, 3> uv;
    std::int32_t tile_u = 0, tile_v = 0;
    double top() const;
  };
  PageVector<Triangle> triangles_;  ///< by top(), once finished
};

}  // namespace pounce::mesh
