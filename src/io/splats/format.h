// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

namespace pounce::io {

/// How a Gaussian splat scene is stored.
enum class SplatKind { ply, compressed_ply, spz, sog, gltf, dot_splat, ksplat, unread };
struct SplatFormat {
  std::string name;  ///< "3DGS PLY", "SPZ v4", "SOG v2 (a folder)"
  SplatKind kind = SplatKind::unread;
  bool is_read() const { return kind != SplatKind::unread; }
};

/// What a file or folder holds, if that is a splat scene and nothing but one: by content, and by
/// its ending where the format has no mark of its own. So not of glTF, which may hold meshes, too.
/// Throws Error(storage) where there is nothing to read.
std::optional<SplatFormat> splat_format(const std::string& path);
/// The same, and glTF with Gaussians: what a source is.
std::optional<SplatFormat> source_splat_format(const std::string& path);

/// "room/lod-meta.json: a Gaussian splat scene in streamed SOG; pounce reads ...": for a scene that
/// is not read.
std::string why_not_read(const std::string& path, const SplatFormat& format);

}  // namespace pounce::io
