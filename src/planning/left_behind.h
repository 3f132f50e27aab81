// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "planning/plan.h"

namespace pounce::planning {

/// One line of bounded length: what the materials that take part have and no output will have, by
/// its name in the file, with the images: textures that no channel takes, channels that nobody
/// chose, vertex colours. Empty: nothing. Channels that are left out by name are not missed.
std::string not_transferred(const TransferOptions& options, const SourcePlan& plan,
                            const mesh::Mesh& source);

/// In a line, of an output of images: the channels whose textures have factors, and whether these
/// are applied. Empty: none has.
std::string factors_note(const TransferOptions& options, const SourcePlan& plan,
                         const mesh::Mesh& source);

}  // namespace pounce::planning
