// SPDX-License-Identifier: Apache-2.0
//
// Sixteen texels at once against one by one: the same bits, on each instruction set.
#include "projection/blend_lanes.h"

#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/portable_math.h"
#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::projection;
using mesh::Wrap;
using pounce::test::Random;

namespace {

constexpr std::size_t kSixteen = surface::kLanes;

std::vector<const BlendLanes*> available() {
  std::vector<const BlendLanes*> all;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const BlendLanes* found = nullptr;
    if (test::error_kind([&] { found = &blend_lanes(isa); }) == 0) all.push_back(found);
  }
  return all;
}

bool same(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }

/// Sides about a texel long, much longer, none at all, and what is no footprint.
Vec2d random_side(Random& random) {
  if (random.one_in(40)) return {std::nan(""), 1};
  if (random.one_in(40)) return {1e7, random.unit() * 1e300};
  if (random.one_in(40)) return {0, 0};
  if (random.one_in(20)) return {random.one_in(2) ? 65.0 / 64 : 63.0 / 64, 0};
  const double size = std::exp2(random.between(-2.0, random.one_in(4) ? 9.0 : 2.0));
  const double turn = random.between(0.0, 6.2831853);
  return {size * std::cos(turn), size * std::sin(turn)};
}

Footprint random_footprint(Random& random) {
  if (random.one_in(8)) return {random_side(random), random_side(random)};
  const Vec2d a = random_side(random);
  const double b = random.between(0.7, 1.4), c = random.between(-0.3, 0.3);
  return {a, {-a.y * b + a.x * c, a.x * b + a.y * c}};
}

void set_lane(const Footprint& footprint, std::size_t lane, FootprintLanes& lanes) {
  lanes.ax[lane] = footprint.a.x;
  lanes.ay[lane] = footprint.a.y;
  lanes.bx[lane] = footprint.b.x;
  lanes.by[lane] = footprint.b.y;
}

/// Does a lane say the same as the lookups of one texel?
bool agrees(const FootprintLookupsLanes& lanes, std::size_t lane, const FootprintLookups& one) {
  bool ok = (lanes.two >> lane & 1) == (one.count == 2 ? 1U : 0U) &&
            (lanes.single >> lane & 1) == (one.single() ? 1U : 0U) &&
            lanes.across[lane] == one.sharpening.across && lanes.down[lane] == one.sharpening.down;
  for (std::size_t s = 0; s < static_cast<std::size_t>(one.count); ++s) {
    const LookupsLanes& set = lanes.sets[s];
    const Lookups& expected = one.sets[s];
    ok = ok && set.level[lane] == static_cast<std::int32_t>(expected.level) &&
         set.count_a[lane] == expected.count_a && set.count_b[lane] == expected.count_b &&
         set.step_ax[lane] == expected.step_a.x && set.step_ay[lane] == expected.step_a.y &&
         set.step_bx[lane] == expected.step_b.x && set.step_by[lane] == expected.step_b.y &&
         same(set.share[lane], expected.share / (expected.count_a * expected.count_b));
  }
  return ok;
}

/// A finite sample of a float image: mostly near 1, also 0, tiny, negative and large ones.
float random_sample(Random& random, Depth depth) {
  const float largest = depth == Depth::half ? 65504.0F : std::numeric_limits<float>::max();
  if (random.one_in(6)) return 0;
  if (random.one_in(12)) return random.one_in(2) ? largest : -largest;
  if (random.one_in(12)) return static_cast<float>(random.unit()) * 1e-7F;
  const auto value = static_cast<float>(random.between(0.0, 2.0));
  return random.one_in(5) ? -value : value;
}

/// An image of random samples, or one of its levels, in tiles as its store has them.
struct Image {
  store::ColourDirectory directory;
  std::vector<std::vector<std::byte>> tiles;

