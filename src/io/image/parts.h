// SPDX-License-Identifier: Apache-2.0
//
// The images of an EXR that holds several.
#pragma once

#include <OpenImageIO/imageio.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/image/channels.h"

namespace pounce::io {

/// All of them, up to 1024. The decoder stands at the first one, before and after.
std::vector<Part> parts_of(OIIO::ImageInput& input);
/// The full names of their channels.
std::vector<std::string> names_of(std::span<const Part> parts);
/// How many levels this one has. The decoder stands at its first one afterwards.
std::uint32_t levels_of(OIIO::ImageInput& input, int part);
/// What the user wants of them: named_channels(). Throws Error(input), naming what there is, if
/// none has it. `label` is the file's.
ChosenPart wanted_part(const std::string& label, const std::vector<Part>& parts,
                       const std::string& wanted);

}  // namespace pounce::io
