// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/vec.h"

namespace pounce::io {

/// A material without textures, white where nothing else is said.
struct PlainLook {
  bool double_sided = false;
  std::array<float, 4> base_color{1, 1, 1, 1};  ///< 0..1, linear light
  float roughness = 1, metallic = 0;            ///< 0..1
  std::array<float, 3> emissive{};              ///< 0..1, linear light, times:
  float emissive_strength = 1;                  ///< finite, not negative
  std::optional<float> alpha_cutoff;            ///< its alpha is a mask; finite, not negative
  bool blends = false;  ///< its alpha is opacity; else, without a mask, it is nothing
  bool operator==(const PlainLook&) const = default;
};
/// One and the triangles that have it.
struct PlainMaterial {
  std::string name;
  std::uint64_t triangles = 0;  ///< above 0: those that follow the last one's
  PlainLook look = {};
};

/// A mesh with one set of UVs (v downwards); a primitive for each material, with vertices of its
/// own.
struct PlainMesh {
  std::span<const Vec3f> positions, normals;  ///< as many of each
  std::span<const Vec2f> uvs;                 ///< and of these
  std::span<const std::array<std::uint32_t, 3>> triangles;
  std::vector<PlainMaterial> materials;  ///< have all of the triangles
  Vec3d origin;                          ///< positions are counted from there: a node moves them
};

/// Writes it as .glb to the stream's end; who owns the stream looks for errors of writing. `name`
/// is for messages. Throws Error(input) for more than 4 GiB. Returns the number of bytes.
std::uint64_t write_glb(FILE* stream, const std::string& name, const PlainMesh& mesh);
/// The same into a file, which appears whole or not at all. Throws Error(storage), too.
std::uint64_t write_glb(const std::string& path, const PlainMesh& mesh);

}  // namespace pounce::io
