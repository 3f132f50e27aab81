// SPDX-License-Identifier: Apache-2.0
#include "views/sharpen.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "gaussian/splat_set.h"
#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::views;
using namespace pounce::test;

namespace {

std::vector<const ViewKernels*> kernels() {
  std::vector<const ViewKernels*> all;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const ViewKernels* found = nullptr;
    if (error_kind([&] { found = &view_kernels(isa); }) == 0) all.push_back(found);
  }
  return all;
}

constexpr Sharpening kHow{4, 100, 0.4F};
constexpr float kDepth = 5000;

struct Pixel {
  Vec3f colour;
  float depth = kDepth;
};

/// Sharpens a tile by all kernels, which agree to the bit.
std::unique_ptr<PixelRows> sharpened(const std::function<Pixel(int x, int y)>& pixel_at,
                                     const Sharpening& how = kHow) {
  std::unique_ptr<PixelRows> first;
  for (const ViewKernels* k : kernels()) {
    const auto sharpener = std::make_unique<Sharpener>(how, *k);
    for (int y = 0; y < kStoredEdge; ++y) {
      for (int x = 0; x < kStoredEdge; ++x) {
        const Pixel pixel = pixel_at(x, y);
        const std::size_t at = PixelRows::at(x, y);
        sharpener->pixels().colour[0][at] = pixel.colour.x;
        sharpener->pixels().colour[1][at] = pixel.colour.y;
        sharpener->pixels().colour[2][at] = pixel.colour.z;
        sharpener->pixels().depth[at] = pixel.depth;
      }
    }
    auto found = std::make_unique<PixelRows>(sharpener->sharpened());
    if (first) {
      std::size_t unlike = 0;
      for (int y = 0; y < kStoredEdge; ++y) {
        for (int c = 0; c < 3; ++c)
          unlike +=
              std::memcmp(&found->colour[c][PixelRows::at(0, y)],
                          &first->colour[c][PixelRows::at(0, y)], kStoredEdge * sizeof(float)) == 0
                  ? 0
                  : 1;
      }
      CHECK(unlike == 0);
    } else {
      first = std::move(found);
    }
  }
  return first;
}

float red(const PixelRows& pixels, int x, int y) { return pixels.colour[0][PixelRows::at(x, y)]; }

/// Grey with one pixel that is brighter.
std::function<Pixel(int x, int y)> dot_at(int x, int y) {
  return [=](int at_x, int at_y) {
    const float value = at_x == x && at_y == y ? 1.0F : 0.5F;
    return Pixel{{value, value, value}};
  };
}

}  // namespace

TEST_CASE("a pixel moves away from four pairs on a ring around it", "[views]") {
  const auto found = sharpened(dot_at(20, 30));
  CHECK(red(*found, 20, 30) == Approx(1 + 0.4 * 0.5));
  // It is one of a pair of each of these: a quarter of 0.4 of the difference to 0.75.
  for (const auto& [dx, dy] : {std::pair{4, 0}, {0, 4}, {3, 3}, {3, -3}}) {
    CHECK(red(*found, 20 + dx, 30 + dy) == Approx(0.5 - 0.1 * 0.25));
    CHECK(red(*found, 20 - dx, 30 - dy) == Approx(0.5 - 0.1 * 0.25));
  }
  CHECK(red(*found, 21, 30) == 0.5F);
  CHECK(red(*found, 22, 32) == 0.5F);
  CHECK(red(*found, 25, 30) == 0.5F);
}

TEST_CASE("pairs that lead out of the tile say nothing", "[views]") {
  CHECK(red(*sharpened(dot_at(2, 30)), 2, 30) == Approx(1 + 0.1 * 0.5));
  CHECK(red(*sharpened(dot_at(3, 30)), 3, 30) == Approx(1 + 0.3 * 0.5));
  CHECK(red(*sharpened(dot_at(kStoredEdge - 3, 30)), kStoredEdge - 3, 30) == Approx(1.05));
  CHECK(red(*sharpened(dot_at(30, 0)), 30, 0) == Approx(1.05));
  CHECK(red(*sharpened(dot_at(30, kStoredEdge - 1)), 30, kStoredEdge - 1) == Approx(1.05));
  CHECK(red(*sharpened(dot_at(0, 0)), 0, 0) == 1);
}

