// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "pounce/options.h"
#include "support/target_raster.h"

namespace pounce::test {

/// What the brute force says of one target texel.
enum class Verdict : std::uint8_t {
  outside,    ///< no target triangle covers its centre
  empty,      ///< covered by a triangle, but no source surface is in reach
  found,      ///< the value is `samples`
  ambiguous,  ///< another answer is as good to within rounding: not to be compared
  coarse,  ///< found, but the texel covers more than one of the source's: shows a mean, no lookup
};

struct ReferenceResult {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::vector<Verdict> verdicts;
  std::vector<double> samples;  ///< as the output file codes them, not rounded to its steps
  std::uint64_t count(Verdict verdict) const;
};

/// The transfer of one channel onto one image, in core, in double precision, by trying every source
/// triangle. Slow and obvious; shares no code with the product's stages (only the readers of meshes
/// and images). `channels` and `linear_output` say what the output file is. Selections and UDIM are
/// not known to it; options.image.size must be given, and the options must live.
class Reference {
 public:
  Reference(const TransferOptions& options, Channel channel, std::uint32_t channels,
            bool linear_output);
  ~Reference();
  const TargetRaster& raster() const;
  /// One texel; `samples` has room for all channels.
  Verdict texel(std::size_t texel, double* samples) const;
  /// The value that the source has at a covered texel if it is the target as well: no search.
  void own(std::size_t texel, double* samples) const;

 private:
  class Search;
  std::unique_ptr<Search> search_;
};

/// All texels.
ReferenceResult reference_transfer(const TransferOptions& options, Channel channel,
                                   std::uint32_t channels, bool linear_output);

}  // namespace pounce::test
