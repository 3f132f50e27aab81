// SPDX-License-Identifier: Apache-2.0
#include "views/draw.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <memory>
#include <vector>

#include "core/portable_math.h"
#include "support/bytes.h"
#include "support/splat_scenes.h"

using namespace pounce;
using namespace pounce::views;
using namespace pounce::test;

namespace {

std::vector<const ViewKernels*> available_kernels() {
  std::vector<const ViewKernels*> all;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const ViewKernels* found = nullptr;
    if (error_kind([&] { found = &view_kernels(isa); }) == 0) all.push_back(found);
  }
  return all;
}

/// As they are drawn, not sharpened.
std::vector<std::byte> plain_samples_of(const Canvas& canvas) {
  const auto sharpener = std::make_unique<Sharpener>(Sharpening{}, *available_kernels()[0]);
  return samples_of(canvas, *sharpener);
}

/// In slabs of so many Gaussians.
void draw_into(Canvas& canvas, const gaussian::SplatColumns& set, const TileSight& sight,
               const ViewKernels& kernels, std::size_t most) {
  Slab slab(most);
  do {
    sight.add(set, 0, slab);
    const auto ellipses = slab.nearer_than(kNoEnd);
    CHECK(ellipses.size() <= 2 * most);
    CHECK(std::is_sorted(ellipses.begin(), ellipses.end(),
                         [](const Ellipse* a, const Ellipse* b) { return a->order < b->order; }));
    if (!kernels.draw(ellipses, canvas)) break;
    slab.drop();
  } while (slab.again());
}

/// A tile of a view.
std::unique_ptr<Canvas> drawn(const gaussian::SplatColumns& set, const TileSight& sight,
                              const ViewKernels& kernels, std::size_t most = 1 << 16) {
  auto canvas = std::make_unique<Canvas>();
  canvas->clear();
  draw_into(*canvas, set, sight, kernels, most);
  return canvas;
}

struct ReferencePixel {
  Vec3d colour;
  double alpha = 0, depth = -1;
};

/// Every Gaussian against one pixel, as viewers draw it: double precision, textbook formulas. Those
/// whose best hit lies before `begin` are not there.
ReferencePixel reference_pixel(std::vector<ReferenceSplat> scene, const Grid& grid,
                               std::uint32_t view, Vec2d at, bool antialiased,
                               double begin = -1e30) {
  const Frame& f = grid.frame(view);
  const Vec3d u(f.right), v(f.down), w(f.forward), middle(grid.middle());
  const double pixel = static_cast<double>(grid.pixel());
  std::stable_sort(scene.begin(), scene.end(),
                   [&](const auto& a, const auto& b) { return dot(w, a.mean) < dot(w, b.mean); });
  ReferencePixel out;
  double through = 1;
  for (const ReferenceSplat& s : scene) {
    const std::array<double, 9> m = covariance(s);
    const auto quadratic = [&](Vec3d a, Vec3d b) {
      return (a.x * (m[0] * b.x + m[1] * b.y + m[2] * b.z) +
              a.y * (m[3] * b.x + m[4] * b.y + m[5] * b.z) +
              a.z * (m[6] * b.x + m[7] * b.y + m[8] * b.z)) /
             (pixel * pixel);
    };
    const double a = quadratic(u, u), b = quadratic(u, v), c = quadratic(v, v), ga = a + 0.3,
                 gc = c + 0.3, det = ga * gc - b * b;
    const double centre = grid.edge() / 2.0 - 0.5;
    const double dx = at.x - centre - dot(u, s.mean - middle) / pixel,
                 dy = at.y - centre - dot(v, s.mean - middle) / pixel;
    const double q = (gc * dx * dx - 2 * b * dx * dy + ga * dy * dy) / det;
    if (q > 9) continue;
    double opacity = s.alpha;
    if (antialiased) opacity *= std::sqrt(std::max(a * c - b * b, 0.0) / det);
    const double alpha = std::min(0.99, opacity * std::exp(-q / 2));
    if (alpha < 1.0 / 255 || through < 1.0 / 255) continue;
    const double wu = quadratic(w, u), wv = quadratic(w, v);
    const double depth = (dot(w, s.mean - middle) / pixel +
                          ((wu * gc - wv * b) * dx + (wv * ga - wu * b) * dy) / det) *
                             pixel / static_cast<double>(grid.depth_step()) +
                         kMostDepth / 2;
    if (depth < begin) continue;
    out.colour = out.colour + s.colour * (through * alpha);
    const double before = through;
    through *= 1 - alpha;
    if (before > 0.5 && through <= 0.5) out.depth = std::clamp(depth, 0.0, double{kMostDepth});
  }
  out.alpha = 1 - through;
  return out;
}

