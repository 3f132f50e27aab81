// SPDX-License-Identifier: Apache-2.0
//
// WebP by libwebp, which wants the whole file and gives the whole picture: both are counted, and
// taken at the first row. Of an animation the first frame is read.
#include <fmt/format.h>
#include <webp/decode.h>
#include <webp/demux.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "io/codec/guard.h"
#include "io/codec/row_decoder.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

class WebpDecoder : public RowDecoder {
 public:
  WebpDecoder(ByteSource& bytes, ImageInfo& info);
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) override;

 private:
  void read_profile(std::span<const std::uint8_t> head, ImageInfo& info);
  PageVector<std::uint8_t> picture() const;
  void decode();
  void decode_frame(std::span<const std::uint8_t> frame, std::uint64_t x, std::uint64_t y,
                    std::uint64_t width, std::uint64_t height);

  ByteSource& bytes_;
  WebPBitstreamFeatures features_{};
  std::uint64_t height_ = 0, decoder_bytes_ = 0;
  std::size_t texel_bytes_ = 3, row_bytes_ = 0;
  PageVector<std::uint8_t> whole_;
};

WebpDecoder::WebpDecoder(ByteSource& bytes, ImageInfo& info) : bytes_(bytes) {
  std::array<std::uint8_t, 4096> head;
  const std::size_t got = bytes.read_at(0, head.data(), head.size());
  bytes.check();
  if (WebPGetFeatures(head.data(), got, &features_) != VP8_STATUS_OK)
    refuse_damaged(bytes.label(), "the image header cannot be read", "");
  check_size(bytes.label(), features_.width, features_.height);
  info.width = static_cast<std::uint32_t>(features_.width);
  info.height = static_cast<std::uint32_t>(features_.height);
  info.has_alpha = features_.has_alpha != 0;
  info.channels = info.has_alpha ? 4 : 3;
  info.names = usual_names(info.channels, info.has_alpha);
  height_ = info.height;
  texel_bytes_ = info.channels;
  row_bytes_ = texel_bytes_ * info.width;
  // libwebp keeps all texels of a lossless one in four bytes, and 17 rows more; of others some rows
  // and, of their alpha, a plane.
  constexpr int kLossy = 1;
  const std::uint64_t width = info.width;
  const bool is_by_rows = features_.format == kLossy && !info.has_alpha;
  const std::uint64_t working = width * (is_by_rows ? 128 : (height_ + 17) * 5);
  info.decoder_bytes = decoder_bytes_ =
      kDecoderBaseBytes + working + row_bytes_ * height_ + bytes.size_bytes();
  read_profile({head.data(), got}, info);
}

/// A profile follows the extended header.
void WebpDecoder::read_profile(std::span<const std::uint8_t> head, ImageInfo& info) {
  constexpr std::size_t kExtended = 12, kNext = 30;
  const auto is = [&](std::size_t at, const char* name) {
    return at + 8 <= head.size() && std::memcmp(head.data() + at, name, 4) == 0;
  };
  if (!is(kExtended, "VP8X") || !is(kNext, "ICCP")) return;
  std::uint32_t size = 0;
  for (std::size_t i = 0; i < 4; ++i) size |= std::uint32_t{head[kNext + 4 + i]} << 8 * i;
  if (size > kMostColourBytes) return;
  std::vector<std::byte> profile(size);
  if (bytes_.read_at(kNext + 8, profile.data(), size) != size) return;
  std::vector<ColourPiece> colours;
  add_piece("ICC", profile, colours);
  info.colours = read_colour_tags(colours);
}

