// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "options/row.h"

namespace pounce::options {

// Options of a transfer whose values name channels. What is no channel is a map of the user's own,
// which these rows number in ChannelOptions::other_maps in the order in which they meet it.

Row<TransferOptions> output_for_row();
Row<TransferOptions> channels_row();
Row<TransferOptions> source_texture_row();
/// --color, or else --data.
Row<TransferOptions> map_kind_row(bool is_colour);
Row<TransferOptions> source_space_row();

}  // namespace pounce::options