  Image(Random& random, std::uint32_t width, std::uint32_t height, std::uint32_t channels, Wrap u,
        Wrap v, Depth depth = Depth::u8) {
    directory.width = width;
    directory.height = height;
    directory.channels = channels;
    directory.wrap_u = u;
    directory.wrap_v = v;
    directory.depth = depth;
    const std::size_t size = store::depth_bytes(depth);
    std::vector<std::byte> samples(std::size_t{width} * height * channels * size);
    // Edges and flat parts as well as noise.
    for (std::size_t at = 0; at < samples.size(); at += size) {
      std::uint32_t bits = random.one_in(3) ? (random.one_in(2) ? 0 : ~0U)
                                            : static_cast<std::uint32_t>(random.bits());
      if (depth == Depth::float32)
        bits = std::bit_cast<std::uint32_t>(random_sample(random, depth));
      if (depth == Depth::half) bits = float_to_half(random_sample(random, depth));
      std::memcpy(samples.data() + at, &bits, size);
    }
    for (std::uint32_t ty = 0; ty < directory.tiles_y(); ++ty) {
      for (std::uint32_t tx = 0; tx < directory.tiles_x(); ++tx) add_tile(samples, tx, ty);
    }
  }
  void add_tile(const std::vector<std::byte>& samples, std::uint32_t tx, std::uint32_t ty) {
    auto& tile = tiles.emplace_back();
    for (int y = -store::kApron; y < mesh::kBlockEdge + store::kApron; ++y) {
      for (int x = -store::kApron; x < mesh::kBlockEdge + store::kApron; ++x) {
        const auto column = static_cast<std::size_t>(store::wrapped(
            std::int64_t{tx} * mesh::kBlockEdge + x, directory.width, directory.wrap_u));
        const auto row = static_cast<std::size_t>(store::wrapped(
            std::int64_t{ty} * mesh::kBlockEdge + y, directory.height, directory.wrap_v));
        const std::size_t texel = directory.texel_bytes();
        const auto from =
            samples.begin() + static_cast<std::ptrdiff_t>((row * directory.width + column) * texel);
        tile.insert(tile.end(), from, from + static_cast<std::ptrdiff_t>(texel));
      }
    }
  }
  const std::byte* tile(std::uint32_t x, std::uint32_t y) const {
    return tiles.at(std::size_t{y} * directory.tiles_x() + x).data();
  }
};

/// Where one lookup lies.
struct At {
  Coordinate x, y;
};

/// One texel's lookup, as it is written down in blend.h.
template <class Use>
void look(const Image& image, const At& at, BlendKernel kernel, Sharpening by, Use&& use) {
  const int tx = std::max(at.x.texel, 0) / mesh::kBlockEdge,
            ty = std::max(at.y.texel, 0) / mesh::kBlockEdge;
  Taps taps;
  kernel(at.x.rest, at.y.rest, taps);
  sharpen(by, at.x.rest, at.y.rest, taps);
  use(image.tile(static_cast<std::uint32_t>(tx), static_cast<std::uint32_t>(ty)),
      at.x.texel - tx * mesh::kBlockEdge, at.y.texel - ty * mesh::kBlockEdge, taps);
}

/// The mean of one texel's set of lookups, added to `mean`, one by one.
void add_one(const Image& image, const Image& level, const Lookups& set, Sharpening by,
             BlendKernel kernel, Vec2d middle, Blended& mean) {
  const double share = set.share / (set.count_a * set.count_b);
  const Depth depth = image.directory.depth;
  const bool is_float = depth == Depth::half || depth == Depth::float32;
  const auto in = [&](double texel, std::uint32_t size, std::uint32_t level_size, Wrap wrap) {
    if (size != level_size) texel = (texel + 0.5) * level_size / size - 0.5;
    Coordinate at = placed(texel, level_size, wrap);
    if (is_float) at.rest = settled(at.rest);
    return at;
  };
  for (int a = 0; a < set.count_a; ++a) {
    for (int b = 0; b < set.count_b; ++b) {
      const double i = a - 0.5 * (set.count_a - 1), j = b - 0.5 * (set.count_b - 1);
      const At at{in(middle.x + (i * set.step_a.x + j * set.step_b.x), image.directory.width,
                     level.directory.width, image.directory.wrap_u),
                  in(middle.y + (i * set.step_a.y + j * set.step_b.y), image.directory.height,
                     level.directory.height, image.directory.wrap_v)};
      look(level, at, kernel, set.level == 0 ? by : Sharpening{},
           [&](const std::byte* tile, int column, int row, const Taps& taps) {
             const Blended samples =
                 blend(level.directory, tile, column, row, taps, BlendAlpha::straight);
             for (std::size_t c = 0; c < mean.size(); ++c) mean[c] += share * samples[c];
           });
    }
  }
}

