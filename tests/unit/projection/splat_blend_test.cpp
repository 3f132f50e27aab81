// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "unit/projection/splat_runs.h"

using namespace pounce;
using namespace pounce::projection;
using namespace pounce::test;

TEST_CASE("blends of random scenes are those of the reference", "[projection]") {
  const std::uint32_t seed = GENERATE(range(1U, 8U));
  Random random(seed);
  const auto scene = random_splats(random, 1500, seed % 2 == 0);
  SplatLimits limits;
  limits.reach = seed == 5 ? 3.117F : 0.4131F;
  limits.min_cosine = 0.17F;
  limits.window = seed == 3 ? 0.0005F : seed == 6 ? 0.1F : 0.02F;
  limits.discness = seed < 4 ? 1.0F : seed == 7 ? 0.4F : 0.0F;
  limits.antialiased = seed == 4;
  if (seed == 2 || seed == 7) limits.expected = 0.1F, limits.deviation = 0.05F;
  // Packets' edges are 0.006 and 0.02: all fine, some coarse, all coarse.
  if (seed % 3 != 0) limits.fine_edge = seed % 3 == 1 ? 0.01F : 0.003F;
  const ReferenceLimits expected{limits.reach,     limits.min_cosine,  limits.window,
                                 limits.discness,  limits.antialiased, limits.expected,
                                 limits.deviation, limits.fine_edge};
  SplatState state = piece_of_packets(random, 60);
  run_whole(make_sets(scene, 700), limits, splat_kernels(""), state);
  std::size_t compared = 0, unsure = 0, wrong = 0, empty = 0;
  double largest = 0, farthest = 0;
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (state.packets[p].texel[lane] == surface::kNoTexel) {
        CHECK(state.depths[p].weight[lane] == 0);
        continue;
      }
      const ReferenceBlend blend =
          reference_blend(scene, texel_of(state.packets[p], lane), expected);
      const auto found = findings(limits, state, p)[static_cast<std::size_t>(lane)];
      if (blend.unsure) {
        ++unsure;
        continue;
      }
      ++compared;
      if (found.has_value() != blend.covered) {
        ++wrong;
      } else if (!blend.covered) {
        ++empty;
      } else {
        const double e = std::max({std::abs(found->colour[0] - blend.colour.x),
                                   std::abs(found->colour[1] - blend.colour.y),
                                   std::abs(found->colour[2] - blend.colour.z)});
        largest = std::max({largest, e, std::abs(found->opacity - blend.opacity)});
        farthest = std::max(farthest, std::abs(found->distance - blend.distance));
      }
    }
  }
  CAPTURE(seed, compared, unsure, wrong, empty, largest, farthest);
  CHECK(compared > 500);
  CHECK(unsure * 10 < compared);
  CHECK(wrong == 0);
  CHECK(largest < 0.25 / 255);
  CHECK(farthest < 4e-3 * double{limits.reach});  // seed 3: the window is a texel's half
}