ReferenceSplat ball(Vec3d mean, double sigma, double alpha, Vec3d colour) {
  ReferenceSplat s;
  s.mean = mean;
  s.sigma = {sigma, sigma, sigma};
  s.rotation = {1, 0, 0, 0};
  s.alpha = alpha;
  s.colour = colour;
  return as_floats(s);
}

/// The tile in whose middle row and column the grid's middle lies, or beside it.
TileSight middle_tile(const Grid& grid, std::uint32_t view, const DrawOptions& options = {},
                      const ViewKernels& kernels = *available_kernels()[0]) {
  return {grid, view, grid.tiles_across() / 2, grid.tiles_across() / 2, options, kernels};
}

int pixel_at(int x, int y) { return Canvas::at(x + kApron, y + kApron); }

}  // namespace

TEST_CASE("two balls behind each other, by hand", "[views]") {
  // Four across the region, so that the middle lies between the tiles 1 and 2.
  const Grid grid({{-1, -1, -1}, {1, 1, 1}}, 1 / 64.0F, 24);
  REQUIRE(grid.pixel() == 1 / 64.0F);
  REQUIRE(grid.tiles_across() % 2 == 0);
  const Vec3f forward = grid.frame(5).forward;
  const double sigma = 2.0 / 64;
  const Vec3d near = Vec3d(forward) * -0.25, far = Vec3d(forward) * 0.25;
  // The second in the file is the first that is met.
  const auto set = gaussian::make_splat_columns(
      splat_block({ball(far, sigma, 0.9, {0.1, 0.2, 1}), ball(near, sigma, 0.6, {1, 0.5, 0})}));
  for (const ViewKernels* kernels : available_kernels()) {
    const auto canvas = drawn(set, middle_tile(grid, 5, {}, *kernels), *kernels);
    // The pixel half a pixel right of and below the middle: q = 0.5 / (4 + 0.3).
    const double response = std::exp(-0.5 * 0.5 / 4.3), front = 0.6 * response,
                 back = 0.9 * response;
    const int at = pixel_at(0, 0);
    CHECK(canvas->through[at] == Approx((1 - front) * (1 - back)).epsilon(1e-4));
    CHECK(canvas->colour[0][at] == Approx(front + (1 - front) * back * 0.1).epsilon(1e-4));
    CHECK(canvas->colour[1][at] == Approx(front * 0.5 + (1 - front) * back * 0.2).epsilon(1e-4));
    CHECK(canvas->colour[2][at] == Approx((1 - front) * back).epsilon(1e-4));
    // More than half is taken by the first.
    CHECK(canvas->depth[at] * grid.depth_step() ==
          Approx(kMostDepth / 2 * grid.depth_step() - 0.25).margin(1e-3));
    // Beyond the least alpha there is nothing: at 9 pixels q = 81 / 4.3.
    CHECK(canvas->through[pixel_at(10, 0)] == 1);
    const auto samples = plain_samples_of(*canvas);
    std::uint16_t stored[kSceneSamples];
    std::memcpy(stored, samples.data() + ((kApron * kStoredEdge) + kApron) * sizeof(stored),
                sizeof stored);
    const double alpha = 1 - (1 - front) * (1 - back);
    CHECK(stored[3] == Approx(alpha * 65535).margin(3));
    CHECK(stored[0] == Approx((front + (1 - front) * back * 0.1) / alpha * 8191).margin(3));
    std::memcpy(stored, samples.data() + ((kApron * kStoredEdge) + kApron + 20) * sizeof(stored),
                sizeof stored);
    CHECK(stored[3] == 0);
    CHECK(stored[4] == kNoDepth);
  }
}

