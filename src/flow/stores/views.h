// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "flow/stores/block_readers.h"
#include "job/job_context.h"
#include "mesh/mesh.h"
#include "runtime/memory_budget.h"
#include "store/pack/pack.h"
#include "views/draw.h"
#include "views/gather.h"
#include "views/grid.h"

namespace pounce::flow {

/// A scene as it is seen from all around, in front of one target: tiles of what the scene shows,
/// which the cache keeps for the next target and size, and of where the target's surface is.
struct SceneViews {
  views::Grid grid;
  views::SightLimits limits;
  const views::ViewKernels* kernels = nullptr;
  std::unique_ptr<ColourCache> scene, target;
  /// The same as in a doll's house, where a tile shows the inside of the target: see
  /// views::TargetDepths::inside(). Null: nowhere.
  std::unique_ptr<ColourCache> inside_scene = nullptr, inside_target = nullptr;
  std::vector<std::unique_ptr<job::ScratchPack>> go_with_it = {};
  bool stays_decoded = false;  ///< all tiles have room in half of the budget
  /// Then: where these tiles are, row by row. To ask a cache that all threads share takes as long
  /// as to look up a few texels.
  std::vector<store::ChunkRef> scene_tiles = {}, target_tiles = {};
  runtime::Lease tiles_lease = {};

  /// Packets that look inside of the target at once.
  static constexpr std::size_t kInsideAtOnce = 64;
  /// What a piece of the target needs to look texels up, beside what it holds of each packet.
  static constexpr std::uint64_t kReadingBytes =
      kInsideAtOnce * sizeof(surface::TexelPacket) +
      3 * (views::tile_bytes(views::kSceneSamples) + views::tile_bytes(views::kTargetSamples) +
           2 * kPageBytes);
};

struct ViewsRequest {
  std::shared_ptr<store::SplatStore> scene;
  views::DrawOptions drawing;
  const views::ViewKernels* kernels = nullptr;
  std::uint32_t views = 0;
  std::string path;               ///< of the scene
  std::size_t most_ellipses = 0;  ///< for tests: of a slab; 0: what the budget holds
};

/// The scene as a grid sees it, tiles of views::kSceneSamples: found in the cache, or drawn, which
/// advances job.meter by their rows. Counts the store in the report.
std::unique_ptr<ColourCache> drawn_scene(job::JobContext& job, const ViewsRequest& request,
                                         const views::Grid& grid, bool* cached);

/// Draws the scene for such a target, or finds its views in the cache, and draws the target.
/// `edge`: of its texels. Takes job.meter through a stage "views" whose end is `progress_end`.
SceneViews scene_views(job::JobContext& job, const ViewsRequest& request, const mesh::Mesh& target,
                       double diagonal, float edge, double progress_end);

/// The least that this needs at once beside the mesh, for scenes with so many lobes of harmonics.
std::uint64_t scene_views_least_bytes(std::uint32_t lobes, std::uint64_t splats);

}  // namespace pounce::flow
