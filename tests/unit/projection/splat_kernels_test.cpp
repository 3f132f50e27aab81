// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "unit/projection/splat_packets.h"

using namespace pounce;
using namespace pounce::projection;
using namespace pounce::test;

namespace {

/// What one Gaussian gives to a packet; empty if that is nothing. Adds it to `profile`.
std::vector<SplatResponse> respond(const SplatKernels& kernels, const gaussian::SplatSet& set,
                                   const TexelPacket& packet, const SplatLimits& limits,
                                   ProfilePacket* profile = nullptr) {
  SplatState state;
  state.packets.push_back(packet);
  start(limits, state);
  const RayBundle everywhere{{0, 0, 0}, {0, 0, 0}, 1e9F, 0};
  SplatCandidates candidates(set.shapes.size());
  kernels.gather(std::array{&set}, everywhere, 1e9F, 0, candidates);
  std::vector<SplatResponse> out(candidates.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < candidates.size(); i += kMostResponses) {
    const std::size_t end = std::min(i + kMostResponses, candidates.size());
    count += kernels.respond(candidates, i, end, everywhere, packet, state.depths[0], limits,
                             out.data() + count, profile);
  }
  out.resize(count);
  return out;
}

SplatLimits wide() {
  SplatLimits limits;
  limits.reach = 12;
  return limits;
}

ReferenceLimits reference_limits(const SplatLimits& limits) {
  ReferenceLimits out{limits.reach, limits.min_cosine, limits.window, limits.discness,
                      limits.antialiased};
  out.fine_edge = limits.fine_edge;
  return out;
}

/// A texel's packet that looks along +z from (x, 0, 0), its edge 1.
TexelPacket upright_packet(float x) {
  TexelPacket packet = wavy_packet(0, 0, 1, 0, 1);
  for (int lane = 0; lane < kLanes; ++lane) {
    packet.px[lane] = x;
    packet.py[lane] = packet.pz[lane] = packet.nx[lane] = packet.ny[lane] = 0;
    packet.nz[lane] = 1;
  }
  return packet;
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
    splat.alpha = 0.5;  // below what alpha is clamped to
    splat.rotation = random_rotation(random);
    splat.sigma = {random.between(0.1, 0.5), random.between(0.1, 0.5), random.between(0.1, 0.5)};
    splat.mean = {random.between(-0.5, 0.5), random.between(-0.5, 0.5), random.between(-0.5, 0.5)};
    ReferenceTexel texel;
    texel.normal = {random.between(-1.0, 1.0), random.between(-1.0, 1.0), 1.3};
    texel.normal = texel.normal * (1 / length(texel.normal));
    texel.edge = random.one_in(2) ? 0.001 : 0.3;
    const Contribution c = contribution(splat, texel, {9, 0, 0.1, 0, false});
    if (c.alpha == 0) continue;
    const Peak peak = search_peak(splat, texel);
    CHECK(c.t == Approx(peak.t).margin(1e-6));
    // What is left of alpha without its other factors.
    ReferenceTexel at = texel;
    at.position = splat.mean;
    CHECK(c.alpha / contribution(splat, at, {9, 0, 0.1, 0, false}).alpha ==
          Approx(peak.response).epsilon(1e-9));
    ++compared;
  }
  CHECK(compared > 100);
}

