// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenImageIO/imageio.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/files/asset_file.h"
#include "io/image/channels.h"
#include "io/image/colour_tags.h"
#include "pounce/options.h"

namespace pounce::io {

/// Tells OpenImageIO once, for the whole process, what it cannot be told per file: that OpenEXR
/// starts no threads of its own (all threads live in flow/), and to accept every image size that
/// pounce accepts. Its own threads are turned off file by file, so the pool of a program that uses
/// it, too, stays as it is. Thread-safe; called before every use of the library.
void set_up_oiio();

/// An error text of OpenImageIO as part of one sentence: no line breaks, no full stop at its end.
std::string one_line(std::string message);

/// Rows asked of a decoder in one call: of a TIFF strip that is asked for whole it would make two
/// copies.
inline constexpr std::uint32_t kMostRowsAtOnce = 64;

/// Rows that the decoder unpacks together: a row of tiles, an EXR block, a TIFF strip; else 1.
std::uint32_t block_rows(const OIIO::ImageSpec& spec, const std::string& format);

/// The most memory that decoding such an image takes beyond the rows handed out. Upper bounds,
/// checked against resident memory by tests/unit/io/test_image_memory.cpp.
std::uint64_t decoder_cost(const OIIO::ImageSpec& spec, const std::string& format,
                           ByteSource& bytes);

/// The same of a JPEG by its width: libjpeg holds a few rows of blocks per component.
std::uint64_t jpeg_row_cost(std::uint64_t width);
/// Of a format that only decodes whole, from a copy of the file.
std::uint64_t whole_cost(std::uint64_t decoded_bytes, const ByteSource& bytes);

// What an image's ImageSpec says.

/// The type of the deepest of these channels' samples.
OIIO::TypeDesc sample_type_of(const OIIO::ImageSpec& spec, const std::vector<int>& places);
/// How deep such samples are. Throws Error(input) if they are none that can be read.
Depth depth_of(const std::string& label, OIIO::TypeDesc type);
/// An EXR's attribute of that name.
void take_chromaticities(const OIIO::ImageSpec& spec, ColourTags& tags);

/// Throws Error(input) that calls the image of that label damaged: `what` is not to be had of it,
/// and `why`, if that is known.
[[noreturn]] void refuse_damaged(const std::string& label, const std::string& what,
                                 const std::string& why);

/// The same of a decoder that failed with the message `why`, which may be empty. One that got no
/// memory is Error(budget), `needed_bytes` being what it may take; of one that cannot do what is
/// asked of it the image may be whole.
[[noreturn]] void decoder_failed(const std::string& label, const std::string& what,
                                 const std::string& why, std::uint64_t needed_bytes);

// The images of an EXR that holds several.

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