void WebpDecoder::decode_frame(std::span<const std::uint8_t> frame, std::uint64_t x,
                               std::uint64_t y, std::uint64_t width, std::uint64_t height) {
  WebPDecoderConfig config;
  WebPInitDecoderConfig(&config);
  config.output.colorspace = texel_bytes_ == 4 ? MODE_RGBA : MODE_RGB;
  config.output.is_external_memory = 1;
  WebPRGBABuffer& out = config.output.u.RGBA;
  out.rgba = whole_.data() + y * row_bytes_ + x * texel_bytes_;
  out.stride = static_cast<int>(row_bytes_);
  out.size = (height - 1) * row_bytes_ + width * texel_bytes_;
  const VP8StatusCode status = WebPDecode(frame.data(), frame.size(), &config);
  if (status == VP8_STATUS_OUT_OF_MEMORY)
    decoder_failed(bytes_, "decoding failed", "out of memory", decoder_bytes_);
  if (status != VP8_STATUS_OK) refuse_damaged(bytes_.label(), "decoding failed", "");
}

/// The file without what is no picture: chunks of (type, length, data), padded to even lengths.
PageVector<std::uint8_t> WebpDecoder::picture() const {
  constexpr std::array<std::string_view, 6> kPicture{"VP8 ", "VP8L", "VP8X",
                                                     "ALPH", "ANIM", "ANMF"};
  constexpr std::uint64_t kHead = 12;
  PageVector<std::uint8_t> file(kHead);
  bytes_.read_at(0, file.data(), kHead);
  std::array<char, 8> head;
  for (std::uint64_t at = kHead; bytes_.read_at(at, head.data(), head.size()) == head.size();) {
    std::uint64_t size = 0;
    for (std::size_t i = 0; i < 4; ++i)
      size |= std::uint64_t{static_cast<std::uint8_t>(head[4 + i])} << 8 * i;
    const std::uint64_t end = std::min(at + head.size() + (size + 1) / 2 * 2, bytes_.size_bytes());
    if (std::find(kPicture.begin(), kPicture.end(), std::string_view(head.data(), 4)) !=
        kPicture.end()) {
      const std::size_t had = file.size();
      file.resize(had + (end - at));
      bytes_.read_at(at, file.data() + had, end - at);
    }
    at = end;
  }
  bytes_.check();
  const std::uint64_t size = file.size() - 8;  // what follows the length
  for (std::size_t i = 0; i < 4; ++i) file[4 + i] = static_cast<std::uint8_t>(size >> 8 * i);
  return file;
}

void WebpDecoder::decode() {
  const PageVector<std::uint8_t> file = picture();
  whole_.assign(row_bytes_ * height_, 0);
  const std::span<const std::uint8_t> data(file);
  const auto width = static_cast<std::uint64_t>(features_.width);
  if (features_.has_animation == 0) return decode_frame(data, 0, 0, width, height_);
  const WebPData all{data.data(), data.size()};
  const std::unique_ptr<WebPDemuxer, void (*)(WebPDemuxer*)> frames(WebPDemux(&all),
                                                                    WebPDemuxDelete);
  WebPIterator frame{};
  if (!frames || WebPDemuxGetFrame(frames.get(), 1, &frame) == 0)
    refuse_damaged(bytes_.label(), "the first frame of the animation cannot be read", "");
  const std::unique_ptr<WebPIterator, void (*)(WebPIterator*)> held(&frame,
                                                                    WebPDemuxReleaseIterator);
  const auto x = static_cast<std::uint64_t>(frame.x_offset);
  const auto y = static_cast<std::uint64_t>(frame.y_offset);
  const auto across = static_cast<std::uint64_t>(frame.width);
  const auto down = static_cast<std::uint64_t>(frame.height);
  if (frame.x_offset < 0 || frame.y_offset < 0 || x + across > width || y + down > height_)
    refuse_damaged(bytes_.label(), "the first frame of the animation lies outside of it", "");
  decode_frame({frame.fragment.bytes, frame.fragment.size}, x, y, across, down);
}

void WebpDecoder::read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) {
  if (first == 0) decode();
  std::memcpy(rows, whole_.data() + first * row_bytes_, count * row_bytes_);
}

}  // namespace

std::unique_ptr<RowDecoder> open_webp(ByteSource& bytes, ImageInfo& info) {
  return std::make_unique<WebpDecoder>(bytes, info);
}

}  // namespace pounce::io
