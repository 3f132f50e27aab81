// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "mesh/lattice.h"
#include "mesh/mesh.h"
#include "mesh/uv_tiles.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"

namespace pounce::planning {

/// A triangle's UVs as a texture transform has them. The set must be there.
std::array<Vec2d, 3> transformed_uvs(const mesh::Mesh& mesh, std::size_t triangle,
                                     std::uint32_t uv_set, const mesh::UvTransform& transform);

/// Which image, or which set of UDIM tiles, each material of a source has in a channel, with
/// --source-texture and --source-uv-set applied. What is asked for becomes a column or a tile set
/// of the plan. All references must outlive it. Not thread-safe.
class SourceImages {
 public:
  /// Throws Error(usage) for two source textures of one channel.
  SourceImages(const TransferOptions& options, const mesh::Mesh& source, SourcePlan& plan);

  /// The texture of a material in a channel; nothing: it has none.
  std::optional<mesh::TextureBinding> binding(std::size_t material, Channel channel) const;
  /// Does --source-uv-set name the set through which the material's texture is seen anyway?
  bool is_usual_uv_set(std::size_t material, Channel channel) const;
  /// Is it an image that the mesh file names itself?
  bool is_own(std::uint32_t image) const { return image < source_.images.size(); }
  bool has_uvs(std::size_t triangle, std::uint32_t uv_set) const;

  /// The column of a bound image, which is opened when it is first asked for.
  int column_of(const mesh::TextureBinding& binding);
  /// The tile set that a bound image stands for; -1: it stands for itself. Throws Error(storage)
  /// where no image of the set is there.
  int tile_set_of(const mesh::TextureBinding& binding, Channel channel);

 private:
  int column_for(const mesh::ImageRef& image, mesh::Wrap wrap_u, mesh::Wrap wrap_v,
                 bool heeds_tags);
  const std::map<std::uint32_t, std::set<mesh::UvTile>>& middles(Channel channel);
  std::optional<mesh::ImageRef> set_meant(std::uint32_t index, Channel channel);
  void warn_of_one_tile(const mesh::ImageRef& image, const NamedTile& named, std::size_t tiles,
                        Channel channel);
  bool heeds_tags(std::uint32_t image) const;
  int tile_set_for(const mesh::ImageRef& wanted, std::uint32_t index, Channel channel);
  std::vector<std::uint32_t> entered_udims(Channel channel, std::uint32_t image);
  std::string name_of(Channel channel) const { return channel_name(options_, channel); }

  const TransferOptions& options_;
  const mesh::Mesh& source_;
  SourcePlan& plan_;
  std::vector<mesh::ImageRef> images_;
  std::optional<std::uint32_t> uv_set_;      ///< instead of what the materials say
  std::map<Channel, std::size_t> override_;  ///< by --source-texture: into images_
  std::map<Channel, std::map<std::uint32_t, std::set<mesh::UvTile>>> middles_;
};

}  // namespace pounce::planning
