// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cstring>
#include <limits>
#include <optional>

#include "support/bytes.h"
#include "unit/projection/random_facets.h"

using namespace pounce;
using namespace pounce::projection;
using pounce::test::Random;

namespace {

/// The instruction sets that this processor has.
std::vector<const Kernels*> available() {
  std::vector<const Kernels*> all;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const Kernels* found = nullptr;
    if (test::error_kind([&] { found = &kernels(isa); }) == 0) all.push_back(found);
  }
  return all;
}

struct Hit {
  double key = 0, x = 0, y = 0;
};

/// The definition in double precision. Nothing: no hit. `unsure`: too near a limit to say.
std::optional<Hit> reference(const source::Facet& f, const TexelPacket& packet, int lane,
                             const SearchLimits& limits, bool& unsure) {
  const auto vec = [](const float(&v)[3]) { return Vec3d{v[0], v[1], v[2]}; };
  const Vec3d p{packet.px[lane], packet.py[lane], packet.pz[lane]};
  const Vec3d n{packet.nx[lane], packet.ny[lane], packet.nz[lane]};
  const auto beyond = [&](double value, double limit, double scale) {
    if (std::abs(value - limit) <= 1e-4 * scale) unsure = true;
    return value > limit;
  };
  const double facing = dot(vec(f.n), n);
  if (beyond(limits.min_cosine, facing, 1)) return {};
  const Vec3d r = vec(f.m) - p;
  const double t = dot(vec(f.n), r) / facing;
  if (beyond(std::abs(t), limits.max_distance, 1)) return {};
  const Vec3d d = n * t - r;
  const double w1 = dot(vec(f.g1), d), w2 = dot(vec(f.g2), d), w0 = 1 - w1 - w2;
  const double steep = 1 + length(vec(f.g1)) + length(vec(f.g2));
  if (beyond(-w0, f.reach[0], steep) || beyond(-w1, f.reach[1], steep) ||
      beyond(-w2, f.reach[2], steep)) {
    return {};
  }
  double c1 = std::max(w1, 0.0), c2 = std::max(w2, 0.0);
  const double sum = std::max(c1 + c2, 1.0);
  c1 /= sum;
  c2 /= sum;
  const double outside = length(d - (vec(f.e1) * c1 + vec(f.e2) * c2));
  if (beyond(outside, f.tolerance, 1)) return {};
  if (beyond(std::abs(t) + outside, limits.max_distance, 1 + 20 / packet.per_texel[lane]))
    return {};
  return Hit{(std::abs(t) + outside) * packet.per_texel[lane] * kKeySteps,
             f.base[0] + double{f.frac[0]} + f.du[0] * c1 + f.du[1] * c2,
             f.base[1] + double{f.frac[1]} + f.dv[0] * c1 + f.dv[1] * c2};
}

source::Facet flat_facet(std::int32_t id, float height) {
  // The right triangle (0,0) (1,0) (0,1) at z = height, ten texels along its legs.
  source::Facet f{};
  f.n[2] = 1;
  f.m[2] = height;
  f.g1[0] = f.e1[0] = 1;
  f.g2[1] = f.e2[1] = 1;
  f.du[0] = f.dv[1] = 10;
  f.base[0] = 3;
  f.base[1] = -7;
  f.tolerance = 0.125F;
  f.reach[1] = f.reach[2] = 0.125F;
  f.reach[0] = 0.125F * 1.41421356F;
  f.id = id;
  f.page = 2;
  return f;
}

/// Texel i at (x[i], 0.25, 0) facing up; one unit per 8 texels.
TexelPacket flat_packet() {
  TexelPacket packet{};
  for (int lane = 0; lane < kLanes; ++lane) {
    packet.px[lane] = static_cast<float>(lane) / 16;
    packet.py[lane] = 0.25F;
    packet.nz[lane] = 1;
    packet.per_texel[lane] = 8;
    packet.texel[lane] = static_cast<std::uint16_t>(lane);
  }
  return packet;
}

}  // namespace

TEST_CASE("hits of a right triangle are what one works out by hand") {
  HitPacket best;
  clear(best);
  TexelPacket packet = flat_packet();
  packet.nz[5] = -1;                   // faces away
  packet.nz[6] = 0, packet.nx[6] = 1;  // along the plane
  kernels("").hit(flat_facet(9, 0.5F), packet, {1, 0.5F}, best);
  for (int lane = 0; lane < kLanes; ++lane) {
    CAPTURE(lane);
    const double x = lane / 16.0;
    // Beyond x = 3/4 the hit is outside; clamping (x, 1/4) onto x + y = 1 scales it by 1/(x + 1/4).
    const double sum = std::max(x + 0.25, 1.0);
    const double outside = std::hypot(x, 0.25) * (1 - 1 / sum);
    if (lane == 5 || lane == 6 || outside > 0.125) {
      CHECK(best.key[lane] == kNoHit);
      CHECK(best.id[lane] == kNoHit);
      continue;
    }
    CHECK(best.key[lane] == Approx((0.5 + outside) * 8 * 1024).margin(1));
    CHECK(best.id[lane] == 9);
    CHECK(best.page[lane] == 2);
    CHECK(best.base_x[lane] == 3);
    CHECK(best.base_y[lane] == -7);
    CHECK(best.frac_x[lane] == Approx(10 * x / sum));
    CHECK(best.frac_y[lane] == Approx(2.5 / sum));
  }
  CHECK(best.key[12] == 4096);  // on the edge
  CHECK(best.key[13] != kNoHit);
}

