// SPDX-License-Identifier: Apache-2.0
//
// JPEG by libjpeg-turbo, the samples that its slow and exact inverse DCT and its usual upsampling
// give. It goes on after damage with a warning and grey rows; here a warning is an error. It jumps
// out of errors (longjmp), so each step that may fail runs in attempt(), below which nothing has a
// destructor. A progressive one takes the coefficients of the whole picture and goes over them once
// per scan: the library is told the most memory it may take, and the number of scans is limited.
#include <fmt/format.h>
#include <jpeglib.h>

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>  // jpeglib.h wants FILE
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include "io/codec/guard.h"
#include "io/codec/jump.h"
#include "io/codec/row_decoder.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

using namespace std::string_view_literals;

constexpr int kMostScans = 500;  // about 10 are usual; libjpeg-turbo's own programs stop there

/// What libjpeg's callbacks see; the decompressor's client_data.
struct JpegContext {
  jpeg_error_mgr errors{};
  jpeg_source_mgr source{};
  jpeg_progress_mgr progress{};
  std::jmp_buf place{};
  ByteSource* bytes = nullptr;
  std::uint64_t position = 0;  ///< of the source, behind the window
  std::array<JOCTET, 65536> window{};
  std::array<char, JMSG_LENGTH_MAX> message{};
  bool too_many_scans = false;
  std::vector<std::byte> profile;  ///< its parts, in their order; has room for all it may get
};

JpegContext& context_of(j_common_ptr jpeg) { return *static_cast<JpegContext*>(jpeg->client_data); }
JpegContext& context_of(j_decompress_ptr jpeg) {
  return *static_cast<JpegContext*>(jpeg->client_data);
}

[[noreturn]] void on_error(j_common_ptr jpeg) {
  JpegContext& context = context_of(jpeg);
  jpeg->err->format_message(jpeg, context.message.data());
  std::longjmp(context.place, 1);
}

/// `level` is below 0 for a warning: damage.
void on_message(j_common_ptr jpeg, int level) {
  if (level < 0) on_error(jpeg);
}

void on_progress(j_common_ptr jpeg) {
  if (jpeg->is_decompressor == 0) return;
  const auto* const decompressor = reinterpret_cast<j_decompress_ptr>(jpeg);
  if (decompressor->input_scan_number <= kMostScans) return;
  context_of(jpeg).too_many_scans = true;
  std::longjmp(context_of(jpeg).place, 1);
}

/// At the end of the file the picture ends, too, with a warning.
boolean on_fill(j_decompress_ptr jpeg) {
  JpegContext& context = context_of(jpeg);
  const std::size_t got =
      context.bytes->read_at(context.position, context.window.data(), context.window.size());
  context.position += got;
  context.source.next_input_byte = context.window.data();
  context.source.bytes_in_buffer = got;
  if (got > 0) return TRUE;
  std::snprintf(context.message.data(), context.message.size(), "the file ends too early");
  std::longjmp(context.place, 1);
}

void on_skip(j_decompress_ptr jpeg, long count) {
  jpeg_source_mgr& source = *jpeg->src;
  std::size_t left = count > 0 ? static_cast<std::size_t>(count) : 0;
  while (left > source.bytes_in_buffer) {
    left -= source.bytes_in_buffer;
    on_fill(jpeg);
  }
  source.next_input_byte += left;
  source.bytes_in_buffer -= left;
}

void do_nothing(j_decompress_ptr) {}

/// The next bytes of a marker.
void take(j_decompress_ptr jpeg, std::byte* out, std::size_t count) {
  jpeg_source_mgr& source = *jpeg->src;
  while (count > 0) {
    if (source.bytes_in_buffer == 0) on_fill(jpeg);
    const std::size_t piece = std::min(count, source.bytes_in_buffer);
    std::memcpy(out, source.next_input_byte, piece);
    source.next_input_byte += piece;
    source.bytes_in_buffer -= piece;
    out += piece;
    count -= piece;
  }
}

/// An APP2 marker may be a part of a profile: numbered, in their order.
boolean on_profile(j_decompress_ptr jpeg) {
  constexpr auto kMark = "ICC_PROFILE\0"sv;
  JpegContext& context = context_of(jpeg);
  std::array<std::byte, 2> length;
  take(jpeg, length.data(), length.size());
  const std::size_t size =
      std::to_integer<std::size_t>(length[0]) << 8 | std::to_integer<std::size_t>(length[1]);
  std::size_t left = size < 2 ? 0 : size - 2;
  std::array<std::byte, 14> head;  // the mark, the part's number, their count
  if (left >= head.size()) {
    take(jpeg, head.data(), head.size());
    left -= head.size();
    std::vector<std::byte>& profile = context.profile;
    const bool is_part = std::memcmp(head.data(), kMark.data(), kMark.size()) == 0;
    if (is_part && profile.size() + left <= profile.capacity()) {
      const std::size_t had = profile.size();
      profile.resize(had + left);
      take(jpeg, profile.data() + had, left);
      return TRUE;
    }
  }
  on_skip(jpeg, static_cast<long>(left));
  return TRUE;
}

/// libjpeg holds a few rows of blocks per component.
std::uint64_t row_cost(std::uint64_t width) { return kDecoderBaseBytes + width * 3 * 64; }

