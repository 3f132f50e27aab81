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

#include <algorithm>
#include <set>

#include "io/files/finished_output.h"

namespace pounce::planning {
namespace {

std::vector<std::string> images_of(const SourcePlan& plan, const ChannelPlan& channel) {
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

bool is_made(const ImageOutput& image) {
  const auto by_job = [&](const std::string& file) {
    // Later than any time there is: by its time no file is kept here.
    return standing_of(file, image.job, FileTime::max()) == Standing::same_job;
  };
  return by_job(image.path) && (image.coverage_path.empty() || by_job(image.coverage_path));
}

void keep_existing(const SourcePlan& plan, FileTime meshes, const std::set<std::string>& made,
                   TargetPlan& target) {
  for (std::size_t c = 0; c < plan.channels.size(); ++c) {
    // By the channel's own images: a repainted colour does not outdate the normal map.
    const FileTime source = std::max(meshes, newest(images_of(plan, plan.channels[c])));
    for (ImageOutput& image : target.images[c]) {
      const FileTime old =
          image.onto ? newest({image.onto->path, image.onto->mask_path}) : FileTime::min();
      const FileTime inputs = std::max(source, old);
      std::vector<std::string> files{image.path};
      if (!image.coverage_path.empty()) files.push_back(image.coverage_path);
      // An output of this job's first attempt is no older work: it may be made from the damaged
      // pack.
      image.keep =
          made.count(image.path) == 0 && keeps_all(files, image.job, inputs, target.kept_by_time);
      if (!image.keep) continue;
      for (const std::string& path : files) {
        std::erase(target.outputs, path);
        target.kept.push_back(path);
      }
    }
  }
}

}  // namespace pounce::planning
