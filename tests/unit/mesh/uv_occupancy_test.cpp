// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <string>

#include "mesh/block_bins.h"
#include "mesh/uv_raster.h"
#include "support/random.h"

using namespace pounce;
using mesh::UvOccupancy;

namespace {

std::vector<std::uint8_t> rows_of(const UvOccupancy& occupancy, std::uint32_t width,
                                  std::uint32_t height, std::uint32_t step) {
  std::vector<std::uint8_t> out(std::size_t{width} * height, 9);
  UvOccupancy::Rows rows(occupancy, width, height);
  for (std::uint32_t y = 0; y < height; y += step) {
    rows.next(std::min(step, height - y), out.data() + std::size_t{y} * width);
  }
  return out;
}

std::string picture(const std::vector<std::uint8_t>& rows, std::size_t width) {
  std::string text;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    text += rows[i] == 0 ? '.' : rows[i] == 1 ? '#' : '?';
    if ((i + 1) % width == 0) text += '\n';
  }
  return text;
}

}  // namespace

TEST_CASE("occupied is what a triangle covers, v down", "[mesh]") {
  UvOccupancy occupancy;
  // The upper left half of the image without its diagonal, and a square of 2 x 2 texels of 8.
  occupancy.add({Vec2f{0, 0}, Vec2f{1, 0}, Vec2f{0, 1}}, 0, 0);
  occupancy.add({Vec2f{.75F, .75F}, Vec2f{1, .75F}, Vec2f{1, 1}}, 0, 0);
  occupancy.add({Vec2f{.75F, .75F}, Vec2f{1, 1}, Vec2f{.75F, 1}}, 0, 0);
  occupancy.finish();
  const std::string wanted =
      "#######.\n"
      "######..\n"
      "#####...\n"
      "####....\n"
      "###.....\n"
      "##......\n"
      "#.....##\n"
      "......##\n";
  for (const std::uint32_t step : {1U, 3U, 8U}) {
    CHECK(picture(rows_of(occupancy, 8, 8, step), 8) == wanted);
  }
}

TEST_CASE("what leaves the image wraps or stays outside", "[mesh]") {
  const std::array<Vec2f, 3> uv{Vec2f{.5F, 0}, Vec2f{1.5F, 0}, Vec2f{.5F, 1}};
  UvOccupancy tile, next, wrapped;
  tile.add(uv, 0, 0);
  next.add(uv, 1, 0);
  wrapped.add_wrapped(uv);
  for (UvOccupancy* each : {&tile, &next, &wrapped}) each->finish();
  CHECK(picture(rows_of(tile, 4, 4, 4), 4) == "..##\n..##\n..#.\n....\n");
  CHECK(picture(rows_of(next, 4, 4, 4), 4) == "#...\n....\n....\n....\n");
  CHECK(picture(rows_of(wrapped, 4, 4, 4), 4) == "#.##\n..##\n..#.\n....\n");
}

TEST_CASE("rows in any steps are the rasters of all triangles", "[mesh]") {
  test::Random random(7);
  std::vector<std::array<Vec2f, 3>> triangles;
  UvOccupancy occupancy;
  for (int i = 0; i < 200; ++i) {
    const auto at = [&] { return Vec2f{random.between(-.2F, 1.2F), random.between(-.2F, 1.2F)}; };
    const Vec2f a = at();
    const auto by = [&] { return random.between(-.1F, .1F); };
    triangles.push_back({a, a + Vec2f{by(), by()}, a + Vec2f{by(), by()}});
    occupancy.add(triangles.back(), 0, 0);
  }
  occupancy.finish();
  const std::uint32_t width = 97, height = 61;
  std::vector<std::uint8_t> wanted(std::size_t{width} * height);
  for (const auto& uv : triangles) {
    std::array<Vec2d, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) corners[k] = mesh::to_texel({width, height, 0, {}}, uv[k]);
    mesh::raster_triangle(corners, {0, 0, width, height},
                          [&](std::int64_t y, std::int64_t from, std::int64_t to) {
                            for (std::int64_t x = from; x < to; ++x)
                              wanted[static_cast<std::size_t>(y * width + x)] = 1;
                          });
  }
  for (const std::uint32_t step : {1U, 7U, 64U}) {
    CHECK(rows_of(occupancy, width, height, step) == wanted);
  }
}
