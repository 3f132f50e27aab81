// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/job_space.h"
#include "gaussian/splat_keep.h"
#include "pounce/options.h"

namespace pounce::planning {

/// A splat scene as a source.
struct SplatRequest {
  std::string path;
  Axes axes;  ///< applied to everything that is read
  /// What a texel will want of the harmonics decides how many of them are kept.
  SphericalHarmonics harmonics = SphericalHarmonics::mean;
  gaussian::SplatKeep keep = {};
  /// keep.near counts whatever it saves; else only where little of the scene is near.
  bool near_is_asked = false;
  /// For tests: most Gaussians of a run and most runs merged at once; 0 = what the budget holds.
  /// The store does not depend on them.
  std::uint64_t run_splats = 0;
  std::size_t fan_in = 0;
  bool fades_isolated = true;  ///< see gaussian::fade_isolated(); tests alone do without
};

/// What is known of a scene from its headers.
struct SceneFacts {
  std::uint64_t splats = 0;                     ///< in the file
  std::uint32_t lobes = 0;                      ///< of its harmonics that are kept
  bool is_linear = false;                       ///< colours are linear light, not sRGB-coded
  std::vector<std::string> files, assumptions;  ///< as in io::SplatSceneInfo
  /// The least that splat_store() may need at once; the same for a file of any length.
  std::uint64_t least_bytes = 0;
  std::uint64_t unpacked_bytes = 0;  ///< as io::SplatScene::unpacked_bytes()
};

}  // namespace pounce::planning
