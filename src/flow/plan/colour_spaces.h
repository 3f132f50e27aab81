// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "flow/plan/plan.h"

namespace pounce::flow {

/// Throws Error(usage) for names of colour spaces that are not known, and for spaces that the
/// output's format cannot hold.
void check_colour_spaces(const TransferOptions& options);

/// What --source-colorspace says of a channel; nothing for data.
std::optional<ColourSpace> given_space(const TransferOptions& options, Channel channel);

/// What a channel's image holds: as the options say, else as its file says.
ColourSpace space_of(const TransferOptions& options, Channel channel, const ColumnPlan& column);

/// Decides the output's primaries and whether it is linear light, and what its file says of them:
/// the source's, or what is painted onto, or what its format needs. `notes` tell conversions.
void choose_space(const TransferOptions& options, const SourceLook& look,
                  const std::optional<io::ImageInfo>& onto, ChannelPlan& plan,
                  std::vector<std::string>& notes);

/// How an image of that space becomes the output; nothing where its samples mean what is `usual`
/// for their depth and have the output's primaries.
std::optional<texture::ColourInput> colour_input(const ColourSpace& space, bool usual_linear,
                                                 const ChannelPlan& plan);

}  // namespace pounce::flow