class JpegDecoder : public RowDecoder {
 public:
  JpegDecoder(ByteSource& bytes, ImageInfo& info);
  ~JpegDecoder() override { jpeg_destroy_decompress(&jpeg_); }
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) override;

 private:
  void read_header();
  void start();
  void from_cmyk(const JSAMPLE* texel, std::byte* out) const;
  [[noreturn]] void fail(const std::string& what) const;

  ByteSource& bytes_;
  JpegContext context_;
  jpeg_decompress_struct jpeg_{};
  std::size_t row_bytes_ = 0;
  std::uint64_t decoder_bytes_ = 0;
  std::vector<JSAMPLE> cmyk_;  ///< a row of four components
};

JpegDecoder::JpegDecoder(ByteSource& bytes, ImageInfo& info) : bytes_(bytes) {
  context_.bytes = &bytes;
  context_.profile.reserve(kMostColourBytes);
  jpeg_.err = jpeg_std_error(&context_.errors);
  context_.errors.error_exit = on_error;
  context_.errors.emit_message = on_message;
  jpeg_.client_data = &context_;
  try {
    read_header();
    check_size(bytes.label(), jpeg_.image_width, jpeg_.image_height);
  } catch (...) {
    jpeg_destroy_decompress(&jpeg_);
    throw;
  }
  info.width = jpeg_.image_width;
  info.height = jpeg_.image_height;
  const bool is_cmyk = jpeg_.num_components == 4;
  info.channels = is_cmyk ? 3 : static_cast<std::uint32_t>(jpeg_.num_components);
  info.names = usual_names(info.channels, false);
  row_bytes_ = std::size_t{info.width} * info.channels;
  info.decoder_bytes = row_cost(info.width);
  if (jpeg_has_multiple_scans(&jpeg_) != 0) {  // two bytes per coefficient
    for (int c = 0; c < jpeg_.num_components; ++c) {
      const jpeg_component_info& component = jpeg_.comp_info[c];
      const auto padded = [](std::uint64_t blocks, int factor) {
        const auto unit = static_cast<std::uint64_t>(factor);
        return (blocks + unit - 1) / unit * unit;
      };
      info.decoder_bytes += padded(component.width_in_blocks, component.h_samp_factor) *
                            padded(component.height_in_blocks, component.v_samp_factor) * 128;
    }
  }
  decoder_bytes_ = info.decoder_bytes;
  std::vector<ColourPiece> colours;
  if (!context_.profile.empty()) add_piece("ICC", context_.profile, colours);
  context_.profile = {};
  info.colours = read_colour_tags(colours);
}

void JpegDecoder::read_header() {
  const bool read = attempt(context_.place, [this] {
    jpeg_create_decompress(&jpeg_);
    context_.source.init_source = do_nothing;
    context_.source.fill_input_buffer = on_fill;
    context_.source.skip_input_data = on_skip;
    context_.source.resync_to_restart = jpeg_resync_to_restart;
    context_.source.term_source = do_nothing;
    jpeg_.src = &context_.source;
    context_.progress.progress_monitor = on_progress;
    jpeg_.progress = &context_.progress;
    jpeg_set_marker_processor(&jpeg_, JPEG_APP0 + 2, on_profile);
    jpeg_read_header(&jpeg_, TRUE);
  });
  if (!read) fail("the JPEG is damaged before its first row");
}

void JpegDecoder::start() {
  if (jpeg_.num_components == 4) {
    jpeg_.out_color_space = JCS_CMYK;  // of YCCK, too
    cmyk_.resize(std::size_t{jpeg_.image_width} * 4);
  }
  // What is counted, and a part of it for the library's own tables.
  jpeg_.mem->max_memory_to_use = static_cast<long>(decoder_bytes_ + kDecoderBaseBytes);
  if (!attempt(context_.place, [this] { jpeg_start_decompress(&jpeg_); })) fail("decoding failed");
}

/// Adobe writes the inks as what they leave white.
void JpegDecoder::from_cmyk(const JSAMPLE* texel, std::byte* out) const {
  const auto share = [](JSAMPLE ink) { return static_cast<float>(ink) * (1.0F / 255.0F); };
  for (std::size_t x = 0; x < jpeg_.image_width; ++x, texel += 4, out += 3) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = share(texel[c]) * share(texel[3]);
      out[c] = static_cast<std::byte>(static_cast<std::uint8_t>(value * 255.0F + 0.5F));
    }
  }
}

void JpegDecoder::read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) {
  if (first == 0) start();
  std::uint32_t done = 0;
  const bool decoded = attempt(context_.place, [&] {
    while (done < count) {
      std::byte* const out = rows + done * row_bytes_;
      JSAMPROW row = cmyk_.empty() ? reinterpret_cast<JSAMPROW>(out) : cmyk_.data();
      if (jpeg_read_scanlines(&jpeg_, &row, 1) != 1) break;
      if (!cmyk_.empty()) from_cmyk(cmyk_.data(), out);
      ++done;
    }
    if (first + done == jpeg_.output_height) jpeg_finish_decompress(&jpeg_);
  });
  if (!decoded || done < count)
    fail(fmt::format("the image is damaged in rows {} to {} of {}", first, first + count - 1,
                     jpeg_.output_height));
}

void JpegDecoder::fail(const std::string& what) const {
  bytes_.check();
  if (context_.too_many_scans) {
    throw Error(
        ErrorKind::input,
        fmt::format("{}: the JPEG has more than {} scans (about 10 are usual); save it again",
                    bytes_.label(), kMostScans));
  }
  decoder_failed(bytes_, what, one_line(context_.message.data()), decoder_bytes_);
}

}  // namespace

std::unique_ptr<RowDecoder> open_jpeg(ByteSource& bytes, ImageInfo& info) {
  return std::make_unique<JpegDecoder>(bytes, info);
}

}  // namespace pounce::io
