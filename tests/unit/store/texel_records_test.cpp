// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <limits>

#include "pounce/error.h"
#include "store/blocks/geometry_block.h"
#include "store/pack/codec.h"
#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::store;
using pounce::test::Random;

namespace {

/// Records of any values on texels in runs, alone and in whole rows.
GeometryBlock random_records(Random& random) {
  GeometryBlock block;
  block.page = static_cast<std::uint32_t>(random.below(4));
  block.x = static_cast<std::int32_t>(random.below(1000));
  block.step = std::ldexp(1.0F, static_cast<int>(random.whole(-126, 100)));
  const std::uint64_t longest = 1 + random.below(random.one_in(2) ? 5 : 500);
  while (block.owner.size() < kTexelsPerBlock) {
    const bool covered = random.one_in(2) || (block.records.empty() && block.owner.size() > 4000);
    const std::size_t room = kTexelsPerBlock - block.owner.size();
    for (std::uint64_t n = std::min<std::uint64_t>(room, 1 + random.below(longest)); n > 0; --n) {
      block.owner.push_back(covered ? static_cast<std::uint16_t>(block.records.size())
                                    : kNoTriangle);
      if (!covered) continue;
      TexelRecord& record = block.records.emplace_back();
      for (auto& p : record.position)
        p = static_cast<std::int32_t>(random.whole(-kLargestPosition, kLargestPosition));
      for (auto& n2 : record.normal) n2 = static_cast<std::int16_t>(random.bits());
      record.edge = static_cast<std::uint16_t>(1 + random.below(0x7F7F));
      for (auto& i : record.inset) i = static_cast<std::int8_t>(random.bits());
    }
  }
  return block;
}

bool refused(std::span<const std::byte> raw) {
  // A copy of exactly this size, so that AddressSanitizer sees a read past the end.
  const std::vector<std::byte> copy(raw.begin(), raw.end());
  try {
    const GeometryBlock block = decode_geometry(copy, "head.pack: block");
    std::uint16_t next = 0;
    bool valid = block.owner.empty() || block.owner.size() == kTexelsPerBlock;
    if (!block.records.empty()) {
      for (const std::uint16_t o : block.owner) valid = valid && (o == kNoTriangle || o == next++);
      valid = valid && next == block.records.size() && block.triangles.empty();
      for (const TexelRecord& r : block.records) {
        for (const std::int32_t p : r.position)
          valid = valid && std::abs(std::int64_t{p}) <= kLargestPosition;
        valid = valid && r.edge > 0 && r.edge < 0x7F80;
      }
    }
    if (!valid) FAIL("an invalid block came through");
    return false;
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::damaged_store) FAIL("another kind of error: " << e.what());
    return true;
  }
}

}  // namespace

TEST_CASE("records come back as they were, whatever is covered") {
  Random random(61);
  std::vector<std::byte> raw;
  for (int round = 0; round < 100; ++round) {
    const GeometryBlock block = random_records(random);
    encode(block, raw);
    const GeometryBlock back = decode_geometry(raw, "x");
    CHECK(back.page == block.page);
    CHECK(back.x == block.x);
    CHECK(back.step == block.step);
    CHECK(back.owner == block.owner);
    CHECK(back.records == block.records);
    CHECK(back.triangles.empty());
    CHECK(raw.size() <= 32 + 2 * (kTexelsPerBlock + 1) + kRecordBytes * block.records.size());
  }
}

TEST_CASE("records of a plane are next to nothing when they are compressed") {
  GeometryBlock block;
  block.step = 0.5F;
  for (std::int32_t t = 0; t < static_cast<std::int32_t>(kTexelsPerBlock); ++t) {
    block.owner.push_back(static_cast<std::uint16_t>(t));
    const std::int32_t x = t % 64, y = t / 64;
    block.records.push_back({{3000 * x, 2000 * y - x, -700 * x}, {123, -456}, 0x3F80, {}});
  }
  std::vector<std::byte> raw, stored;
  encode(block, raw);
  Compressor().compress(raw, stored);
  CHECK(stored.size() < kTexelsPerBlock / 4);
}

TEST_CASE("every truncation of records is refused, and so is a byte too many") {
  Random random(62);
  std::vector<std::byte> raw;
  encode(random_records(random), raw);
  for (std::size_t size = 0; size < raw.size(); size += 1 + size / 200) {
    if (!refused(std::span(raw).first(size))) FAIL("cut to " << size << " of " << raw.size());
  }
  CHECK(refused(std::span(raw).first(raw.size() - 1)));
  raw.push_back(std::byte{0});
  CHECK(refused(raw));
}

TEST_CASE("corrupted records are refused or still valid, never a crash") {
  Random random(63);
  int refusals = 0, valid = 0;
  for (int round = 0; round < 1000; ++round) {
    std::vector<std::byte> raw;
    encode(random_records(random), raw);
    for (std::uint64_t i = 1 + random.below(4); i > 0; --i) {
      const std::uint64_t at = random.one_in(2) ? random.below(40) : random.below(raw.size());
      raw[at] = static_cast<std::byte>(random.bits());
    }
    refused(raw) ? ++refusals : ++valid;
  }
  CHECK(refusals > 200);
  CHECK(valid > 50);
}

TEST_CASE("steps, edges, positions and flags that cannot be are refused") {
  Random random(64);
  const GeometryBlock sound = random_records(random);
  std::vector<std::byte> raw;
  encode(sound, raw);
  CHECK_FALSE(refused(raw));
  for (const float step :
       {0.0F, -1.0F, 0.75F, 0x1p-127F, 0x1p101F, std::numeric_limits<float>::infinity(),
        std::numeric_limits<float>::quiet_NaN()}) {
    GeometryBlock block = sound;
    block.step = step;
    encode(block, raw);
    CHECK(refused(raw));
  }
  const auto with = [&](auto change) {
    GeometryBlock block = sound;
    change(block.records.back());
    encode(block, raw);
    return refused(raw);
  };
  CHECK(with([](TexelRecord& r) { r.edge = 0; }));
  CHECK(with([](TexelRecord& r) { r.edge = 0x7F80; }));
  CHECK(with([](TexelRecord& r) { r.edge = 0x8001; }));
  CHECK(with([](TexelRecord& r) { r.position[2] = kLargestPosition + 1; }));
  CHECK(with([](TexelRecord& r) { r.position[0] = INT32_MIN; }));
  encode(sound, raw);
  for (const unsigned flags : {5U, 6U, 7U, 8U}) {  // records beside runs or periods
    raw[12] = static_cast<std::byte>(flags);
    CHECK(refused(raw));
  }
  raw[12] = std::byte{4};
  raw[16] = std::byte{1};  // and beside a vertex
  CHECK(refused(raw));
}

TEST_CASE("estimated sizes are those of the entropy, within a byte in a thousand") {
  Random random(65);
  std::vector<std::byte> raw(10000);
  CHECK(estimated_bytes({}) == 0);
  CHECK(estimated_bytes(raw) == 0);  // one value
  for (std::size_t i = 0; i < raw.size(); ++i) raw[i] = std::byte(i % 2);
  CHECK(estimated_bytes(raw) == 1250);
  for (std::size_t i = 0; i < raw.size(); ++i) raw[i] = std::byte(i % 256);
  CHECK(estimated_bytes(std::span(raw).first(8192)) == 8192);
  for (std::byte& b : raw) b = random.one_in(8) ? std::byte{1} : std::byte{0};
  CHECK(estimated_bytes(raw) == Approx(10000 * 0.5436 / 8).epsilon(0.05));
}
