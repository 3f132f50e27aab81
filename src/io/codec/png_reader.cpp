// SPDX-License-Identifier: Apache-2.0
//
// PNG by libpng. It jumps out of errors (longjmp), so each step that may fail runs in attempt(),
// below which nothing has a destructor. Chunks that are no picture are skipped without being kept:
// a text may claim gigabytes. Those that say what the colours mean are kept as they are, for
// read_colour_tags(). What libpng passes over and what would change the picture is an error here:
// a wrong checksum of the transparency, and whatever is behind the last row.
#include <fmt/format.h>
#include <png.h>

#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <vector>

#include "core/page_pool.h"
#include "io/codec/guard.h"
#include "io/codec/jump.h"
#include "io/codec/row_decoder.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// What libpng's callbacks see.
struct PngContext {
  ByteSource* bytes = nullptr;
  std::uint64_t position = 0;
  std::array<char, 160> message{};

  void keep(const char* text) { std::snprintf(message.data(), message.size(), "%s", text); }
};

[[noreturn]] void on_error(png_structp png, png_const_charp text) {
  static_cast<PngContext*>(png_get_error_ptr(png))->keep(text);
  png_longjmp(png, 1);
}

/// Of what libpng would go on after only the transparency makes the picture.
void on_warning(png_structp png, png_const_charp text) {
  if (std::strncmp(text, "tRNS", 4) == 0) on_error(png, text);
}

void on_read(png_structp png, png_bytep out, png_size_t count) {
  auto& context = *static_cast<PngContext*>(png_get_io_ptr(png));
  if (context.bytes->read_at(context.position, out, count) != count)
    png_error(png, "the file ends too early");
  context.position += count;
}

class PngDecoder : public RowDecoder {
 public:
  PngDecoder(ByteSource& bytes, ImageInfo& info);
  ~PngDecoder() override { png_destroy_read_struct(&png_, &png_info_, nullptr); }
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) override;

 private:
  void set_up();
  void describe(ImageInfo& info);
  void decode_whole();
  [[noreturn]] void fail(const std::string& what) const;

  ByteSource& bytes_;
  PngContext context_;
  png_structp png_ = nullptr;
  png_infop png_info_ = nullptr;
  std::uint32_t height_ = 0;
  std::size_t row_bytes_ = 0;
  std::uint64_t decoder_bytes_ = 0;
  int passes_ = 1;
  PageVector<std::byte> whole_;  ///< of an interlaced one, all rows
};

PngDecoder::PngDecoder(ByteSource& bytes, ImageInfo& info) : bytes_(bytes) {
  context_.bytes = &bytes;
  png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &context_, on_error, on_warning);
  if (png_ != nullptr) png_info_ = png_create_info_struct(png_);
  if (png_info_ == nullptr) {
    png_destroy_read_struct(&png_, &png_info_, nullptr);
    decoder_failed(bytes, "the image header cannot be read", "out of memory", 0);
  }
  try {
    set_up();
    describe(info);
  } catch (...) {
    png_destroy_read_struct(&png_, &png_info_, nullptr);
    throw;
  }
}

void PngDecoder::set_up() {
  static constexpr std::array<png_byte, 25> kColours{'c', 'I', 'C', 'P', 0,   'i', 'C', 'C', 'P',
                                                     0,   's', 'R', 'G', 'B', 0,   'g', 'A', 'M',
                                                     'A', 0,   'c', 'H', 'R', 'M', 0};
  const bool opened = attempt(png_jmpbuf(png_), [this] {
    png_set_read_fn(png_, &context_, on_read);
    png_set_user_limits(png_, 0x7FFFFFFF, 0x7FFFFFFF);  // check_size() says it better
    png_set_chunk_malloc_max(png_, kMostColourBytes);
    // Every byte of a chunk is checked by its CRC already. The sum over what is inflated took a
    // fifth of a job with very many images.
    png_set_option(png_, PNG_IGNORE_ADLER32, PNG_OPTION_ON);
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_ALWAYS, kColours.data(), 5);
    png_read_info(png_, png_info_);
  });
  if (!opened) fail("the image header cannot be read");
  check_size(bytes_.label(), png_get_image_width(png_, png_info_),
             png_get_image_height(png_, png_info_));
  const bool described = attempt(png_jmpbuf(png_), [this] {
    png_set_expand(png_);  // small samples, palettes, transparency
    if (std::endian::native == std::endian::little) png_set_swap(png_);
    passes_ = png_set_interlace_handling(png_);
    png_read_update_info(png_, png_info_);
  });
  if (!described) fail("the image header cannot be read");
}

