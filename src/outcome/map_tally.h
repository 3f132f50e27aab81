// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "planning/target_pages.h"
#include "pounce/options.h"
#include "pounce/report.h"

namespace pounce::outcome {

/// What a report states of a target's projection maps, by their numbers in planning::kMapNames.
class MapTally {
 public:
  /// Both must outlive it.
  MapTally(const MapsOptions& options, Report& report);
  /// An image that this very job has made before.
  void keeps(const planning::TargetPage& page, const std::string& path, int map);
  /// An image, and of how many texels; each of them has its map.
  void wrote(const planning::TargetPage& page, const std::string& path, int map,
             std::uint64_t texels);

 private:
  ImageReport& add(const planning::TargetPage& page, const std::string& path, int map);

  const MapsOptions& options_;
  const bool by_tile_;
  Report& report_;
};

}  // namespace pounce::outcome