TEST_CASE("a slope of colours stays, up to the tile's edges", "[views]") {
  const auto slope = [](int x, int y) {
    return static_cast<float>(x) * 0.01F + static_cast<float>(y) * 0.005F;
  };
  const auto found = sharpened([&](int x, int y) { return Pixel{{slope(x, y), 0.25F, 0}}; });
  float worst = 0;
  for (int y = 0; y < kStoredEdge; ++y) {
    for (int x = 0; x < kStoredEdge; ++x) {
      worst = std::max(worst, std::abs(red(*found, x, y) - slope(x, y)));
      CHECK(found->colour[1][PixelRows::at(x, y)] == 0.25F);
    }
  }
  CHECK(worst < 1e-6F);
}

TEST_CASE("another surface says nothing, nor does what is not there", "[views]") {
  for (const float beyond : {kDepth + 101, kDepth - 101, PixelRows::kNoDepth}) {
    CAPTURE(beyond);
    const auto found = sharpened([&](int x, int) {
      return x < 30 ? Pixel{{0.2F, 0.2F, 0.2F}} : Pixel{{0.9F, 0.9F, 0.9F}, beyond};
    });
    std::size_t moved = 0;
    for (int y = 0; y < kStoredEdge; ++y) {
      for (int x = 0; x < kStoredEdge; ++x)
        moved += red(*found, x, y) == (x < 30 ? 0.2F : 0.9F) ? 0 : 1;
    }
    CHECK(moved == 0);
  }
  // As far apart as it may be: half a step of 0.7 in the pair that leads across, and in two more.
  const auto near = sharpened([](int x, int) {
    return x < 30 ? Pixel{{0.2F, 0.2F, 0.2F}} : Pixel{{0.9F, 0.9F, 0.9F}, kDepth + 100};
  });
  CHECK(red(*near, 29, 30) == Approx(std::max(0.0, 0.2 - 0.3 * 0.35)));
  CHECK(red(*near, 26, 30) == Approx(0.2 - 0.1 * 0.35));
  CHECK(red(*near, 25, 30) == 0.2F);
}

TEST_CASE("colours stay within what is stored", "[views]") {
  constexpr float kMost = gaussian::kLargestSplatColour;
  const auto found = sharpened([](int x, int y) {
    const float value = (x / 4 + y / 4) % 2 == 0 ? 0 : kMost;
    return Pixel{{value, value, value}};
  });
  std::size_t out = 0;
  for (int y = 0; y < kStoredEdge; ++y) {
    for (int x = 0; x < kStoredEdge; ++x)
      out += red(*found, x, y) == 0 || red(*found, x, y) == kMost ? 0 : 1;
  }
  CHECK(out == 0);
}

TEST_CASE("kernels sharpen alike", "[views]") {
  for (int reach = 0; reach <= Sharpening::kMostReach; ++reach) {
    sharpened(
        [reach](int x, int y) {
          Random pixel(static_cast<std::uint64_t>((reach * kStoredEdge + y) * kStoredEdge + x));
          return Pixel{
              {pixel.between(0.0F, 1.0F), pixel.between(0.0F, 8.0F), pixel.between(0.0F, 0.1F)},
              pixel.between(0.0F, 1.0F) < 0.1F ? PixelRows::kNoDepth : pixel.between(0.0F, 300.0F)};
        },
        {reach, 100, 0.4F});
  }
}

TEST_CASE("the ring has a radius in space", "[views]") {
  // The region is the box, 3.46 in diagonal: 0.0173 is the radius.
  const Box3f box{{-1, -1, -1}, {1, 1, 1}};
  const auto reach = [&](float edge) { return sharpening_of(Grid(box, edge, 24)).reach; };
  CHECK(reach(0) == 3);  // pixels of 2^-7.5
  CHECK(reach(1 / 64.0F) == 1);
  CHECK(reach(1 / 16.0F) == 0);  // as large as what would be sharpened
  const Grid grid(box, 0, 24);
  CHECK(sharpening_of(grid).most_apart == Approx(grid.in_steps(2 * 0.005F * 3.4641F)));
}