TEST_CASE("batches, blocks and kernels do not change a splat blend", "[projection]") {
  const float discness = GENERATE(0.0F, 1.0F);
  Random random(99);
  const auto scene = random_splats(random, 2000, false);
  SplatLimits limits{0.4F, 0.17F, 0.002F, discness, false};
  if (discness == 0) limits.fine_edge = 0.01F;  // half of the packets are coarse
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

TEST_CASE("a texel does not depend on who shares its packet", "[projection]") {
  const float discness = GENERATE(0.0F, 1.0F);
  Random random(7);
  auto scene = random_splats(random, 2000, false);
  for (ReferenceSplat& splat : scene) {  // so many that some are hidden
    for (double& sigma : splat.sigma) sigma *= 4;
  }
  SplatLimits limits{0.4F, 0.17F, 0.002F, discness, false};
  if (discness == 0) limits.fine_edge = 0.004F;  // only lane 1 of some packets is fine
  SplatState together = piece_of_packets(random, 10);
  for (TexelPacket& packet : together.packets) packet.per_texel[1] *= 3;
  SplatState alone;
  for (const TexelPacket& packet : together.packets) {
    for (int lane = 0; lane < kLanes; ++lane) {
      TexelPacket one = packet;
      std::fill_n(one.texel, kLanes, surface::kNoTexel);
      std::fill_n(one.nx, kLanes, 0.0F);
      std::fill_n(one.ny, kLanes, 0.0F);
      std::fill_n(one.nz, kLanes, 0.0F);
      std::fill_n(one.per_texel, kLanes, packet.per_texel[lane]);
      one.texel[lane] = packet.texel[lane];
      one.nx[lane] = packet.nx[lane];
      one.ny[lane] = packet.ny[lane];
      one.nz[lane] = packet.nz[lane];
      if (one.texel[lane] == surface::kNoTexel) one.texel[lane] = 0;  // looks nowhere
      alone.groups.push_back({static_cast<std::uint32_t>(alone.packets.size()), 1});
      alone.packets.push_back(one);
    }
  }
  run_whole(make_sets(scene, 700), limits, splat_kernels(""), together);
  run_whole(make_sets(scene, 700), limits, splat_kernels(""), alone);
  std::size_t compared = 0;
  for (std::size_t p = 0; p < together.packets.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (together.packets[p].texel[lane] == surface::kNoTexel) continue;
      const DepthPacket& a = together.depths[p];
      const DepthPacket& b = alone.depths[p * kLanes + static_cast<std::size_t>(lane)];
      CHECK(a.weight[lane] == b.weight[lane]);
      for (int c = 0; c < 3; ++c) CHECK(a.colour[c][lane] == b.colour[c][lane]);
      CHECK(a.depth[lane] == b.depth[lane]);
      compared += a.weight[lane] > 0 ? 1 : 0;
    }
  }
  CHECK(compared > 100);
}

TEST_CASE("more responses than a packet keeps change nothing", "[projection]") {
  Random random(5);
  auto scene = random_splats(random, 3000, false);
  for (ReferenceSplat& splat : scene) {
    splat.sigma = {0.8, 0.7, 0.01};  // every texel sees them all
    splat.alpha *= 0.01;
  }
  const SplatLimits limits{0.4F, 0.17F, 0.02F, 0, false};
  const SplatState piece = piece_of_packets(random, 4);
  SplatState whole = piece, batches = piece;
  run_whole(make_sets(scene, 4096), limits, splat_kernels(""), whole);
  run_batches(make_sets(scene, 100), limits, splat_kernels(""), batches);
  CHECK(whole.depths[0].weight[0] > 0);
  CHECK(same_sums(whole, batches));
}

namespace {

ReferenceSplat disc(double z, double alpha, Vec3d colour) {
  ReferenceSplat splat;
  splat.mean = {0, 0, z};
  splat.sigma = {0.1, 0.1, 0.001};
  splat.alpha = alpha;
  splat.colour = colour;
  return splat;
}

/// What the texel in the middle of sixteen finds, the target `lift` above z = 0.
SplatFinding look(const std::vector<ReferenceSplat>& scene, const SplatLimits& limits,
                  float lift = 0) {
  SplatState state;
  state.packets.push_back(wavy_packet(-0.02F, -0.02F, 0.01F, lift, kLanes));
  for (int lane = 0; lane < kLanes; ++lane) {
    TexelPacket& packet = state.packets[0];
    packet.pz[lane] = lift;
    packet.nx[lane] = packet.ny[lane] = 0;
    packet.nz[lane] = 1;
  }
  state.groups.push_back({0, 1});
  run_whole(make_sets(scene, 10), limits, splat_kernels(""), state);
  const auto found = findings(limits, state, 0)[10];
  REQUIRE(found);
  return *found;
}

}  // namespace