TEST_CASE("a tile shows what a slow viewer shows", "[views]") {
  for (const unsigned seed : {3U, 4U, 5U, 6U}) {
    Random random(seed);
    const auto scene = random_splats(random, seed % 2 == 0 ? 60 : 700, false);
    const auto set = gaussian::make_splat_columns(splat_block(scene));
    const Grid grid({{-1.2F, -1.2F, -0.4F}, {1.2F, 1.2F, 0.1F}}, 0.01F, 24);
    const bool antialiased = seed % 2 == 0;
    const std::uint32_t view = seed * 5 % 24, tile = grid.tiles_across() / 2;
    const auto canvas = drawn(set, middle_tile(grid, view, {antialiased}), *available_kernels()[0]);
    double worst = 0;
    std::size_t unlike = 0, pixels = 0, depths = 0;
    for (int y = 0; y < kTileEdge; y += 3) {
      for (int x = 0; x < kTileEdge; x += 2, ++pixels) {
        const Vec2d at{double(tile * kTileEdge) + x, double(tile * kTileEdge) + y};
        const ReferencePixel expected = reference_pixel(scene, grid, view, at, antialiased);
        const int i = pixel_at(x, y);
        const double off = std::max({std::abs(canvas->colour[0][i] - expected.colour.x),
                                     std::abs(canvas->colour[1][i] - expected.colour.y),
                                     std::abs(canvas->colour[2][i] - expected.colour.z),
                                     std::abs(1 - canvas->through[i] - expected.alpha)});
        worst = std::max(worst, off);
        unlike += off > 1e-3 ? 1 : 0;
        // Where exactly half is taken, rounding says by which.
        const bool is_met = (canvas->depth[i] >= 0) == (expected.depth >= 0) &&
                            std::abs(canvas->depth[i] - expected.depth) < 8;
        depths += is_met ? 0 : 1;
      }
    }
    CAPTURE(seed, worst);
    CHECK(worst < 0.01);  // a Gaussian at its least alpha is there or not
    CHECK(unlike <= pixels / 50);
    CHECK(depths <= pixels / 50);
  }
}

TEST_CASE("pixels begin where they are told to, or are none", "[views]") {
  const Grid grid({{-1.2F, -1.2F, -0.4F}, {1.2F, 1.2F, 0.1F}}, 0.01F, 24);
  const std::uint32_t view = 11, tile = grid.tiles_across() / 2;
  Random random(8);
  const auto scene = random_splats(random, 700, false);
  const auto set = gaussian::make_splat_columns(splat_block(scene));
  constexpr float kGap = 40;
  std::vector<std::uint16_t> depths(std::size_t{kStoredEdge} * kStoredEdge, kNoDepth);
  const auto number = [](int x, int y) {
    return static_cast<std::size_t>((y + kApron) * kStoredEdge + x + kApron);
  };
  for (int y = 0; y < kTileEdge; ++y) {
    for (int x = 0; x < kTileEdge; ++x) {
      if ((x / 7 + y / 5) % 3 == 0) continue;
      depths[number(x, y)] = static_cast<std::uint16_t>(kMostDepth / 2 + 40 * (x - y));
    }
  }
  std::vector<std::byte> first;
  for (const ViewKernels* kernels : available_kernels()) {
    for (const std::size_t most : {std::size_t{1} << 16, std::size_t{30}}) {
      auto canvas = std::make_unique<Canvas>();
      canvas->begin_before(depths.data(), kGap);
      canvas->clear();
      draw_into(*canvas, set, middle_tile(grid, view, {}, *kernels), *kernels, most);
      const auto samples = plain_samples_of(*canvas);
      if (first.empty()) first = samples;
      CHECK(samples == first);
      if (samples != first || most == 30) continue;
      std::size_t unlike = 0, pixels = 0, cut = 0;
      for (int y = 0; y < kTileEdge; y += 3) {
        for (int x = 0; x < kTileEdge; x += 2, ++pixels) {
          std::uint16_t stored[kSceneSamples];
          std::memcpy(stored, samples.data() + number(x, y) * sizeof stored, sizeof stored);
          if (depths[number(x, y)] == kNoDepth) {
            CHECK(stored[3] == 0);
            CHECK(stored[4] == kNoDepth);
            continue;
          }
          const Vec2d at{double(tile * kTileEdge) + x, double(tile * kTileEdge) + y};
          const double begin = depths[number(x, y)] - double{kGap};
          const auto expected = reference_pixel(scene, grid, view, at, false, begin),
                     whole = reference_pixel(scene, grid, view, at, false);
          cut += std::abs(whole.alpha - expected.alpha) > 0.1 ? 1 : 0;
          unlike += std::abs(stored[3] / 65535.0 - expected.alpha) < 0.01 ? 0 : 1;
        }
      }
      CHECK(cut > 50);
      CHECK(unlike <= pixels / 50);
    }
  }
}

