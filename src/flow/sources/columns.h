// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "flow/project/page_colour.h"
#include "flow/stores/colour_levels.h"
#include "job/job_context.h"
#include "job/memory_needs.h"
#include "planning/plan.h"
#include "planning/source_images.h"

namespace pounce::flow {

/// The images of a mesh as columns of colour tiles, open as long as this lives, and what is kept of
/// them.
struct SourceColumns {
  std::vector<std::unique_ptr<ColourCache>> columns;  ///< by SourcePlan::columns
  std::vector<TileColumns> tile_sets;                 ///< by SourcePlan::tile_sets
  std::unique_ptr<ColourLevels> levels;               ///< of all columns
  runtime::Lease whole_lease;                         ///< for what WholeColumn builds
  bool all_cached = true;

  /// What each source page gives to a channel whose source is seen through these lattices.
  std::vector<PageColour> pages_of(const planning::ChannelPlan& channel,
                                   const std::vector<mesh::Lattice>& lattices) const;
  std::uint64_t bytes_read() const;
};

/// What building a planned column takes.
ColourRequest request_of(const planning::ColumnPlan& column);

/// That of each, and the largest decoded tile of them all.
std::vector<job::LeastMemory> column_needs(const planning::SourcePlan& plan);
std::uint64_t colour_tile_bytes(const planning::SourcePlan& plan);

using planning::WantedTiles;
/// Of the tiles that planning::little_shown() names, `wanted`, those that a job keeps: all of every
/// image where targets of so many texels see it from too far for tiles alone (levels are made of
/// all), and where the budget has no space for building an image later.
WantedTiles tiles_shown(const job::JobContext& job, const planning::SourcePlan& plan,
                        WantedTiles wanted, std::uint64_t target_texels);

/// Builds the columns of a plan or finds them in the cache; takes job.meter through a stage whose
/// end is `progress_end`, and counts what was done in job.report.
SourceColumns build_columns(job::JobContext& job, const planning::SourcePlan& plan,
                            const WantedTiles& wanted, double progress_end);

}  // namespace pounce::flow
