// SPDX-License-Identifier: Apache-2.0
#include "outcome/clipped_samples.h"

#include <fmt/format.h>

namespace pounce::outcome {

void ClippedSamples::count(std::size_t channel, std::uint64_t samples, const std::string& image) {
  if (samples == 0) return;
  Clipped& clipped = channels_[channel];
  clipped.samples += samples;
  if (clipped.images++ == 0) clipped.first = image;
}

void ClippedSamples::warn(const planning::SourcePlan& source, Report& report) const {
  for (const auto& [c, clipped] : channels_) {
    report.target_clipped += clipped.samples;
    const Depth depth = source.channels[c].format.depth;
    const bool is_half = depth == Depth::half;
    report.warnings.push_back(fmt::format(
        "{}{}: {} samples of {} were clipped: {} holds {}; use {} to keep them", clipped.first,
        clipped.images > 1 ? fmt::format(" and {} more", clipped.images - 1) : "", clipped.samples,
        source.channels[c].name, depth_name(depth), is_half ? "-65504 to 65504" : "0 to 1",
        is_half ? "--depth float" : "--depth half or float with .exr"));
  }
}

}  // namespace pounce::outcome