TEST_CASE("responses are those of the reference", "[projection]") {
  const bool antialiased = GENERATE(false, true), with_normals = GENERATE(false, true);
  Random random(antialiased ? 11 : 12);
  SplatLimits limits;
  limits.reach = 0.4F;
  limits.min_cosine = 0.2F;
  limits.antialiased = antialiased;
  if (with_normals) limits.fine_edge = 0.004F;  // of texels of 0.01
  const SplatKernels& kernels = splat_kernels("");
  std::size_t found = 0;
  double worst_alpha = 0, worst_depth = 0, worst_mass = 0;
  for (const ReferenceSplat& splat : random_splats(random, 3000, with_normals)) {
    const auto set = gaussian::make_splat_set(splat_block({splat}), SphericalHarmonics::dc);
    const float x = static_cast<float>(splat.mean.x + random.between(-0.1, 0.1));
    const float y = static_cast<float>(splat.mean.y + random.between(-0.1, 0.1));
    const TexelPacket packet = wavy_packet(x, y, 0.01F, 0, kLanes);
    ProfilePacket profile{};
    const auto responses = respond(kernels, set, packet, limits, &profile);
    const double bin = double{limits.reach} / 12;
    for (int lane = 0; lane < kLanes; ++lane) {
      const Contribution c = contribution(splat, texel_of(packet, lane), reference_limits(limits));
      const double alpha = responses.empty() ? 0 : responses[0].alpha[lane];
      // At the cut-off and at the largest angle rounding may decide; little is left there.
      if ((alpha == 0) != (c.alpha == 0)) {
        CHECK(std::max(alpha, c.alpha) < 0.06);
        continue;
      }
      if (alpha == 0) continue;
      ++found;
      const double depth = double{limits.reach} - responses[0].at[lane] * bin;
      double mass = 0;
      for (const auto& bins : profile.bins) mass += bins[lane] / double{kSplatSteps};
      worst_alpha = std::max(worst_alpha, std::abs(alpha / c.alpha - 1));
      worst_depth = std::max(worst_depth, std::abs(depth - c.t));
      worst_mass = std::max(worst_mass, std::abs(mass - c.mass));
    }
  }
  CAPTURE(antialiased, with_normals, worst_alpha, worst_depth, worst_mass);
  CHECK(found > 5000);
  CHECK(worst_alpha < 2e-3);  // thin needles: the floats of their means
  CHECK(worst_depth < 1e-4);
  CHECK(worst_mass < 2e-4);
}

TEST_CASE("a Gaussian's alpha and mass by hand", "[projection]") {
  // A disc in the plane at the texel's left by one sigma, half opaque, 3 : 2 : 1/2.
  ReferenceSplat splat;
  splat.mean = {3, 0, 0.25};
  splat.sigma = {3, 2, 0.5};
  splat.alpha = 0.5;
  const auto set = gaussian::make_splat_set(splat_block({splat}), SphericalHarmonics::dc);
  for (const SplatKernels* kernels : available_splat_kernels()) {
    ProfilePacket profile{};
    const auto responses = respond(*kernels, set, upright_packet(0), wide(), &profile);
    REQUIRE(responses.size() == 1);
    // q = 9 / 9.3; the footprint makes it fainter by the fourth root of 9 * 4 / (9.3 * 4.3).
    const double kept = 36 / (9.3 * 4.3), q = 9 / 9.3;
    CHECK(responses[0].alpha[0] ==
          Approx(0.5 * std::pow(kept, 0.25) * std::exp(-q / 2)).epsilon(2e-6));
    // Bins are one long, the first at depth 12: 0.25 lies between the twelfth and the next.
    CHECK(responses[0].at[0] == Approx(11.75).epsilon(1e-6));
    const double mass = 0.4 * 0.5 * std::pow(kept, 0.25) * (1 - q / 9) * kSplatSteps;
    CHECK(profile.bins[11][0] == Approx(mass * 0.25).margin(2));
    CHECK(profile.bins[12][0] == Approx(mass * 0.75).margin(2));
    CHECK(profile.bins[12][1] == 0);  // the packet has one texel
    // Antialiased: all of that loss.
    SplatLimits limits = wide();
    limits.antialiased = true;
    const auto fainter = respond(*kernels, set, upright_packet(0), limits);
    CHECK(fainter[0].alpha[0] == Approx(0.5 * std::sqrt(kept) * std::exp(-q / 2)).epsilon(2e-6));
  }
}

