// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "io/files/asset_file.h"

namespace pounce::io {

/// How many levels a TIFF holds: its first image and those that follow it, each half as large as
/// the one before, rounded either way. `bytes` are all of the file's, before hide_metadata().
/// Damage counts as the end: it is for the decoder to say.
std::uint32_t tiff_levels(ByteSource& bytes);

}  // namespace pounce::io
