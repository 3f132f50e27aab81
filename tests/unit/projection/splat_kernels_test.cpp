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

/// Responses of one Gaussian; empty if it gives nothing.
std::vector<SplatResponse> respond(const SplatKernels& kernels, const source::SplatSet& set,
                                   const TexelPacket& packet, const SplatLimits& limits) {
  const RayBundle everywhere{{0, 0, 0}, {0, 0, 0}, 1e9F, 0};
  SplatCandidates candidates;
  kernels.gather(set, everywhere, 1e9F, candidates);
  std::vector<SplatResponse> out(candidates.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < candidates.size(); i += kMostResponses) {
    const std::size_t end = std::min(i + kMostResponses, candidates.size());
    count +=
        kernels.respond(candidates, i, end, everywhere, 1e9F, packet, limits, out.data() + count);
  }
  out.resize(count);
  return out;
}

ReferenceLimits reference_limits(const SplatLimits& limits) {
  return {limits.max_distance, limits.min_cosine, limits.window, limits.antialiased};
}

/// Largest value of the 3D Gaussian along a ray and where, by trying: no formula of the product or
/// of the reference.
struct Peak {
  double response = 0, t = 0;
};
Peak search_peak(const ReferenceSplat& splat, const ReferenceTexel& texel) {
  auto m = covariance(splat);
  const double f = 0.3 * texel.edge * texel.edge;
  const std::array<double, 3> n{texel.normal.x, texel.normal.y, texel.normal.z};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) m[3 * i + j] += f * ((i == j ? 1 : 0) - n[i] * n[j]);
  }
  const auto minor = [&](std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
    return m[a] * m[b] - m[c] * m[d];
  };
  const std::array<double, 9> inverse{minor(4, 8, 5, 7), minor(2, 7, 1, 8), minor(1, 5, 2, 4),
                                      minor(5, 6, 3, 8), minor(0, 8, 2, 6), minor(2, 3, 0, 5),
                                      minor(3, 7, 4, 6), minor(1, 6, 0, 7), minor(0, 4, 1, 3)};
  const double det = m[0] * inverse[0] + m[1] * inverse[3] + m[2] * inverse[6];
  const auto exponent = [&](double t) {
    const Vec3d d = texel.position + texel.normal * t - splat.mean;
    const std::array<double, 3> v{d.x, d.y, d.z};
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) sum += v[i] * inverse[3 * i + j] / det * v[j];
    }
    return sum;
  };
  double low = -10, high = 10;
  for (int step = 0; step < 200; ++step) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (exponent(a) < exponent(b) ? high : low) = exponent(a) < exponent(b) ? b : a;
  }
  return {std::exp(-exponent((low + high) / 2) / 2), (low + high) / 2};
}

}  // namespace

TEST_CASE("the marginal's response is the largest along the ray", "[projection]") {
  Random random(7);
  int compared = 0;
  for (int i = 0; i < 300; ++i) {
    ReferenceSplat splat;
    splat.rotation = random_rotation(random);
    splat.sigma = {random.between(0.1, 0.5), random.between(0.1, 0.5), random.between(0.1, 0.5)};
    splat.mean = {random.between(-0.5, 0.5), random.between(-0.5, 0.5), random.between(-0.5, 0.5)};
    ReferenceTexel texel;
    texel.normal = {random.between(-1.0, 1.0), random.between(-1.0, 1.0), 1.3};
    texel.normal = texel.normal * (1 / length(texel.normal));
    texel.edge = random.one_in(2) ? 0.001 : 0.3;
    const Contribution c = contribution(splat, texel, {1, 0, 0.1, false});
    if (c.weight == 0) continue;
    const Peak peak = search_peak(splat, texel);
    CHECK(c.t == Approx(peak.t).margin(1e-6));
    // What is left of the weight without its other factors.
    ReferenceTexel at = texel;
    at.position = splat.mean;
    CHECK(c.weight / contribution(splat, at, {1, 0, 0.1, false}).weight ==
          Approx(peak.response).epsilon(1e-9));
    ++compared;
  }
  CHECK(compared > 100);
}