TEST_CASE("slabs, kernels and the order of blocks are nobody's to see", "[views]") {
  Random random(11);
  const auto scene = random_splats(random, 900, false);
  const auto set = gaussian::make_splat_columns(splat_block(scene));
  const Grid grid({{-1.2F, -1.2F, -0.4F}, {1.2F, 1.2F, 0.1F}}, 0.01F, 24);
  for (const std::uint32_t view : {0U, 7U, 12U, 23U}) {
    const TileSight sight = middle_tile(grid, view);
    const auto expected = drawn(set, sight, *available_kernels()[0]);
    for (const ViewKernels* kernels : available_kernels()) {
      for (const std::size_t most : {1UL, 2UL, 7UL, 100UL, 899UL, 900UL}) {
        CAPTURE(kernels->isa, view, most);
        const auto canvas = drawn(set, middle_tile(grid, view, {}, *kernels), *kernels, most);
        CHECK(std::memcmp(canvas.get(), expected.get(), offsetof(Canvas, begin)) == 0);
      }
    }
  }
  // Two halves as two blocks, the second first.
  const std::vector<ReferenceSplat> front(scene.begin(), scene.begin() + 450),
      back(scene.begin() + 450, scene.end());
  const auto first = gaussian::make_splat_columns(splat_block(front)),
             second = gaussian::make_splat_columns(splat_block(back));
  const TileSight sight = middle_tile(grid, 7);
  const auto expected = drawn(set, sight, *available_kernels()[0]);
  Canvas canvas;
  canvas.clear();
  Slab slab(64);
  do {
    sight.add(second, 450, slab);
    sight.add(first, 0, slab);
    if (!available_kernels()[0]->draw(slab.nearer_than(kNoEnd), canvas)) break;
    slab.drop();
  } while (slab.again());
  CHECK(std::memcmp(&canvas, expected.get(), offsetof(Canvas, begin)) == 0);
}

