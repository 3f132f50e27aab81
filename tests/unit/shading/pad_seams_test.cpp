// SPDX-License-Identifier: Apache-2.0
#include "shading/pad_seams.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

#include "pounce/error.h"

using pounce::shading::SeamPadder;

namespace {

struct Picture {
  std::uint32_t width = 0, height = 0, texel_bytes = 1;
  std::vector<std::byte> texels;
  std::vector<std::uint8_t> covered;
};

/// Every texel, covered or not, holds bytes of its own: what is not covered must not leak.
Picture make_picture(std::uint32_t width, std::uint32_t height, std::uint32_t texel_bytes) {
  Picture picture{
      width, height, texel_bytes, {}, std::vector<std::uint8_t>(std::size_t{width} * height)};
  picture.texels.resize(std::size_t{width} * height * texel_bytes);
  std::uint32_t state = 1;
  for (std::byte& byte : picture.texels)
    byte = static_cast<std::byte>((state = state * 1664525U + 1013904223U) >> 24);
  return picture;
}

struct Padded {
  std::vector<std::byte> texels;
  std::uint64_t filled = 0;
  bool operator==(const Padded&) const = default;
};

/// The definition, texel by texel: the least (distance, y, x) of all covered ones.
Padded pad_by_search(const Picture& picture, std::uint32_t radius) {
  const auto w = static_cast<std::int64_t>(picture.width),
             h = static_cast<std::int64_t>(picture.height);
  const std::size_t bytes = picture.texel_bytes;
  Padded padded{picture.texels, 0};
  for (std::int64_t y = 0; y < h; ++y) {
    for (std::int64_t x = 0; x < w; ++x) {
      if (picture.covered[static_cast<std::size_t>(y * w + x)] != 0) continue;
      auto best =
          std::make_tuple(std::int64_t{radius} * radius + 1, std::int64_t{0}, std::int64_t{0});
      for (std::int64_t v = 0; v < h; ++v) {
        for (std::int64_t u = 0; u < w; ++u) {
          if (picture.covered[static_cast<std::size_t>(v * w + u)] == 0) continue;
          best = std::min(best, std::make_tuple((u - x) * (u - x) + (v - y) * (v - y), v, u));
        }
      }
      std::byte* const out = padded.texels.data() + static_cast<std::size_t>(y * w + x) * bytes;
      const auto [distance, v, u] = best;
      if (distance > std::int64_t{radius} * radius) {
        std::memset(out, 0, bytes);
      } else {
        std::memcpy(out, picture.texels.data() + static_cast<std::size_t>(v * w + u) * bytes,
                    bytes);
        ++padded.filled;
      }
    }
  }
  return padded;
}

/// Streams the picture in pushes of 1..largest rows and pops of 1..ready rows, sizes drawn from
/// `seed`.
Padded pad_by_stream(const Picture& picture, std::uint32_t radius, std::uint32_t largest,
                     unsigned seed) {
  SeamPadder padder(picture.width, picture.height, radius, picture.texel_bytes, largest);
  const std::size_t row_bytes = std::size_t{picture.width} * picture.texel_bytes;
  Padded padded{std::vector<std::byte>(picture.texels.size()), 0};
  std::mt19937 random(seed);
  std::uint32_t pushed = 0, popped = 0;
  while (pushed < picture.height) {
    const auto rows =
        std::min(picture.height - pushed, 1 + static_cast<std::uint32_t>(random()) % largest);
    padder.push(rows, picture.texels.data() + pushed * row_bytes,
                picture.covered.data() + std::size_t{pushed} * picture.width);
    pushed += rows;
    const std::uint32_t due = pushed == picture.height ? pushed
                              : pushed > radius        ? pushed - radius
                                                       : 0;
    REQUIRE(padder.ready_rows() == due - popped);
    while (padder.ready_rows() > 0) {
      const auto piece = 1 + static_cast<std::uint32_t>(random()) % padder.ready_rows();
      padder.pop(piece, padded.texels.data() + popped * row_bytes);
      popped += piece;
    }
  }
  REQUIRE(popped == picture.height);
  padded.filled = padder.filled();
  return padded;
}

/// Random discs, or single texels where `disc` is 0: charts and speckles.
void cover_at_random(Picture& picture, unsigned seed, int spots, int disc) {
  std::mt19937 random(seed);
  const auto w = static_cast<int>(picture.width), h = static_cast<int>(picture.height);
  for (int i = 0; i < spots; ++i) {
    const int cx = static_cast<int>(random() % picture.width),
              cy = static_cast<int>(random() % picture.height);
    for (int y = std::max(0, cy - disc); y <= std::min(h - 1, cy + disc); ++y) {
      for (int x = std::max(0, cx - disc); x <= std::min(w - 1, cx + disc); ++x) {
        if ((x - cx) * (x - cx) + (y - cy) * (y - cy) <= disc * disc) {
          picture.covered[static_cast<std::size_t>(y * w + x)] = 1;
        }
      }
    }
  }
}

}  // namespace