TEST_CASE("responses are those of the reference", "[projection]") {
  const bool antialiased = GENERATE(false, true), with_normals = GENERATE(false, true);
  Random random(antialiased ? 11 : 12);
  SplatLimits limits;
  limits.min_cosine = 0.2F;
  limits.antialiased = antialiased;
  const SplatKernels& kernels = splat_kernels("");
  std::size_t found = 0;
  double worst_weight = 0, worst_depth = 0;
  for (const ReferenceSplat& splat : random_splats(random, 3000, with_normals)) {
    const auto set = source::make_splat_set(splat_block({splat}));
    const float x = static_cast<float>(splat.mean.x + random.between(-0.1, 0.1));
    const float y = static_cast<float>(splat.mean.y + random.between(-0.1, 0.1));
    const TexelPacket packet = wavy_packet(x, y, 0.01F, 0, kLanes);
    const auto responses = respond(kernels, set, packet, limits);
    for (int lane = 0; lane < kLanes; ++lane) {
      const Contribution c = contribution(splat, texel_of(packet, lane), reference_limits(limits));
      const double weight = responses.empty() ? 0 : responses[0].weight[lane];
      const double depth = responses.empty() ? 0 : responses[0].depth[lane] * 0.01;
      // At the cut-off and at the largest angle rounding may decide; little is left there.
      if ((weight == 0) != (c.evidence == 0)) {
        CHECK(std::max(weight, c.evidence) < 0.06);
        continue;
      }
      if (weight == 0) continue;
      ++found;
      worst_weight = std::max(worst_weight, std::abs(weight / c.evidence - 1));
      worst_depth = std::max(worst_depth, std::abs(depth - c.t));
    }
  }
  CAPTURE(antialiased, with_normals, worst_weight, worst_depth);
  CHECK(found > 5000);
  CHECK(worst_weight < 2e-3);  // thin needles: the floats of their means
  CHECK(worst_depth < 1e-4);
}

TEST_CASE("a Gaussian's weight by hand", "[projection]") {
  // A disc in the plane at the texel's left by one sigma, half opaque, 3 : 2 : 1/2.
  ReferenceSplat splat;
  splat.mean = {3, 0, 0.25};
  splat.sigma = {3, 2, 0.5};
  splat.alpha = 0.5;
  TexelPacket packet = wavy_packet(0, 0, 1, 0, 1);
  for (int lane = 0; lane < kLanes; ++lane) {
    packet.px[lane] = packet.py[lane] = packet.pz[lane] = 0;
    packet.nx[lane] = packet.ny[lane] = 0;
    packet.nz[lane] = 1;
  }
  for (const SplatKernels* kernels : available_splat_kernels()) {
    const auto responses =
        respond(*kernels, source::make_splat_set(splat_block({splat})), packet, {});
    REQUIRE(responses.size() == 1);
    // 0.5 opaque, 1 - 1/4 planar; q = 9 / 9.3. That it is 2/3 round counts in the sums.
    CHECK(responses[0].weight[0] == Approx(0.5 * 0.75 * std::exp(-0.5 * 9 / 9.3)).epsilon(1e-6));
    CHECK(responses[0].depth[0] == Approx(0.25).epsilon(1e-6));
    // Antialiased: sqrt(9 * 4 / (9.3 * 4.3)) of it.
    SplatLimits limits;
    limits.antialiased = true;
    const auto fainter =
        respond(*kernels, source::make_splat_set(splat_block({splat})), packet, limits);
    CHECK(fainter[0].weight[0] / responses[0].weight[0] ==
          Approx(std::sqrt(36 / (9.3 * 4.3))).epsilon(1e-6));
  }
}

