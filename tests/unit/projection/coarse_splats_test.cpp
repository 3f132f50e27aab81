// SPDX-License-Identifier: Apache-2.0
//
// Texels that cover more of the surface than a Gaussian does.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "unit/projection/splat_runs.h"

using namespace pounce;
using namespace pounce::projection;
using namespace pounce::test;

namespace {

/// Sixteen texels that look along +z, from (x, y, 0) on, of that edge.
TexelPacket flat_packet(float x, float y, float edge) {
  TexelPacket packet = wavy_packet(x, y, edge, 0, kLanes);
  for (int lane = 0; lane < kLanes; ++lane) {
    packet.pz[lane] = packet.nx[lane] = packet.ny[lane] = 0;
    packet.nz[lane] = 1;
  }
  return packet;
}

ReferenceSplat ball(Vec3d mean, double sigma, double alpha) {
  ReferenceSplat splat;
  splat.mean = mean;
  splat.sigma = {sigma, sigma, sigma};
  splat.alpha = alpha;
  splat.colour = {1, 0, 0};
  return splat;
}

SplatLimits coarse(float fine_edge, float reach = 12) {
  SplatLimits limits;
  limits.reach = reach;
  limits.fine_edge = fine_edge;
  return limits;
}

/// Opacities that one Gaussian has for the texels of a packet.
std::array<float, kLanes> alphas(const SplatKernels& kernels, const ReferenceSplat& splat,
                                 const TexelPacket& packet, const SplatLimits& limits) {
  const auto set = gaussian::make_splat_set(splat_block({splat}), SphericalHarmonics::dc);
  SplatState state;
  state.packets.push_back(packet);
  start(limits, state);
  SplatCandidates candidates(set.shapes.size());
  kernels.gather(std::array{&set}, state.bundles[0], limits.reach, state.depths[0].footprint,
                 candidates);
  std::array<float, kLanes> out{};
  SplatResponse response{};
  if (candidates.size() == 1 && kernels.respond(candidates, 0, 1, state.bundles[0], packet,
                                                state.depths[0], limits, &response, nullptr) == 1) {
    std::copy_n(response.alpha, kLanes, out.begin());
  }
  return out;
}

}  // namespace

TEST_CASE("a coarse texel's response by hand", "[projection]") {
  // Texels of edge 4, fine up to 1, half a Gaussian of variances 9 and 1: a fine texel adds 0.3, a
  // coarse one (16 - 1) / 12 more: 1.55. The Gaussian lies one to the left of the first texel.
  ReferenceSplat splat = ball({-1, 0, 0}, 1, 0.5);
  splat.sigma = {3, 1, 0.5};
  const double kept = std::pow(9.0 / (9.3 * 1.3), 0.25), spread = 9.3 * 1.3 / (10.55 * 2.55);
  const double response = std::exp(-1 / 10.55 / 2);
  for (const SplatKernels* kernels : available_splat_kernels()) {
    SplatLimits limits = coarse(1);
    CHECK(alphas(*kernels, splat, flat_packet(0, 0, 4), limits)[0] ==
          Approx(0.5 * kept * std::sqrt(spread) * response).epsilon(2e-6));
    limits.antialiased = true;
    CHECK(alphas(*kernels, splat, flat_packet(0, 0, 4), limits)[0] ==
          Approx(0.5 * std::sqrt(9 / (10.55 * 2.55)) * response).epsilon(2e-6));
  }
}

TEST_CASE("texels up to the fine edge see what they saw without one", "[projection]") {
  const SplatKernels& kernels = splat_kernels("");
  const ReferenceSplat splat = ball({0.3, -0.2, 0.1}, 0.7, 0.8);
  const TexelPacket packet = flat_packet(-1, -1, 0.5F);
  const auto fine = alphas(kernels, splat, packet, SplatLimits{12});
  CHECK(fine[5] > 0.1F);
  CHECK(fine == alphas(kernels, splat, packet, coarse(0.5F)));
  CHECK(fine != alphas(kernels, splat, packet, coarse(0.49F)));
}