TEST_CASE("what lies before all that is to come is drawn before it comes", "[views]") {
  Random random(5);
  auto scene = random_splats(random, 3000, false);
  const Grid grid({{-1.2F, -1.2F, -0.4F}, {1.2F, 1.2F, 0.1F}}, 0.01F, 24);
  const TileSight sight = middle_tile(grid, 7);
  // Blocks of fifty, the nearest first, as their boxes say.
  struct Block {
    gaussian::SplatColumns set;
    std::uint64_t first;
    DepthRange depths;
  };
  std::vector<Block> blocks;
  const Vec3d forward = Vec3d(grid.frame(7).forward);
  std::sort(scene.begin(), scene.end(), [&](const ReferenceSplat& a, const ReferenceSplat& b) {
    return dot(forward, a.mean) < dot(forward, b.mean);
  });
  for (std::size_t i = 0; i < scene.size(); i += 50) {
    const std::vector<ReferenceSplat> part(scene.begin() + static_cast<std::ptrdiff_t>(i),
                                           scene.begin() + static_cast<std::ptrdiff_t>(i + 50));
    const store::SplatBlock block = splat_block(part);
    Box3f box;
    for (std::size_t k = 0; k < part.size(); ++k) box.extend(store::splat_box(block.splat(k)));
    blocks.push_back({gaussian::make_splat_columns(block), i, sight.depths(box)});
    Slab all(100);
    sight.add(blocks.back().set, i, all);
    for (const Ellipse* e : all.nearer_than(kNoEnd)) {
      CHECK(e->order.depth >= blocks.back().depths.nearest);
      CHECK(e->order.depth <= blocks.back().depths.farthest);
    }
  }
  const auto whole = gaussian::make_splat_columns(splat_block(scene));
  const auto expected = drawn(whole, sight, *available_kernels()[0]);
  std::vector<NearBlock> near;
  for (const Block& block : blocks) near.push_back({block.depths, block.first, &block});
  std::swap(near.front(), near.back());  // they come in any order
  std::size_t asked = 0;
  const auto read = [&](const NearBlock& of) {
    ++asked;
    const auto& block = *static_cast<const Block*>(of.entry);
    return std::shared_ptr<const gaussian::SplatColumns>(std::shared_ptr<void>(), &block.set);
  };
  for (const std::size_t most : {10UL, 1000UL, 5000UL}) {
    CAPTURE(most);
    Canvas canvas;
    Slab slab(most);
    asked = 0;
    CHECK(draw_tile(sight, near, read, *available_kernels()[0], slab, canvas));
    CHECK(std::memcmp(&canvas, expected.get(), offsetof(Canvas, begin)) == 0);
    CHECK((asked > 10 * blocks.size()) == (most == 10));
    if (most == 5000) CHECK(asked <= blocks.size());
  }
  // What full pixels hide is not read.
  const auto wall = gaussian::make_splat_columns(splat_block(
      {ball({0, 0, -0.2}, 3, 0.99, {1, 0, 0}), ball({0, 0, -0.2}, 3, 0.99, {0, 1, 0}),
       ball({0, 0, -0.2}, 3, 0.99, {0, 0, 1}), ball({0, 0, -0.2}, 3, 0.99, {1, 1, 1})}));
  near.push_back({{0, 1}, 5000, &wall});
  const auto read_wall = [&](const NearBlock& of) {
    if (of.entry != &wall) return read(of);
    return std::shared_ptr<const gaussian::SplatColumns>(std::shared_ptr<void>(), &wall);
  };
  Canvas canvas;
  Slab slab(5000);
  asked = 0;
  CHECK(draw_tile(sight, near, read_wall, *available_kernels()[0], slab, canvas));
  CHECK(asked < blocks.size());
  CHECK_FALSE(draw_tile(sight, {}, read, *available_kernels()[0], slab, canvas));
}

TEST_CASE("what a tile may see is in its boxes, and what it cannot is not added", "[views]") {
  Random random(21);
  const Grid grid({{-1, -1, -1}, {1, 1, 1}}, 0.01F, 24);
  std::size_t met = 0;
  for (int i = 0; i < 400; ++i) {
    const auto splats = random_splats(random, 1, false);
    const store::SplatBlock block = splat_block(splats);
    const auto set = gaussian::make_splat_columns(block);
    const std::uint32_t view = static_cast<std::uint32_t>(random.below(24)),
                        x = static_cast<std::uint32_t>(random.below(grid.tiles_across())),
                        y = static_cast<std::uint32_t>(random.below(grid.tiles_across()));
    const TileSight sight(grid, view, x, y, {}, *available_kernels()[0]);
    const auto canvas = drawn(set, sight, *available_kernels()[0]);
    const float most =
        *std::max_element(std::begin(canvas->colour[0]), std::end(canvas->colour[0]));
    if (most == 0) continue;
    ++met;
    CHECK(sight.meets(store::splat_box(block.splat(0))));
  }
  CHECK(met > 20);
}

