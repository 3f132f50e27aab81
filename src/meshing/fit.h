// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>

#include "meshing/surface.h"

namespace pounce::meshing {

/// Moves the vertices of a surface that was simplified to where its triangles lie nearest to the
/// dense one, by least squares over the dense one's vertices, each at the nearest point that faces
/// as it does. An edge collapse leaves vertices on the dense surface, and triangles within what
/// bulges; after this they lie on both sides of it. Vertices on a border stay, and so do those of
/// triangles that would turn over. `poll` is called often and may throw.
void fit(
    Surface& simplified, const Surface& dense, int rounds,
    const std::function<void()>& poll = [] {});

/// To at most so many triangles, as far as its shape allows, in steps of half of them that are
/// fitted each: the next step then knows where the surface is.
void simplify_fitted(Surface& surface, std::size_t triangles, const std::function<void()>& poll);

}  // namespace pounce::meshing