/// Sixteen texels of an image and of its first two levels.
struct Window {
  std::vector<Image> levels;
  std::array<Footprint, kSixteen> footprints;
  std::array<Vec2d, kSixteen> middles;
  unsigned lanes = 0;
  Filter filter = Filter::cubic;

  explicit Window(Random& random) {
    constexpr std::array kWraps{Wrap::repeat, Wrap::clamp, Wrap::mirror};
    const auto wrap = [&] { return kWraps.at(static_cast<std::size_t>(random.whole(0, 2))); };
    const auto side = [&] { return static_cast<std::uint32_t>(random.whole(1, 140)); };
    const auto channels = static_cast<std::uint32_t>(random.whole(1, 4));
    const Wrap u = wrap(), v = wrap();
    std::uint32_t width = side(), height = side();
    constexpr std::array kDepths{Depth::u8, Depth::u16, Depth::half, Depth::float32};
    const Depth depth = kDepths.at(static_cast<std::size_t>(random.whole(0, 3)));
    for (int level = 0; level < 3; ++level) {
      levels.emplace_back(random, width, height, channels, u, v, depth);
      width = (width + 1) / 2;
      height = (height + 1) / 2;
    }
    constexpr std::array kFilters{Filter::cubic, Filter::sharp, Filter::tent};
    // Tents are of bytes alone.
    filter = kFilters.at(static_cast<std::size_t>(random.whole(0, depth == Depth::u8 ? 2 : 1)));
    lanes = random.one_in(2) ? 0xFFFF : random.bits() & 0xFFFF;
    // Near each other or not, in the image or beyond its edges.
    const double far = random.one_in(3) ? 1e3 : 4;
    const Vec2d first{random.between(-5.0, levels[0].directory.width + 5.0),
                      random.between(-5.0, levels[0].directory.height + 5.0)};
    const auto kind = random.whole(0, 4);  // any; finer than texels along one axis alone, or none
    for (std::size_t lane = 0; lane < kSixteen; ++lane) {
      footprints[lane] = random_footprint(random);
      const double fine = random.between(0.2, 0.9), wide = random.between(1.0, 3.0);
      if (kind == 1) footprints[lane] = {{fine, 0}, {0, wide}};
      if (kind == 2) footprints[lane] = {{0, fine}, {wide, 0}};
      if (kind == 3) footprints[lane] = {{0, wide}, {wide, 0}};
      middles[lane] = {first.x + random.between(-far, far), first.y + random.between(-far, far)};
      if (random.one_in(10)) middles[lane] = {std::floor(first.x), std::floor(first.y)};
    }
  }
};

/// Lookups and means of a window, by lanes.
struct LanesResult {
  FootprintLookupsLanes lookups{};
  MeansLanes means{};
  bool is_sharp_across = false, is_sharp_down = false;  ///< along axes of the image itself