TEST_CASE("Gaussians of any size are drawn, or left out whole", "[views]") {
  const Grid grid({{-1, -1, -1}, {1, 1, 1}}, 0.01F, 24);
  for (const double sigma : {1e2, 1e5, 1e8, 1e12, 1e15, 1e18, 1e19}) {
    for (const std::array<double, 3> turned :
         {std::array{1.0, 1.0, 1.0}, std::array{1.0, 1e-3, 1e-6}, std::array{1.0, 1.0, 1e-12}}) {
      ReferenceSplat s = ball({0.1, 0.2, 0.3}, sigma, 0.9, {1, 0.5, 0.25});
      s.sigma = {sigma * turned[0], sigma * turned[1], sigma * turned[2]};
      s = as_floats(s);
      const auto set = gaussian::make_splat_columns(splat_block({s}));
      std::unique_ptr<Canvas> expected;
      for (const ViewKernels* kernels : available_kernels()) {
        CAPTURE(sigma, turned[1], turned[2], kernels->isa);
        auto found = drawn(set, middle_tile(grid, 3, {}, *kernels), *kernels);
        for (int i = 0; i < Canvas::kPixels; ++i)
          REQUIRE((found->through[i] >= 0 && found->through[i] <= 1));  // and a number
        if (sigma == 1e2 && turned[1] == 1)
          CHECK(found->through[pixel_at(32, 32)] == Approx(0.1).margin(1e-3));
        if (!expected)
          expected = std::move(found);
        else
          CHECK(std::memcmp(found.get(), expected.get(), offsetof(Canvas, begin)) == 0);
      }
    }
  }
}

TEST_CASE("kernels see harmonics at the same bits, of any half float", "[views]") {
  // 37 Gaussians: the last sixteen are not all there. Degree 1, red's first coefficient alone.
  std::vector<ReferenceSplat> scene(37, ball({0, 0, 0}, 0.1, 0.9, {0.5, 0.25, 9}));
  store::SplatBlock block = splat_block(scene);
  block.lobes = 3;
  block.sh.resize(9 * scene.size());
  const std::vector<float> basis{1.25F, 0, 0};
  for (std::uint32_t bits = 0; bits < 0x10000; bits += 37) {
    for (std::uint32_t i = 0; i < 37; ++i) {
      const auto own = static_cast<std::uint16_t>(bits + i);
      block.sh[i] = (own & 0x7C00U) == 0x7C00U ? 0 : own;  // infinite ones are never stored
    }
    const auto set = gaussian::make_splat_columns(block);
    for (const ViewKernels* kernels : available_kernels()) {
      for (std::uint32_t first = 0; first < 37; first += 16) {
        float colours[3][surface::kLanes];
        kernels->colour(set, first, basis, colours);
        for (std::uint32_t i = first; i < std::min(first + 16, 37U); ++i) {
          const float red = 0.5F + 1.25F * half_to_float(block.sh[i]);
          REQUIRE(colours[0][i - first] == std::clamp(red, 0.0F, 8.0F));
          REQUIRE(colours[1][i - first] == 0.25F);
          REQUIRE(colours[2][i - first] == 8);
        }
      }
    }
  }
}

TEST_CASE("a view shows the harmonics of its own direction", "[views]") {
  ReferenceSplat splat = ball({0, 0, 0}, 0.1, 0.9, {0.5, 0.5, 0.5});
  store::SplatBlock block = splat_block({splat});
  block.lobes = 3;
  const std::uint16_t one = float_to_half(0.5F), zero = float_to_half(0);
  // Degree 1's second coefficient is 0.4886 z; of red alone.
  block.sh = {zero, zero, zero, one, zero, zero, zero, zero, zero};
  const auto set = gaussian::make_splat_columns(block);
  const Grid grid({{-1, -1, -1}, {1, 1, 1}}, 0.01F, 24);
  for (const std::uint32_t view : {0U, 11U, 23U}) {
    Slab slab(4);
    middle_tile(grid, view).add(set, 0, slab);
    const float z = grid.frame(view).forward.z;
    const auto found = slab.nearer_than(kNoEnd);
    REQUIRE(found.size() == 1);
    CHECK(found[0]->colour[0] == Approx(0.5 + 0.5 * 0.4886025 * z).margin(1e-3));
    CHECK(found[0]->colour[1] == Approx(0.5));
    Slab plain(4);
    middle_tile(grid, view, {false, 1e9F, false}).add(set, 0, plain);
    CHECK(plain.nearer_than(kNoEnd)[0]->colour[0] == Approx(0.5));
  }
}