TEST_CASE("the nearest facet wins on either side, equal ones by the smaller triangle") {
  const std::array<float, 3> heights{0.5F, -0.25F, 0.75F};
  std::array<int, 3> order{0, 1, 2};
  do {
    HitPacket best;
    clear(best);
    for (const int i : order) {
      const float height = heights[static_cast<std::size_t>(i)];
      kernels("").hit(flat_facet(10 + i, height), flat_packet(), {1, 0.5F}, best);
      kernels("").hit(flat_facet(20 + i, height), flat_packet(), {1, 0.5F}, best);
    }
    CHECK(best.id[0] == 11);
    CHECK(best.key[0] == 2048);
  } while (std::next_permutation(order.begin(), order.end()));
  HitPacket best;
  clear(best);
  for (const std::int32_t id : {7, 3, 5})
    kernels("").hit(flat_facet(id, id == 5 ? -0.5F : 0.5F), flat_packet(), {1, 0.5F}, best);
  CHECK(best.id[0] == 3);
}

TEST_CASE("a facet at the maximum distance or too oblique is not hit") {
  for (const auto& [limits, hits] : std::vector<std::pair<SearchLimits, bool>>{
           {{0.5002F, 0.5F}, true}, {{0.5F, 0.5F}, false}, {{1, 1}, true}, {{1, 1.0001F}, false}}) {
    HitPacket best;
    clear(best);
    kernels("").hit(flat_facet(1, 0.5F), flat_packet(), limits, best);
    CHECK((best.key[0] != kNoHit) == hits);
  }
}

TEST_CASE("the hit kernel agrees with the definition in double precision") {
  Random random(51);
  std::size_t hits = 0, misses = 0, unsure_ones = 0;
  for (int round = 0; round < 3000; ++round) {
    const source::SourceBlock block = test::random_source(random, 4, random.one_in(2) ? 1 : 0.2F);
    const TexelPacket packet = test::random_packet(random, 0.5F);
    const SearchLimits limits{random.between(0.5F, 2.0F), random.between(0.1F, 0.9F)};
    for (const source::Facet& facet : block.facets) {
      HitPacket best;
      clear(best);
      kernels("").hit(facet, packet, limits, best);
      for (int lane = 0; lane < kLanes; ++lane) {
        bool unsure = false;
        const auto expected = reference(facet, packet, lane, limits, unsure);
        if (unsure) {
          ++unsure_ones;
          continue;
        }
        if (expected.has_value() != (best.key[lane] != kNoHit)) FAIL("round " << round);
        if (!expected) {
          ++misses;
          continue;
        }
        ++hits;
        const double steep = std::abs(facet.du[0]) + std::abs(facet.du[1]) + std::abs(facet.dv[0]) +
                             std::abs(facet.dv[1]) + 1;
        const double x = best.base_x[lane] + double{best.frac_x[lane]};
        const double y = best.base_y[lane] + double{best.frac_y[lane]};
        const double bends = length(Vec3d{facet.g1[0], facet.g1[1], facet.g1[2]}) +
                             length(Vec3d{facet.g2[0], facet.g2[1], facet.g2[2]});
        if (std::abs(best.key[lane] - expected->key) > 1.5 + 1e-4 * expected->key * (1 + bends) ||
            std::abs(x - expected->x) > 1e-5 * steep * (1 + bends) ||
            std::abs(y - expected->y) > 1e-5 * steep * (1 + bends)) {
          FAIL("round " << round << " lane " << lane << ": key " << best.key[lane] << " for "
                        << expected->key << ", x " << x << " for " << expected->x);
        }
      }
    }
  }
  CHECK(hits > 2000);
  CHECK(misses > 50000);
  CHECK(unsure_ones < (hits + misses) / 50);
}

