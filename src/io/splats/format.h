// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

namespace pounce::io {

/// How a Gaussian splat scene is stored.
struct SplatFormat {
  std::string name;      ///< "3DGS PLY", "SPZ v4", "SOG (a folder)"
  bool is_read = false;  ///< does pounce read it? Only PLY
};

/// What a file or folder holds, if that is a splat scene: by content, and by its ending where the
/// format has no mark of its own. Scenes in glTF are found by read_gltf(), which parses it. Throws
/// Error(storage) where there is nothing to read.
std::optional<SplatFormat> splat_format(const std::string& path);

/// "splats/room.spz: a Gaussian splat scene in SPZ v4; pounce reads 3DGS PLY, ...": for a scene
/// that is not read.
std::string why_not_read(const std::string& path, const SplatFormat& format);

}  // namespace pounce::io
