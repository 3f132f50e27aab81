// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "projection/splat_blend.h"
#include "unit/projection/splat_runs.h"

using namespace pounce;
using namespace pounce::projection;
using namespace pounce::test;

namespace {

constexpr double kTilt = 35 * std::numbers::pi / 180;

/// v turned about the axis (a unit vector) by an angle: Rodrigues' formula.
Vec3d turned(Vec3d v, Vec3d axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1 - c));
}

/// Ray k of `count` around n, by turning: x and y go with z as it turns into n (or -n) the short
/// way; n tilts towards where x has gone, and that goes round n.
Vec3d cone_ray(Vec3d n, int k, int count) {
  const double sign = n.z < 0 ? -1 : 1;
  const Vec3d to = n * sign, across = cross({0, 0, 1}, to);
  const double sine = length(across);
  const Vec3d x{1, 0, 0};
  const Vec3d u = sine > 0 ? turned(x, across * (1 / sine), std::atan2(sine, to.z)) : x;
  const Vec3d tilted_once = turned(n, cross(n, u), kTilt);
  return turned(tilted_once, n, 2 * std::numbers::pi * k / count);
}

Vec3d normal_of(const TexelPacket& packet, int lane) {
  return {packet.nx[lane], packet.ny[lane], packet.nz[lane]};
}

TexelPacket packet_looking(Vec3d n) {
  TexelPacket packet = wavy_packet(0, 0, 1e-4F, 0, 15);
  for (int lane = 0; lane < 15; ++lane) {
    packet.px[lane] = packet.py[lane] = packet.pz[lane] = 0;
    packet.nx[lane] = static_cast<float>(n.x);
    packet.ny[lane] = static_cast<float>(n.y);
    packet.nz[lane] = static_cast<float>(n.z);
  }
  return packet;
}

/// What `rays` rays beside the normal, which points up, find from the origin.
SplatFinding look(const std::vector<ReferenceSplat>& scene, int rays) {
  SplatLimits limits{0.4F, 0.17F, 0.01F, 0, false};
  limits.rays = rays;
  SplatState state;
  state.packets.push_back(packet_looking({0, 0, 1}));
  state.groups.push_back({0, 1});
  run_whole(make_sets(scene, 10), limits, splat_kernels(""), state);
  const auto found = findings(limits, state, 0)[3];
  REQUIRE(found);
  return *found;
}

/// A stack of small discs, a tenth below the origin.
void add_stack(std::vector<ReferenceSplat>& scene, double x, double y, Vec3d colour) {
  ReferenceSplat splat;
  splat.mean = {x, y, -0.1};
  splat.sigma = {0.01, 0.01, 0.0001};
  splat.alpha = 0.9;
  splat.colour = colour;
  scene.insert(scene.end(), 10, splat);
}

}  // namespace

TEST_CASE("further rays lie evenly in a cone around the normal", "[projection]") {
  const int count = GENERATE(1, 3, 4, 16);
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    Vec3d n{random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0)};
    if (i < 2) n = {0, 0, i == 0 ? 1.0 : -1.0};
    n = n * (1 / length(n));
    const TexelPacket packet = packet_looking(n);
    for (int k = 0; k < count; ++k) {
      const TexelPacket ray = tilted(packet, k, count);
      CHECK(length(normal_of(ray, 14) - cone_ray(normal_of(packet, 14), k, count)) < 3e-7);
      CHECK(length(normal_of(ray, 15)) == 0);  // no texel
      CHECK(ray.px[3] == packet.px[3]);
    }
  }
}

TEST_CASE("rays see one colour where there is one", "[projection]") {
  ReferenceSplat splat;
  splat.sigma = {0.5, 0.5, 0.001};
  splat.alpha = 0.9;
  splat.colour = {0.2, 0.4, 0.6};
  const std::vector<ReferenceSplat> plane(8, splat);
  const SplatFinding alone = look(plane, 0), found = look(plane, 5);
  CHECK(found.colour[0] == Approx(0.2).margin(1e-6));
  CHECK(found.colour[2] == Approx(0.6).margin(1e-6));
  CHECK(found.opacity == alone.opacity);
  CHECK(found.distance == alone.distance);
}