TEST_CASE("all instruction sets give the same bits, whatever is in the packets") {
  const auto isas = available();
  if (isas.size() < 2) WARN("only one instruction set here: nothing to compare");
  Random random(52);
  const auto any_float = [&] {
    switch (random.below(8)) {
      case 0:
        return std::bit_cast<float>(static_cast<std::uint32_t>(random.bits()));
      case 1:
        return std::numeric_limits<float>::infinity();
      case 2:
        return std::numeric_limits<float>::quiet_NaN();
      case 3:
        return 0.0F;
      case 4:
        return 1e-42F;  // subnormal
      default:
        return random.between(-1.0F, 1.0F);
    }
  };
  std::size_t cases = 0, hit_lanes = 0;
  for (int round = 0; round < 4000; ++round) {
    source::SourceBlock block = test::random_source(random, 5, 1);
    std::vector<TexelPacket> packets;
    for (int i = 0; i < 5; ++i) packets.push_back(test::random_packet(random, 1));
    const bool wild = random.one_in(3);
    if (wild) {
      for (source::Facet& f : block.facets) {
        float* const parts[] = {f.n, f.m, f.g1, f.g2, f.e1, f.e2, f.reach, &f.tolerance};
        *parts[random.below(8)] = any_float();
      }
      for (TexelPacket& p : packets) {
        float* const parts[] = {p.px, p.py, p.pz, p.nx, p.ny, p.nz, p.per_texel};
        for (int i = 0; i < 10; ++i) parts[random.below(7)][random.below(kLanes)] = any_float();
      }
    }
    const SearchLimits limits{random.between(0.1F, 3.0F), random.between(0.0F, 0.9F)};
    const float height = random.between(0.0F, 2.0F);
    Candidates candidates;
    for (const source::Patch& patch : block.patches)
      candidates.add({patch.box, patch.centre, patch.radius, &block.facets[patch.facet], 0, {}});
    for (const TexelPacket& packet : packets) {
      std::vector<HitPacket> results(isas.size() * 2);
      std::vector<bool> finals(isas.size());
      for (std::size_t k = 0; k < isas.size(); ++k) {
        clear(results[2 * k]);
        clear(results[2 * k + 1]);
        for (const source::Facet& facet : block.facets)
          isas[k]->hit(facet, packet, limits, results[2 * k]);
        isas[k]->search(candidates, bundle_of(packet), height, packet, limits, results[2 * k + 1]);
        finals[k] = isas[k]->all_final(packet, results[2 * k], height);
        if (std::memcmp(&results[0], &results[2 * k], sizeof(HitPacket)) != 0 ||
            std::memcmp(&results[1], &results[2 * k + 1], sizeof(HitPacket)) != 0 ||
            finals[k] != finals[0]) {
          FAIL(isas[k]->isa << " differs from " << isas[0]->isa << " in round " << round);
        }
      }
      cases += block.facets.size();
      for (const std::int32_t key : results[0].key) hit_lanes += key != kNoHit;
    }
  }
  CHECK(cases >= 100000);
  CHECK(hit_lanes > 10000);
}

TEST_CASE("a NaN anywhere is never a hit") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (int part = 0; part < 6; ++part) {
    TexelPacket packet = flat_packet();
    float* const parts[] = {packet.px, packet.py, packet.pz, packet.nx, packet.ny, packet.nz};
    parts[part][2] = nan;
    HitPacket best;
    clear(best);
    kernels("").hit(flat_facet(1, 0.5F), packet, {1, 0.5F}, best);
    CHECK(best.key[2] == kNoHit);
    CHECK(best.key[1] == 4096);
  }
}

TEST_CASE("a packet is final when every used lane's key is below the height") {
  for (const Kernels* k : available()) {
    CAPTURE(k->isa);
    TexelPacket packet = flat_packet();  // 8 texels per unit: height h is the key 8192 h
    HitPacket best;
    clear(best);
    CHECK_FALSE(k->all_final(packet, best, 1e30F));
    for (std::int32_t& key : best.key) key = 4095;
    CHECK(k->all_final(packet, best, 0.5F));
    CHECK_FALSE(k->all_final(packet, best, 0.4999F));
    best.key[15] = 4096;  // a facet just beyond could have the same key and a smaller id
    CHECK_FALSE(k->all_final(packet, best, 0.5F));
    best.key[15] = kNoHit;
    CHECK_FALSE(k->all_final(packet, best, 0.5F));
    packet.texel[15] = target::kNoTexel;
    CHECK(k->all_final(packet, best, 0.5F));
  }
}

TEST_CASE("kernels are found by name, the best one without, unknown ones are refused") {
  CHECK(std::string(kernels("sse2").isa) == "sse2");
  CHECK(std::string(kernels("").isa) == available().back()->isa);
  for (const char* isa : {"neon", "SSE2", "avx"}) {
    std::string message;
    CHECK(test::error_kind([&] { kernels(isa); }, &message) == static_cast<int>(ErrorKind::usage));
    CHECK(message.find(isa) != std::string::npos);
  }
}
