// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "io/files/asset_file.h"
#include "pounce/options.h"

namespace pounce::io {

/// The format of an image, told by its content alone: "png", "jpeg", "openexr", "tiff", "webp",
/// "hdr", "pnm" (binary), and "bmp" and "targa" where they are allowed. Throws Error(input) for
/// everything else, with how to convert it where it is known.
std::string image_format(ByteSource& bytes, const std::string& path,
                         std::span<const ImageFormat> allowed);

}  // namespace pounce::io
