// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/geometry_block.h"

#include <catch2/catch.hpp>
#include <cstring>
#include <limits>

#include "support/bytes.h"
#include "unit/store/random_block.h"

using namespace pounce;
using namespace pounce::store;
using pounce::test::Random;
using pounce::test::random_block;

namespace {

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

bool same(const GeometryBlock& a, const GeometryBlock& b) {  // NaN equals itself
  return a.page == b.page && a.x == b.x && a.y == b.y && same_bytes(a.positions, b.positions) &&
         same_bytes(a.normals, b.normals) && same_bytes(a.uvs, b.uvs) &&
         same_bytes(a.tangents, b.tangents) && same_bytes(a.colours, b.colours) &&
         same_bytes(a.triangles, b.triangles) && same_bytes(a.ids, b.ids) &&
         same_bytes(a.shifts, b.shifts) && same_bytes(a.owner, b.owner);
}

/// What every reader of a block relies on.
bool is_valid(const GeometryBlock& b) {
  const std::size_t vertices = b.positions.size();
  bool valid = b.normals.size() == vertices && b.uvs.size() == vertices &&
               b.tangents.size() == vertices && b.ids.size() == b.triangles.size() &&
               b.triangles.size() <= kMostTrianglesPerBlock &&
               (b.colours.empty() || b.colours.size() == vertices) &&
               (b.shifts.empty() || b.shifts.size() == b.triangles.size()) &&
               (b.owner.empty() || b.owner.size() == kTexelsPerBlock);
  for (const auto& t : b.triangles) {
    for (const std::uint16_t v : t) valid = valid && v < vertices;
  }
  for (const std::uint16_t o : b.owner)
    valid = valid && (o == kNoTriangle || o < b.triangles.size());
  return valid;
}

/// Decodes to a valid block or throws Error(damaged_store); returns whether it threw.
bool refused(std::span<const std::byte> raw) {
  // A copy of exactly this size, so that AddressSanitizer sees a read past the end.
  const std::vector<std::byte> copy(raw.begin(), raw.end());
  try {
    const GeometryBlock block = decode_geometry(copy, "head.pack: block");
    if (!is_valid(block)) FAIL("an invalid block came through");
    return false;
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::damaged_store) FAIL("another kind of error: " << e.what());
    if (std::string(e.what()).find("head.pack: block") != 0) FAIL(e.what());
    return true;
  }
}

}  // namespace

TEST_CASE("a decoded block is the encoded one, with or without shifts and owners") {
  Random random(1);
  std::vector<std::byte> raw{std::byte{1}};
  for (int round = 0; round < 200; ++round) {
    const GeometryBlock block =
        random_block(random, random.one_in(2), random.one_in(2), random.one_in(2));
    encode(block, raw);
    if (!same(decode_geometry(raw, "x"), block)) FAIL("round " << round);
  }
}

TEST_CASE("shifts that are all zero are not stored") {
  Random random(2);
  GeometryBlock block = random_block(random, false, false, false);
  std::vector<std::byte> without, with;
  encode(block, without);
  block.shifts.assign(block.triangles.size(), {0, 0});
  encode(block, with);
  CHECK(with == without);
}

TEST_CASE("the largest block comes back") {
  GeometryBlock block;
  for (std::uint32_t i = 0; i < 3 * kMostTrianglesPerBlock; ++i) {
    block.positions.push_back({static_cast<float>(i), 0, 0});
    block.normals.push_back({});
    block.uvs.push_back({});
    block.tangents.push_back({});
  }
  for (std::uint32_t i = 0; i < kMostTrianglesPerBlock; ++i) {
    const auto v = static_cast<std::uint16_t>(3 * i);
    block.triangles.push_back(
        {v, static_cast<std::uint16_t>(v + 1), static_cast<std::uint16_t>(v + 2)});
    block.ids.push_back(i);
    block.owner.push_back(static_cast<std::uint16_t>(i));  // 4096 runs of one texel
  }
  std::vector<std::byte> raw;
  encode(block, raw);
  CHECK(same(decode_geometry(raw, "x"), block));
}

