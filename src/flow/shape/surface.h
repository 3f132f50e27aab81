// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/bounds.h"
#include "core/vec.h"
#include "io/gltf/mesh_writer.h"
#include "meshing/surface.h"
#include "pounce/options.h"
#include "runtime/memory_budget.h"

namespace pounce::flow {

/// The surface of a job's source, and room in the budget for what is made of it.
struct SourceSurface {
  meshing::Surface surface;
  Vec3d origin;  ///< its positions are counted from there
  /// Is every triangle meant? Then a simpler surface is fitted to it. A capture's is rough: there
  /// that changes nothing that can be seen, and takes as long as all else.
  bool is_exact = false;
  io::PlainLook look = {};  ///< of all of it
  runtime::Lease room;
};

/// Of the longest side of what a mesh is made of, in its units: beyond them squares leave the
/// numbers that single precision can tell apart.
constexpr bool is_usable_size(float longest) { return longest >= 1e-15F && longest <= 1e15F; }

/// What was asked for, in units; of a percentage the box's diagonal is all.
inline double length_of(const Length& asked, const Box3f& box) {
  return asked.is_percent ? asked.value / 100 * length(Vec3d(box.hi) - Vec3d(box.lo)) : asked.value;
}

/// What a surface takes with what its steps need beside it: edges, what simplifying holds, charts.
constexpr std::uint64_t surface_bytes(std::uint64_t triangles) { return 250 * triangles; }
/// With the simpler one that is fitted to it, and what its least squares hold.
constexpr std::uint64_t fitting_bytes(std::uint64_t triangles) { return 600 * triangles; }
/// The same where it keeps its UVs, with about as many wedges as places. What has more takes more
/// once that is known (meshing::collapsing_bytes_of).
constexpr std::uint64_t collapsing_bytes(std::uint64_t triangles) { return 800 * triangles; }
/// What charts of so many triangles take while they are unfolded: the sparse systems of the
/// largest.
constexpr std::uint64_t unfolding_bytes(std::uint64_t triangles) { return 2600 * triangles; }
/// What the layouts of all materials may be looked at with, together, of textures of this size.
constexpr std::uint64_t layout_texels(std::uint32_t size) {
  constexpr std::uint64_t kMost = 16ULL << 20;
  const std::uint64_t four_textures = std::uint64_t{4} * size * size;
  return four_textures < kMost ? four_textures : kMost;
}
/// The counts of these, and how they change at once.
constexpr std::uint64_t layout_bytes(std::uint32_t size) { return 4 * layout_texels(size); }

}  // namespace pounce::flow
