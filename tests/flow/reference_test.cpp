// SPDX-License-Identifier: Apache-2.0
//
// The transfer against a brute force that shares no code with it.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "pounce/transfer.h"
#include "support/random_scene.h"
#include "support/reference_transfer.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

struct Difference {
  double largest = 0;
  std::uint64_t compared = 0, empty = 0, wrongly_covered = 0, wrongly_empty = 0, ambiguous = 0,
                coarse = 0;
};

Difference compare_with_reference(TransferOptions options, Channel channel) {
  options.channels.transferred = {channel};
  options.mesh.filter = Filter::tent;  // what the reference looks up
  options.resources.use_cache = false;
  options.resources.memory_bytes = 256 << 20;
  options.image.size = ImageSize{2 * options.image.size->width,
                                 2 * options.image.size->height};  // few coarse texels
  transfer(options);
  const WholeImage out = read_whole_image(options.output);
  const WholeImage coverage = read_whole_image(options.image.coverage_output);
  const Reference reference(options, channel, out.channels, options.image.depth == Depth::float32);
  REQUIRE(out.width == reference.raster().width);
  REQUIRE(out.height == reference.raster().height);
  Difference d;
  std::vector<double> samples(out.channels);
  constexpr std::size_t kEach = 3;  // texels of a row in turn
  for (std::size_t i = 0; i < reference.raster().owner.size(); i += kEach) {
    const bool covered = coverage.at(i, 0) > 0.5;
    const Verdict verdict = reference.texel(i, samples.data());
    if (verdict == Verdict::ambiguous) {
      ++d.ambiguous;
    } else if (verdict == Verdict::coarse) {
      ++d.coarse;
      if (!covered) ++d.wrongly_empty;
    } else if (verdict == Verdict::found) {
      ++d.compared;
      if (!covered) ++d.wrongly_empty;
      for (std::size_t c = 0; c < out.channels && covered; ++c) {
        const double e = std::abs(out.at(i, c) - samples[c]);
        d.largest = std::max(d.largest, e);
      }
    } else {
      if (verdict == Verdict::empty) ++d.empty;
      if (covered) ++d.wrongly_covered;
    }
  }
  return d;
}

}  // namespace

TEST_CASE("random scenes agree with the brute force", "[flow]") {
  const std::uint32_t seed = GENERATE(range(1U, 9U));
  const bool as_float = GENERATE(false, true);
  const Channel channel = GENERATE(Channel::base_color, Channel::metallic_roughness);
  const TempFolder folder;
  TransferOptions options = make_random_scene(folder.path().string(), seed);
  options.output = folder.file(as_float ? "out.exr" : "out.png");
  if (as_float) options.image.depth = Depth::float32;
  options.image.coverage_output = folder.file("coverage.png");
  const Difference d = compare_with_reference(options, channel);
  CAPTURE(seed, as_float, channel_name(channel), d.compared, d.ambiguous, d.largest);
  CHECK(d.compared > 1000);
  CHECK(d.wrongly_covered == 0);
  CHECK(d.wrongly_empty == 0);
  CHECK(static_cast<double>(d.ambiguous) < 0.01 * static_cast<double>(d.compared));
  if (seed % 5 == 0) CHECK(d.empty > 100);  // these scenes look less far than they are displaced
  // Half a step of rounding and next to nothing else; 1/255 and 1e-4 were asked for.
  CHECK(d.largest <= (as_float ? 2e-5 : 0.502 / 255));
  std::printf(
      "FIGURE reference seed %u %s %s largest %.3g compared %llu ambiguous %llu coarse %llu\n",
      seed, as_float ? "exr" : "png", channel_name(channel), d.largest,
      static_cast<unsigned long long>(d.compared), static_cast<unsigned long long>(d.ambiguous),
      static_cast<unsigned long long>(d.coarse));
  std::fflush(stdout);
}

}  // namespace pounce::test
