// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/colour_space.h"
#include "io/codec/channels.h"
#include "io/codec/colour_tags.h"
#include "pounce/options.h"

namespace pounce::io {

/// What an image file says of itself.
struct ImageInfo {
  std::uint32_t width = 0, height = 0;
  std::uint32_t channels = 0;  ///< 1..4, or as many as were named; palettes are expanded
  Depth depth = Depth::u8;     ///< below 8 bits per sample: u8, scaled to 0..255
  bool linear = false;     ///< a format's usual: float samples are linear light, others sRGB-coded
  bool has_alpha = false;  ///< the last channel is straight (unassociated) alpha
  bool premultiplied = false;         ///< the file holds colours times alpha (EXR always does)
  std::string format;                 ///< "png", "jpeg", "openexr", "tiff", ...
  std::vector<std::string> names;     ///< of the channels: "R", "G", "B", "disp"
  std::vector<std::string> left_out;  ///< the names of the file's other channels
  ColourTags colours;                 ///< what the file says of its colour space
  std::uint32_t tile_width = 0, tile_height = 0;  ///< what the file keeps together; 0: rows
  std::uint32_t levels = 1;                       ///< itself and its smaller ones in the file
  /// Memory that the decoder itself needs beyond the rows handed out: small where the file decodes
  /// by rows, the whole image where it only decodes whole (interlaced PNG, progressive JPEG, WebP).
  std::uint64_t decoder_bytes = 0;
  /// Of an EXR that is a hit map: what pounce wrote there to read it again. Untrusted.
  std::string hits_note;

  /// What its colours are, by what the file says and what is usual where it says nothing.
  ColourSpace space() const {
    return {colours.primaries.value_or(kRec709), colours.linear.value_or(linear)};
  }
};

/// What to write. Samples handed over are in `depth`, row-major, tightly packed, native endian. EXR
/// stores colours premultiplied, so they are multiplied by alpha when written (where alpha is 0 the
/// colour is lost).
struct ImageWriteSpec {
  std::uint32_t width = 0, height = 0;
  std::uint32_t channels = 0;  ///< 1..4; of an EXR with names, any number
  Depth depth = Depth::u8;
  bool linear = false;         ///< samples are scene-linear: tagged so where the format can say it
  bool has_alpha = false;      ///< the last channel is straight alpha
  bool premultiplied = false;  ///< EXR, levels: colours come multiplied by alpha already
  /// EXR only: what the channels are called; empty: usual_names().
  std::vector<std::string> names = {};
  /// Primaries that the file is to name: EXR in an attribute, the others by an ICC profile.
  std::optional<Chromaticities> chromaticities = {};
  bool tagged = true;  ///< false: what the samples are, sRGB or else, is not said
  /// With levels (EXR, TIFF in tiles) all smaller ones follow (ImageWriter::next_level), with the
  /// attributes of a texture by maketx, and colours are stored times alpha, in TIFF too.
  ImageLayout layout = {};
  /// Hash of the job that makes it: recorded, as the software's name always is.
  std::string job = {};
  std::string hits_note = {};  ///< EXR only: see ImageInfo
};

}  // namespace pounce::io
