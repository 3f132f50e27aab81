// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "planning/plan.h"
#include "pounce/report.h"

namespace pounce::outcome {

/// Samples of one target's images that their depth cannot hold. Not thread-safe.
class ClippedSamples {
 public:
  void count(std::size_t channel, std::uint64_t samples, const std::string& image);
  /// One warning per channel, however many images it has; adds the samples up.
  void warn(const planning::SourcePlan& source, Report& report) const;

 private:
  struct Clipped {
    std::uint64_t samples = 0, images = 0;
    std::string first;  ///< image
  };
  std::map<std::size_t, Clipped> channels_;
};

}  // namespace pounce::outcome
