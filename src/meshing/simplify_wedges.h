// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "meshing/wedges.h"

namespace pounce::meshing {

/// Of textures with `edge` texels along their sides: those that more than one triangle lies on.
struct SharedTexels {
  std::uint64_t before = 0, after = 0;
};

/// To at most so many triangles, as far as seams and the layout allow (meshing/collapse.h), in
/// steps of half of them that are fitted each (meshing/fit.h). UVs stay those of the surface.
SharedTexels simplify_fitted(WedgeSurface& surface, std::size_t triangles, std::uint32_t edge,
                             const std::function<void()>& poll);
/// To as few triangles as keep it within about this distance, above 0, and fitted then.
SharedTexels simplify_within(WedgeSurface& surface, double distance, std::uint32_t edge,
                             const std::function<void()>& poll);

}  // namespace pounce::meshing
