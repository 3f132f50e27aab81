// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/job_space.h"
#include "flow/stores/splat_keep.h"
#include "job/job_context.h"
#include "pounce/options.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// A splat scene as a source.
struct SplatRequest {
  std::string path;
  Axes axes;  ///< applied to everything that is read
  /// What a texel will want of the harmonics decides how many of them are kept.
  SphericalHarmonics harmonics = SphericalHarmonics::mean;
  SplatKeep keep = {};
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
/// `poll`: as io::open_splat_scene(), which takes io::kOpenSplatBytes.
SceneFacts scene_facts(
    const SplatRequest& request, const std::function<void()>& poll = [] {});

/// Reads, filters and sorts a scene into a store of blocks, or finds the store in the cache. Takes
/// job.meter through a stage "precondition" whose end is `progress_end`. Adds what was left out to
/// job.report.source_filtered, also where the store was cached. Throws Error(input) where the file
/// is none that we read or no Gaussian of it is of use, Error(budget) below
/// SceneFacts::least_bytes.
std::unique_ptr<store::SplatStore> splat_store(job::JobContext& job, const SplatRequest& request,
                                               bool* cached, double progress_end);

}  // namespace pounce::flow
