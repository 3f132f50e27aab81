// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/hash.h"
#include "job/job_context.h"
#include "planning/plan.h"

namespace pounce::planning {

/// Which job made an image, as a hash of all that its bytes depend on: this version of pounce, the
/// options, the contents of the files that it is made of. Not of where files lie or what they are
/// called, of threads, memory and cache, nor of the job's other images: the same image of a job
/// with more targets, tiles or channels has the same hash. An option that says what holds without
/// it is as if it were not given. Reads every input once. Not thread-safe.
class JobHash {
 public:
  JobHash(job::JobContext& job, const TransferOptions& options);
  JobHash(job::JobContext& job, const MapsOptions& options);

  /// Of the image of a channel on a page of a target. `source`, `target`: files of the meshes, or
  /// of the scene.
  std::string of_image(const std::vector<std::string>& source, const SourcePlan& plan,
                       const std::vector<std::string>& target, const TargetPlan& target_plan,
                       std::size_t channel, std::size_t page);
  /// Of a model: of its images, by [channel][page], and of every file that it is made of.
  std::string of_model(const std::string& path, const TargetPlan& target_plan);
  /// Of one of a target's projection maps.
  std::string of_map(const std::vector<std::string>& target, const TargetPage& page, ImageSize size,
                     const std::string& map, const std::string& path);

 private:
  /// `said_anyway`: options whose values hold without them.
  void begin(const std::vector<std::string>& said_anyway, Hasher& hash) const;
  void add_file(const std::string& path, Hasher& hash);
  void add_files(const std::vector<std::string>& paths, Hasher& hash);
  void add_image(const mesh::ImageRef& image, Hasher& hash);
  void add_source_images(const SourcePlan& plan, const ChannelPlan& channel, Hasher& hash);
  void add_output(const ChannelPlan& channel, const ImageOutput& image, Hasher& hash);

  job::JobContext& job_;
  std::vector<OptionReport> options_;        ///< those that matter to bytes
  std::map<std::string, Hash128> contents_;  ///< by path
};

// --- keys of pages -------------------------------------------------------------------------------

/// Are a mesh's colours blended in linear light? As the images hold them: if any of them is linear.
bool texels_are_linear(const SourcePlan& plan);

/// What a page of the mesh has in a channel; `columns` are the keys of the plan's.
void add_page(const PageTexture& page, const std::vector<Hash128>& columns, Hasher& hash);
void add_tile_set(const TileSetPlan& set, const std::vector<Hash128>& columns, Hasher& hash);

}  // namespace pounce::planning