TEST_CASE("a texel shows what its rays find, by cosine", "[projection]") {
  // Four rays meet a plane a tenth below the texel 0.1 tan 35 degrees beside it: at +x they come
  // from where they looked at last, -x.
  const double beside = 0.1 * std::tan(kTilt), cosine = std::cos(kTilt);
  const Vec3d red{1, 0, 0}, green{0, 1, 0};
  std::vector<ReferenceSplat> scene;
  add_stack(scene, 0, 0, red);
  add_stack(scene, -beside, 0, green);
  add_stack(scene, beside, 0, red);
  add_stack(scene, 0, -beside, red);
  const SplatFinding three = look(scene, 4);  // the fourth finds nothing and does not count
  CHECK(three.colour[1] == Approx(cosine / (1 + 3 * cosine)).margin(1e-4));
  CHECK(three.colour[0] == Approx((1 + 2 * cosine) / (1 + 3 * cosine)).margin(1e-4));
  add_stack(scene, 0, beside, green);
  const SplatFinding four = look(scene, 4);
  CHECK(four.colour[1] == Approx(2 * cosine / (1 + 4 * cosine)).margin(1e-4));
  CHECK(four.distance == Approx(-0.1).margin(1e-5));
  CHECK(look(scene, 0).colour[1] == 0);
}

TEST_CASE("rays do not cover what the normal does not find", "[projection]") {
  std::vector<ReferenceSplat> scene;
  for (const double x : {-1.0, 1.0}) add_stack(scene, x * 0.1 * std::tan(kTilt), 0, {1, 0, 0});
  SplatLimits limits{0.4F, 0.17F, 0.01F, 0, false};
  limits.rays = 2;
  SplatState state;
  state.packets.push_back(packet_looking({0, 0, 1}));
  state.groups.push_back({0, 1});
  run_whole(make_sets(scene, 10), limits, splat_kernels(""), state);
  CHECK(state.depths[1].weight[0] > 0);
  CHECK_FALSE(findings(limits, state, 0)[0]);
}

TEST_CASE("blends of several rays are those of the reference", "[projection]") {
  const std::uint32_t seed = GENERATE(range(1U, 5U));
  Random random(seed);
  const auto scene = random_splats(random, 1500, seed % 2 == 0);
  SplatLimits limits{0.4131F, 0.17F, 0.02F, seed < 3 ? 1.0F : 0.0F, seed == 4};
  limits.rays = static_cast<int>(seed) + 1;
  const ReferenceLimits expected{limits.reach, limits.min_cosine, limits.window, limits.discness,
                                 limits.antialiased};
  SplatState state = piece_of_packets(random, 30);
  run_whole(make_sets(scene, 700), limits, splat_kernels(""), state);
  std::size_t compared = 0, unsure = 0, wrong = 0;
  double largest = 0;
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (state.packets[p].texel[lane] == surface::kNoTexel) continue;
      const ReferenceTexel texel = texel_of(state.packets[p], lane);
      const ReferenceBlend own = reference_blend(scene, texel, expected);
      bool is_unsure = own.unsure;
      double weights = own.opacity;
      Vec3d colour = own.colour * own.opacity;
      for (int k = 0; k < limits.rays; ++k) {
        ReferenceTexel along = texel;
        along.normal = cone_ray(texel.normal, k, limits.rays);
        const ReferenceBlend seen = reference_blend(scene, along, expected);
        is_unsure = is_unsure || seen.unsure;
        if (!seen.covered) continue;
        colour = colour + seen.colour * (seen.opacity * std::cos(kTilt));
        weights += seen.opacity * std::cos(kTilt);
      }
      const auto found = findings(limits, state, p)[static_cast<std::size_t>(lane)];
      if (is_unsure) {
        ++unsure;
        continue;
      }
      ++compared;
      if (found.has_value() != own.covered) ++wrong;
      if (!found || !own.covered) continue;
      colour = colour * (1 / weights);
      largest = std::max(
          {largest, std::abs(found->colour[0] - colour.x), std::abs(found->colour[1] - colour.y),
           std::abs(found->colour[2] - colour.z), std::abs(found->opacity - own.opacity)});
    }
  }
  CAPTURE(seed, compared, unsure, wrong, largest);
  CHECK(compared > 200);
  CHECK(unsure * 2 < compared);
  CHECK(wrong == 0);
  CHECK(largest < 0.3 / 255);
}

