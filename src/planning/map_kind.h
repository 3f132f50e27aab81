// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "pounce/options.h"

namespace pounce::planning {

/// Whether a map of this name usually is colour (diffuse, specular, ...) or data (displacement,
/// mask, ...), whatever the case of its letters and with or without - and _. Nothing: the name says
/// neither.
std::optional<bool> usually_colour(const std::string& name);

/// Data is never converted between sRGB coding and linear light. A map whose name says nothing is
/// data.
bool is_colour(const TransferOptions& options, Channel channel);

}  // namespace pounce::planning