  LanesResult(const BlendLanes& kernels, const Window& window) {
    FootprintLanes footprints{};
    Sixteen<std::int32_t> last;
    last.fill(2);
    Vec2Lanes middles{};
    for (std::size_t lane = 0; lane < kSixteen; ++lane) {
      set_lane(window.footprints[lane], lane, footprints);
      middles.x[lane] = window.middles[lane].x;
      middles.y[lane] = window.middles[lane].y;
    }
    kernels.lookups(footprints, last, lookups);
    const store::ColourDirectory& image = window.levels[0].directory;
    PlacesLanes places{};
    WeightsLanes weights{};
    for (std::size_t s = 0; s < 2; ++s) {
      for (std::uint32_t number = 0; number < 3; ++number) {
        unsigned lanes = 0;
        for_each_lane(window.lanes & (s == 0 ? ~0U : lookups.two), [&](std::size_t lane) {
          if (lookups.sets[s].level[lane] == static_cast<std::int32_t>(number)) lanes |= 1U << lane;
        });
        const Image& level = window.levels[number];
        const LookedUp in{
            image.width,  image.height, level.directory.width,       level.directory.height,
            image.wrap_u, image.wrap_v, store::is_float(image.depth)};
        const auto add = kernels.add[static_cast<std::size_t>(image.depth)][image.channels - 1];
        for_each_lookup(kernels, keys_of(kernel_of(window.filter)), lookups.sets[s],
                        number == 0 ? sharpening_of(lookups, lanes) : SharpeningLanes{}, in,
                        middles, lanes, places, weights, [&] {
                          for_each_tile(
                              places,
                              [&](std::uint32_t x, std::uint32_t y) { return level.tile(x, y); },
                              [&](const std::byte* tile, const auto& share, unsigned) {
                                add(tile, places, weights, share, means);
                              });
                          is_sharp_across = is_sharp_across || weights.is_sharp_across;
                          is_sharp_down = is_sharp_down || weights.is_sharp_down;
                        });
      }
    }
  }
};

}  // namespace

TEST_CASE("lanes have the lookups that texels have one by one") {
  for (const BlendLanes* kernels : available()) {
    CAPTURE(kernels->isa);
    Random random(4001);
    FootprintLookupsLanes out{};
    for (int i = 0; i < 4000; ++i) {
      FootprintLanes footprints{};
      Sixteen<std::int32_t> last{};
      std::array<Footprint, kSixteen> all;
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        all[lane] = random_footprint(random);
        set_lane(all[lane], lane, footprints);
        last[lane] = static_cast<std::int32_t>(random.whole(0, 9));
      }
      kernels->lookups(footprints, last, out);
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        const auto one = lookups_of(all[lane], static_cast<std::uint32_t>(last[lane]));
        if (!agrees(out, lane, one)) FAIL("footprint " << i << ", lane " << lane);
      }
    }
  }
}

TEST_CASE("lanes have the footprints that hits have one by one") {
  for (const BlendLanes* kernels : available()) {
    CAPTURE(kernels->isa);
    Random random(4004);
    for (int i = 0; i < 500; ++i) {
      HitPacket hit{};
      AxesLanes axes{};
      Vec2Lanes scale{};
      const unsigned lanes = random.bits() & 0xFFFF;
      const auto some = [&] {
        return static_cast<float>(random.between(-3.0, 3.0) * std::exp2(random.whole(-40, 40)));
      };
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        // What is in other lanes was never written.
        const bool used = (lanes >> lane & 1) != 0;
        constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
        for (std::size_t k = 0; k < 3; ++k) {
          hit.x_by[k][lane] = used ? some() : kNone;
          hit.y_by[k][lane] = used ? some() : kNone;
          axes.x[k][lane] = some();
          axes.y[k][lane] = some();
        }
        scale.x[lane] = random.one_in(2) ? 1 : random.between(0.01, 9.0);
        scale.y[lane] = random.one_in(2) ? 1 : random.between(0.01, 9.0);
      }
      FootprintLanes out{};
      kernels->footprints(hit, axes, scale, lanes, out);
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        Footprint one{};
        if ((lanes >> lane & 1) != 0) {
          one = footprint_of({{hit.x_by[0][lane], hit.x_by[1][lane], hit.x_by[2][lane]},
                              {hit.y_by[0][lane], hit.y_by[1][lane], hit.y_by[2][lane]}},
                             {axes.x[0][lane], axes.x[1][lane], axes.x[2][lane]},
                             {axes.y[0][lane], axes.y[1][lane], axes.y[2][lane]});
        }
        if (!same(out.ax[lane], one.a.x * scale.x[lane]) ||
            !same(out.ay[lane], one.a.y * scale.y[lane]) ||
            !same(out.bx[lane], one.b.x * scale.x[lane]) ||
            !same(out.by[lane], one.b.y * scale.y[lane]))
          FAIL("packet " << i << ", lane " << lane);
      }
    }
  }
}

