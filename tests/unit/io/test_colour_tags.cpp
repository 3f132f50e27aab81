// SPDX-License-Identifier: Apache-2.0
#include <zlib.h>

#include <catch2/catch.hpp>
#include <string>

#include "io/codec/colour_tags.h"
#include "io/codec/guard.h"

using namespace pounce;

namespace {

using Bytes = std::vector<std::byte>;

Bytes big_endian(const std::vector<std::uint32_t>& numbers) {
  Bytes bytes;
  for (const std::uint32_t n : numbers) {
    for (int shift = 24; shift >= 0; shift -= 8)
      bytes.push_back(static_cast<std::byte>(n >> shift));
  }
  return bytes;
}

Bytes deflated(const std::string& name, const Bytes& profile) {
  Bytes chunk;
  for (const char c : name) chunk.push_back(static_cast<std::byte>(c));
  chunk.resize(chunk.size() + 2);
  const std::size_t begin = chunk.size();
  uLongf size = ::compressBound(profile.size());
  chunk.resize(begin + size);
  REQUIRE(::compress(reinterpret_cast<Bytef*>(chunk.data() + begin), &size,
                     reinterpret_cast<const Bytef*>(profile.data()), profile.size()) == Z_OK);
  chunk.resize(begin + size);
  return chunk;
}

const Chromaticities kP3 = colour_space_from_name("display-p3")->primaries;
const Chromaticities kAp1 = colour_space_from_name("acescg")->primaries;

/// White first, as the chunk has it.
const Bytes kP3Chunk = big_endian({31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000});

/// Adobe RGB (1998)'s curves are 563/256: no space that is known.
Bytes of_gamma(double gamma) {
  Bytes profile = io::make_icc({kRec709, true});
  // Three curves of one tag each at the end: "curv", 0, 0. A count of 1 and a gamma instead.
  for (std::size_t curve = 1; curve <= 3; ++curve) {
    const std::size_t at = profile.size() - 12 * curve;
    REQUIRE(profile[at] == std::byte{'c'});
  }
  // Lengthened: all three share the last one's place then.
  const std::size_t place = profile.size() - 12;
  profile[place + 11] = std::byte{1};
  const auto steps = static_cast<std::uint32_t>(gamma * 256);
  profile.push_back(static_cast<std::byte>(steps >> 8));
  profile.push_back(static_cast<std::byte>(steps & 255));
  for (std::size_t tag = 7; tag < 10; ++tag) {
    const Bytes there = big_endian({static_cast<std::uint32_t>(place)});
    std::copy(there.begin(), there.end(),
              profile.begin() + static_cast<std::ptrdiff_t>(132 + tag * 12 + 4));
  }
  return profile;
}

}  // namespace

TEST_CASE("profiles that are written are recognised", "[io]") {
  for (const char* name : {"srgb", "lin_rec709", "acescg", "aces2065-1", "display-p3"}) {
    CAPTURE(name);
    const ColourSpace space = *colour_space_from_name(name);
    const auto profile = io::read_icc(io::make_icc(space));
    REQUIRE(profile);
    CHECK(profile->description == name);
    REQUIRE(profile->space);
    CHECK(profile->space->linear == space.linear);
    CHECK(same_primaries(profile->space->primaries, space.primaries));
  }
}

