// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "cube_charts.h"
#include "pounce/error.h"
#include "recipes.h"
#include "texture_pattern.h"
#include "write_textured_mesh.h"

namespace pounce::fixture {
namespace {

/// One strip of the plane per UDIM tile, side by side; together 1 x 1 in the plane z = 0.
GridMesh plane_charts(std::uint64_t triangle_count, std::uint32_t uv_tiles) {
  const double per_tile = static_cast<double>(triangle_count) / (2.0 * uv_tiles);
  const auto cells = std::max(1U, static_cast<std::uint32_t>(std::lround(std::sqrt(per_tile))));
  GridMesh mesh;
  for (std::uint32_t tile = 0; tile < uv_tiles; ++tile) {
    GridChart chart;
    chart.name = fmt::format("strip {}", tile);
    chart.columns = chart.rows = cells;
    chart.uv_sets.push_back(fit_frame(cells, cells, {tile % 10 * 1.0, -1.0 * (tile / 10)}, {1, 1}));
    chart.point = [=](std::uint32_t column, std::uint32_t row) {
      const double x = (1.0 * tile * cells + column) / (1.0 * uv_tiles * cells);
      return SurfacePoint{{x, 1 - row / (1.0 * cells), 0}, {0, 0, 1}};
    };
    mesh.push_back(std::move(chart));
  }
  return mesh;
}

/// One of `tiles` pictures that lie side by side as a map of the world: the head's pattern by
/// longitude (u) and latitude (v).
void world_map_row(std::uint32_t tile, std::uint32_t tiles, std::uint32_t y, std::uint32_t size,
                   std::span<float> row) {
  constexpr double kPi = 3.14159265358979323846;
  for (std::uint32_t x = 0; x < size; ++x) {
    const double reach = 3.6 / size;  // half a diagonal of 2 pi x pi / size at the equator
    const Rgb colour = area_colour(reach, [&](double dx, double dy) {
      const double longitude = ((tile + (x + 0.5 + dx) / size) / tiles - 0.5) * 2 * kPi;
      const double latitude = (0.5 - (y + 0.5 + dy) / size) * kPi;
      const double ring = std::cos(latitude);
      return Vec3d{std::sin(longitude) * ring, std::sin(latitude), std::cos(longitude) * ring};
    });
    for (std::size_t c = 0; c < 3; ++c) row[std::size_t{x} * 3 + c] = colour[c];
  }
}

/// STEM.1001.png and so on, beside a mesh without texture: neither format can name a set.
void write_texture_set(const MeshFiles& files, const PlainOptions& options, Paths& written) {
  const std::uint32_t size = options.texture_size, tiles = options.uv_tiles;
  for (std::uint32_t tile = 0; tile < tiles; ++tile) {
    const std::string path = fmt::format("{}.{}.png", files.stem, 1001 + tile);
    render_image(path, {.width = size, .height = size}, [=](std::uint32_t y, std::span<float> row) {
      world_map_row(tile, tiles, y, size, row);
    });
    written.push_back(path);
  }
}

Paths write(const PlainOptions& options, const GridMesh& mesh) {
  const std::filesystem::path path(options.path);
  const bool glb = path.extension() == ".glb", obj = path.extension() == ".obj";
  if (!glb && !obj) {
    throw Error(
        ErrorKind::usage,
        fmt::format("{}: its ending says no mesh format; write .glb or .obj", options.path));
  }
  const MeshFiles files{(path.parent_path() / path.stem()).string(), glb, obj, "png"};
  Paths written;
  if (const std::uint32_t size = options.texture_size; size == 0) {
    write_plain_mesh(files, mesh, written);
  } else if (options.uv_tiles > 1) {
    write_texture_set(files, options, written);
    write_plain_mesh(files, mesh, written);
  } else {
    write_textured_mesh(
        files, mesh, {.width = size, .height = size},
        [size](std::uint32_t y, std::span<float> row) { world_map_row(0, 1, y, size, row); },
        written);
  }
  return written;
}

}  // namespace

Paths make_sphere(const PlainOptions& options) {
  return write(options, sphere_charts(options.triangles, options.uv_tiles));
}

Paths make_plane(const PlainOptions& options) {
  return write(options, plane_charts(options.triangles, options.uv_tiles));
}

}  // namespace pounce::fixture
