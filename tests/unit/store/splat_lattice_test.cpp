// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "store/blocks/splat_store.h"
#include "support/random.h"

namespace pounce::store {
namespace {

Splat at(float x, float y, float z, float size = 0.01F) {
  Splat s;
  s.mean = {x, y, z};
  s.sigma = {size / 2, size, 0};
  return s;
}

/// The inner 80 % of it is 1.6 wide in x: cells are 2^-19, since 1 is the power of two above 0.8.
std::vector<Splat> line() {
  std::vector<Splat> splats;
  for (int i = -100; i <= 100; ++i) splats.push_back(at(static_cast<float>(i) / 100, 0, 0));
  return splats;
}

/// Bit by bit.
std::uint64_t interleave(std::uint64_t x, std::uint64_t y, std::uint64_t z) {
  std::uint64_t code = 0;
  for (int bit = 20; bit >= 0; --bit)
    code = code << 3 | (x >> bit & 1) << 2 | (y >> bit & 1) << 1 | (z >> bit & 1);
  return code;
}

TEST_CASE("keys are Morton codes of equal cells in the middle of a scene", "[tiles]") {
  const SplatLattice lattice(line());
  CHECK(lattice.cell() == 0x1p-19);
  CHECK(lattice.middle_box().hi.x == 0.8F);
  const std::uint64_t middle = 1 << 20;
  const auto cell = [&](float v) {
    return v >= 0 ? middle + static_cast<std::uint64_t>(v * 0x1p19F)
                  : middle - 1 - static_cast<std::uint64_t>(-v * 0x1p19F);
  };
  test::Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const float x = random.between(-0.9F, 0.9F), y = random.between(-0.9F, 0.9F),
                z = random.between(-0.9F, 0.9F);
    if (lattice.key(at(x, y, z)) != interleave(cell(x), cell(y), cell(z))) FAIL("Gaussian " << i);
  }
}

TEST_CASE("the order of an axis holds from the middle to the farthest Gaussian", "[tiles]") {
  const SplatLattice lattice(line());
  std::vector<float> places;
  for (float v = 1e-6F; v < 65535; v *= 1.01F) places.insert(places.end(), {v, -v});
  places.push_back(0);
  std::sort(places.begin(), places.end());
  for (std::size_t i = 1; i < places.size(); ++i) {
    CAPTURE(places[i]);
    CHECK(lattice.key(at(places[i - 1], 0, 0)) <= lattice.key(at(places[i], 0, 0)));
    CHECK(lattice.key(at(0, 0, places[i - 1])) <= lattice.key(at(0, 0, places[i])));
  }
  // Beyond the equal cells there are 2^15 per doubling: a step of 1/16384 is seen.
  CHECK(lattice.key(at(1000, 0, 0)) < lattice.key(at(1000.1F, 0, 0)));
}

TEST_CASE("what lies beyond 65536 half widths is far, what is as large exploded", "[tiles]") {
  const SplatLattice lattice(line());
  CHECK_FALSE(lattice.filter(at(65535, 0, -65535)));
  CHECK(lattice.filter(at(0, 65536, 0)) == SplatFilter::far);
  CHECK(lattice.filter(at(0, 0, -1e7F)) == SplatFilter::far);
  CHECK(lattice.filter(at(0, 0, 0, 65536)) == SplatFilter::exploded);
  CHECK_FALSE(lattice.filter(at(0, 0, 0, 65535)));
}

TEST_CASE("strays in the sample do not move the lattice", "[tiles]") {
  auto splats = line();
  for (int i = 0; i < 15; ++i) splats.push_back(at(1e7F, -1e7F, 1e7F, 1e6F));
  const SplatLattice lattice(splats);
  CHECK(lattice.cell() == 0x1p-19);
  CHECK(lattice.filter(splats.back()) == SplatFilter::far);
}

TEST_CASE("scenes without extent have an order as well", "[tiles]") {
  const std::vector<Splat> one{at(5, 6, 7)}, none, heap(100, at(1, 1, 1)),
      two{at(1, 1, 1), at(1e6F, 1, 1)};
  for (const auto& splats : {one, heap, two}) {
    const SplatLattice lattice(splats);
    for (const Splat& s : splats) {
      CHECK_FALSE(lattice.filter(s));
      CHECK(SplatLattice::key_size_class(lattice.key(s)) == 0);
    }
  }
  CHECK(SplatLattice(none).cell() == 1);
}

TEST_CASE("size classes begin above the median and go by factors of 4", "[tiles]") {
  const SplatLattice lattice(line());  // median size 0.01: up to 2 * 2^-6 = 1/32
  CHECK(lattice.size_class(0.001F) == 0);
  CHECK(lattice.size_class(0x1p-5F) == 0);
  CHECK(lattice.size_class(0x1.1p-5F) == 1);
  CHECK(lattice.size_class(0x1.fp-4F) == 1);
  CHECK(lattice.size_class(0x1p-3F) == 2);
  CHECK(lattice.size_class(65535) == 11);
  for (const float size : {0.01F, 0.1F, 1.0F, 100.0F}) {
    const auto key = lattice.key(at(0.5F, 0.5F, 0.5F, size));
    CHECK(SplatLattice::key_size_class(key) == lattice.size_class(size));
    // Whatever its place, a larger class comes later.
    CHECK(lattice.key(at(-60000, -60000, -60000, size * 20)) > lattice.key(at(1, 1, 1, size)));
  }
}

TEST_CASE("blocks are cut where neighbours are farthest apart", "[tiles]") {
  std::vector<std::uint64_t> keys;
  for (std::uint64_t i = 0; i < 20; ++i) keys.push_back(i);
  // 8 is where the widest power of two within 4..16 begins: gaps of 3 bits are one level.
  CHECK(splat_cut(std::span(keys).first(17), 16, false) == 16);
  CHECK(splat_cut(std::span(keys).first(12), 11, false) == 8);
  CHECK(splat_cut(std::span(keys).first(10), 16, true) == 10);
  CHECK(splat_cut(std::span(keys).first(1), 16, true) == 1);
  for (auto it = keys.begin() + 5; it != keys.end(); ++it) *it += 1 << 12;
  CHECK(splat_cut(std::span(keys).first(17), 16, false) == 5);
  // Not before a quarter is full.
  CHECK(splat_cut(std::span(keys).subspan(3, 17), 16, false) > 3);
  // A change of class cuts wherever it is, also at the end of the scene.
  keys[1] |= 1ULL << 63 | 1ULL << 57;
  CHECK(splat_cut(std::span(keys).first(17), 16, false) == 1);
  CHECK(splat_cut(std::span(keys).first(3), 16, true) == 1);
}

}  // namespace
}  // namespace pounce::store