void PngDecoder::describe(ImageInfo& info) {
  height_ = png_get_image_height(png_, png_info_);
  row_bytes_ = png_get_rowbytes(png_, png_info_);
  info.width = png_get_image_width(png_, png_info_);
  info.height = height_;
  info.channels = png_get_channels(png_, png_info_);
  info.depth = png_get_bit_depth(png_, png_info_) == 16 ? Depth::u16 : Depth::u8;
  info.has_alpha = (png_get_color_type(png_, png_info_) & PNG_COLOR_MASK_ALPHA) != 0;
  info.names = usual_names(info.channels, info.has_alpha);
  const std::uint64_t whole = passes_ > 1 ? std::uint64_t{row_bytes_} * height_ : 0;
  info.decoder_bytes = decoder_bytes_ = kDecoderBaseBytes + 4 * row_bytes_ + whole;
  png_unknown_chunkp chunks = nullptr;
  const int count = png_get_unknown_chunks(png_, png_info_, &chunks);
  std::vector<ColourPiece> colours;
  for (int i = 0; i < count; ++i) {
    const auto* const data = reinterpret_cast<const std::byte*>(chunks[i].data);
    add_piece(reinterpret_cast<const char*>(chunks[i].name), {data, chunks[i].size}, colours);
  }
  info.colours = read_colour_tags(colours);
}

void PngDecoder::decode_whole() {
  whole_.resize(row_bytes_ * height_);
  const bool decoded = attempt(png_jmpbuf(png_), [this] {
    for (int pass = 0; pass < passes_; ++pass) {
      for (std::uint32_t y = 0; y < height_; ++y)
        png_read_row(png_, reinterpret_cast<png_bytep>(whole_.data() + y * row_bytes_), nullptr);
    }
  });
  if (!decoded) fail("its interlaced rows cannot be decoded");
}

void PngDecoder::read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) {
  if (passes_ > 1) {
    if (first == 0) decode_whole();
    std::memcpy(rows, whole_.data() + first * row_bytes_, count * row_bytes_);
  } else {
    std::uint32_t done = 0;
    const bool decoded = attempt(png_jmpbuf(png_), [&] {
      for (; done < count; ++done)
        png_read_row(png_, reinterpret_cast<png_bytep>(rows + done * row_bytes_), nullptr);
    });
    if (!decoded) fail(fmt::format("decoding failed in row {} of {}", first + done, height_));
  }
  if (first + count < height_) return;
  if (!attempt(png_jmpbuf(png_), [this] { png_read_end(png_, nullptr); }))
    fail("all rows of the PNG were decoded, but not what follows them");
}

void PngDecoder::fail(const std::string& what) const {
  const std::string_view why(context_.message.data());
  constexpr std::string_view kChecksum = ": CRC error";
  if (why.ends_with(kChecksum)) {
    bytes_.check();
    refuse_damaged(bytes_.label(), what,
                   fmt::format("the checksum of its {} chunk is wrong",
                               why.substr(0, why.size() - kChecksum.size())));
  }
  decoder_failed(bytes_, what, one_line(std::string(why)), decoder_bytes_);
}

}  // namespace

std::unique_ptr<RowDecoder> open_png(ByteSource& bytes, ImageInfo& info) {
  return std::make_unique<PngDecoder>(bytes, info);
}

}  // namespace pounce::io
