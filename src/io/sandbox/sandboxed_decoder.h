// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/codec/row_decoder.h"
#include "pounce/options.h"

namespace pounce::io {

/// Is an image of this format decoded in a process of its own?
bool is_sandboxed(const std::string& format, Sandbox mode);

/// Opens the image there (DecoderProcess). Null where there is no such process to be had and `mode`
/// does not insist; then the caller decodes it here. Throws as the openers in row_decoder.h, and
/// Error(storage) where `mode` insists.
std::unique_ptr<RowDecoder> open_sandboxed(ByteSource& bytes, const WantedChannels& wanted,
                                           Sandbox mode, ImageInfo& info);
/// See exr_channel_names(); nothing where open_sandboxed() would be null.
std::optional<std::vector<std::string>> list_sandboxed(ByteSource& bytes, Sandbox mode);

}  // namespace pounce::io
