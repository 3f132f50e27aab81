// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "unit/projection/splat_packets.h"

using namespace pounce;
using namespace pounce::projection;
using namespace pounce::test;

namespace {

/// Sets of at most `block` Gaussians each, in their order.
std::vector<source::SplatSet> make_sets(const std::vector<ReferenceSplat>& scene,
                                        std::size_t block) {
  std::vector<source::SplatSet> sets;
  for (std::size_t i = 0; i < scene.size(); i += block) {
    const std::vector<ReferenceSplat> part(
        scene.begin() + static_cast<std::ptrdiff_t>(i),
        scene.begin() + static_cast<std::ptrdiff_t>(std::min(i + block, scene.size())));
    sets.push_back(source::make_splat_set(splat_block(part)));
  }
  return sets;
}

std::vector<const source::SplatSet*> pointers(const std::vector<source::SplatSet>& sets) {
  std::vector<const source::SplatSet*> out;
  for (const auto& set : sets) out.push_back(&set);
  return out;
}

void run_whole(const std::vector<source::SplatSet>& sets, const SplatLimits& limits,
               const SplatKernels& kernels, SplatState& state) {
  const auto all = pointers(sets);
  for (start(limits, state); !state.open.empty(); next_height(limits, state))
    blend_height(all, limits, kernels, state);
}

void run_batches(const std::vector<source::SplatSet>& sets, const SplatLimits& limits,
                 const SplatKernels& kernels, SplatState& state) {
  const auto all = pointers(sets);
  for (start(limits, state); !state.open.empty(); next_height(limits, state)) {
    for (std::size_t i = 0; i < all.size(); ++i)
      profile_batch(std::span(all).subspan(i, 1), limits, kernels, state);
    find_centres(limits, state);
    for (std::size_t i = all.size(); i-- > 0;)
      sum_batch(std::span(all).subspan(i, 1), limits, kernels, state);
  }
}

/// What two runs must agree in, to the bit.
bool same_sums(const SplatState& a, const SplatState& b) {
  for (std::size_t p = 0; p < a.depths.size(); ++p) {
    if (std::memcmp(a.depths[p].weight, b.depths[p].weight, sizeof a.depths[p].weight) != 0 ||
        std::memcmp(a.depths[p].colour, b.depths[p].colour, sizeof a.depths[p].colour) != 0) {
      return false;
    }
  }
  return true;
}

}  // namespace

TEST_CASE("blends of random scenes are those of the reference", "[projection]") {
  const std::uint32_t seed = GENERATE(range(1U, 7U));
  Random random(seed);
  const auto scene = random_splats(random, 1500, seed % 2 == 0);
  SplatLimits limits;
  limits.max_distance = seed == 5 ? 3.117F : 0.4131F;
  limits.min_cosine = 0.17F;
  limits.window = seed == 3 ? 0.0005F : 0.02F;  // a thin one makes the search double it often
  limits.antialiased = seed == 4;
  const ReferenceLimits expected{limits.max_distance, limits.min_cosine, limits.window,
                                 limits.antialiased};
  SplatState state = piece_of_packets(random, 60);
  run_whole(make_sets(scene, 700), limits, splat_kernels(""), state);
  std::size_t compared = 0, unsure = 0, wrong = 0, empty = 0;
  double largest = 0;
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (state.packets[p].texel[lane] == target::kNoTexel) {
        CHECK(state.depths[p].weight[lane] == 0);
        continue;
      }
      const ReferenceBlend blend =
          reference_blend(scene, texel_of(state.packets[p], lane), expected);
      const auto colour = splat_colour(state.depths[p], lane);
      if (blend.unsure) {
        ++unsure;
        continue;
      }
      ++compared;
      if (colour.has_value() != blend.covered) {
        ++wrong;
      } else if (!blend.covered) {
        ++empty;
      } else {
        const double e = std::max({std::abs((*colour)[0] - blend.colour.x),
                                   std::abs((*colour)[1] - blend.colour.y),
                                   std::abs((*colour)[2] - blend.colour.z)});
        largest = std::max(largest, e);
      }
    }
  }
  CAPTURE(seed, compared, unsure, wrong, empty, largest);
  CHECK(compared > 500);
  CHECK(unsure * 10 < compared);
  CHECK(wrong == 0);
  CHECK(largest < 0.25 / 255);
}

