// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "io/image/write.h"
#include "pounce/compare.h"
#include "support/test_data.h"

using Catch::Matchers::Contains;
using pounce::compare;
using pounce::Comparison;
using pounce::Depth;

namespace {

template <class Sample>
std::string write(const pounce::test::TempFolder& folder, const std::string& name,
                  std::uint32_t width, std::uint32_t height, std::uint32_t channels, Depth depth,
                  const std::vector<Sample>& samples) {
  const std::string path = folder.file(name);
  REQUIRE(samples.size() == std::size_t{width} * height * channels);
  pounce::io::ImageWriter writer(path, {width, height, channels, depth, false, channels % 2 == 0});
  writer.write_rows(height, reinterpret_cast<const std::byte*>(samples.data()));
  writer.commit();
  return path;
}

using U8 = std::vector<std::uint8_t>;
using U16 = std::vector<std::uint16_t>;

}  // namespace

TEST_CASE("similarity, PSNR and the largest error are those worked by hand", "[compare]") {
  pounce::test::TempFolder folder;
  const auto a = write(folder, "a.png", 2, 2, 1, Depth::u8, U8{0, 51, 102, 255});
  const auto b = write(folder, "b.png", 2, 2, 1, Depth::u8, U8{0, 0, 204, 255});
  // Errors 0, 0.2, 0.4, 0: mean 0.15; mean of squares (0.04 + 0.16) / 4 = 0.05.
  const Comparison c = compare(a, b);
  CHECK(c.similarity == Approx(0.85).margin(1e-12));
  CHECK(c.psnr_db == Approx(13.010299956639813).margin(1e-9));
  CHECK(c.largest_error == Approx(0.4).margin(1e-12));
  CHECK(c.largest_x == 0);
  CHECK(c.largest_y == 1);
  CHECK(c.texels == 4);
  CHECK(c.channels == 1);
}

TEST_CASE("equal images are infinitely alike", "[compare]") {
  pounce::test::TempFolder folder;
  const auto a = write(folder, "a.png", 1, 1, 3, Depth::u8, U8{1, 2, 3});
  const Comparison c = compare(a, a);
  CHECK(c.similarity == 1);
  CHECK(c.psnr_db == std::numeric_limits<double>::infinity());
  CHECK(c.largest_error == 0);
}

TEST_CASE("8 and 16 bit images are compared on one scale", "[compare]") {
  pounce::test::TempFolder folder;
  const auto a = write(folder, "a.png", 2, 1, 1, Depth::u8, U8{255, 51});
  const auto b =
      write(folder, "b.png", 2, 1, 1, Depth::u16, U16{65535, 13107});  // 51/255 = 13107/65535
  CHECK(compare(a, b).largest_error == 0);
}

TEST_CASE("B's alpha is the mask, and alpha itself is not compared", "[compare]") {
  pounce::test::TempFolder folder;
  const auto a = write(folder, "a.png", 2, 1, 3, Depth::u8, U8{10, 20, 30, 255, 255, 255});
  const auto b = write(folder, "b.png", 2, 1, 4, Depth::u8, U8{10, 20, 81, 1, 0, 0, 0, 0});
  const Comparison c = compare(a, b);
  CHECK(c.texels == 1);
  CHECK(c.channels == 3);
  CHECK(c.largest_error == Approx(0.2).margin(1e-12));
  CHECK(c.similarity == Approx(1 - 0.2 / 3).margin(1e-12));
  const auto other = write(folder, "c.png", 2, 1, 4, Depth::u8, U8{10, 20, 81, 200, 9, 9, 9, 9});
  CHECK(compare(other, b).similarity == 1);
}

TEST_CASE("a mask image selects texels by its first channel, and alpha is compared then",
          "[compare]") {
  pounce::test::TempFolder folder;
  const auto a =
      write(folder, "a.png", 3, 1, 4, Depth::u8, U8{9, 9, 9, 255, 9, 9, 9, 255, 9, 9, 9, 255});
  const auto b =
      write(folder, "b.png", 3, 1, 4, Depth::u8, U8{0, 9, 9, 255, 9, 9, 9, 204, 9, 9, 9, 0});
  const auto mask = write(folder, "m.png", 3, 1, 3, Depth::u8, U8{0, 255, 255, 1, 0, 0, 0, 0, 0});
  const Comparison c = compare(a, b, mask);
  CHECK(c.texels == 1);
  CHECK(c.channels == 4);
  CHECK(c.largest_x == 1);
  CHECK(c.largest_error == Approx(0.2).margin(1e-12));
}

TEST_CASE("a number that is not one counts as infinitely wrong", "[compare]") {
  pounce::test::TempFolder folder;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto a = write(folder, "a.exr", 2, 1, 1, Depth::float32, std::vector<float>{1, nan});
  const auto b = write(folder, "b.exr", 2, 1, 1, Depth::float32, std::vector<float>{1, 2});
  const Comparison c = compare(a, b);
  CHECK(c.psnr_db == -std::numeric_limits<double>::infinity());
  CHECK(c.largest_x == 1);
  CHECK(compare(a, a).similarity == 1);
}

TEST_CASE("images that cannot be compared say why", "[compare]") {
  pounce::test::TempFolder folder;
  const auto a = write(folder, "a.png", 2, 1, 1, Depth::u8, U8{1, 2});
  const auto b = write(folder, "b.png", 1, 2, 1, Depth::u8, U8{1, 2});
  const auto black = write(folder, "black.png", 2, 1, 1, Depth::u8, U8{0, 0});
  CHECK_THROWS_WITH(compare(a, b), Contains("2 x 1") && Contains("1 x 2") && Contains("b.png"));
  CHECK_THROWS_WITH(compare(a, a, b), Contains("b.png"));
  CHECK_THROWS_WITH(compare(a, a, black), Contains("mask is empty") && Contains("black.png"));
  CHECK_THROWS_WITH(compare(a, folder.file("no.png")), Contains("no.png"));
}
