// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mesh/block_bins.h"
#include "mesh/mesh.h"
#include "mesh/uv_tiles.h"

namespace pounce::planning {

/// One image of the target, for every channel: a texture set, and one of its UDIM tiles.
struct TargetPage {
  std::string set;                        ///< name of the material; "default" when all share a page
  std::optional<std::uint32_t> material;  ///< index into Mesh::materials, if the set is one
  std::uint32_t udim = mesh::kFirstUdim;  ///< 1001 where the output has no tiles
  /// Its values for the tokens of a file name.
  std::map<std::string, std::string> tokens() const;
};

struct PageRequest {
  bool by_material = false;             ///< a texture set per material, else one for all
  bool by_tile = false;                 ///< UVs outside [0,1) are UDIM tiles, else they wrap
  std::vector<std::uint32_t> selected;  ///< UDIMs to keep, sorted; empty = all
  std::uint32_t uv_set = 0;
};

/// The target's pages in the order they are written, and which triangles they have.
struct TargetPages {
  std::vector<TargetPage> pages;
  std::shared_ptr<const mesh::PageTriangles> triangles;  ///< by page
};

/// Throws Error(input) where nothing would be left to write. What is left out (triangles without
/// UVs, or beyond the UDIM grid) goes to `warnings`.
TargetPages target_pages(const mesh::Mesh& target, const PageRequest& request,
                         std::vector<std::string>& warnings);

using mesh::udim_list;

}  // namespace pounce::planning
