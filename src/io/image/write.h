// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/colour_space.h"
#include "core/file.h"
#include "io/image/channels.h"
#include "pounce/options.h"

namespace pounce::io {

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

/// Does the ending of `path` name a format that images are written in?
bool is_image_path(const std::string& path);
/// Can the format of `path` (by its ending) hold this? Returns "" or a sentence that says what it
/// can hold.
std::string why_not_writable(const std::string& path, const ImageWriteSpec& spec);
/// "" or a sentence that says which compressions there are: those of EXR that lose nothing.
std::string why_no_exr_compression(const std::string& name);
/// Is it called .tx: tiles and levels, a TIFF or, of halves, an EXR?
bool is_tx_path(const std::string& path);
/// Are samples of this depth written as EXR into a file of this name: .exr, and .tx of halves?
bool is_exr(const std::string& path, Depth depth);

/// What a format can say of an image's channels: that of this name and depth.
struct FormatLook {
  std::string name;        ///< "PNG"
  bool data = false;       ///< two or four channels without alpha
  bool annotated = false;  ///< names of channels
  bool tiled = false;      ///< can hold tiles and levels
};
FormatLook format_look(const std::string& path, Depth depth);
/// The nearest depth that the format of `path` can hold (png: u8/u16; jpeg: u8; exr: half/float;
/// tiff: all).
Depth writable_depth(const std::string& path, Depth wanted);

/// Calls `one` with 0 to count - 1 and returns when all calls have: on one thread or on several.
/// What a call throws it throws.
using ForEach = std::function<void(std::size_t count, const std::function<void(std::size_t)>& one)>;
/// One after another.
void one_by_one(std::size_t count, const std::function<void(std::size_t)>& one);

/// Writes an image top to bottom in strips of rows in bounded memory. Until commit() the bytes have
/// no name, or where the file system cannot do that a hidden temporary one beside `path`, which the
/// destructor removes. The same samples give the same bytes, whenever and wherever they are
/// written. PNG: deflate at a level that keeps pace with the projection. JPEG: quality 95, 4:4:4.
/// TIFF: deflate, strips. EXR: zip, scanlines. Both may be in tiles. Throws Error(usage) for what
/// why_not_writable() names, Error(storage) with path and reason. Not thread-safe.
class ImageWriter {
 public:
  /// `for_each` runs what can be encoded at the same time (blocks of a PNG); the bytes are the same
  /// with any.
  ImageWriter(const std::string& path, const ImageWriteSpec& spec, ForEach for_each = one_by_one);
  /// As PNG at the end of `sink`, which must outlive the writer; commit() only ends the image.
  ImageWriter(WriteFile& sink, const ImageWriteSpec& spec, ForEach for_each = one_by_one);
  ~ImageWriter();
  ImageWriter(ImageWriter&&) noexcept;
  ImageWriter& operator=(ImageWriter&&) noexcept;

  void write_rows(std::uint32_t row_count, const std::byte* rows);
  /// All rows of this level were written: those of the next follow, half as wide and high (rounded
  /// down, at least 1).
  void next_level();
  /// Flushes, fsyncs, renames, fsyncs the folder. All rows must have been written.
  void commit();
  /// Memory the encoder holds beyond the rows handed over, for the budget.
  static std::uint64_t encoder_bytes(const std::string& path, const ImageWriteSpec& spec);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pounce::io
