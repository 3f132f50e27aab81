// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pounce::io {

/// A texture of an MTL file, as it is named there.
struct MtlTexture {
  std::string name;  ///< empty: none
  bool clamp = false;
  std::array<double, 2> scale{1, 1}, offset{0, 0};
  float strength = 1;  ///< "-bm": of bumps, and of a normal map
};

/// What counts of one material of an MTL file; white where it says nothing.
struct MtlMaterial {
  std::string name;
  std::array<float, 3> diffuse{1, 1, 1}, emission{0, 0, 0};
  float dissolve = 1;
  /// How "Kd" and "Ke" say a colour that is not read: "xyz" or "spectral"; empty: they do not.
  std::string_view unread_diffuse, unread_emission;
  MtlTexture base_color, emissive, normal;  ///< "map_Kd", "map_Ke", "norm"
  /// Textures that no channel is made of: by statement ("map_Bump"), the name.
  std::vector<std::pair<const char*, std::string>> others;
};

/// Reads the materials one after the other, in the order of the file; what is in memory is one of
/// them. Throws Error(storage) or Error(input).
void read_mtl(const std::string& path, const std::function<void(MtlMaterial&&)>& found);

/// No material names more.
inline constexpr std::size_t kMaxMtlTextures = 13;

/// From one pass over the file.
struct MtlSize {
  std::uint64_t bytes = 0;  ///< that all its materials take until the OBJ is read, at most
  std::uint64_t longest_line_bytes = 0;
  /// Statements that name textures, and their bytes.
  std::uint64_t textures = 0, texture_bytes = 0, longest_texture_bytes = 0;
};
MtlSize mtl_size(const std::string& path);

}  // namespace pounce::io
