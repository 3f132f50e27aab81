// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "io/image/write.h"
#include "planning/target_pages.h"
#include "pounce/options.h"

namespace pounce::planning {

/// A target's projection maps, by number.
inline constexpr std::array<const char*, 3> kMapNames{"position", "normal", "mask"};
inline constexpr int kMask = 2;

/// What a job of maps writes, and where. The options must outlive it.
class MapsOutput {
 public:
  /// Throws Error(usage) for patterns that cannot be.
  explicit MapsOutput(const MapsOptions& options);
  bool by_tile() const { return by_tile_; }
  std::string path(const TargetPage& page, int map) const;
  /// Throws Error(usage) for names that clash and formats that do not hold maps, Error(storage)
  /// where no file can be made.
  void plan(const std::vector<TargetPage>& pages);
  /// By map, once it is planned.
  const std::vector<io::ImageWriteSpec>& specs() const { return specs_; }

 private:
  const MapsOptions& options_;
  const bool by_tile_;
  std::vector<io::ImageWriteSpec> specs_;
};

}  // namespace pounce::planning
