// SPDX-License-Identifier: Apache-2.0
//
// --skip-existing: which outputs this very job has made before. Images of other programs, and of
// versions that did not say so, are told by times: whoever edited one by hand keeps it.
//
// A recorded job decides alone, whatever the times are: a checkout or a copy changes times, and
// nothing else. Times decide for files without a job. Both ask first whether the file is whole,
// which its structure shows without decoding (io::is_whole_file()).
//
// An image and its mask stand or fall together.
#include "planning/existing_outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "io/files/finished_output.h"

namespace pounce::planning {

namespace {

std::vector<std::string> files_of(const SourcePlan& plan, const ChannelPlan& channel) {
  std::set<std::size_t> columns;
  for (const PageTexture& page : channel.pages) {
    if (page.column >= 0) columns.insert(static_cast<std::size_t>(page.column));
    if (page.tile_set < 0) continue;
    const TileSetPlan& set = plan.tile_sets[static_cast<std::size_t>(page.tile_set)];
    for (const auto& [tile, column] : set.columns) columns.insert(column);
  }
  std::vector<std::string> files;
  for (const std::size_t column : columns) files.push_back(plan.columns[column].image.path);
  return files;
}

}  // namespace

FileTime newest(const std::vector<std::string>& files) {
  FileTime latest = FileTime::min();
  for (const std::string& file : files) {
    std::error_code failed;
    const FileTime time = std::filesystem::last_write_time(file, failed);
    if (!failed) latest = std::max(latest, time);
  }
  return latest;
}

bool has_content(const std::string& file) {
  std::error_code failed;
  return std::filesystem::is_regular_file(file, failed) &&
         std::filesystem::file_size(file, failed) > 0 && !failed;
}

Standing standing_of(const std::string& output, const std::string& job, FileTime inputs) {
  std::error_code failed;
  const FileTime time = std::filesystem::last_write_time(output, failed);
  // A file that another program has cut off or renamed to a wrong ending is no output, whoever made
  // it.
  if (failed || !io::is_whole_file(output)) return Standing::outdated;
  if (const auto made_by = io::read_job(output))
    return *made_by == job ? Standing::same_job : Standing::outdated;
  return time > inputs ? Standing::younger : Standing::outdated;
}

bool keeps_all(const std::vector<std::string>& files, const std::string& job, FileTime inputs,
               std::vector<std::string>& by_time) {
  std::vector<std::string> younger;
  for (const std::string& file : files) {
    const Standing standing = standing_of(file, job, inputs);
    if (standing == Standing::outdated) return false;
    if (standing == Standing::younger) younger.push_back(file);
  }
  by_time.insert(by_time.end(), younger.begin(), younger.end());
  return true;
}

bool is_made_by(const std::string& output, const std::function<std::string()>& job) {
  return io::read_job(output).has_value() &&
         standing_of(output, job(), FileTime::max()) == Standing::same_job;
}

bool is_made(const ImageOutput& image) {
  const auto by_job = [&](const std::string& file) {
    // Later than any time there is: by its time no file is kept here.
    return standing_of(file, image.job, FileTime::max()) == Standing::same_job;
  };
  return by_job(image.path) && (image.coverage_path.empty() || by_job(image.coverage_path));
}

namespace {

void leave(const std::vector<std::string>& files, TargetPlan& target) {
  for (const std::string& path : files) {
    std::erase(target.outputs, path);
    target.kept.push_back(path);
  }
}

}  // namespace

void keep_existing(const SourcePlan& plan, FileTime meshes, const std::set<std::string>& made,
                   TargetPlan& target) {
  for (std::size_t c = 0; c < plan.channels.size(); ++c) {
    // By the channel's own images: a repainted colour does not outdate the normal map.
    const FileTime source = std::max(meshes, newest(files_of(plan, plan.channels[c])));
    for (ImageOutput& image : target.images[c]) {
      if (image.elsewhere) continue;
      const FileTime old =
          image.onto ? newest({image.onto->path, image.onto->mask_path}) : FileTime::min();
      const FileTime inputs = std::max(source, old);
      std::vector<std::string> files{image.path};
      if (!image.coverage_path.empty()) files.push_back(image.coverage_path);
      // An output of this job's first attempt is no older work: it may be made from the damaged
      // pack.
      image.keep =
          made.count(image.path) == 0 && keeps_all(files, image.job, inputs, target.kept_by_time);
      if (image.keep) leave(files, target);
    }
  }
}

void leave_painted(TargetPlan& target) {
  for (auto& images : target.images) {
    for (ImageOutput& image : images) {
      if (image.keep || !image.onto || !image.onto->in_place) continue;
      image.painted = standing_of(image.path, image.job, FileTime::max()) == Standing::same_job;
      if (image.painted) leave({image.path}, target);
    }
  }
}

bool may_be_made(const TransferOptions& options, const TargetPlan& target,
                 const std::string& model_path) {
  const auto says_its_job = [](const std::string& output) {
    std::error_code failed;
    return std::filesystem::is_regular_file(output, failed) && io::read_job(output).has_value();
  };
  if (!options.keep_made || (options.min_coverage_percent != 0 && !target.painted_over))
    return false;
  if (!model_path.empty()) return says_its_job(model_path);
  for (const auto& images : target.images) {
    for (const planning::ImageOutput& image : images) {
      if (!image.elsewhere && (says_its_job(image.path) || says_its_job(image.coverage_path)))
        return true;
    }
  }
  return false;
}

namespace {

void warn_of_kept(TargetPlan& target) {
  const std::vector<std::string>& kept = target.kept_by_time;
  if (kept.empty()) return;
  target.warnings.push_back(fmt::format(
      "{}{}: skipped because newer than all inputs; no job is recorded there", kept.front(),
      kept.size() > 1 ? fmt::format(" and {} more", kept.size() - 1) : ""));
}

/// The model says which job made it; of the files beside it, its images and masks say their own.
bool keeps_model(const ModelFile& model, FileTime inputs, const std::set<std::string>& made,
                 TargetPlan& target) {
  std::map<std::string, std::string> jobs{{model.path, model.job}};
  for (const auto& images : target.images) {
    for (const ImageOutput& image : images) {
      jobs[image.path] = image.job;
      jobs[image.coverage_path] = image.job;
    }
  }
  std::vector<std::string> by_time;
  for (const std::string& output : target.outputs) {
    // What an attempt before this one wrote is no earlier work: it may come from the damaged pack.
    if (made.count(output) > 0) return false;
    const auto job = jobs.find(output);
    const bool keeps = job == jobs.end()  // a buffer or an image that was copied
                           ? has_content(output)
                           : keeps_all({output}, job->second, inputs, by_time);
    if (!keeps) return false;
  }
  target.kept_by_time = by_time;
  return true;
}

/// A model is made of all its inputs, the images that it takes over among them.
void keep_model(const ModelFile& model, const SourcePlan& source, std::vector<std::string> files,
                bool by_time, const std::set<std::string>& made, TargetPlan& target) {
  for (const ColumnPlan& column : source.columns) files.push_back(column.image.path);
  files.insert(files.end(), target.inputs.begin(), target.inputs.end());
  if (!keeps_model(model, by_time ? newest(files) : FileTime::max(), made, target)) return;
  warn_of_kept(target);
  for (auto& images : target.images) {
    for (ImageOutput& image : images) image.keep = true;
  }
  target.kept = std::exchange(target.outputs, {});
}

}  // namespace

void keep_what_is_there(const TransferOptions& options, const SourcePlan& source,
                        std::vector<std::string> meshes, const ModelFile& model,
                        const std::set<std::string>& written_before, TargetPlan& target) {
  // Only --skip-existing goes by times: later than any time there is, no file is kept by its own.
  const bool by_time = options.skip_existing;
  const bool keeps = by_time || options.min_coverage_percent == 0;
  if (keeps && !model.path.empty()) {
    keep_model(model, source, std::move(meshes), by_time, written_before, target);
  } else if (keeps) {
    keep_existing(source, by_time ? newest(meshes) : FileTime::max(), written_before, target);
    warn_of_kept(target);
  }
  if (options.keep_made) leave_painted(target);
}

}  // namespace pounce::planning
