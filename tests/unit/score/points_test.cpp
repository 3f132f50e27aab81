// SPDX-License-Identifier: Apache-2.0
#include "points.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "image.h"
#include "io/image/write.h"
#include "pounce/error.h"
#include "support/test_data.h"

using namespace pounce;
using namespace pounce::score;
using namespace pounce::test;

namespace {

void write_map(const std::string& path, std::uint32_t channels, const std::vector<float>& samples) {
  io::ImageWriter writer(
      path,
      {.width = 4, .height = 3, .channels = channels, .depth = Depth::float32, .linear = true});
  writer.write_rows(3, reinterpret_cast<const std::byte*>(samples.data()));
  writer.commit();
}

}  // namespace

TEST_CASE("texels are taken from maps with their edges", "[score]") {
  const TempFolder folder;
  // Four columns, 0.5 apart, and three rows, 0.125 apart; the last column is empty.
  std::vector<float> position, normal, mask;
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      const bool covered = x < 3;
      mask.push_back(covered ? 1 : 0);
      const float unit = covered ? 1 : 0;
      position.insert(position.end(), {unit * 0.5F * static_cast<float>(x),
                                       unit * 0.125F * static_cast<float>(y), unit * 2});
      normal.insert(normal.end(), {0, 0, unit});
    }
  }
  write_map(folder.file("m.position.exr"), 3, position);
  write_map(folder.file("m.normal.exr"), 3, normal);
  write_map(folder.file("m.mask.exr"), 1, mask);
  const std::string maps = folder.file("m.<CHANNEL>.exr");

  const Points all = read_points(maps, 100);
  REQUIRE(all.points.size() == 9);
  CHECK(all.width == 4);
  CHECK(all.diagonal == Approx(std::hypot(1.0, 0.25)));
  for (const Point& p : all.points) {
    CHECK(p.edge == Approx(0.25));
    CHECK(p.normal == Vec3d{0, 0, 1});
    CHECK(p.position == Vec3d{0.5 * p.x, 0.125 * p.y, 2});
  }
  const Points some = read_points(maps, 3);
  REQUIRE(some.points.size() == 3);
  for (std::uint32_t i = 0; i < 3; ++i) CHECK(some.points[i].y == i);

  std::vector<Vec3d> picture(12);
  picture[4 * 1 + 2] = {1, 0.2, 0};
  write_image(folder.file("p.png"), 4, 3, picture);
  const std::vector<Vec3d> colours = read_colours(folder.file("p.png"), all);
  CHECK(colours[5].x == 1);
  CHECK(colours[5].y == Approx(0.2));
  CHECK(colours[4] == Vec3d{});
  write_image(folder.file("other.png"), 3, 4, picture);
  CHECK_THROWS_AS(read_colours(folder.file("other.png"), all), Error);
  CHECK_THROWS_AS(read_points(folder.file("m.exr"), 100), Error);
}
