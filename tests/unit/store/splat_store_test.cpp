// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/splat_store.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "support/bytes.h"
#include "support/memory_file_system.h"
#include "support/random.h"

namespace pounce::store {
namespace {

Splat some_splat(std::mt19937& random, bool normal) {
  const auto uniform = [&](float lo, float hi) {
    return lo + (hi - lo) * static_cast<float>(random() % 65536) / 65536.0F;
  };
  Splat s;
  s.mean = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
  s.sigma = {uniform(0, 1), 0, uniform(1e-9F, 1e-3F)};
  s.rotation = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), 1};
  float sum = 0;
  for (const float c : s.rotation) sum += c * c;
  for (float& c : s.rotation) c /= std::sqrt(sum);
  s.alpha = uniform(0.01F, 1);
  s.colour = {uniform(-1, 2), uniform(0, 1), uniform(0, 1)};
  if (normal) s.normal = {0, -1, 0};
  return s;
}

TEST_CASE("the box of a Gaussian holds its 3-sigma ellipsoid and no more", "[tiles]") {
  Splat s;
  s.mean = {1, 2, 3};
  s.sigma = {0.1F, 0.2F, 0.4F};
  const Box3f straight = splat_box(s);
  CHECK(straight.hi.x == Approx(1.3));
  CHECK(straight.lo.y == Approx(1.4));
  CHECK(straight.hi.z == Approx(4.2));
  // 45 degrees about z: Sigma_xx = (0.01 + 0.04) / 2.
  s.rotation = {std::cos(0.39269908F), 0, 0, std::sin(0.39269908F)};
  const Box3f turned = splat_box(s);
  CHECK(turned.hi.x - 1 == Approx(3 * std::sqrt(0.025)));
  CHECK(turned.hi.y - 2 == Approx(3 * std::sqrt(0.025)));
  CHECK(turned.hi.z - 3 == Approx(1.2));
}

TEST_CASE("what is rounded for the store stays what it is to the eye", "[tiles]") {
  std::mt19937 random(3);
  for (int i = 0; i < 1000; ++i) {
    const Splat from = some_splat(random, true);
    Splat to = from;
    round_for_store(to);
    CHECK(to.mean == from.mean);
    CHECK(to.sigma.x == Approx(from.sigma.x).epsilon(0x1.02p-16));
    CHECK(to.colour.x == Approx(from.colour.x).epsilon(0x1.02p-16));
    CHECK(to.rotation[2] == Approx(from.rotation[2]).epsilon(0x1.02p-16));
    CHECK(to.alpha <= 1);
    Splat again = to;
    round_for_store(again);
    CHECK(again == to);
  }
  Splat whole;
  whole.alpha = 0x1.fffffep-1F;  // the last float below 1
  whole.rotation = {0x1.fffffep-1F, 0, -0.0F, 0};
  round_for_store(whole);
  CHECK(whole.alpha == 1);
  CHECK(whole.rotation == std::array<float, 4>{1, 0, 0, 0});
}

TEST_CASE("what is rounded for the store stays a Gaussian", "[tiles]") {
  // The least floats above 0: rounded to 0 they had neither size nor opacity, and the block that
  // held them was damaged to its reader.
  Splat tiny;
  tiny.mean = {1, 2, 3};
  tiny.sigma = {0x1p-149F, 0, 0};
  tiny.alpha = 0x1p-149F;
  tiny.rotation = {1, 0, 0, 0};
  round_for_store(tiny);
  CHECK(tiny.sigma.x > 0);
  CHECK(tiny.sigma.y == 0);
  CHECK(tiny.alpha > 0);
  Splat again = tiny;
  round_for_store(again);
  CHECK(again == tiny);
  SplatBlock block;
  block.assign(std::span(&tiny, 1));
  std::vector<std::byte> raw;
  encode(block, raw);
  CHECK(decode_splats(raw, "a block").splat(0) == tiny);
}