TEST_CASE("every truncation of a block is refused, and so is a byte too many") {
  Random random(3);
  for (const bool shifts : {false, true}) {
    for (const bool owner : {false, true}) {
      std::vector<std::byte> raw;
      encode(random_block(random, shifts, owner, false), raw);
      for (std::size_t size = 0; size < raw.size(); ++size) {
        if (!refused(std::span(raw).first(size))) FAIL("cut to " << size << " of " << raw.size());
      }
      raw.push_back(std::byte{0});
      CHECK(refused(raw));
    }
  }
}

TEST_CASE("corrupted blocks are refused or still valid, never a crash") {
  Random random(4);
  int refusals = 0, valid = 0;
  for (int round = 0; round < 3000; ++round) {
    std::vector<std::byte> raw;
    encode(random_block(random, random.one_in(2), random.one_in(2), false), raw);
    const std::uint64_t flips = 1 + random.below(4);
    for (std::uint64_t i = 0; i < flips; ++i) {
      const std::uint64_t at = random.one_in(2) ? random.below(24) : random.below(raw.size());
      raw[at] = static_cast<std::byte>(random.bits());
    }
    refused(raw) ? ++refusals : ++valid;
  }
  CHECK(refusals > 500);
  CHECK(valid > 500);
  for (int round = 0; round < 2000; ++round) {  // nothing but noise
    std::vector<std::byte> raw(random.below(300));
    for (std::byte& b : raw) b = static_cast<std::byte>(random.bits());
    CHECK(refused(raw));
  }
}

TEST_CASE("a header of huge counts is refused before anything is allocated") {
  std::vector<std::byte> raw(24, std::byte{0});
  for (const std::size_t at : {std::size_t{16}, std::size_t{20}}) {
    auto copy = raw;
    for (std::size_t i = 0; i < 4; ++i) copy[at + i] = std::byte{0xFF};
    CHECK(refused(copy));
  }
  raw[20] = std::byte{1};  // one triangle, but no vertices: it cannot name any
  raw.resize(24 + 6 + 4, std::byte{0});
  CHECK(refused(raw));
}

TEST_CASE("a builder shares vertices and keeps the order of triangles") {
  mesh::Mesh mesh;
  for (int i = 0; i < 5; ++i) {
    mesh.positions.push_back({static_cast<float>(i), 0, 0});
    mesh.normals.push_back({0, 0, 1});
  }
  mesh.tangents.assign(5, {1, 0, -0.5F, -1});
  mesh.uv_sets = {{}, {{0, 0}, {1, 0}, {0, 1}, {1, 1}, {2, 2}}};
  mesh.triangles = {{0, 1, 2}, {2, 1, 3}, {4, 3, 2}};
  GeometryBlockBuilder builder(mesh);
  builder.start(2, -3, 4, 3);
  CHECK(builder.add({2, 0, 0}, 1, true) == 0);
  CHECK(builder.add({1, -1, 2}, 1, true) == 1);
  const GeometryBlock& block = builder.block();
  CHECK(block.page == 2);
  CHECK(block.x == -3);
  CHECK(block.y == 4);
  CHECK(block.triangles == std::vector<std::array<std::uint16_t, 3>>{{0, 1, 2}, {2, 3, 1}});
  CHECK(block.ids == std::vector<std::uint32_t>{2, 1});
  CHECK(block.positions == std::vector<Vec3f>{{4, 0, 0}, {3, 0, 0}, {2, 0, 0}, {1, 0, 0}});
  CHECK(block.uvs == std::vector<Vec2f>{{2, 2}, {1, 1}, {0, 1}, {1, 0}});
  CHECK(block.tangents[0] == std::array<std::int16_t, 4>{32767, 0, -16384, -32767});
  // 8 x 4 texels, shifted by (-1, 2) periods: vertex 2 is at uv (0, 1).
  const auto corners = block.texel_corners({8, 4, 1, {}}, 1);
  CHECK(corners[0] == Vec2d{0 * 8 - 0.5 + 8, 1 * 4 - 0.5 - 8});
  builder.start(0, 0, 0, 1);
  CHECK(builder.add({0, 0, 0}, 1, false) == 0);
  CHECK(builder.block().triangles[0] == std::array<std::uint16_t, 3>{0, 1, 2});
  CHECK(builder.block().uvs == std::vector<Vec2f>(3));
}