TEST_CASE("the surface hides what lies behind it", "[projection]") {
  const float discness = GENERATE(0.0F, 1.0F);
  const SplatLimits limits{0.4F, 0.17F, 0.01F, discness, false};
  // Twelve opaque layers at the target, another wall far behind, and a wisp before them.
  std::vector<ReferenceSplat> scene(12, disc(0, 0.99, {1, 0, 0}));
  scene.push_back(disc(-0.3, 0.99, {0, 0, 1}));
  scene.push_back(disc(0.2, 0.02, {0, 1, 0}));
  const SplatFinding found = look(scene, limits);
  CAPTURE(discness, found.colour[0], found.colour[1], found.colour[2]);
  CHECK(found.colour[0] > 0.97);
  CHECK(found.colour[2] < 0.01);
  CHECK(found.distance == Approx(0).margin(0.01));
}

TEST_CASE("one opaque Gaussian before a surface neither hides nor tints it", "[projection]") {
  // It floats 2 % of the diagonal above the target (the reach is 3 %), wide of the texel's normal
  // by one of its deviations; the surface is eight discs deep, as scenes are where they are sure.
  const SplatLimits limits{0.3F, 0.17F, 0.01F, 1, false};
  std::vector<ReferenceSplat> scene(8, disc(0, 0.9, {0.8, 0.8, 0.8}));
  scene.push_back(disc(0.2, 0.9, {0, 0, 0}));
  scene.back().mean.x = 0.1;
  const SplatFinding found = look(scene, limits);
  CHECK(found.colour[0] > 0.75);
  CHECK(found.distance == Approx(0).margin(0.01));
}

TEST_CASE("through a gap in the surface no denser interior wins", "[projection]") {
  // Where a scene's discs leave a gap their rims are all that a texel meets: 0.4 x 0.5 x 0.56 each
  // at two deviations. Far below lie four times as many that face it.
  const SplatLimits limits{0.3F, 0.17F, 0.01F, 1, false};
  std::vector<ReferenceSplat> scene(6, disc(0, 0.5, {0.9, 0.7, 0.5}));
  for (ReferenceSplat& rim : scene) rim.mean.x = 0.2;
  scene.insert(scene.end(), 6, disc(-0.16, 0.9, {0.1, 0.2, 0.4}));
  const SplatFinding found = look(scene, limits);
  CHECK(found.distance == Approx(0).margin(0.01));
  CHECK(found.colour[0] == Approx(0.9).margin(0.02));
}

TEST_CASE("a texel takes the surface that lies where others found it", "[projection]") {
  // Two sheets of six discs, of which the outer is thinner: a veil before a surface, or a surface
  // and what it hides?
  SplatLimits limits{0.3F, 0.17F, 0.01F, 1, false};
  std::vector<ReferenceSplat> scene(6, disc(0.05, 0.3, {0.9, 0.7, 0.5}));
  scene.insert(scene.end(), 6, disc(-0.1, 0.9, {0.1, 0.2, 0.4}));
  CHECK(look(scene, limits).distance < -0.05);
  limits.expected = 0.05F, limits.deviation = 0.025F;
  CHECK(look(scene, limits).distance > 0.04);
  limits.expected = -0.1F;
  CHECK(look(scene, limits).distance < -0.09);
}

TEST_CASE("distance is signed, positive outside", "[projection]") {
  const SplatLimits limits{0.4F, 0.17F, 0.01F, 0, false};
  const std::vector<ReferenceSplat> scene(6, disc(0, 0.9, {0.2, 0.4, 0.6}));
  for (const float lift : {-0.1F, 0.0F, 0.05F}) {
    const SplatFinding found = look(scene, limits, lift);
    CHECK(found.distance == Approx(-double{lift}).margin(2e-6));
    CHECK(found.colour[1] == Approx(0.4).margin(1e-6));
  }
}

TEST_CASE("a texel that finds next to nothing stays empty", "[projection]") {
  const SplatLimits limits{0.4F, 0.17F, 0.01F, 0, false};
  SplatState state;
  state.packets.push_back(wavy_packet(-0.02F, -0.02F, 0.01F, 0, kLanes));
  state.groups.push_back({0, 1});
  run_whole(make_sets({disc(0, 0.05, {1, 1, 1})}, 10), limits, splat_kernels(""), state);
  CHECK(state.depths[0].weight[0] > 0);
  CHECK_FALSE(findings(limits, state, 0)[0]);
}
