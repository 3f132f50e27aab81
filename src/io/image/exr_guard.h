// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "io/files/asset_file.h"

namespace pounce::io {

/// Checks what OpenEXR takes from a file without a look of its own: how much room it makes, and
/// that the first block of each part decodes to all of the texels that are handed out. Throws
/// Error(input). Returns what it makes room for when it opens the file, beside the decoder of the
/// part that is read: of a file in several parts a block of each, read or not.
std::uint64_t guard_exr(ByteSource& bytes);

}  // namespace pounce::io