TEST_CASE("a profile of primaries that have no name is those primaries", "[io]") {
  // ProPhoto's, whose white is D50; and some of another white, which the profile has adapted.
  const Chromaticities prophoto{0.7347F, 0.2653F, 0.1596F, 0.8404F,
                                0.0366F, 0.0001F, 0.3457F, 0.3585F};
  const Chromaticities wide{0.66F, 0.31F, 0.22F, 0.73F, 0.14F, 0.05F, 0.3127F, 0.3290F};
  for (const Chromaticities& primaries : {prophoto, wide}) {
    for (const bool linear : {false, true}) {
      CAPTURE(linear);
      const auto profile = io::read_icc(io::make_icc({primaries, linear}));
      REQUIRE(profile);
      REQUIRE(profile->space);
      CHECK(profile->space->linear == linear);
      // What counts: its colours are the same ones. D50's adaptation is Bradford's, as ours is.
      const Matrix3 got = primaries_matrix(profile->space->primaries, kRec709),
                    expected = primaries_matrix(primaries, kRec709);
      for (std::size_t i = 0; i < 9; ++i) CHECK(got[i] == Approx(expected[i]).margin(5e-4));
    }
  }
  Bytes flat = io::make_icc({wide, true});  // green is where red is
  const auto entry = [&](std::size_t tag) {
    return flat.begin() + static_cast<std::ptrdiff_t>(132 + 12 * tag);
  };
  std::copy_n(entry(4) + 4, 8, entry(5) + 4);
  CHECK_FALSE(io::read_icc(flat)->space);
}

TEST_CASE("profiles with other curves or of other things are not", "[io]") {
  const auto gamma = io::read_icc(of_gamma(2.2));
  REQUIRE(gamma);
  CHECK_FALSE(gamma->space);
  const auto one = io::read_icc(of_gamma(1));
  REQUIRE(one);
  CHECK(one->space);
  Bytes profile = io::make_icc({kP3, false});
  for (std::size_t cut = 0; cut < profile.size(); cut += 3)
    io::read_icc(std::span(profile).first(cut));  // nothing is thrown, nothing read beyond
  CHECK_FALSE(io::read_icc(std::span(profile).first(100))->space);
  profile[16] = std::byte{'G'};
  CHECK_FALSE(io::read_icc(profile));
}

TEST_CASE("a PNG's chunks are heeded in their order", "[io]") {
  using io::ColourPiece;
  const ColourPiece gamma{"gAMA", big_endian({45455})}, white{"cHRM", kP3Chunk},
      srgb{"sRGB", Bytes(1)}, profile{"iCCP", deflated("x", io::make_icc({kAp1, true}))},
      code{"cICP", {std::byte{12}, std::byte{13}, std::byte{0}, std::byte{1}}};
  CHECK_FALSE(io::read_colour_tags({}).linear);
  CHECK_FALSE(io::read_colour_tags({}).primaries);
  const io::ColourTags weak = io::read_colour_tags({gamma, white});
  CHECK(weak.linear == false);
  REQUIRE(weak.primaries);
  CHECK(same_primaries(*weak.primaries, kP3));
  CHECK(same_primaries(*io::read_colour_tags({gamma, white, srgb}).primaries, kRec709));
  const io::ColourTags by_profile = io::read_colour_tags({gamma, profile, srgb});
  CHECK(by_profile.linear == true);
  CHECK(same_primaries(*by_profile.primaries, kAp1));
  const io::ColourTags by_code = io::read_colour_tags({profile, code});
  CHECK(by_code.linear == false);
  CHECK(same_primaries(*by_code.primaries, kP3));
  for (const io::ColourTags& tags : {weak, by_profile, by_code}) CHECK(tags.problem.empty());
}

TEST_CASE("what a file says and nobody understands is told", "[io]") {
  const auto problem = [](const char* kind, const Bytes& data) {
    return io::read_colour_tags({{kind, data}}).problem;
  };
  CHECK(io::read_colour_tags({{"gAMA", big_endian({100000})}}).linear == true);
  CHECK(problem("gAMA", big_endian({55556})) == "its gamma of 0.55556 is not applied");
  CHECK(problem("cHRM", big_endian(std::vector<std::uint32_t>(8))) ==
        "its chromaticities are invalid: they enclose no colours");
  CHECK(problem("cICP", {std::byte{9}, std::byte{16}, std::byte{0}, std::byte{1}}) ==
        "its cICP code points 9, 16 are not supported");
  CHECK(problem("ICC", of_gamma(2.2)) == "its ICC profile \"lin_rec709\" is not applied");
  CHECK(problem("ICC", Bytes(5000)).empty());
  CHECK(problem("iCCP", Bytes(40, std::byte{'x'})).empty());
}