TEST_CASE("splat blocks come back as they went in", "[tiles]") {
  std::mt19937 random(1);
  const std::size_t count = GENERATE(1U, 2U, 777U, 4096U);
  const bool normals = GENERATE(false, true);
  const std::uint32_t degree = GENERATE(0U, 1U, 3U);
  const std::uint32_t lobes = kLobesOfDegree[degree];
  std::vector<Splat> splats;
  std::vector<std::uint16_t> sh;
  for (std::size_t i = 0; i < count; ++i) {
    splats.push_back(some_splat(random, normals && i % 2 == 0));
    for (std::size_t c = 0; c < std::size_t{3} * lobes; ++c)
      sh.push_back(static_cast<std::uint16_t>(0x8000 | random() % 0x7C00));
  }
  SplatBlock block;
  block.assign(splats, lobes, sh);
  std::vector<std::byte> raw;
  const SplatBytes form = GENERATE(SplatBytes::filtered, SplatBytes::plain);
  encode(block, raw, form);
  const SplatBlock back = decode_splats(raw, "block");
  REQUIRE(back.size() == count);
  CHECK(back.normal[0].empty() == !normals);
  CHECK(back.lobes == lobes);
  REQUIRE(back.sh.size() == sh.size());
  if (lobes > 0) {  // the last Gaussian's first coefficient, its green
    CHECK(back.sh[2 * count - 1] == sh[(count - 1) * 3 * lobes + 1]);
  }
  CHECK(back.sh == block.sh);
  for (std::size_t i = 0; i < count; ++i) {
    if (!(back.splat(i) == splats[i])) FAIL("splat " << i);
  }
  const auto refused = [](std::span<const std::byte> bytes) {
    return test::error_kind([&] { decode_splats(bytes, "block"); }) == test::kDamaged;
  };
  CHECK(refused(std::span(raw).first(raw.size() - 1)));
  CHECK(refused(std::span(raw).first(7)));
  raw.push_back(std::byte{0});
  CHECK(refused(raw));
  raw.pop_back();
  const std::byte flags = raw[4];
  for (const unsigned other : {1U, 2U, 4U, 16U}) {  // what is there says otherwise
    raw[4] = flags ^ static_cast<std::byte>(other);
    CHECK(refused(raw));
  }
  raw[4] = flags;
  if (lobes == 0) return;
  for (const int broken : {0x7C00, 0xFC00, 0x7E00}) {  // infinities, NaN
    block.sh[0] = static_cast<std::uint16_t>(broken);
    encode(block, raw, form);
    CHECK(refused(raw));
  }
}

TEST_CASE("a splat block with one Gaussian that no reader lets through is refused", "[tiles]") {
  constexpr float kInfinity = std::numeric_limits<float>::infinity(), kNan = NAN;
  std::mt19937 random(3);
  std::vector<Splat> sound(50);
  for (Splat& splat : sound) splat = some_splat(random, true);
  const SplatBytes form = GENERATE(SplatBytes::filtered, SplatBytes::plain);
  const std::size_t at = GENERATE(0U, 17U, 49U);  // in whole registers and behind the last
  const auto is_refused = [&](const auto& change) {
    std::vector<Splat> splats = sound;
    change(splats[at]);
    SplatBlock block;
    block.assign(splats);
    std::vector<std::byte> raw;
    encode(block, raw, form);
    return test::error_kind([&] { decode_splats(raw, "block"); }) == test::kDamaged;
  };
  CHECK_FALSE(is_refused([](Splat&) {}));
  CHECK_FALSE(is_refused([](Splat& s) { s.colour = {-1, 2, kInfinity}; }));  // a half can be that
  CHECK_FALSE(is_refused([](Splat& s) { s.sigma = {0, 1, -0.0F}; }));
  CHECK_FALSE(is_refused([](Splat& s) { s.alpha = 1; }));
  CHECK_FALSE(is_refused([](Splat& s) { s.normal = {}; }));
  CHECK(is_refused([&](Splat& s) { s.mean.y = kNan; }));
  CHECK(is_refused([&](Splat& s) { s.mean.z = -kInfinity; }));
  CHECK(is_refused([&](Splat& s) { s.sigma.x = kInfinity; }));
  CHECK(is_refused([&](Splat& s) { s.sigma.z = kNan; }));
  CHECK(is_refused([](Splat& s) { s.sigma.y = -1e-30F; }));
  CHECK(is_refused([](Splat& s) { s.sigma = {}; }));
  CHECK(is_refused([](Splat& s) { s.rotation[0] += 0.01F; }));
  CHECK(is_refused([&](Splat& s) { s.rotation[3] = kNan; }));
  CHECK(is_refused([](Splat& s) { s.alpha = 0; }));
  CHECK(is_refused([](Splat& s) { s.alpha = 1.001F; }));
  CHECK(is_refused([&](Splat& s) { s.alpha = kNan; }));
  CHECK(is_refused([&](Splat& s) { s.colour.z = kNan; }));
  CHECK(is_refused([](Splat& s) { s.normal.x += 0.1F; }));
  CHECK(is_refused([&](Splat& s) { s.normal.z = kNan; }));
}

