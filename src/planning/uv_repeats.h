// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "surface/geometry_request.h"

namespace pounce::planning {

/// Adds a warning for each material whose UVs lie over its image so many times that its Gaussians
/// are unreasonably many: each repetition writes all of the image's again. One stray texture
/// coordinate is enough.
void warn_of_repeats(const surface::GeometryRequest& request, std::vector<std::string>& warnings);

}  // namespace pounce::planning
