// SPDX-License-Identifier: Apache-2.0
//
// Binary PNM: grey (P5) or RGB (P6) of 8 or 16 bits, the first of the file's images.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "io/codec/row_decoder.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// The text before the picture: "P6 width height largest" and one white space, with comments from #
/// to the end of a line.
class PnmHeader {
 public:
  explicit PnmHeader(ByteSource& bytes) : bytes_(bytes) { next(); }

  int next() {
    if (at_ == count_) {
      position_ += count_;
      count_ = bytes_.read_at(position_, window_.data(), window_.size());
      at_ = 0;
    }
    return last_ = at_ < count_ ? static_cast<unsigned char>(window_[at_++]) : -1;
  }
  /// The next number, and one byte behind it; 0 if there is none.
  std::uint32_t number() {
    while (last_ == '#' || is_white(last_)) {
      const bool comment = last_ == '#';
      while (comment && last_ != '\n' && last_ >= 0) next();
      next();
    }
    std::uint32_t value = 0;
    for (; last_ >= '0' && last_ <= '9'; next()) {
      if (value > 9'999'999) return 0;
      value = value * 10 + static_cast<std::uint32_t>(last_ - '0');
    }
    return is_white(last_) || last_ == '#' ? value : 0;
  }
  /// Behind the byte read last.
  std::uint64_t position() const { return position_ + at_; }

 private:
  static bool is_white(int c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

  ByteSource& bytes_;
  std::array<char, 4096> window_;
  std::uint64_t position_ = 0;
  std::size_t at_ = 0, count_ = 0;
  int last_ = -1;
};

class PnmDecoder : public RowDecoder {
 public:
  PnmDecoder(ByteSource& bytes, ImageInfo& info);
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) override;

 private:
  ByteSource& bytes_;
  std::uint32_t largest_ = 0;  ///< sample
  std::uint64_t row_bytes_ = 0;
  std::uint64_t begin_ = 0;  ///< of the first row
};

PnmDecoder::PnmDecoder(ByteSource& bytes, ImageInfo& info) : bytes_(bytes) {
  PnmHeader header(bytes);
  info.channels = header.next() == '6' ? 3 : 1;
  header.next();
  for (std::uint32_t* number : {&info.width, &info.height, &largest_}) *number = header.number();
  begin_ = header.position();
  bytes.check();
  if (info.width == 0 || info.height == 0 || largest_ == 0 || largest_ > 65535) {
    throw Error(
        ErrorKind::input,
        bytes.label() + ": the image header cannot be read; the PNM is damaged or truncated");
  }
  info.depth = largest_ > 255 ? Depth::u16 : Depth::u8;
  info.names = usual_names(info.channels, false);
  row_bytes_ = std::uint64_t{info.width} * info.channels * (largest_ > 255 ? 2 : 1);
  const std::uint64_t end = begin_ + row_bytes_ * info.height;
  if (end > bytes.size_bytes()) {
    throw Error(
        ErrorKind::input,
        fmt::format(
            "{}: the PNM is truncated: its image data end at byte {}, the file ends at byte {}",
            bytes.label(), end, bytes.size_bytes()));
  }
  check_size(bytes.label(), info.width, info.height);
}

/// Native endian, scaled to the whole range.
void PnmDecoder::read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) {
  const std::size_t size = static_cast<std::size_t>(row_bytes_ * count);
  bytes_.read_at(begin_ + row_bytes_ * first, rows, size);
  bytes_.check();
  const bool wide = largest_ > 255;
  const std::uint32_t full = wide ? 65535 : 255;
  if (!wide && largest_ == full) return;
  for (std::size_t i = 0; i < size; i += wide ? 2 : 1) {
    const auto high = static_cast<std::uint32_t>(rows[i]);
    const std::uint32_t stored = wide ? high << 8 | static_cast<std::uint32_t>(rows[i + 1]) : high;
    // 65535 * 65535 + 32767 fits.
    const std::uint32_t value = (std::min(stored, largest_) * full + largest_ / 2) / largest_;
    if (wide) {
      const auto sample = static_cast<std::uint16_t>(value);
      std::memcpy(rows + i, &sample, sizeof sample);
    } else {
      rows[i] = static_cast<std::byte>(value);
    }
  }
}

}  // namespace

std::unique_ptr<RowDecoder> open_pnm(ByteSource& bytes, ImageInfo& info) {
  return std::make_unique<PnmDecoder>(bytes, info);
}

}  // namespace pounce::io