TEST_CASE("a splat store gives back its tiles, entries and blocks", "[tiles]") {
  const auto files = test::make_memory_file_system();
  constexpr Hash128 kKey{1, 2};
  Compressor compressor;
  std::mt19937 random(2);
  std::vector<SplatBlock> blocks(5);
  SplatStoreWriter writer(
      std::make_unique<PackWriter>(files->create("pack"), PackKind::splats, kKey));
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    std::vector<Splat> splats(100 + b);
    SplatEntry entry;
    for (Splat& s : splats) {
      s = some_splat(random, b == 2);
      entry.box.extend(splat_box(s));
    }
    blocks[b].assign(splats);
    entry.splats = static_cast<std::uint32_t>(splats.size());
    entry.size_class = b == 4 ? 3 : 0;
    std::vector<std::byte> raw, stored;
    encode(blocks[b], raw);
    compressor.compress(raw, stored);
    writer.add_block(entry, stored, static_cast<std::uint32_t>(raw.size()));
    if (b == 1 || b >= 3) writer.end_tile(compressor);
  }
  SplatDirectory directory;
  directory.filtered = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  directory.model = SplatModel::flat;
  directory.is_linear = true;
  directory.has_normals = true;
  directory.surface_noise = 0.25F;
  directory.typical_size = 0.5F;
  directory.middle_box = {{-1, -1, -1}, {1, 1, 1}};
  writer.finish(directory, compressor);

  const SplatStore store(
      std::make_unique<PackReader>(files->open("pack"), "pack", PackKind::splats, kKey),
      SplatFacts{510 + 55, SplatModel::flat, 0, true}, compressor);
  const SplatDirectory& found = store.directory();
  CHECK(found.splats == 510);
  CHECK(found.filtered == SplatCounts{1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
  CHECK(found.is_linear);
  CHECK(found.model == SplatModel::flat);
  CHECK(found.has_normals);
  CHECK(found.surface_noise == 0.25F);
  CHECK(found.typical_size == 0.5F);
  CHECK(found.middle_box == directory.middle_box);
  CHECK(found.most_splats == 104);
  CHECK(found.most_blocks == 2);
  REQUIRE(found.tiles.size() == 3);
  CHECK(found.tiles[2].size_class == 3);
  std::size_t b = 0;
  for (std::uint32_t t = 0; t < 3; ++t) {
    for (const SplatEntry& entry : store.read_index(t, compressor)) {
      const SplatBlock block = store.read_block(entry, compressor);
      REQUIRE(block.size() == blocks[b].size());
      for (std::size_t i = 0; i < block.size(); ++i) {
        if (!(block.splat(i) == blocks[b].splat(i))) FAIL("splat " << i << " of block " << b);
        const Box3f box = splat_box(block.splat(i));
        CHECK((box.lo.x >= entry.box.lo.x && box.hi.z <= entry.box.hi.z));
      }
      ++b;
    }
  }
  CHECK(b == 5);
}

}  // namespace
}  // namespace pounce::store
