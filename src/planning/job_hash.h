// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
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

// --- what is there already -----------------------------------------------------------------------

using FileTime = std::filesystem::file_time_type;

/// When the youngest of these files was changed; what is not there does not count.
FileTime newest(const std::vector<std::string>& files);

/// Is this a file with something in it?
bool has_content(const std::string& file);

/// What --skip-existing thinks of a file.
enum class Standing : std::uint8_t {
  outdated,  ///< it is not there, is not whole, or another job made it
  same_job,  ///< it says that this job made it
  younger,   ///< it says of no job, and was changed after all inputs
};
/// `job`: the hash of the one that would make it. Equal times do not tell, so they mean outdated.
Standing standing_of(const std::string& output, const std::string& job, FileTime inputs);
/// Are all of these there, and none outdated? Adds those that only their time speaks for to
/// `by_time`.
bool keeps_all(const std::vector<std::string>& files, const std::string& job, FileTime inputs,
               std::vector<std::string>& by_time);

/// Has the job that `job` names made this file? It is asked where the file says of one: naming a
/// job reads all inputs.
bool is_made_by(const std::string& output, const std::function<std::string()>& job);

/// Has this very job made the image, with its mask, by now?
bool is_made(const ImageOutput& image);

/// --skip-existing: marks the images (ImageOutput::keep, whose `job` is known) that are there, with
/// their masks, as this job would make them, or that say of no job and are younger than all they
/// are made from: `meshes`, the channel's source images, the image painted over. What is kept
/// leaves TargetPlan::outputs for TargetPlan::kept. What the job has `made` is no older work.
void keep_existing(const SourcePlan& plan, FileTime meshes, const std::set<std::string>& made,
                   TargetPlan& target);

/// Marks the images that this very job has painted over in place (ImageOutput::painted) and that
/// are not kept, as where their mask is missing: painted twice they would be other images.
void leave_painted(TargetPlan& target);

}  // namespace pounce::planning
