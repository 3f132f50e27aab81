// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "flow/plan/plan.h"

namespace pounce::flow {

/// What the source has and no output will have, a line per kind: textures that no channel takes,
/// factors that an image cannot hold (a model has them), vertex colours.
std::vector<std::string> left_behind(const Plan& plan, const mesh::Mesh& source, bool is_model);

}  // namespace pounce::flow
