// SPDX-License-Identifier: Apache-2.0
#include "outcome/map_tally.h"

#include <utility>

#include "planning/image_output.h"

namespace pounce::outcome {

MapTally::MapTally(const MapsOptions& options, Report& report)
    : options_(options), by_tile_(planning::MapsOutput(options).by_tile()), report_(report) {
  report_.targets.emplace_back().path = options.target;
  for (const char* map : planning::kMapNames) report_.channels.push_back({map, 0, {}});
}

void MapTally::keeps(const planning::TargetPage& page, const std::string& path, int map) {
  report_.kept.push_back(path);
  add(page, path, map).state = "kept";
}

void MapTally::wrote(const planning::TargetPage& page, const std::string& path, int map,
                     std::uint64_t texels) {
  report_.outputs.push_back(path);
  ImageReport& image = add(page, path, map);
  image.state = "written";
  image.counts = {texels, texels, 0, 0};
  ChannelReport& channel = report_.channels[static_cast<std::size_t>(map)];
  ++channel.images;
  channel.counts.texels += texels;
  channel.counts.covered += texels;
}

ImageReport& MapTally::add(const planning::TargetPage& page, const std::string& path, int map) {
  ImageReport image;
  image.path = path;
  image.channel = planning::kMapNames[static_cast<std::size_t>(map)];
  image.material = page.set;
  image.udim = by_tile_ ? static_cast<int>(page.udim) : 0;
  image.width = options_.size.width;
  image.height = options_.size.height;
  return report_.targets.back().images.emplace_back(std::move(image));
}

}  // namespace pounce::outcome