TEST_CASE("coarse texels share a small Gaussian and keep its integral", "[projection]") {
  // A Gaussian of a hundredth of a texel's edge, drawn as if it were a pixel of 0.02: wherever it
  // lies, the mean over its places of what a texel gets is its integral over the texel's area.
  // All or nothing would be its own opacity, or 0.
  const double sigma = 0.01, fine_edge = 0.02, places = 64;
  const SplatKernels& kernels = splat_kernels("");
  double sum = 0, largest = 0;
  for (double y = 0.5; y < places; ++y) {
    for (double x = 0.5; x < places; ++x) {
      const ReferenceSplat splat = ball({x / places - 0.5, y / places - 0.5, 0}, sigma, 0.9);
      const auto alpha = alphas(kernels, splat, flat_packet(-1, -1, 1), coarse(float(fine_edge)));
      for (const float a : alpha) {
        sum += double{a};
        largest = std::max(largest, double{a});
      }
    }
  }
  const double fine = sigma * sigma + 0.3 * fine_edge * fine_edge;
  const double pi = 3.14159265358979;
  const double share = 0.9 * std::sqrt(sigma * sigma / fine) * 2 * pi * fine;
  CHECK(sum / (places * places) == Approx(share).epsilon(0.02));  // 1.1 % lie beyond the cut-off
  CHECK(largest < 2 * share);
}

TEST_CASE("a coarse response is the mean over the texel, about", "[projection]") {
  // Numbers: the opacities of 40 x 40 fine texels of the same square, by the kernels themselves.
  const SplatKernels& kernels = splat_kernels("");
  const float sigma = GENERATE(1.0F, 0.7F, 0.5F);
  const double x = GENERATE(0.0, 0.4, 0.9);
  const ReferenceSplat splat = ball({x, 0.1, 0}, double{sigma}, 0.5);
  // As fine as their pixel, which is 0.1: with the same 0.3 x 0.1^2.
  TexelPacket fine = flat_packet(0, 0, 0.1F);
  double mean = 0;
  constexpr int kSide = 40;
  for (int at = 0; at < kSide * kSide; at += kLanes) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const int i = at + lane;
      fine.px[lane] = (float(i % kSide) + 0.5F) / kSide - 0.5F;
      fine.py[lane] = (float(i / kSide) + 0.5F) / kSide - 0.5F;
    }
    for (const float a : alphas(kernels, splat, fine, coarse(0.1F))) mean += double{a};
  }
  mean /= kSide * kSide;
  const double found = double{alphas(kernels, splat, flat_packet(0, 0, 1), coarse(0.1F))[0]};
  CAPTURE(sigma, x, mean, found);
  CHECK(found == Approx(mean).epsilon(0.03));
}

TEST_CASE("a plane of small Gaussians shows coarse texels its mean", "[projection]") {
  // A checker of red and blue balls, 32 to a texel's edge, the red ones half as wide: their shares
  // are their areas, 1 : 4. A fine footprint alone would take their peaks for more, 1 : 2.
  std::vector<ReferenceSplat> scene;
  for (int y = -64; y < 64; ++y) {
    for (int x = -64; x < 64; ++x) {
      const bool red = (x + y) % 2 != 0;
      ReferenceSplat splat = ball({(x + 0.5) / 32, (y + 0.5) / 32, 0}, red ? 0.01 : 0.02, 0.2);
      if (!red) splat.colour = {0, 0, 1};
      scene.push_back(as_floats(splat));
    }
  }
  SplatState state;
  state.packets.push_back(flat_packet(-0.5F, -0.5F, 0.25F));
  for (float& per_texel : state.packets[0].per_texel) per_texel = 1;
  state.groups.push_back({0, 1});
  SplatLimits limits = coarse(1e-4F, 1);
  limits.window = 0.1F;
  run_whole(make_sets(scene, 4096), limits, splat_kernels(""), state);
  for (int lane = 0; lane < kLanes; ++lane) {
    const auto found = findings(limits, state, 0)[static_cast<std::size_t>(lane)];
    REQUIRE(found);
    CHECK(found->colour[0] == Approx(0.2).margin(0.01));
    CHECK(found->colour[2] == Approx(0.8).margin(0.01));
  }
}
