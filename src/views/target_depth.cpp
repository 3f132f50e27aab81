// SPDX-License-Identifier: Apache-2.0
//
// A triangle between the pixels' middles leaves no depth: its depth is that of its neighbours, but
// where it is alone texels on it are seen by no view.
#include "views/target_depth.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>

namespace pounce::views {
TargetDepths draw_target(const mesh::Mesh& mesh, const Grid& grid, const ViewKernels& kernels,
                         std::uint32_t view, std::uint32_t first_tile_y, std::uint32_t tile_rows) {
  TargetDepths out;
  out.first_tile_y = first_tile_y;
  out.tile_rows = tile_rows;
  out.row = grid.edge() + 2 * kApron;
  for (auto* depths : {&out.samples, &out.facing}) {
    depths->resize(std::size_t{out.row} * out.rows() + TargetDepths::kBehind);
    std::fill(depths->begin(), depths->end(), kNoDepth);
  }
  const double above = static_cast<double>(first_tile_y * kTileEdge) - kApron;
  const auto corner = [&](std::uint32_t vertex) {
    const Seen seen = grid.see(view, mesh.positions[vertex]);
    return DepthTriangle::Corner{double{seen.x} + kApron, double{seen.y} - above,
                                 double{seen.depth}};
  };
  constexpr std::size_t kAtOnce = 64;
  std::vector<DepthTriangle> seen;
  seen.reserve(kAtOnce);
  const auto draw = [&] {
    kernels.draw_depths(seen, out);
    seen.clear();
  };
  for (const auto* triangles : {&mesh.triangles, &mesh.rest}) {
    for (const auto& t : *triangles) {
      const Vec3f normal = mesh.normals[t[0]] + mesh.normals[t[1]] + mesh.normals[t[2]];
      const bool faces = dot(normal, grid.frame(view).forward) < 0;
      seen.push_back({{corner(t[0]), corner(t[1]), corner(t[2])}, faces});
      if (seen.size() == kAtOnce) draw();
    }
  }
  draw();
  return out;
}

bool TargetDepths::has(std::uint32_t tile_x, std::uint32_t tile_y) const {
  for (std::size_t y = 0; y < kStoredEdge; ++y) {
    const std::uint16_t* const first = samples.data() + at(tile_x, tile_y, y);
    std::uint16_t set_in_all = kNoDepth;  // bits: none of its own is missing where nothing is
    for (int x = 0; x < kStoredEdge; ++x) set_in_all &= first[x];
    if (set_in_all != kNoDepth) return true;
  }
  return false;
}

std::vector<std::byte> TargetDepths::tile(std::uint32_t tile_x, std::uint32_t tile_y) const {
  constexpr std::size_t kRowBytes = kStoredEdge * sizeof(std::uint16_t);
  std::vector<std::byte> out(kStoredEdge * kRowBytes);
  for (std::size_t y = 0; y < kStoredEdge; ++y)
    std::memcpy(out.data() + y * kRowBytes, samples.data() + at(tile_x, tile_y, y), kRowBytes);
  return out;
}

std::vector<std::byte> TargetDepths::inside(std::uint32_t tile_x, std::uint32_t tile_y,
                                            float gap) const {
  constexpr std::size_t kPixels = std::size_t{kStoredEdge} * kStoredEdge, kLeast = kPixels / 50;
  std::vector<std::uint16_t> depths(kPixels, kNoDepth);
  std::size_t count = 0;
  for (std::size_t y = 0; y < kStoredEdge; ++y) {
    const std::size_t first = at(tile_x, tile_y, y);
    for (std::size_t x = 0; x < kStoredEdge; ++x) {
      const std::uint16_t nearest = samples[first + x], front = facing[first + x];
      if (front == kNoDepth || static_cast<float>(front - nearest) <= gap) continue;
      depths[y * kStoredEdge + x] = front;
      ++count;
    }
  }
  if (count < kLeast) return {};
  const auto bytes = std::as_bytes(std::span(depths));
  return {bytes.begin(), bytes.end()};
}

}  // namespace pounce::views
