// SPDX-License-Identifier: Apache-2.0
//
// A hit map as a source, which has its target in it: `pounce apply`.
//
// A map says where each texel's ray met which material; what that material is (wrap modes, UV sets,
// factors, which UDIM tiles it enters) stands in a note in its header. Both together are all that a
// transfer knows of two meshes once the search is done.
//
// So the rest of the job is that of a transfer, with two small meshes instead of the real ones: a
// triangle for each material and UDIM tile of the source, a square for each image of the target.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mesh/lattice.h"
#include "mesh/mesh.h"
#include "planning/mesh_planning.h"
#include "pounce/options.h"

namespace pounce::planning {

/// What a map's note says of the source.
struct MapNote {
  struct Material {
    mesh::Material material;           ///< of its textures the images are not known
    bool is_used = false;              ///< by some triangle
    mesh::Lattice lattice;             ///< that its hits lie on; 0 x 0: they have no place
    std::vector<std::uint32_t> udims;  ///< tiles of UV space that its triangles enter
  };
  ImageSize size;  ///< of the map's images
  std::vector<Material> materials;
  std::size_t pages = 0;                ///< that hits are on: the materials, perhaps twice
  std::optional<std::uint32_t> uv_set;  ///< --source-uv-set
  bool has_colours = false;             ///< do the source's vertices have some?
  double max_distance = 0;              ///< of the search, in the target's units
};

/// The note of a pass's map, as text; with_distance() adds what is known for a target.
std::string map_note(const MeshPlanning& planning, const PassPlan& pass);
std::string with_distance(const std::string& note, double max_distance);

/// The images of a map, all of one search.
struct KnownMap {
  struct Page {
    std::uint32_t udim = mesh::kFirstUdim;
    std::string path;
  };
  std::string pattern;
  std::vector<Page> pages;  ///< by rising UDIM
  ImageSize size;
  std::uint64_t decoder_bytes = 0;  ///< of the image whose decoder needs most
  MapNote note;
};

/// Is this source a hit map?
bool is_hit_map(const std::string& path);

/// Reads the headers of a map's images. Throws Error(storage) if there is none, Error(input) for
/// what is no map, or no longer whole, or of another search than the first.
KnownMap read_known_map(const std::string& pattern, const ImageTrust& trust = {});

/// Stands for the source.
mesh::Mesh map_source(const KnownMap& map, const TransferOptions& options);
/// Throws Error(input), or Error(usage), for a channel of the plan that the map has no places for.
void check_map_channels(const KnownMap& map, const TransferOptions& options,
                        const SourcePlan& plan);
/// Stands for the target.
mesh::Mesh map_target(const KnownMap& map);
/// The options of the transfer that paints through a map: its size, its target, its search. What
/// they do not say is what is usual for maps.
TransferOptions apply_options(const KnownMap& map, TransferOptions options);

}  // namespace pounce::planning