TEST_CASE("batches, blocks and kernels do not change what rays find", "[projection]") {
  Random random(98);
  const auto scene = random_splats(random, 2000, false);
  SplatLimits limits{0.4F, 0.17F, 0.002F, 0, false};
  limits.rays = 3;
  const SplatState piece = piece_of_packets(random, 30);
  SplatState first = piece;
  run_whole(make_sets(scene, 4096), limits, splat_kernels(""), first);
  REQUIRE(first.depths.size() == 4 * piece.packets.size());
  for (const SplatKernels* kernels : available_splat_kernels()) {
    SplatState state = piece;
    run_whole(make_sets(scene, 33), limits, *kernels, state);
    CHECK(same_sums(first, state));
    state = piece;
    run_batches(make_sets(scene, 250), limits, *kernels, state);
    CHECK(same_sums(first, state));
  }
}

TEST_CASE("what rays may meet is within the boxes that are asked for", "[projection]") {
  // A stack at the end of a tilted ray, where no normal of the packet comes near.
  SplatLimits limits{0.4F, 0.17F, 0.01F, 0, false};
  limits.rays = 4;
  SplatState state;
  state.packets.push_back(packet_looking({0, 0, 1}));
  state.groups.push_back({0, 1});
  start(limits, state);
  const Box3f box = reachable_boxes(limits, state, 1)[0];
  const float across = 0.39F * std::sin(35 * 3.14159F / 180),
              up = 0.39F * std::cos(35 * 3.14159F / 180);
  for (const float s : {-1.0F, 1.0F}) {
    CHECK(box.overlaps({{s * across, 0, up}, {s * across, 0, up}}));
    CHECK(box.overlaps({{0, s * across, -up}, {0, s * across, -up}}));
  }
}

TEST_CASE("a piece's bytes are counted with its rays", "[projection]") {
  const std::uint64_t per_ray = sizeof(RayBundle) + sizeof(DepthPacket);
  const std::uint64_t alone = SplatState::most_bytes(1000, 0);
  CHECK(alone >= 1000 * (sizeof(TexelPacket) + per_ray));
  CHECK(SplatState::most_bytes(1000, 3) - alone >= 3000 * per_ray - 3 * kPageBytes);
  CHECK(SplatState::most_bytes(1000, 3) - alone <= 3000 * per_ray + 3 * kPageBytes);
  CHECK(SplatState::profile_bytes(1000, 3) >= 4000 * sizeof(ProfilePacket));
}

TEST_CASE("a blend ends where it is told to", "[projection]") {
  Random random(4);
  const auto sets = make_sets(random_splats(random, 200, false), 100);
  SplatLimits limits{0.4F, 0.17F, 0.02F, 0, false};
  limits.rays = 2;
  SplatState state = piece_of_packets(random, 10);
  start(limits, state);
  int calls = 0;
  const GoOn third = [&] {
    if (++calls == 3) throw std::runtime_error("stop");
  };
  const auto runs = [&](const auto& pass) {
    calls = 0;
    CHECK_THROWS_AS(pass(third), std::runtime_error);
    CHECK(calls == 3);
    calls = 3;
    pass(third);
    CHECK(calls == 3 + 10 * 3);
  };
  const SplatKernels& kernels = splat_kernels("");
  const auto all = pointers(sets);
  runs([&](const GoOn& go_on) { profile_batch(all, limits, kernels, state, go_on); });
  runs([&](const GoOn& go_on) { sum_batch(all, limits, kernels, state, go_on); });
  runs([&](const GoOn& go_on) { blend_whole(all, limits, kernels, state, go_on); });
}
