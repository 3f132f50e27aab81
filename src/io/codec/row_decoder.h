// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/codec/channels.h"
#include "io/codec/image_info.h"
#include "io/files/asset_file.h"
#include "pounce/error.h"

namespace pounce::io {

/// Decodes the rows of one image that is open, from the first to the last, each once: one format's
/// own library behind it. Not thread-safe.
class RowDecoder {
 public:
  RowDecoder() = default;
  virtual ~RowDecoder() = default;
  RowDecoder(const RowDecoder&) = delete;
  RowDecoder& operator=(const RowDecoder&) = delete;

  /// The next `count` rows, tightly packed, as ImageInfo describes them; alpha is as the file has
  /// it. `first` is the number of the first one. Throws Error(input), Error(budget), Error(storage)
  /// as ImageReader does. With the last row everything behind it was checked, too.
  virtual void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) = 0;
};

/// The channels of an EXR that a caller wants.
struct WantedChannels {
  std::string named;              ///< by the user: ImageRef::channels
  std::vector<std::string> data;  ///< these alone, exact: see ImageReader
};

// Each opens the image that `bytes` hold, takes no memory by what a header claims, and fills in
// `info`. What decodes whole alone (decoder_bytes) does so at the first row. `bytes` must outlive
// the decoder. Throws as ImageReader does.

std::unique_ptr<RowDecoder> open_png(ByteSource& bytes, ImageInfo& info);
std::unique_ptr<RowDecoder> open_jpeg(ByteSource& bytes, ImageInfo& info);
std::unique_ptr<RowDecoder> open_webp(ByteSource& bytes, ImageInfo& info);
std::unique_ptr<RowDecoder> open_pnm(ByteSource& bytes, ImageInfo& info);
std::unique_ptr<RowDecoder> open_tiff(ByteSource& bytes, ImageInfo& info);
std::unique_ptr<RowDecoder> open_exr(ByteSource& bytes, const WantedChannels& wanted,
                                     ImageInfo& info);
/// Whichever of these `info.format` names.
std::unique_ptr<RowDecoder> open_here(ByteSource& bytes, const WantedChannels& wanted,
                                      ImageInfo& info);
/// The full names of the channels of all parts of an EXR.
std::vector<std::string> exr_channel_names(ByteSource& bytes);
/// Radiance HDR, BMP and Targa, by the module (foreign/module.h).
std::unique_ptr<RowDecoder> open_foreign(ByteSource& bytes, ImageInfo& info);

// What decoders have in common.

/// Memory that any decoder may take for itself.
inline constexpr std::uint64_t kDecoderBaseBytes = 1U << 20;

/// Throws Error(input) unless each side is 1 to 65536.
void check_size(const std::string& label, std::int64_t width, std::int64_t height);

/// Error(input) of an image whose channels say nothing of which ones are meant.
Error too_many_channels(const std::string& label, const std::vector<std::string>& names);

/// An error text of a library as part of one sentence: no line breaks, no full stop at its end.
std::string one_line(std::string message);

/// Throws Error(input) that calls the image of that label damaged: `what` is not to be had of it,
/// and `why`, if that is known.
[[noreturn]] void refuse_damaged(const std::string& label, const std::string& what,
                                 const std::string& why);

/// The same of a decoder that failed with the message `why`, which may be empty. A disk that failed
/// is Error(storage), a decoder that got no memory Error(budget), `needed_bytes` being what it may
/// take; of one that cannot do what is asked of it the image may be whole.
[[noreturn]] void decoder_failed(const ByteSource& bytes, const std::string& what,
                                 const std::string& why, std::uint64_t needed_bytes);

}  // namespace pounce::io
