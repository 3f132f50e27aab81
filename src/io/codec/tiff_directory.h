// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/codec/guard.h"

namespace pounce::io {

enum TiffTag : std::uint16_t {
  kWidth = 256,
  kHeight = 257,
  kBits = 258,
  kCompression = 259,
  kPhotometric = 262,
  kFillOrder = 266,
  kFaxOptions = 292,
  kFax4Options = 293,
  kStripOffsets = 273,
  kSamples = 277,
  kStripRows = 278,
  kStripBytes = 279,
  kPlanes = 284,
  kPredictor = 317,
  kColourMap = 320,
  kTileWidth = 322,
  kTileHeight = 323,
  kTileOffsets = 324,
  kTileBytes = 325,
  kInkSet = 332,
  kExtraSamples = 338,
  kSampleFormat = 339,
  kJpegTables = 347,
  kSubsampling = 530,
  kMatteing = 32995,
  kIccProfile = 34675,
};

enum TiffType : std::uint16_t { kShort = 3, kLong = 4, kLong8 = 16 };

struct TiffField {
  std::uint16_t tag = 0, type = 0;
  std::uint64_t count = 0;
  std::uint64_t place = 0, size_bytes = 0;  ///< of the field itself
  std::uint64_t data = 0;                   ///< where its values are

  /// Of one value; 1 where the type is not known.
  std::uint64_t value_bytes() const {
    constexpr std::array<std::uint8_t, 19> kBytes{1, 1, 1, 2, 4, 8, 1, 1, 2, 4,
                                                  8, 4, 8, 4, 1, 1, 8, 8, 8};
    return type < kBytes.size() ? kBytes[type] : 1;
  }
  std::uint64_t data_bytes() const {
    return count > UINT64_MAX / 8 ? UINT64_MAX : count * value_bytes();
  }
};

/// A directory of a TIFF, classic or big, of either byte order, and what its fields say. Whatever
/// is wrong with it throws Error(input) naming the file.
class TiffDirectory {
 public:
  /// The one at `place`, or the first.
  explicit TiffDirectory(ByteSource& bytes, std::optional<std::uint64_t> place = std::nullopt);

  /// The place of the one that follows; 0: none does.
  std::uint64_t next();
  [[noreturn]] void refuse(const std::string& why) const { at_.refuse(why); }
  Cursor& at() { return at_; }

  /// A field of that tag; null if there is none. Two of them are damage: decoders differ in which
  /// one they take.
  const TiffField* find(std::uint16_t tag) const;
  /// The same, and from here on it is shown.
  const TiffField* use(std::uint16_t tag);
  /// All values of a field of whole numbers, of which there are `count`.
  std::vector<std::uint64_t> numbers(const TiffField& field, std::uint64_t count);
  /// The one value of a field, or what stands for a missing one.
  std::uint64_t number(std::uint16_t tag, std::uint64_t fallback);
  std::uint64_t needed(std::uint16_t tag, std::string_view what);
  /// A field with a value per sample, all alike. Writers of one value mean all samples, and so does
  /// libtiff.
  std::uint64_t of_all_samples(std::uint16_t tag, std::uint64_t samples, std::uint64_t fallback);

  /// A directory of the used fields alone in the place of this one. Everything else keeps its
  /// place.
  void show_used();

 private:
  std::size_t count_bytes() const { return big_ ? 8 : 2; }
  std::size_t word_bytes() const { return big_ ? 8 : 4; }

  Cursor at_;
  bool big_ = false;  ///< 64-bit offsets
  std::uint64_t place_ = 0, end_ = 0;
  std::vector<TiffField> fields_;
  std::vector<std::uint16_t> used_;
};

/// How many levels a TIFF holds: its first image and those that follow it, each half as large as
/// the one before, rounded either way. `bytes` are all of the file's, before hide_metadata().
/// Damage counts as the end: it is for the decoder to say.
std::uint32_t tiff_levels(ByteSource& bytes);

}  // namespace pounce::io
