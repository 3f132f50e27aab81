// SPDX-License-Identifier: Apache-2.0
#include "mesh/uv_occupancy.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mesh/lattice.h"
#include "mesh/uv_raster.h"

namespace pounce::mesh {
namespace {

constexpr double kMostPeriods = 65536;
constexpr double kLargestUv = 1e9;

/// The last period that [.., high] has an inner point of.
double last_period(double low, double high) {
  return std::max(std::floor(low), std::ceil(high) - 1);
}

}  // namespace

double UvOccupancy::Triangle::top() const {
  return static_cast<double>(std::min({uv[0].y, uv[1].y, uv[2].y})) - tile_v;
}

void UvOccupancy::add(const std::array<Vec2f, 3>& uv, std::int32_t tile_u, std::int32_t tile_v) {
  triangles_.push_back({uv, tile_u, tile_v});
}

void UvOccupancy::add_wrapped(const std::array<Vec2f, 3>& uv) {
  const auto [low_u, high_u] = std::minmax({uv[0].x, uv[1].x, uv[2].x});
  const auto [low_v, high_v] = std::minmax({uv[0].y, uv[1].y, uv[2].y});
  const double largest =
      std::max({std::abs(low_u), std::abs(high_u), std::abs(low_v), std::abs(high_v)});
  if (!(largest < kLargestUv)) return;
  const double first_u = std::floor(low_u), last_u = last_period(low_u, high_u);
  const double first_v = std::floor(low_v), last_v = last_period(low_v, high_v);
  if ((last_u - first_u + 1) * (last_v - first_v + 1) > kMostPeriods) return;
  for (double v = first_v; v <= last_v; ++v) {
    for (double u = first_u; u <= last_u; ++u)
      add(uv, static_cast<std::int32_t>(u), static_cast<std::int32_t>(v));
  }
}

void UvOccupancy::finish() {
  triangles_.shrink_to_fit();
  std::sort(triangles_.begin(), triangles_.end(),
            [](const Triangle& a, const Triangle& b) { return a.top() < b.top(); });
}

void UvOccupancy::Rows::next(std::uint32_t count, std::uint8_t* occupied) {
  std::memset(occupied, 0, std::size_t{count} * width_);
  const auto& triangles = occupancy_.triangles_;
  const Lattice lattice{width_, height_, 0, {}};
  const std::uint32_t end = row_ + count;
  while (upcoming_ < triangles.size() &&
         triangles[upcoming_].top() * height_ - 0.5 < static_cast<double>(end)) {
    active_.push_back(static_cast<std::uint32_t>(upcoming_++));
  }
  const TexelWindow window{0, row_, width_, end};
  std::erase_if(active_, [&](std::uint32_t index) {
    const Triangle& triangle = triangles[index];
    std::array<Vec2d, 3> corners;
    double bottom = -INFINITY;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = to_texel(lattice, triangle.uv[k]);
      corners[k].x -= static_cast<double>(triangle.tile_u) * width_;
      corners[k].y -= static_cast<double>(triangle.tile_v) * height_;
      bottom = std::max(bottom, corners[k].y);
    }
    raster_triangle(corners, window, [&](std::int64_t y, std::int64_t from, std::int64_t to) {
      std::memset(occupied + static_cast<std::size_t>(y - row_) * width_ + from, 1,
                  static_cast<std::size_t>(to - from));
    });
    return bottom < static_cast<double>(end);
  });
  row_ = end;
}

}  // namespace pounce::mesh
