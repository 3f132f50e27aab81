// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
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
  double distance = 0, x = 0, y = 0;
};

/// Where a line meets a facet.
struct Meeting {
  double t = 0, outside = 0;
  std::array<double, 3> raw{}, inside{};  ///< barycentrics, before and after they are clamped
};

Vec3d vec(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

Meeting meet(const surface::Facet& f, Vec3d p, Vec3d n) {
  double rise = dot(vec(f.n), n);
  if (std::abs(rise) < kGrazing) rise = std::copysign(double{kGrazing}, rise);
  Meeting out;
  out.t = dot(vec(f.n), vec(f.m) - p) / rise;
  const Vec3d d = p + n * out.t - vec(f.m);
  const double w1 = dot(vec(f.g1), d), w2 = dot(vec(f.g2), d);
  out.raw = {1 - w1 - w2, w1, w2};
  double c1 = std::max(w1, 0.0), c2 = std::max(w2, 0.0);
  const double sum = std::max(c1 + c2, 1.0);
  c1 /= sum;
  c2 /= sum;
  out.inside = {1 - c1 - c2, c1, c2};
  out.outside = length(d - (vec(f.e1) * c1 + vec(f.e2) * c2));
  return out;
}

/// The definition in double precision. Nothing: no hit. `unsure`: too near a limit to say.
std::optional<Hit> reference(const surface::Facet& f, const TexelPacket& packet, int lane,
                             const SearchLimits& limits, bool& unsure) {
  const Vec3d p{packet.px[lane], packet.py[lane], packet.pz[lane]};
  const Vec3d n{packet.nx[lane], packet.ny[lane], packet.nz[lane]};
  if (n == Vec3d{}) return {};
  const auto beyond = [&](double value, double limit, double scale) {
    if (std::abs(value - limit) <= 1e-4 * scale) unsure = true;
    return value > limit;
  };
  const Meeting at = meet(f, p, n);
  const double amplified = 1 / std::max(std::abs(dot(vec(f.n), n)), double{kGrazing});
  if (beyond(std::abs(at.t), limits.max_distance, amplified)) return {};
  const double steep = amplified * (1 + length(vec(f.g1)) + length(vec(f.g2)));
  for (std::size_t k = 0; k < 3; ++k) {
    if (beyond(-at.raw[k], f.reach[k], steep)) return {};
  }
  if (beyond(at.outside, f.tolerance, amplified)) return {};
  if (beyond(std::abs(at.t) + at.outside, limits.max_distance, amplified)) return {};
  const Vec3d surface = vec(f.s) + vec(f.s1) * at.inside[1] + vec(f.s2) * at.inside[2];
  if (beyond(limits.min_cosine, dot(surface, n) / length(surface), steep)) return {};
  const Vec3d inset{1.0 * packet.inset_x[lane], 1.0 * packet.inset_y[lane],
                    1.0 * packet.inset_z[lane]};
  const Vec3d own = p - inset * double{surface::step_of(packet)};
  const auto w = meet(f, own, n).inside;
  return Hit{std::abs(at.t) + at.outside,
             f.base[0] + double{f.frac[0]} + f.du[0] * w[1] + f.du[1] * w[2],
             f.base[1] + double{f.frac[1]} + f.dv[0] * w[1] + f.dv[1] * w[2]};
}

surface::Facet flat_facet(std::int32_t id, float height) {
  // The right triangle (0,0) (1,0) (0,1) at z = height, ten texels along its legs.
  surface::Facet f{};
  f.n[2] = f.s[2] = 1;
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
TexelPacket flat_packet(float coarseness = 0) {
  TexelPacket packet{};
  packet.coarseness = coarseness;
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
  TexelPacket packet = flat_packet(4);
  packet.nz[5] = -1;                   // faces away
  packet.nz[6] = 0, packet.nx[6] = 1;  // along the plane
  const SearchLimits limits{1, 0.5F};
  kernels("").hit(flat_facet(9, 0.5F), packet, limits, best);
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
    CHECK(distance_of(best.key[lane], packet) == Approx(0.5 + outside));
    CHECK(best.id[lane] == 9);
    CHECK(best.page[lane] == 2);
    CHECK(best.base_x[lane] == 3);
    CHECK(best.base_y[lane] == -7);
    CHECK(best.frac_x[lane] == Approx(10 * x / sum));
    CHECK(best.frac_y[lane] == Approx(2.5 / sum));
  }
  CHECK(best.key[12] == key_of(0.5F, packet));  // on the edge
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
    CHECK(best.key[0] == key_of(0.25F, flat_packet()));
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
    const surface::SourceBlock block = test::random_source(random, 4, random.one_in(2) ? 1 : 0.2F);
    TexelPacket packet = test::random_packet(random, 0.5F);
    packet.coarseness = random.one_in(2) ? 0.0F : 4.0F;
    const SearchLimits limits{random.between(0.5F, 2.0F), random.between(0.1F, 0.9F)};
    for (const surface::Facet& facet : block.facets) {
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
        const double distance = double{distance_of(best.key[lane], packet)};
        const double rise = std::abs(facet.n[0] * packet.nx[lane] + facet.n[1] * packet.ny[lane] +
                                     facet.n[2] * packet.nz[lane]);
        const double loss = 1e-6 * (1 + bends) / std::max(rise, double{kGrazing});
        if (std::abs(distance - expected->distance) > 1e-6 + loss ||
            std::abs(x - expected->x) > loss * steep || std::abs(y - expected->y) > loss * steep) {
          FAIL("round " << round << " lane " << lane << ": distance " << distance << " for "
                        << expected->distance << ", x " << x << " for " << expected->x);
        }
      }
    }
  }
  CHECK(hits > 2000);
  CHECK(misses > 50000);
  CHECK(unsure_ones < (hits + misses) / 50);
}

