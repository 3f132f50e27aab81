// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "flow/plan/plan.h"

namespace pounce::flow {

/// One line of bounded length: what the materials that take part have and no output will have, by
/// its name in the file, with the images: textures that no channel takes, channels that nobody
/// chose, vertex colours. Empty: nothing. Channels that are left out by name are not missed.
std::string not_transferred(const TransferOptions& options, const Plan& plan,
                            const mesh::Mesh& source);

/// Factors that an image cannot hold; a model has them.
std::vector<std::string> left_behind(const Plan& plan, const mesh::Mesh& source, bool is_model);

}  // namespace pounce::flow
