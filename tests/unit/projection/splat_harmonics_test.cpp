// SPDX-License-Identifier: Apache-2.0
//
// Which colour a Gaussian with harmonics shows to sixteen texels, against slow evaluations.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/directions.h"
#include "core/portable_math.h"
#include "support/slow_harmonics.h"
#include "unit/projection/splat_packets.h"

using namespace pounce;
using namespace pounce::projection;
using namespace pounce::test;

namespace {

/// One Gaussian with random coefficients, in the order of store::SplatRows.
struct Coloured {
  store::SplatBlock block;
  std::vector<double> sh;
  std::array<double, 3> dc;

  Coloured(Random& random, std::uint32_t lobes, double size) {
    store::Splat splat;
    splat.sigma = {10, 10, 0};
    splat.colour = {random.between(0.2F, 0.8F), random.between(0.2F, 0.8F),
                    random.between(0.2F, 0.8F)};
    dc = {double{splat.colour.x}, double{splat.colour.y}, double{splat.colour.z}};
    std::vector<std::uint16_t> halves;
    for (std::size_t i = 0; i < std::size_t{3} * lobes; ++i) {
      halves.push_back(float_to_half(static_cast<float>(random.between(-size, size))));
      sh.push_back(double{half_to_float(halves.back())});
    }
    block.assign(std::span(&splat, 1), lobes, halves);
  }

  /// Not clamped.
  double seen(const Vec3d& direction, std::size_t channel) const {
    const auto basis = slow_basis(direction);
    double sum = dc[channel];
    for (std::size_t k = 0; 3 * k < sh.size(); ++k) sum += basis[k + 1] * sh[3 * k + channel];
    return sum;
  }
};

TexelPacket packet_of_normals(Random& random) {
  TexelPacket packet{};
  for (int lane = 0; lane < kLanes; ++lane) {
    Vec3f n{random.between(-1.0F, 1.0F), random.between(-1.0F, 1.0F), random.between(-1.0F, 1.0F)};
    if (lane < 3) n = {lane == 0 ? 1.0F : 0, lane == 1 ? 1.0F : 0, lane == 2 ? 1.0F : 0};
    n = n * (1 / length(n));
    packet.nx[lane] = n.x;
    packet.ny[lane] = n.y;
    packet.nz[lane] = n.z;
    packet.per_texel[lane] = 1;
  }
  return packet;
}

Vec3d normal_of(const TexelPacket& packet, int lane) {
  const Vec3d n{packet.nx[lane], packet.ny[lane], packet.nz[lane]};
  return n * (1 / length(n));
}

/// The colours that sixteen texels take from it alone.
DepthPacket summed(const SplatKernels& kernels, const gaussian::SplatSet& set,
                   const TexelPacket& packet) {
  SplatResponse response{};
  response.shape = &set.shapes[0];
  std::fill(std::begin(response.alpha), std::end(response.alpha), 1.0F);
  SplatLimits limits;
  limits.reach = 1;
  DepthPacket depths{};
  std::fill(std::begin(depths.per_bin), std::end(depths.per_bin), 1.0F);
  std::fill(std::begin(depths.per_window), std::end(depths.per_window), 1.0F);
  std::fill(std::begin(depths.anchor), std::end(depths.anchor), 1.0F);
  kernels.accumulate(std::span(&response, 1), packet, ProfilePacket{}, limits, depths);
  return depths;
}

double colour(const DepthPacket& depths, int lane, std::size_t channel) {
  return static_cast<double>(depths.colour[channel][lane]) /
         static_cast<double>(depths.weight[lane]);
}

}  // namespace

TEST_CASE("the basis is that of the definition", "[projection]") {
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    Vec3d d{random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0)};
    d = d * (1 / length(d));
    const auto fast = sh_basis<double>(d.x, d.y, d.z), slow = slow_basis(d);
    for (std::size_t k = 0; k < fast.size(); ++k) CHECK(fast[k] == Approx(slow[k]).margin(1e-12));
  }
}

TEST_CASE("harmonics are seen along the normal on every instruction set", "[projection]") {
  Random random(17);
  const std::uint32_t lobes = GENERATE(0U, 3U, 8U, 15U);
  const double size = GENERATE(0.3, 6.0);  // the larger leave 0..8
  const auto all = available_splat_kernels();
  std::size_t clamped = 0;
  for (int i = 0; i < 20; ++i) {
    const Coloured splat(random, lobes, size);
    const auto set = gaussian::make_splat_set(splat.block, SphericalHarmonics::normal);
    const TexelPacket packet = packet_of_normals(random);
    const DepthPacket first = summed(*all.front(), set, packet);
    for (int lane = 0; lane < kLanes; ++lane) {
      const Vec3d towards_splat = normal_of(packet, lane) * -1.0;
      for (std::size_t c = 0; c < 3; ++c) {
        const double free = splat.seen(towards_splat, c), expected = std::clamp(free, 0.0, 8.0);
        clamped += free != expected ? 1 : 0;
        CHECK(colour(first, lane, c) == Approx(expected).margin(1e-5));
      }
    }
    for (const SplatKernels* kernels : all) {
      const DepthPacket same = summed(*kernels, set, packet);
      CHECK(std::memcmp(&same, &first, sizeof same) == 0);
    }
  }
  if (lobes > 0) CHECK((clamped > 100) == (size > 1));
}

TEST_CASE("the mean is that of 10,000 directions that look at the texel", "[projection]") {
  Random random(23);
  const std::uint32_t lobes = GENERATE(3U, 8U, 15U);
  for (int i = 0; i < 3; ++i) {
    const Coloured splat(random, lobes, 0.1);
    const auto set = gaussian::make_splat_set(splat.block, SphericalHarmonics::mean);
    const TexelPacket packet = packet_of_normals(random);
    const DepthPacket sums = summed(splat_kernels(""), set, packet);
    for (const int lane : {0, 1, 2, 9}) {
      std::array<double, 3> mean{};
      constexpr int kDirections = 10000;
      for_hemisphere(normal_of(packet, lane), kDirections, [&](const Vec3d& towards_eye) {
        for (std::size_t c = 0; c < 3; ++c)
          mean[c] += splat.seen(towards_eye * -1.0, c) / kDirections;
      });
      for (std::size_t c = 0; c < 3; ++c)
        CHECK(colour(sums, lane, c) == Approx(mean[c]).margin(2e-4));
    }
  }
}

TEST_CASE("the base colour alone is the mean over the whole sphere", "[projection]") {
  Random random(29);
  const Coloured splat(random, 15, 0.5);
  const auto set = gaussian::make_splat_set(splat.block, SphericalHarmonics::dc);
  CHECK(set.sh.empty());
  const DepthPacket sums = summed(splat_kernels(""), set, packet_of_normals(random));
  for (std::size_t c = 0; c < 3; ++c) CHECK(colour(sums, 5, c) == Approx(splat.dc[c]).margin(1e-6));
}
