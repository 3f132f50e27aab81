// SPDX-License-Identifier: Apache-2.0
//
// --skip-existing: which outputs are younger than everything that they are made from.
#include "flow/plan/existing_outputs.h"

#include <algorithm>
#include <set>

namespace pounce::flow {
namespace {

std::vector<std::string> images_of(const Plan& plan, const ChannelPlan& channel) {
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

bool is_up_to_date(const std::string& output, FileTime inputs) {
  std::error_code failed;
  const FileTime time = std::filesystem::last_write_time(output, failed);
  return !failed && time > inputs;
}

void keep_existing(const Plan& plan, FileTime meshes, const std::set<std::string>& made,
                   TargetPlan& target) {
  for (std::size_t c = 0; c < plan.channels.size(); ++c) {
    const FileTime source = std::max(meshes, newest(images_of(plan, plan.channels[c])));
    for (ImageOutput& image : target.images[c]) {
      const FileTime old =
          image.onto ? newest({image.onto->path, image.onto->mask_path}) : FileTime::min();
      const FileTime inputs = std::max(source, old);
      image.keep = made.count(image.path) == 0 && is_up_to_date(image.path, inputs) &&
                   (image.coverage_path.empty() || is_up_to_date(image.coverage_path, inputs));
      if (!image.keep) continue;
      for (const std::string& path : {image.path, image.coverage_path}) {
        if (path.empty()) continue;
        std::erase(target.outputs, path);
        target.kept.push_back(path);
      }
    }
  }
}

}  // namespace pounce::flow