TEST_CASE("hits lie where they do one by one, or outside") {
  for (const BlendLanes* kernels : available()) {
    CAPTURE(kernels->isa);
    Random random(4005);
    int inside = 0, outside = 0;
    for (int i = 0; i < 4000; ++i) {
      const auto size = [&] { return static_cast<std::uint32_t>(random.whole(1, 140)); };
      const LookedUp in{size(), size(), 0, 0, Wrap::clamp, Wrap::mirror, false};
      const unsigned lanes = random.bits() & 0xFFFF;
      constexpr std::array kFractions{0.0F, -0.0F, -1e-30F, 1e-30F, 0.99999994F, 1.0F, -1.0F};
      HitPacket hit{};
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        const auto fraction = [&] {
          return random.one_in(3) ? kFractions.at(random.below(kFractions.size()))
                                  : random.between(-3.0F, 70.0F);
        };
        hit.base_x[lane] = static_cast<std::int32_t>(random.whole(-9, 141));
        hit.base_y[lane] = static_cast<std::int32_t>(random.whole(-9, 141));
        hit.frac_x[lane] = fraction();
        hit.frac_y[lane] = fraction();
        if ((lanes >> lane & 1) != 0) continue;
        // Of what is in other lanes nothing is known.
        hit.base_x[lane] = std::numeric_limits<std::int32_t>::max();
        hit.base_y[lane] = std::numeric_limits<std::int32_t>::min();
        hit.frac_x[lane] = std::numeric_limits<float>::quiet_NaN();
        hit.frac_y[lane] = 3e38F;
      }
      PlacesLanes out{}, one{};
      kernels->place_hits(hit, in, lanes, out);
      REQUIRE(out.active == lanes);
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        if (out.share[lane] != (lanes >> lane & 1)) FAIL("share of lane " << lane);
        if ((lanes >> lane & 1) == 0) continue;
        const Coordinate x = placed(hit.base_x[lane], hit.frac_x[lane], in.width, in.wrap_u),
                         y = placed(hit.base_y[lane], hit.frac_y[lane], in.height, in.wrap_v);
        const auto is_in = [](std::int32_t base, float fraction, std::uint32_t width) {
          const double at = base + std::floor(double{fraction});
          return at >= 0 && at < width;
        };
        const bool is_outside = !is_in(hit.base_x[lane], hit.frac_x[lane], in.width) ||
                                !is_in(hit.base_y[lane], hit.frac_y[lane], in.height);
        if ((out.outside >> lane & 1) != (is_outside ? 1U : 0U)) FAIL("packet " << i);
        ++(is_outside ? outside : inside);
        if (is_outside) continue;
        one.set_place(lane, x, y);
        if (!same(out.rest_x[lane], one.rest_x[lane]) ||
            !same(out.rest_y[lane], one.rest_y[lane]) || out.tile[lane] != one.tile[lane] ||
            out.offset[lane] != one.offset[lane])
          FAIL("packet " << i << ", lane " << lane);
      }
    }
    CHECK(inside > 1000);
    CHECK(outside > 1000);
  }
}