TEST_CASE("weights follow the exponential to a millionth", "[projection]") {
  // A round Gaussian of sigma^2 = 0.7 texels has a marginal of 1: q is the squared distance.
  ReferenceSplat splat;
  splat.alpha = 0.5;
  splat.sigma = {std::sqrt(0.7), std::sqrt(0.7), std::sqrt(0.7)};
  const auto set = gaussian::make_splat_set(splat_block({splat}), SphericalHarmonics::dc);
  double worst = 0;
  for (int i = 0; i < 2900; ++i) {
    const TexelPacket packet = upright_packet(static_cast<float>(i) / 1000);
    const auto responses = respond(splat_kernels(""), set, packet, wide());
    REQUIRE(responses.size() == 1);
    const double x = static_cast<double>(packet.px[0]);
    const double exact = 0.5 * std::sqrt(0.7) * std::exp(-x * x / 2);
    worst = std::max(worst, std::abs(responses[0].alpha[0] / exact - 1));
  }
  CAPTURE(worst);
  CHECK(worst < 2e-6);
}

TEST_CASE("beyond three standard deviations a Gaussian weighs nothing", "[projection]") {
  ReferenceSplat splat;
  splat.sigma = {std::sqrt(0.7), std::sqrt(0.7), 0.1};
  const auto set = gaussian::make_splat_set(splat_block({splat}), SphericalHarmonics::dc);
  for (const float x : {2.99F, 3.01F}) {
    CHECK(respond(splat_kernels(""), set, upright_packet(x), wide()).size() == (x < 3 ? 1 : 0));
  }
}

TEST_CASE("what a texel does not reach weighs nothing", "[projection]") {
  ReferenceSplat splat;
  splat.sigma = {1, 1, 0.01};
  for (const double z : {11.99, 12.01, -11.99, -12.01}) {
    splat.mean.z = z;
    const auto set = gaussian::make_splat_set(splat_block({splat}), SphericalHarmonics::dc);
    CHECK(respond(splat_kernels(""), set, upright_packet(0), wide()).size() ==
          (std::abs(z) < 12 ? 1 : 0));
  }
}

TEST_CASE("gathering leaves out nothing that gives anything", "[projection]") {
  Random random(77);
  const auto scene = random_splats(random, 4000, false);
  const auto set = gaussian::make_splat_set(splat_block(scene), SphericalHarmonics::dc);
  SplatLimits limits;
  limits.reach = 0.3F;
  limits.fine_edge = GENERATE(1.0F, 0.002F);  // of texels of 0.01
  std::size_t given = 0, gathered = 0;
  for (int i = 0; i < 40; ++i) {
    SplatState state;
    TexelPacket packet =
        wavy_packet(random.between(-1.0F, 0.9F), random.between(-1.0F, 0.9F), 0.01F, 0, kLanes);
    if (i % 2 == 1) {  // a packet around a sharp bend: a wide cone
      for (int lane = 0; lane < kLanes; ++lane) {
        Vec3f n{packet.nx[lane] + random.between(-0.5F, 0.5F), packet.ny[lane], packet.nz[lane]};
        n = n * (1 / length(n));
        packet.nx[lane] = n.x, packet.ny[lane] = n.y, packet.nz[lane] = n.z;
      }
    }
    state.packets.push_back(packet);
    start(limits, state);
    for (const SplatKernels* kernels : available_splat_kernels()) {
      SplatCandidates candidates(set.shapes.size());
      kernels->gather(std::array{&set}, state.bundles[0], limits.reach, state.depths[0].footprint,
                      candidates);
      std::vector<SplatResponse> near(candidates.size());
      std::size_t count = 0;
      for (std::size_t at = 0; at < candidates.size(); at += kMostResponses) {
        count += kernels->respond(candidates, at, std::min(at + kMostResponses, candidates.size()),
                                  state.bundles[0], packet, state.depths[0], limits,
                                  near.data() + count, nullptr);
      }
      CHECK(count == respond(*kernels, set, packet, limits).size());
      given += count;
      gathered += candidates.size();
    }
  }
  CAPTURE(given, gathered);
  CHECK(given > 1000);
  CHECK(gathered < 4 * given);  // and not much else
}

