// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "io/codec/colour_config.h"
#include "io/codec/row_decoder.h"

// What the module is made of.
namespace pounce::io {

/// Radiance HDR, BMP and Targa by OpenImageIO. See RowDecoder.
std::unique_ptr<RowDecoder> open_by_oiio(ByteSource& bytes, ImageInfo& info);

/// See ColourConfig::load().
std::unique_ptr<const ColourConfig> load_ocio_config(const std::string& path, bool allow_external,
                                                     std::uint64_t most_bytes);

}  // namespace pounce::io
