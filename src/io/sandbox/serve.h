// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "io/codec/row_decoder.h"

namespace pounce::io {

/// What opens an image: open_here().
using ImageOpener = std::unique_ptr<RowDecoder>(ByteSource& bytes, const WantedChannels& wanted,
                                                ImageInfo& info);

/// Decodes images for the process at the other end of `socket`, one after another, until that is
/// gone; the whole life of the program pounce-decoder. Before it sees a byte of a file it gives up
/// all that decoding does not need: it can open, connect, start and become nothing. Returns the
/// program's exit status. `with_module`: OpenImageIO's formats, too.
int serve_images(int socket, bool with_module, ImageOpener& opener = open_here);

}  // namespace pounce::io