TEST_CASE("a ray that lies across its bundle still meets what is far along it", "[projection]") {
  // Two rays, a quarter of a degree from being opposite; a small ball 11 along the first, which is
  // hardly anything along the direction between them.
  TexelPacket packet = upright_packet(0);
  const float tilt = 0.002F, across = std::sqrt(1 - tilt * tilt);
  for (int lane = 0; lane < kLanes; ++lane) {
    packet.per_texel[lane] = 1e4F;
    packet.nx[lane] = lane % 2 == 0 ? across : -across;
    packet.nz[lane] = tilt;
  }
  ReferenceSplat splat;
  splat.mean = {11.0 * double{across}, 0, 11.0 * double{tilt}};
  splat.sigma = {0.001, 0.001, 0.001};
  const auto set = gaussian::make_splat_set(splat_block({splat}), SphericalHarmonics::dc);
  SplatState state;
  state.packets.push_back(packet);
  start(wide(), state);
  REQUIRE(state.bundles[0].spread > 1);
  for (const SplatKernels* kernels : available_splat_kernels()) {
    SplatCandidates candidates(set.shapes.size());
    kernels->gather(std::array{&set}, state.bundles[0], 12, state.depths[0].footprint, candidates);
    CHECK(candidates.size() == 1);
    SplatResponse response;
    CHECK(kernels->respond(candidates, 0, candidates.size(), state.bundles[0], packet,
                           state.depths[0], wide(), &response, nullptr) == 1);
  }
}

TEST_CASE("every instruction set gives the same bits for splats", "[projection]") {
  const bool antialiased = GENERATE(false, true);
  const float discness = GENERATE(0.0F, 0.3F, 1.0F);
  Random random(21);
  const auto scene = random_splats(random, 4000, true);
  const auto set = gaussian::make_splat_set(splat_block(scene), SphericalHarmonics::dc);
  const auto all = available_splat_kernels();
  SplatLimits limits{0.5F, 0.2F, 0.02F, discness, antialiased};
  limits.fine_edge = 0.01F;  // some packets are coarse
  for (int i = 0; i < 20; ++i) {
    SplatState state = piece_of_packets(random, 2);
    start(limits, state);
    std::vector<SplatResponse> first;
    DepthPacket first_depths{};
    ProfilePacket first_profile{};
    for (const SplatKernels* kernels : all) {
      ProfilePacket profile{};
      DepthPacket depths = state.depths[0];
      const auto responses = respond(*kernels, set, state.packets[0], limits, &profile);
      kernels->find_surface(limits, profile, depths);
      kernels->accumulate(responses, state.packets[0], profile, limits, depths);
      if (kernels == all.front()) {
        first = responses;
        first_depths = depths;
        first_profile = profile;
        REQUIRE(first.size() > 10);
        CHECK(depths.weight[0] > 0);
        continue;
      }
      REQUIRE(responses.size() == first.size());
      for (std::size_t r = 0; r < first.size(); ++r) {
        CHECK(responses[r].shape == first[r].shape);
        CHECK(std::memcmp(responses[r].alpha, first[r].alpha, sizeof first[r].alpha) == 0);
        CHECK(std::memcmp(responses[r].at, first[r].at, sizeof first[r].at) == 0);
      }
      CHECK(std::memcmp(&profile, &first_profile, sizeof profile) == 0);
      CHECK(std::memcmp(&depths, &first_depths, sizeof depths) == 0);
    }
  }
}

TEST_CASE("bins that are full stay full", "[projection]") {
  ReferenceSplat splat;
  splat.sigma = {50, 50, 0};
  splat.colour = {8, 1, 0};
  const auto set = gaussian::make_splat_set(splat_block({splat}), SphericalHarmonics::dc);
  const SplatKernels& kernels = splat_kernels("");
  const TexelPacket packet = upright_packet(0);
  ProfilePacket profile{};
  for (int i = 0; i < 100; ++i) respond(kernels, set, packet, wide(), &profile);
  CHECK(profile.bins[12][0] == kFullBin);
}
