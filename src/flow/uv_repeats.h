// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "flow/build_stores.h"

namespace pounce::flow {

/// Adds a warning for each material whose UVs lie over its image so many times that the source
/// becomes unreasonably large: each repetition costs what the image costs. One stray texture
/// coordinate is enough.
void warn_of_repeats(const GeometryRequest& request, const std::string& channel,
                     std::vector<std::string>& warnings);

}  // namespace pounce::flow
