// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/vec.h"
#include "meshing/surface.h"
#include "runtime/memory_budget.h"

namespace pounce::flow {

/// The surface of a job's source, and room in the budget for what is made of it.
struct SourceSurface {
  meshing::Surface surface;
  Vec3d origin;  ///< its positions are counted from there
  /// Is every triangle meant? Then a simpler surface is fitted to it. A capture's is rough: there
  /// that changes nothing that can be seen, and takes as long as all else.
  bool is_exact = false;
  runtime::Lease room;
};

/// Of the longest side of what a mesh is made of, in its units: beyond them squares leave the
/// numbers that single precision can tell apart.
constexpr bool is_usable_size(float longest) { return longest >= 1e-15F && longest <= 1e15F; }

/// What a surface takes with what its steps need beside it: edges, what simplifying holds, charts.
constexpr std::uint64_t surface_bytes(std::uint64_t triangles) { return 250 * triangles; }
/// With the simpler one that is fitted to it, and what its least squares hold.
constexpr std::uint64_t fitting_bytes(std::uint64_t triangles) { return 600 * triangles; }
/// What charts of so many triangles take while they are unfolded: the sparse systems of the
/// largest.
constexpr std::uint64_t unfolding_bytes(std::uint64_t triangles) { return 2600 * triangles; }

}  // namespace pounce::flow