TEST_CASE("means of sixteen footprints are those of each, bit by bit") {
  for (const BlendLanes* kernels : available()) {
    CAPTURE(kernels->isa);
    Random random(4002);
    std::array<int, 3> seen{};                  // of one set, of two, sharpened
    std::array<std::array<int, 4>, 4> along{};  // windows by depth: none, across, down, both
    for (int i = 0; i < 1000; ++i) {
      const Window window(random);
      const LanesResult lanes(*kernels, window);
      const auto depth = static_cast<std::size_t>(window.levels[0].directory.depth);
      ++along[depth][(lanes.is_sharp_across ? 1 : 0) + (lanes.is_sharp_down ? 2 : 0)];
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        Blended mean{};
        if ((window.lanes >> lane & 1) != 0) {
          const auto one = lookups_of(window.footprints[lane], 2);
          for (std::size_t s = 0; s < static_cast<std::size_t>(one.count); ++s) {
            add_one(window.levels[0], window.levels[one.sets[s].level], one.sets[s], one.sharpening,
                    kernel_of(window.filter), window.middles[lane], mean);
          }
          ++seen[one.count == 2 ? 1 : 0];
          if (one.sharpening.any()) ++seen[2];
        }
        for (std::size_t c = 0; c < mean.size(); ++c) {
          if (!same(lanes.means[c][lane], mean[c]))
            FAIL("window " << i << ", lane " << lane << ", channel " << c << ": "
                           << lanes.means[c][lane] << " for " << mean[c] << ", depth "
                           << depth_name(window.levels[0].directory.depth));
        }
      }
    }
    CHECK(seen[0] > 2000);
    CHECK(seen[1] > 50);
    CHECK(seen[2] > 500);
    for (const auto& windows : along) {
      for (const int of_this_kind : windows) CHECK(of_this_kind > 20);
    }
  }
}

TEST_CASE("single lookups and means are rounded as texels are one by one") {
  for (const BlendLanes* kernels : available()) {
    CAPTURE(kernels->isa);
    Random random(4003);
    for (int i = 0; i < 600; ++i) {
      const auto channels = static_cast<std::uint32_t>(random.whole(1, 4));
      const Image image(random, 64, 64, channels, Wrap::repeat, Wrap::clamp);
      constexpr std::array kKernels{cubic, sharp, tent};
      const BlendKernel kernel = kKernels.at(static_cast<std::size_t>(random.whole(0, 2)));
      FootprintLookupsLanes lookups{};
      PlacesLanes places{};
      std::array<At, kSixteen> at;
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        const auto place = [&] {
          const auto texel = static_cast<std::int32_t>(random.whole(-1, 63));
          return Coordinate{texel, random.one_in(6) ? 0 : random.unit()};
        };
        at[lane] = {place(), place()};
        places.set_place(lane, at[lane].x, at[lane].y);
        lookups.across[lane] = static_cast<std::int32_t>(random.whole(0, 43690));
        lookups.down[lane] = static_cast<std::int32_t>(random.whole(0, 43690));
      }
      const bool is_sharp_across = random.one_in(2), is_sharp_down = random.one_in(2);
      Sixteen<std::uint32_t> texels{};
      WeightsLanes weights{};
      kernels->weigh(
          places, keys_of(kernel),
          {is_sharp_across ? &lookups.across : nullptr, is_sharp_down ? &lookups.down : nullptr},
          weights);
      kernels->round_u8[channels - 1](image.tile(0, 0), places, weights, texels);
      for (std::size_t lane = 0; lane < kSixteen; ++lane) {
        const Sharpening by{is_sharp_across ? lookups.across[lane] : 0,
                            is_sharp_down ? lookups.down[lane] : 0};
        std::uint32_t expected = 0;
        look(image, at[lane], kernel, by,
             [&](const std::byte* tile, int column, int row, const Taps& taps) {
               blend_u8(image.directory, tile, column, row, taps,
                        reinterpret_cast<std::byte*>(&expected));
             });
        if (texels[lane] != expected) FAIL("image " << i << ", lane " << lane);
      }
    }
    MeansLanes means{};
    means[0] = {0, 0.5 / 255, 0.4999 / 255, 1, 1 + 1e-16, 254.5 / 255, -1e-17, 0.25};
    Sixteen<std::uint32_t> texels{};
    kernels->round_means(means, 1, texels);
    const Sixteen<std::uint32_t> expected{0, 1, 0, 255, 255, 255, 0, 64};
    CHECK(texels == expected);
  }
}
