// SPDX-License-Identifier: Apache-2.0
#include "surface/strewn_places.h"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace pounce;
using namespace pounce::surface;

namespace {

/// Right triangles of so much area each, the i-th at z = i, all normals up.
mesh::Mesh stack(const std::vector<float>& areas) {
  mesh::Mesh mesh;
  for (std::size_t i = 0; i < areas.size(); ++i) {
    const auto z = static_cast<float>(i);
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const Vec3f& corner : {Vec3f{0, 0, z}, Vec3f{2, 0, z}, Vec3f{0, areas[i], z}}) {
      mesh.positions.push_back(corner);
      mesh.normals.push_back({0, 0, 1});
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

std::size_t places_at(const std::vector<Place>& places, float z) {
  return static_cast<std::size_t>(std::count_if(
      places.begin(), places.end(), [&](const Place& place) { return place.position.z == z; }));
}

}  // namespace

TEST_CASE("places share a target's area evenly", "[target]") {
  const mesh::Mesh mesh = stack({1, 0, 4, 2});
  const std::vector<Place> places = strew(mesh);
  REQUIRE(places.size() == 448);
  CHECK(places_at(places, 0) == 64);
  CHECK(places_at(places, 1) == 0);
  CHECK(places_at(places, 2) == 256);
  CHECK(places_at(places, 3) == 128);
  // In the triangle of area 4 (legs 2 and 4) a quarter of the places have x > 1, by similarity,
  // and a quarter y > 2.
  std::size_t right = 0, high = 0;
  for (const Place& place : places) {
    const auto [p, n] = place;
    CHECK(n == Vec3f{0, 0, 1});
    if (p.z != 2) continue;
    CHECK((p.x >= 0 && p.y >= 0 && p.x / 2 + p.y / 4 <= 1.000001F));
    right += p.x > 1 ? 1 : 0;
    high += p.y > 2 ? 1 : 0;
  }
  CHECK(right == Approx(64).margin(4));
  CHECK(high == Approx(64).margin(4));
}

TEST_CASE("places look to the side that the vertices' normals show", "[target]") {
  mesh::Mesh mesh = stack({1});
  for (Vec3f& normal : mesh.normals) normal = {0.6F, 0, -0.8F};
  for (const Place& place : strew(mesh)) CHECK(place.normal == Vec3f{0, 0, -1});
}

TEST_CASE("a target without area has no places", "[target]") {
  CHECK(strew(stack({})).empty());
  CHECK(strew(stack({0, 0})).empty());
}

TEST_CASE("each place has a packet, a group and a block of its own", "[target]") {
  const std::vector<Place> places = {{{1, 2, 3}, {0, 1, 0}}, {{4, 5, 6}, {1, 0, 0}}};
  PageVector<TexelPacket> packets;
  std::vector<PacketGroup> groups;
  make_packets(places, 0.25F, packets, groups);
  REQUIRE(packets.size() == 2);
  REQUIRE(groups.size() == 2);
  CHECK((groups[1].first == 1 && groups[1].count == 1));
  const TexelPacket& packet = packets[1];
  CHECK(packet.block == 1);
  CHECK((packet.px[0] == 4 && packet.py[0] == 5 && packet.pz[0] == 6 && packet.nx[0] == 1));
  CHECK(packet.per_texel[0] == 4);
  CHECK(packet.texel[0] == 0);
  for (int lane = 1; lane < kLanes; ++lane) {
    CHECK(packet.texel[lane] == kNoTexel);
    CHECK((packet.nx[lane] == 0 && packet.px[lane] == 4));
  }
}