TEST_CASE("batches, blocks and kernels do not change a splat blend", "[projection]") {
  Random random(99);
  const auto scene = random_splats(random, 2000, false);
  const SplatLimits limits{0.4F, 0.17F, 0.002F, false};
  const SplatState piece = piece_of_packets(random, 40);
  SplatState first = piece;
  run_whole(make_sets(scene, 4096), limits, splat_kernels(""), first);
  const auto touched = std::count_if(first.depths.begin(), first.depths.end(),
                                     [](const DepthPacket& d) { return d.weight[0] > 0; });
  CHECK(touched > 30);
  for (const SplatKernels* kernels : available_splat_kernels()) {
    SplatState state = piece;
    run_whole(make_sets(scene, 33), limits, *kernels, state);
    CHECK(same_sums(first, state));
    state = piece;
    run_batches(make_sets(scene, 250), limits, *kernels, state);
    CHECK(same_sums(first, state));
  }
  auto shuffled = scene;
  for (std::size_t i = shuffled.size(); i > 1; --i)
    std::swap(shuffled[i - 1], shuffled[random.below(i)]);
  SplatState state = piece;
  run_batches(make_sets(shuffled, 128), limits, splat_kernels("sse2"), state);
  CHECK(same_sums(first, state));
}

TEST_CASE("more responses than a packet keeps change nothing", "[projection]") {
  Random random(5);
  auto scene = random_splats(random, 3000, false);
  for (ReferenceSplat& splat : scene) splat.sigma = {0.8, 0.7, 0.01};  // every texel sees them all
  const SplatLimits limits{0.4F, 0.17F, 0.02F, false};
  const SplatState piece = piece_of_packets(random, 4);
  SplatState whole = piece, batches = piece;
  run_whole(make_sets(scene, 4096), limits, splat_kernels(""), whole);
  run_batches(make_sets(scene, 100), limits, splat_kernels(""), batches);
  CHECK(whole.depths[0].weight[0] > 0);
  CHECK(same_sums(whole, batches));
}

TEST_CASE("the window stays with the surface", "[projection]") {
  // An opaque layer 0.1 behind the texel, a faint speck in front of it, another layer far behind.
  const auto disc = [](double z, double alpha, Vec3d colour) {
    ReferenceSplat splat;
    splat.mean = {0, 0, z};
    splat.sigma = {0.1, 0.1, 0.001};
    splat.alpha = alpha;
    splat.colour = colour;
    return splat;
  };
  const std::vector<ReferenceSplat> scene{disc(-0.1, 1, {1, 0, 0}), disc(0.02, 0.3, {0, 1, 0}),
                                          disc(-0.3, 1, {0, 0, 1})};
  const SplatLimits limits{0.4F, 0.17F, 0.01F, false};
  SplatState state;
  state.packets.push_back(wavy_packet(-0.02F, -0.02F, 0.01F, 0, kLanes));
  state.groups.push_back({0, 1});
  run_whole(make_sets(scene, 10), limits, splat_kernels(""), state);
  for (int lane = 0; lane < kLanes; ++lane) {
    const auto colour = splat_colour(state.depths[0], lane);
    REQUIRE(colour);
    CHECK((*colour)[0] > 0.99);
  }
  // A layer with gaps, of needles: little against the opaque one, and yet the surface.
  auto needle = disc(0.05, 0.7, {0, 1, 0});
  needle.sigma = {0.1, 0.03, 0.0003};
  SplatState gaps;
  gaps.packets = state.packets;
  gaps.groups = state.groups;
  run_whole(make_sets({scene[0], needle}, 10), limits, splat_kernels(""), gaps);
  const auto seen = splat_colour(gaps.depths[0], 7);
  REQUIRE(seen);
  CHECK((*seen)[1] > 0.99);
  // Without the layers the speck is all there is: it counts then.
  SplatState alone;
  alone.packets = state.packets;
  alone.groups = state.groups;
  run_whole(make_sets({scene[1]}, 10), limits, splat_kernels(""), alone);
  const auto colour = splat_colour(alone.depths[0], 0);
  REQUIRE(colour);
  CHECK((*colour)[1] == Approx(1));
}

TEST_CASE("the maximum distance does not change what is nearer", "[projection]") {
  Random random(31);
  const auto scene = random_splats(random, 2500, false);
  SplatState piece = piece_of_packets(random, 30), near = piece, far = piece;
  const auto sets = make_sets(scene, 500);
  run_whole(sets, {0.2F, 0.17F, 0.02F, false}, splat_kernels(""), near);
  run_whole(sets, {0.31F, 0.17F, 0.02F, false}, splat_kernels(""), far);
  std::size_t same = 0, other = 0;
  for (std::size_t p = 0; p < piece.packets.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (near.depths[p].weight[lane] == 0) continue;
      (near.depths[p].weight[lane] == far.depths[p].weight[lane] ? same : other) += 1;
    }
  }
  CAPTURE(same, other);
  CHECK(same > 300);
  // Those that found no surface take the best that they can reach.
  CHECK(other * 4 < same);
}
