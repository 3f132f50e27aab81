// SPDX-License-Identifier: Apache-2.0
//
// What a geometry pack says, compared with what it may say.
//
// A cache may be written by others. A checksum tells that bytes are those that somebody wrote, not
// that pounce wrote them; so every field that becomes an index, a size or a count is held against
// what the job knows, here and before it is used. Legal values: docs/tile-format.md.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mesh/lattice.h"
#include "store/blocks/geometry_block.h"

namespace pounce::store {

struct BlockEntry;
struct GeometryDirectory;
struct TileEntry;

/// What a job knows of a geometry pack before it has seen it.
struct GeometryFacts {
  bool is_target = false;
  std::vector<mesh::Lattice> pages;
  std::uint64_t triangles = 0;    ///< of the mesh
  std::uint64_t most_blocks = 0;  ///< that it may have
  bool has_colours = false;       ///< of vertices
};

/// Each throws Error(damaged_store) that begins with `name`.
void check(const GeometryDirectory& directory, const GeometryFacts& facts, const std::string& name);
void check(const std::vector<BlockEntry>& entries, const GeometryDirectory& directory,
           const GeometryFacts& facts, const std::string& name);
void check(const GeometryBlock& block, const BlockEntry& entry, const GeometryFacts& facts,
           const std::string& name);

}  // namespace pounce::store
