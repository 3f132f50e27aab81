// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "planning/plan.h"
#include "pounce/options.h"

namespace pounce::planning {

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

/// A model that is written; empty: images are.
struct ModelFile {
  std::string path;
  std::string job;  ///< see JobHash
};

/// Whether this very job may have made some of the outputs, and that matters. Naming jobs reads all
/// inputs, so it is asked first whether any output says what job made it.
bool may_be_made(const TransferOptions& options, const TargetPlan& target,
                 const std::string& model_path);

/// Marks what is there, as the options want it, of a target whose jobs are named: images as
/// keep_existing() and leave_painted() do, a model with all its images. `meshes`: files that all
/// are made of. Adds warnings.
void keep_what_is_there(const TransferOptions& options, const SourcePlan& source,
                        std::vector<std::string> meshes, const ModelFile& model,
                        const std::set<std::string>& written_before, TargetPlan& target);

}  // namespace pounce::planning
