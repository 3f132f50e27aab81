// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "io/files/byte_source.h"

namespace pounce::io {

/// Checks what OpenEXR takes from a file without a look of its own: how much room it makes, and
/// that the first block of each part decodes to all of the texels that are handed out. Throws
/// Error(input).
void guard_exr(ByteSource& bytes);

}  // namespace pounce::io
