// SPDX-License-Identifier: Apache-2.0
//
// The options of `pounce apply`: those of a transfer that apply to a hit map. They are the same
// rows, so that they are read, refused, reported and hashed alike; some mean less there, and are
// described in words of their own.
#include "options/row.h"

namespace pounce::options {
namespace {

/// What an option of a transfer is for a hit map, where that is not the same.
void reword(OptionInfo& info) {
  if (info.name == "source") {
    info.value = "MAP";
    info.help = "Hit map (.exr) that `pounce transfer --map` wrote. May hold <UDIM> or <UVTILE>";
  } else if (info.name == "output") {
    info.help =
        "Image to write (.png, .jpg, .tif, .tx, .exr). May hold <CHANNEL>, and holds <UDIM> "
        "(1001) or <UVTILE> (u1_v1) if MAP does. Missing folders are created";
  } else if (info.name == "tiles") {
    info.default_text = "all that MAP has";
  } else if (info.name == "channels") {
    info.help =
        "baseColor, metallicRoughness, occlusion and emissive, separated by commas. Each needs "
        "--source-texture";
    info.default_text = "all that --source-texture names if OUTPUT holds <CHANNEL>, else baseColor";
  } else if (info.name == "source-texture") {
    info.help =
        "Paint this image: of a material's channel, or a custom map (displacement, specular, mask) "
        "that --channels and <CHANNEL> then know by NAME. PATH may hold <UDIM> or <UVTILE>. Layers "
        "and channels of an EXR: NAME=FILE.exr:diffuse or NAME=FILE.exr:N.X,Y,Z. Once per name";
    info.is_required = true;
  }
}

}  // namespace

std::vector<OptionInfo> apply_infos() {
  std::vector<OptionInfo> infos;
  for (const Row<TransferOptions>& row : rows_of<TransferOptions>()) {
    if (!applies_to(row.source, Source::map)) continue;
    infos.push_back(row.info);
    reword(infos.back());
  }
  return infos;
}

}  // namespace pounce::options
