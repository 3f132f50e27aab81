// SPDX-License-Identifier: Apache-2.0
//
// Names and formats of `pounce maps`. All materials share a page there, and the maps are not
// images of colours: what a transfer says of its outputs does not hold for them.
#include "planning/maps_output.h"

#include <filesystem>
#include <map>

#include "planning/output_names.h"
#include "pounce/error.h"

namespace pounce::planning {

MapsOutput::MapsOutput(const MapsOptions& options)
    : options_(options),
      by_tile_(has_token(options.output, "UDIM") || has_token(options.output, "UVTILE")) {
  if (!has_token(options_.output, "CHANNEL")) {
    throw Error(ErrorKind::usage, options_.output +
                                      ": <CHANNEL> is missing, which becomes position, normal "
                                      "and mask; add it to the file name");
  }
  if (io::is_tx_path(options_.output)) {
    throw Error(ErrorKind::usage, options_.output +
                                      ": .tx is for renderers' textures with mipmaps, which maps "
                                      "of a mesh do not have; write .exr or .tif");
  }
}

std::string MapsOutput::path(const TargetPage& page, int map) const {
  // <MATERIAL> has no value here: expand_pattern() refuses it as unknown. The same holds for tokens
  // of tiles unless the pattern has them.
  std::map<std::string, std::string> values{
      {"CHANNEL", kMapNames[static_cast<std::size_t>(map)]},
      {"TARGET", std::filesystem::path(options_.target).stem().string()}};
  if (by_tile_) values.merge(page.tokens());
  values.erase("MATERIAL");
  return expand_pattern(options_.output, values);
}

void MapsOutput::plan(const std::vector<TargetPage>& pages) {
  std::vector<std::string> paths;
  for (const TargetPage& page : pages) {
    for (int map = 0; map < 3; ++map) paths.push_back(path(page, map));
  }
  check_outputs(paths);
  // The ending decides the depth, and endings do not depend on a page: what holds for the first
  // page's names holds for all. Positions and normals are signed and unbounded, so integers cannot
  // hold them.
  for (int map = 0; map < 3; ++map) {
    const std::string& path = paths[static_cast<std::size_t>(map)];
    const Depth depth = io::writable_depth(path, map == kMask ? Depth::u8 : Depth::float32);
    io::ImageWriteSpec spec{
        options_.size.width, options_.size.height, map == kMask ? 1U : 3U, depth, true, false};
    std::string why = io::why_not_writable(path, spec);
    if (why.empty() && map != kMask && depth != Depth::float32) {
      why = path + ": positions and normals need a float format; write .exr or .tif";
    }
    if (!why.empty()) throw Error(ErrorKind::usage, why);
    specs_.push_back(spec);
  }
}

}  // namespace pounce::planning