TEST_CASE("padding takes the nearest covered texel by (distance, y, x), as a search over all does",
          "[texture]") {
  const std::uint32_t radius = GENERATE(0U, 1U, 2U, 5U, 130U);
  const int disc = GENERATE(0, 4);
  const unsigned seed = GENERATE(1U, 2U, 3U);
  const auto [width, height] =
      GENERATE(table<std::uint32_t, std::uint32_t>({{61, 47}, {1, 90}, {90, 1}, {64, 64}}));
  CAPTURE(radius, disc, seed, width, height);
  Picture picture = make_picture(width, height, 3);
  cover_at_random(picture, seed, disc == 0 ? 25 : 5, disc);
  const Padded expected = pad_by_search(picture, radius);
  CHECK(pad_by_stream(picture, radius, height, seed) == expected);
  CHECK(pad_by_stream(picture, radius, 1, seed) == expected);
  CHECK(pad_by_stream(picture, radius, 7, seed) == expected);
}

TEST_CASE("padding decides ties on a regular lattice by the smaller row, then the smaller column",
          "[texture]") {
  // Covered texels every 4 in both directions: nearly every texel between has two or four equally
  // near.
  Picture picture = make_picture(33, 29, 4);
  const std::uint32_t step = GENERATE(2U, 4U, 6U);
  for (std::uint32_t y = 0; y < picture.height; y += step) {
    for (std::uint32_t x = 0; x < picture.width; x += step)
      picture.covered[y * picture.width + x] = 1;
  }
  CHECK(pad_by_stream(picture, 10, 5, 1) == pad_by_search(picture, 10));
}

TEST_CASE("a single covered texel pads a disc of its radius", "[texture]") {
  Picture picture = make_picture(21, 21, 1);
  picture.covered[10 * 21 + 10] = 1;
  picture.texels[10 * 21 + 10] = std::byte{77};
  const Padded padded = pad_by_stream(picture, 5, 3, 1);
  // Lattice points within 5 of the origin: 81, the covered one among them.
  CHECK(padded.filled == 80);
  CHECK(std::count(padded.texels.begin(), padded.texels.end(), std::byte{77}) == 81);
  CHECK(std::count(padded.texels.begin(), padded.texels.end(), std::byte{0}) == 21 * 21 - 81);
}

TEST_CASE("padding leaves a fully covered picture alone and an empty one black", "[texture]") {
  Picture picture = make_picture(40, 30, 6);
  const Padded black = pad_by_stream(picture, 8, 4, 1);
  CHECK(black.filled == 0);
  CHECK(std::all_of(black.texels.begin(), black.texels.end(),
                    [](std::byte b) { return b == std::byte{0}; }));
  std::fill(picture.covered.begin(), picture.covered.end(), std::uint8_t{1});
  const Padded whole = pad_by_stream(picture, 8, 4, 1);
  CHECK(whole.filled == 0);
  CHECK(whole.texels == picture.texels);
}

TEST_CASE("padding copies texels of every size whole", "[texture]") {
  const std::uint32_t texel_bytes = GENERATE(1U, 2U, 3U, 4U, 5U, 6U, 8U, 12U, 16U);
  Picture picture = make_picture(50, 40, texel_bytes);
  cover_at_random(picture, 9, 6, 3);
  CHECK(pad_by_stream(picture, 9, 8, 1) == pad_by_search(picture, 9));
}

TEST_CASE("padding refuses rows that do not fit and a radius that is absurd", "[texture]") {
  SeamPadder padder(4, 100, 2, 1, 8);
  const std::vector<std::byte> texels(4 * 9);
  const std::vector<std::uint8_t> covered(4 * 9);
  CHECK_THROWS_AS(padder.push(9, texels.data(), covered.data()), pounce::Error);
  padder.push(8, texels.data(), covered.data());
  CHECK(padder.ready_rows() == 6);
  CHECK_THROWS_AS(padder.push(8, texels.data(), covered.data()),
                  pounce::Error);  // nothing was popped
  std::vector<std::byte> out(4 * 7);
  CHECK_THROWS_AS(padder.pop(7, out.data()), pounce::Error);
  CHECK_THROWS_AS(SeamPadder(4, 4, 16385, 1, 4), pounce::Error);
}
