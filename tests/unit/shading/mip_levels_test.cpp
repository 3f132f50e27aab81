// SPDX-License-Identifier: Apache-2.0
#include "shading/mip_levels.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "core/portable_math.h"
#include "mesh/lattice.h"

using namespace pounce;
using shading::MipLevels;

namespace {

/// All levels of an image whose rows are handed over `together` at a time.
std::map<std::uint32_t, std::vector<std::byte>> levels_of(ImageSize size, std::uint32_t channels,
                                                          Depth depth, const void* samples,
                                                          std::size_t sample_bytes,
                                                          std::uint32_t together) {
  std::map<std::uint32_t, std::vector<std::byte>> levels;
  std::vector<std::size_t> row_bytes;
  for (ImageSize level = size;; level = mesh::next_level_size(level)) {
    row_bytes.push_back(level.width * channels * sample_bytes);
    if (level.width == 1 && level.height == 1) break;
  }
  MipLevels made(size, channels, depth);
  const auto* from = static_cast<const std::byte*>(samples);
  for (std::uint32_t y = 0; y < size.height; y += together) {
    const std::uint32_t rows = std::min(together, size.height - y);
    made.push(rows, from + y * row_bytes[0], [&](std::uint32_t level, const std::byte* row) {
      levels[level].insert(levels[level].end(), row, row + row_bytes.at(level));
    });
  }
  return levels;
}

template <class Sample>
std::vector<Sample> as(const std::vector<std::byte>& bytes) {
  std::vector<Sample> samples(bytes.size() / sizeof(Sample));
  std::memcpy(samples.data(), bytes.data(), bytes.size());
  return samples;
}

}  // namespace

TEST_CASE("levels halve down to one texel", "[mip]") {
  CHECK(shading::level_count({1, 1}) == 1);
  CHECK(shading::level_count({2, 1}) == 2);
  CHECK(shading::level_count({70, 37}) == 7);
  CHECK(shading::level_count({65536, 3}) == 17);
  CHECK(mesh::next_level_size({5, 1}) == ImageSize{2, 1});
}

TEST_CASE("a texel of even sides is the mean of four, rounded once per level", "[mip]") {
  const std::uint32_t together = GENERATE(1U, 3U, 4U);
  const std::vector<std::uint8_t> image{0, 1,  10, 20,  //
                                        1, 0,  30, 41,  //
                                        7, 7,  0,  0,   //
                                        7, 10, 0,  255};
  const auto levels = levels_of({4, 4}, 1, Depth::u8, image.data(), 1, together);
  // 0.5, 25.25, 7.75 and 63.75; their mean is 24.3125, that of their rounded values 24.5.
  CHECK(as<std::uint8_t>(levels.at(1)) == std::vector<std::uint8_t>{1, 25, 8, 64});
  CHECK(as<std::uint8_t>(levels.at(2)) == std::vector<std::uint8_t>{24});
  CHECK(levels.size() == 2);
}

TEST_CASE("an odd side is filtered where its texels lie", "[mip]") {
  // Texels of two lie at 0.75 and 3.25 of five; that of one in the middle of two.
  const std::vector<float> row{0, 100, 1000, 4, 8};
  const auto levels = levels_of({5, 1}, 1, Depth::float32, row.data(), 4, 1);
  CHECK(as<float>(levels.at(1)) == std::vector<float>{75, 5});
  CHECK(as<float>(levels.at(2)) == std::vector<float>{40});
  // The same downwards, with another channel beside it.
  std::vector<float> column;
  for (const float v : row) column.insert(column.end(), {v, -v});
  const auto down = levels_of({1, 5}, 2, Depth::float32, column.data(), 4, 2);
  CHECK(as<float>(down.at(1)) == std::vector<float>{75, -75, 5, -5});
  CHECK(as<float>(down.at(2)) == std::vector<float>{40, -40});
}

TEST_CASE("levels keep what their depth can hold", "[mip]") {
  const std::vector<std::uint16_t> deep{65535, 65534, 65535, 65535};
  CHECK(as<std::uint16_t>(levels_of({2, 2}, 1, Depth::u16, deep.data(), 2, 1).at(1)) ==
        std::vector<std::uint16_t>{65535});
  std::vector<std::uint16_t> halves;
  for (const float v : {40.0F, -2.0F, 0.5F, 1.5F}) halves.push_back(float_to_half(v));
  CHECK(half_to_float(as<std::uint16_t>(
            levels_of({2, 2}, 1, Depth::half, halves.data(), 2, 1).at(1))[0]) == 10);
  // What is beyond a texel with no share in it does not matter, be it infinite.
  const float infinite = std::numeric_limits<float>::infinity();
  const std::vector<float> narrow{1, 3, infinite, 5};
  const auto levels = levels_of({1, 4}, 1, Depth::float32, narrow.data(), 4, 4);
  CHECK(as<float>(levels.at(1)) == std::vector<float>{2, infinite});
}

TEST_CASE("means of four round halves to even, whatever the channels and the count", "[mip]") {
  store::ColourDirectory image;
  const std::size_t channels = GENERATE(1, 2, 3, 4, 5);
  const Depth depth = GENERATE(Depth::u8, Depth::u16);
  image.channels = static_cast<std::uint32_t>(channels);
  image.depth = depth;
  const std::size_t size = store::depth_bytes(depth), count = 131;  // more than is made at once
  const std::uint32_t most = depth == Depth::u8 ? 255 : 65535;
  std::vector<std::byte> rows[2];
  std::mt19937 random(7);
  const auto get = [&](const std::byte* at) {
    std::uint32_t value = 0;
    std::memcpy(&value, at, size);
    return value;
  };
  for (auto& row : rows) {
    for (std::size_t i = 0; i < 2 * count * channels; ++i) {
      const auto value =
          static_cast<std::uint32_t>(i < 40 ? most - random() % 3 : random() % (most + 1));
      const auto* const bytes = reinterpret_cast<const std::byte*>(&value);
      row.insert(row.end(), bytes, bytes + size);
    }
  }
  std::vector<std::byte> out(count * channels * size);
  shading::mean_of_fours(image, rows[0].data(), rows[1].data(), count, out.data());
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < channels; ++c) {
      double sum = 0;
      for (const auto& row : rows) {
        for (const std::size_t x : {2 * i, 2 * i + 1})
          sum += get(row.data() + (x * channels + c) * size);
      }
      CHECK(get(out.data() + (i * channels + c) * size) == std::nearbyint(sum / 4));
    }
  }
}

TEST_CASE("levels are made of fours only as far as both sides are even", "[mip]") {
  store::ColourDirectory image;
  image.width = 96;
  image.height = 40;
  CHECK(shading::is_halved_evenly(image, 3));
  CHECK_FALSE(shading::is_halved_evenly(image, 4));  // 5 rows
  image.depth = Depth::half;
  CHECK_FALSE(shading::is_halved_evenly(image, 1));
}
