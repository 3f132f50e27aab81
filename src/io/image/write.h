// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/begun_work.h"
#include "core/colour_space.h"
#include "core/file.h"
#include "io/codec/image_info.h"
#include "pounce/options.h"

namespace pounce::io {

class EncodedBlocks;
class OutputFile;

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

/// Writes an image top to bottom in strips of rows in bounded memory. Until commit() the bytes have
/// no name, or where the file system cannot do that a hidden temporary one beside `path`, which the
/// destructor removes. The same samples give the same bytes, whenever and wherever they are
/// written. PNG: deflate at a level that keeps pace with the projection. JPEG: quality 95, 4:4:4.
/// TIFF: deflate, strips. EXR: zip, scanlines. Both may be in tiles. Throws Error(usage) for what
/// why_not_writable() names, Error(storage) with path and reason. Not thread-safe.
class ImageWriter {
 public:
  /// `begin_work` begins what can be encoded beside all else (blocks of a PNG); the bytes are the
  /// same with any.
  /// Of a PNG `known` remembers what blocks were encoded to; it may be null, and must outlive the
  /// writer.
  ImageWriter(const std::string& path, const ImageWriteSpec& spec, BeginWork begin_work = work_here,
              EncodedBlocks* known = nullptr);
  /// As PNG at the end of `sink`, which must outlive the writer; commit() only ends the image.
  ImageWriter(WriteFile& sink, const ImageWriteSpec& spec, BeginWork begin_work = work_here,
              EncodedBlocks* known = nullptr);
  ~ImageWriter();
  ImageWriter(ImageWriter&&) noexcept;
  ImageWriter& operator=(ImageWriter&&) noexcept;

  void write_rows(std::uint32_t row_count, const std::byte* rows);
  /// All rows of this level were written: those of the next follow, half as wide and high (rounded
  /// down, at least 1).
  void next_level();
  /// All rows were written: returns the file, complete and closed, for whoever commits it (on any
  /// thread). Null: the image is at the end of its sink.
  std::unique_ptr<OutputFile> finish();
  /// finish(), and the file is committed.
  void commit();
  /// Memory the encoder holds beyond the rows handed over, for the budget.
  static std::uint64_t encoder_bytes(const std::string& path, const ImageWriteSpec& spec);
  /// The most that `known` gets for one block; 0: this format has none.
  static std::uint64_t encoded_block_bytes(const std::string& path, const ImageWriteSpec& spec);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pounce::io