TEST_CASE("weights follow the exponential to a millionth", "[projection]") {
  // A round Gaussian of sigma^2 = 0.7 texels has a marginal of 1: q is the squared distance.
  ReferenceSplat splat;
  splat.sigma = {std::sqrt(0.7), std::sqrt(0.7), std::sqrt(0.7)};
  const auto set = source::make_splat_set(splat_block({splat}));
  double worst = 0;
  for (int i = 0; i < 2900; ++i) {
    TexelPacket packet = wavy_packet(0, 0, 1, 0, 1);
    for (int lane = 0; lane < kLanes; ++lane) {
      packet.px[lane] = static_cast<float>(i) / 1000;
      packet.py[lane] = packet.pz[lane] = packet.nx[lane] = packet.ny[lane] = 0;
      packet.nz[lane] = 1;
    }
    const auto responses = respond(splat_kernels(""), set, packet, {});
    REQUIRE(responses.size() == 1);
    const double x = static_cast<double>(packet.px[0]);
    const double exact = 0.02 * std::exp(-x * x / (2 * 1.0));
    worst = std::max(worst, std::abs(responses[0].weight[5] / exact - 1));
  }
  CAPTURE(worst);
  CHECK(worst < 2e-6);
}

TEST_CASE("beyond three standard deviations a Gaussian weighs nothing", "[projection]") {
  ReferenceSplat splat;
  splat.sigma = {std::sqrt(0.7), std::sqrt(0.7), 0.1};
  const auto set = source::make_splat_set(splat_block({splat}));
  for (const float x : {2.99F, 3.01F}) {
    TexelPacket packet = wavy_packet(x, 0, 1, 0, 1);
    for (int lane = 0; lane < kLanes; ++lane) {
      packet.nx[lane] = packet.ny[lane] = 0;
      packet.nz[lane] = 1;
    }
    CHECK(respond(splat_kernels(""), set, packet, {}).size() == (x < 3 ? 1 : 0));
  }
}

TEST_CASE("every instruction set gives the same bits for splats", "[projection]") {
  const bool antialiased = GENERATE(false, true);
  Random random(21);
  const auto scene = random_splats(random, 4000, true);
  const auto set = source::make_splat_set(splat_block(scene));
  const auto all = available_splat_kernels();
  SplatLimits limits{0.5F, 0.2F, 0.02F, antialiased};
  for (int i = 0; i < 20; ++i) {
    SplatState state = piece_of_packets(random, 2);
    start(limits, state);
    std::vector<SplatResponse> first;
    DepthPacket first_depths{};
    ProfilePacket first_profile{};
    for (const SplatKernels* kernels : all) {
      const auto responses = respond(*kernels, set, state.packets[0], limits);
      ProfilePacket profile{};
      DepthPacket depths = state.depths[0];
      kernels->deposit(responses, depths, profile);
      for (int lane = 0; lane < kLanes; ++lane) {
        depths.take[lane] = lane % 3 == 0 ? 0 : 1;
        depths.centre[lane] = 0.25F * static_cast<float>(lane) - 1;
      }
      kernels->accumulate(responses, state.packets[0], depths);
      if (kernels == all.front()) {
        first = responses;
        first_depths = depths;
        first_profile = profile;
        REQUIRE(first.size() > 10);
        continue;
      }
      REQUIRE(responses.size() == first.size());
      for (std::size_t r = 0; r < first.size(); ++r) {
        CHECK(responses[r].shape == first[r].shape);
        CHECK(std::memcmp(responses[r].weight, first[r].weight, sizeof first[r].weight) == 0);
        CHECK(std::memcmp(responses[r].depth, first[r].depth, sizeof first[r].depth) == 0);
      }
      CHECK(std::memcmp(&profile, &first_profile, sizeof profile) == 0);
      CHECK(std::memcmp(&depths, &first_depths, sizeof depths) == 0);
    }
  }
}

TEST_CASE("bins that are full stay full", "[projection]") {
  ReferenceSplat splat;
  splat.sigma = {5, 5, 0};
  const auto set = source::make_splat_set(splat_block({splat}));
  TexelPacket packet = wavy_packet(0, 0, 1, 0, kLanes);
  const SplatKernels& kernels = splat_kernels("");
  const auto one = respond(kernels, set, packet, {});
  REQUIRE(one.size() == 1);
  ProfilePacket profile{};
  DepthPacket depths{};
  for (float& w : depths.per_width) w = 1;
  const std::vector<SplatResponse> many(2000, one[0]);
  kernels.deposit(many, depths, profile);
  std::int32_t largest = 0;
  for (const auto& bin : profile.bins) {
    for (const std::int32_t v : bin) {
      CHECK(v >= 0);
      largest = std::max(largest, v);
    }
  }
  CHECK(largest == kFullBin);
}