TEST_CASE("a list is culled to what rays of the bundle may meet, in its order") {
  const auto isas = available();
  Random random(53);
  std::size_t kept = 0, dropped = 0;
  for (int round = 0; round < 500; ++round) {
    const surface::Facet facet{};
    grid::PatchSpheres list;
    const std::size_t count = random.below(grid::BatchPatches::kMostListed + 1);
    for (std::size_t i = 0; i < count; ++i) {
      list.add(
          {random.between(-2.0F, 2.0F), random.between(-2.0F, 2.0F), random.between(-2.0F, 2.0F)},
          random.between(0.0F, 0.5F), &facet);
    }
    const std::array bundles{bundle_of(test::random_packet(random, 0.2F)),
                             bundle_of(test::random_packet(random, 0.2F))};
    RayBundle bundle = random.one_in(2) ? unite(bundles) : bundles[0];
    if (random.one_in(20)) bundle.direction = {}, bundle.spread = 1;
    const float height = random.between(0.0F, 2.0F);
    std::vector<std::uint16_t> expected;
    for (std::uint16_t i = 0; i < count; ++i) {
      if (bundle.may_meet({*list.x(i), *list.y(i), *list.z(i)}, *list.radius(i), height))
        expected.push_back(i);
    }
    for (const Kernels* kernels : isas) {
      std::array<std::uint16_t, grid::BatchPatches::kMostListed> places{};
      const std::size_t met = kernels->cull(list, bundle, height, places.data());
      CHECK(std::vector<std::uint16_t>(places.begin(), places.begin() + met) == expected);
    }
    kept += expected.size();
    dropped += count - expected.size();
  }
  CHECK(kept > 5000);
  CHECK(dropped > 5000);
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
    surface::SourceBlock block = test::random_source(random, 5, 1);
    std::vector<TexelPacket> packets;
    for (int i = 0; i < 5; ++i) packets.push_back(test::random_packet(random, 1));
    const bool wild = random.one_in(3);
    if (wild) {
      for (surface::Facet& f : block.facets) {
        float* const parts[] = {f.n, f.m,  f.g1, f.g2,    f.e1,         f.e2,
                                f.s, f.s1, f.s2, f.reach, &f.tolerance, &f.lean};
        *parts[random.below(12)] = any_float();
      }
      for (TexelPacket& p : packets) {
        float* const parts[] = {p.px, p.py, p.pz, p.nx, p.ny, p.nz, p.per_texel};
        for (int i = 0; i < 10; ++i) parts[random.below(7)][random.below(kLanes)] = any_float();
      }
    }
    const SearchLimits limits{random.between(0.1F, 3.0F), random.between(0.0F, 0.9F)};
    for (TexelPacket& packet : packets)
      packet.coarseness = random.one_in(2) ? 0.0F : random.between(0.0F, 9.0F);
    const float height = random.between(0.0F, 2.0F);
    grid::PatchSpheres candidates;
    for (const surface::Patch& patch : block.patches)
      candidates.add(patch.centre, patch.radius, &block.facets[patch.facet]);
    for (const TexelPacket& packet : packets) {
      std::vector<HitPacket> results(isas.size() * 2);
      std::vector<bool> finals(isas.size());
      for (std::size_t k = 0; k < isas.size(); ++k) {
        clear(results[2 * k]);
        clear(results[2 * k + 1]);
        for (const surface::Facet& facet : block.facets)
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
    CHECK(best.key[1] == key_of(0.5F, packet));
  }
}

TEST_CASE("a packet is final when every used lane's key is below the height") {
  for (const Kernels* k : available()) {
    CAPTURE(k->isa);
    TexelPacket packet = flat_packet(4);
    HitPacket best;
    clear(best);
    CHECK_FALSE(k->all_final(packet, best, 1e30F));
    const std::int32_t half = key_of(0.5F, packet);
    for (std::int32_t& key : best.key) key = half - 1;
    CHECK(k->all_final(packet, best, 0.5F));
    CHECK_FALSE(k->all_final(packet, best, 0.4999F));
    best.key[15] = half;  // a facet just beyond could have the same key and a smaller id
    CHECK_FALSE(k->all_final(packet, best, 0.5F));
    best.key[15] = kNoHit;
    CHECK_FALSE(k->all_final(packet, best, 0.5F));
    packet.texel[15] = surface::kNoTexel;
    CHECK(k->all_final(packet, best, 0.5F));
  }
}

TEST_CASE("keys rise with the distance: in steps where it is small, relative where it is large") {
  const TexelPacket packet = flat_packet(4);  // steps of 2^-21 up to 4
  CHECK(key_of(0x1p-21F, packet) == key_of(0, packet) + 1);
  CHECK(key_of(0x1p-23F, packet) == key_of(0, packet));
  CHECK(key_of(3.5F, packet) == key_of(3.5F - 0x1p-21F, packet) + 1);
  CHECK(key_of(1e20F, packet) < key_of(1.000001e20F, packet));
  CHECK(key_of(3e38F, packet) < kNoHit);
  std::int32_t last = 0;
  for (float distance = 0x1p-40F; distance < 0x1p100F; distance *= 1.5F) {
    CHECK(key_of(distance, packet) >= last);
    last = key_of(distance, packet);
    CHECK(double{distance_of(last, packet)} == Approx(double{distance}).margin(0x1p-21));
  }
}

TEST_CASE("the surface's own normal decides what it faces, not its plane's") {
  // At x = 0 the normals lean 45 degrees to the left of the plane's, at x = 1 45 to the right.
  for (const Kernels* k : available()) {
    CAPTURE(k->isa);
    surface::Facet facet = flat_facet(1, 0.5F);
    facet.lean = 4;
    facet.s[0] = -1;
    facet.s1[0] = 2;
    TexelPacket packet = flat_packet(4);
    for (int lane = 0; lane < kLanes; ++lane) {
      packet.px[lane] = 0.25F - 0.5F;  // looks half a unit to the right: hits at 1/4, or...
      packet.nx[lane] = packet.nz[lane] = std::sqrt(0.5F);
      if (lane % 2 != 0) packet.px[lane] = 0.6F - 0.5F;  // ...at 0.6
    }
    HitPacket best;
    clear(best);
    k->hit(facet, packet, {1, std::cos(0.9F)}, best);  // 51.6 degrees
    // At 1/4 the normal leans 26.6 degrees left, 71.6 from the texel's; at 0.6, 33.7.
    CHECK(best.key[0] == kNoHit);
    CHECK(best.key[1] != kNoHit);
    clear(best);
    k->hit(facet, packet, {1, std::cos(1.3F)}, best);  // 74.5 degrees
    CHECK(best.key[0] != kNoHit);
    CHECK(best.id[1] == 1);
  }
}

TEST_CASE("a texel on a facet finds it whatever its normal, also within the plane") {
  for (const Kernels* k : available()) {
    for (const float degrees : {0.0F, 60.0F, 89.0F, 90.0F, 91.0F, 120.0F, 170.0F}) {
      CAPTURE(k->isa, degrees);
      const float angle = degrees * 3.14159265F / 180;
      surface::Facet facet = flat_facet(1, 0);
      facet.lean = 4;
      facet.s[0] = std::sin(angle);
      facet.s[2] = std::cos(angle);
      TexelPacket packet = flat_packet(4);
      for (int lane = 0; lane < kLanes; ++lane) {
        packet.nx[lane] = facet.s[0];
        packet.nz[lane] = facet.s[2];
        packet.pz[lane] = lane % 2 != 0 ? 1e-7F : -1e-7F;  // off by rounding
      }
      HitPacket best;
      clear(best);
      k->hit(facet, packet, {1, 0.99F}, best);
      for (int lane = 0; lane < 12; ++lane) {
        CAPTURE(lane);
        CHECK(distance_of(best.key[lane], packet) <= 2e-5F);
        CHECK(best.frac_x[lane] == Approx(10 * lane / 16.0).margin(1e-4));
      }
    }
  }
}

TEST_CASE("a ray in a facet's plane does not reach for it from beside") {
  surface::Facet facet = flat_facet(1, 0.05F);
  facet.lean = 4;
  facet.s[0] = 1;
  facet.s[2] = 0;
  TexelPacket packet = flat_packet(4);
  for (int lane = 0; lane < kLanes; ++lane) {
    packet.nx[lane] = 1;
    packet.nz[lane] = 0;
  }
  HitPacket best;
  clear(best);
  kernels("").hit(facet, packet, {100, 0.5F}, best);  // 1/20 above: 3.2 along the ray
  for (const std::int32_t key : best.key) CHECK(key == kNoHit);
}

TEST_CASE("the image is read where the texel is, not where its ray starts") {
  for (const Kernels* k : available()) {
    CAPTURE(k->isa);
    TexelPacket packet = flat_packet(0x1p11F);
    HitPacket plain, inset;
    clear(plain);
    k->hit(flat_facet(1, 0.5F), packet, {1, 0.5F}, plain);
    packet.is_inset = true;
    for (int lane = 0; lane < kLanes; ++lane) {
      packet.inset_x[lane] = -32;  // of 2^-12, as far as the start is to the left
      packet.px[lane] -= 0x1p-7F;
    }
    clear(inset);
    k->hit(flat_facet(1, 0.5F), packet, {1, 0.5F}, inset);
    for (int lane = 0; lane <= 12; ++lane) {
      CAPTURE(lane);
      CHECK(inset.frac_x[lane] == plain.frac_x[lane]);
      CHECK(inset.frac_y[lane] == plain.frac_y[lane]);
    }
    CHECK(inset.key[13] < plain.key[13]);  // nearer to the triangle
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
