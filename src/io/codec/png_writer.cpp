// SPDX-License-Identifier: Apache-2.0
//
// PNG: libpng writes all chunks; the rows are filtered and deflated here, in blocks of rows that
// know nothing of each other: each begins with a row that is filtered within itself, and ends on a
// whole byte (Z_SYNC_FLUSH), so that blocks one after another are one stream. So they may be coded
// on any number of cores, and are the same bytes on all.
#include <fmt/format.h>
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>
#include <exception>
#include <vector>

#include "io/codec/colour_tags.h"
#include "io/codec/jump.h"
#include "io/codec/row_encoder.h"
#include "io/codec/sample.h"
#include "io/files/finished_output.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::size_t kBlockBytes = 128 << 10;
/// Blocks that are coded at the same time, at most.
constexpr std::size_t kMostAtOnce = 6;
/// Rows that come together.
constexpr std::uint32_t kStripeRows = 64;
/// What libpng takes, and the buffers of its chunks.
constexpr std::uint64_t kBaseBytes = 256 << 10;
/// What zlib takes for one (its zconf.h).
constexpr std::uint64_t kDeflaterBytes = 272 << 10;

/// What the PNG specification calls Up and Sub.
constexpr std::byte kSub{1}, kUp{2};

/// Big-endian samples, as PNG has them, less those of the texel before or of the row above.
void filter_row(const std::byte* row, const std::byte* above, std::size_t size, std::size_t texel,
                std::byte* out) {
  const auto less = [](std::byte a, std::byte b) {
    return static_cast<std::byte>(std::to_integer<unsigned>(a) - std::to_integer<unsigned>(b));
  };
  if (above != nullptr) {
    out[0] = kUp;
    for (std::size_t i = 0; i < size; ++i) out[1 + i] = less(row[i], above[i]);
    return;
  }
  out[0] = kSub;
  std::copy_n(row, texel, out + 1);
  for (std::size_t i = texel; i < size; ++i) out[1 + i] = less(row[i], row[i - texel]);
}

void swap_pairs(const std::byte* in, std::size_t size, std::byte* out) {
  for (std::size_t i = 0; i < size; i += 2) {
    out[i] = in[i + 1];
    out[i + 1] = in[i];
  }
}

[[noreturn]] void fail(const std::string& why) {
  throw Error(ErrorKind::storage, fmt::format("cannot encode an image: {}", why));
}

/// How many rows make a block; the last one may have fewer. By the image's size and depth alone; a
/// power of two, as rows come in stripes of 64.
std::uint32_t block_rows(const ImageWriteSpec& spec) {
  return static_cast<std::uint32_t>(
      std::bit_floor(std::clamp<std::uint64_t>(kBlockBytes / row_bytes_of(spec), 1, 1024)));
}

/// Of blocks, as many as rows that come together make.
std::size_t blocks_at_once(const ImageWriteSpec& spec) {
  return std::clamp<std::size_t>(kStripeRows / block_rows(spec), 1, kMostAtOnce);
}

/// Rows, filtered and deflated apart from all others.
struct PngBlock {
  std::vector<std::byte> deflated;
  std::uint64_t raw_bytes = 0;  ///< before
  std::uint32_t adler = 1;      ///< Adler-32 of these
  Hash128 rows;                 ///< the hash of its rows, where somebody wants to know
  bool was_known = false;
};

PngBlock deflated(const ImageWriteSpec& spec, std::uint32_t count, const std::byte* rows,
                  bool is_last) {
  const std::size_t size = row_bytes_of(spec);
  const std::size_t texel = spec.channels * sample_bytes(spec.depth);
  const bool swaps = spec.depth == Depth::u16 && std::endian::native == std::endian::little;
  std::vector<std::byte> filtered((size + 1) * count), big_endian(swaps ? 2 * size : 0);
  const std::byte* above = nullptr;
  for (std::uint32_t y = 0; y < count; ++y, rows += size) {
    const std::byte* row = rows;
    if (swaps) {  // this row and the one above, by turns
      row = big_endian.data() + y % 2 * size;
      swap_pairs(rows, size, big_endian.data() + y % 2 * size);
    }
    filter_row(row, above, size, texel, filtered.data() + y * (size + 1));
    above = row;
  }
  PngBlock block;
  block.raw_bytes = filtered.size();
  block.adler = static_cast<std::uint32_t>(
      adler32_z(1, reinterpret_cast<const Bytef*>(filtered.data()), filtered.size()));
  z_stream zip{};
  constexpr int kRawWindow = -15, kMemory = 8;
  if (deflateInit2(&zip, static_cast<int>(spec.layout.png_compression), Z_DEFLATED, kRawWindow,
                   kMemory, Z_FILTERED) != Z_OK)
    fail("out of memory");
  constexpr std::size_t kFlushBytes = 16;
  block.deflated.resize(deflateBound(&zip, static_cast<uLong>(filtered.size())) + kFlushBytes);
  zip.next_in = reinterpret_cast<Bytef*>(filtered.data());
  zip.avail_in = static_cast<uInt>(filtered.size());
  zip.next_out = reinterpret_cast<Bytef*>(block.deflated.data());
  zip.avail_out = static_cast<uInt>(block.deflated.size());
  deflate(&zip, is_last ? Z_FINISH : Z_SYNC_FLUSH);
  block.deflated.resize(block.deflated.size() - zip.avail_out);
  deflateEnd(&zip);
  return block;
}

/// What libpng's callbacks see.
struct PngSink {
  ByteSink sink;
  std::exception_ptr failure;
  std::array<char, 160> message{};
};

void on_write(png_structp png, png_bytep bytes, png_size_t count) {
  auto& context = *static_cast<PngSink*>(png_get_io_ptr(png));
  if (context.failure) return;
  try {  // the caller is C
    context.sink({reinterpret_cast<const std::byte*>(bytes), count});
  } catch (...) {
    context.failure = std::current_exception();
  }
}

[[noreturn]] void on_error(png_structp png, png_const_charp text) {
  auto& context = *static_cast<PngSink*>(png_get_error_ptr(png));
  std::snprintf(context.message.data(), context.message.size(), "%s", text);
  png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

class PngEncoder : public RowEncoder {
 public:
  PngEncoder(ByteSink sink, const ImageWriteSpec& spec, ForEach for_each, EncodedBlocks* known)
      : spec_(spec), for_each_(std::move(for_each)), known_(known) {
    context_.sink = std::move(sink);
    png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, &context_, on_error, on_warning);
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_write_struct(&png_, &info_);
      fail("out of memory");
    }
    try {
      write_header();
    } catch (...) {
      png_destroy_write_struct(&png_, &info_);
      throw;
    }
  }
  ~PngEncoder() override { png_destroy_write_struct(&png_, &info_); }

  void write_rows(std::uint32_t first, std::uint32_t count, const std::byte* rows) override {
    const std::uint32_t together = block_rows(spec_);
    const std::size_t size = row_bytes_of(spec_);
    std::uint32_t row = first;
    const std::uint32_t end = first + count;
    while (row < end) {
      const std::byte* const from = rows + (row - first) * size;
      const std::uint32_t in_block = row % together;
      const std::uint32_t block_end = std::min(row - in_block + together, spec_.height);
      if (in_block == 0 && block_end <= end) {  // whole blocks: all there are
        const std::uint32_t whole_end = end == spec_.height ? end : end - end % together;
        put_blocks(row, whole_end, from);
        row = whole_end;
        continue;
      }
      const std::uint32_t piece = std::min(end, block_end) - row;
      waiting_.insert(waiting_.end(), from, from + piece * size);
      row += piece;
      if (row < block_end) continue;
      put(made(row - in_block - piece, in_block + piece, waiting_.data()));
      waiting_.clear();
    }
  }

  void next_level(std::uint32_t, std::uint32_t) override { fail("PNG has no levels"); }

  void finish() override {
    static constexpr std::array<png_byte, 4> kIend{'I', 'E', 'N', 'D'};
    run([&] { png_write_chunk(png_, kIend.data(), nullptr, 0); });
  }

 private:
  /// Codes whole blocks of rows, several at once, and puts them out in their order.
  void put_blocks(std::uint32_t begin, std::uint32_t end, const std::byte* rows) {
    const std::uint32_t together = block_rows(spec_);
    const std::size_t count = (end - begin + together - 1) / together;
    const std::size_t at_once = blocks_at_once(spec_);
    for (std::size_t done = 0; done < count; done += at_once) {
      std::array<PngBlock, kMostAtOnce> blocks;
      const std::size_t now = std::min(at_once, count - done);
      for_each_(now, [&](std::size_t i) {
        const std::uint32_t first = begin + static_cast<std::uint32_t>(done + i) * together;
        const std::uint32_t last = std::min(first + together, end);
        blocks[i] = made(first, last - first, rows + (first - begin) * row_bytes_of(spec_));
      });
      for (std::size_t i = 0; i < now; ++i) put(blocks[i]);
    }
  }

  /// A block of so many rows: as it is known, or deflated.
  PngBlock made(std::uint32_t first, std::uint32_t count, const std::byte* rows) const {
    const bool is_last = first + count == spec_.height;
    if (known_ == nullptr) return deflated(spec_, count, rows, is_last);
    Hasher hasher;
    hasher.add(std::span(rows, row_bytes_of(spec_) * count));
    PngBlock block;
    if (known_->find(number_of(first), hasher.digest(), block.deflated) &&
        block.deflated.size() > sizeof block.adler) {
      block.was_known = true;
      block.raw_bytes = (row_bytes_of(spec_) + 1) * count;
      const std::size_t size = block.deflated.size() - sizeof block.adler;
      std::memcpy(&block.adler, &block.deflated[size], sizeof block.adler);
      block.deflated.resize(size);
      return block;
    }
    block = deflated(spec_, count, rows, is_last);
    block.rows = hasher.digest();
    return block;
  }
  std::uint32_t number_of(std::uint32_t row) const { return row / block_rows(spec_); }

  /// With its checksum behind it, which would cost the filters to know.
  void remember(const PngBlock& block) {
    if (known_ == nullptr || block.was_known) return;
    std::vector<std::byte> encoded(block.deflated.size() + sizeof block.adler);
    std::copy(block.deflated.begin(), block.deflated.end(), encoded.begin());
    std::memcpy(&encoded[block.deflated.size()], &block.adler, sizeof block.adler);
    known_->put(number_of(rows_put_), block.rows, encoded);
  }

  void put(const PngBlock& block) {
    remember(block);
    rows_put_ += static_cast<std::uint32_t>(block.raw_bytes / (row_bytes_of(spec_) + 1));
    static constexpr std::array<png_byte, 4> kIdat{'I', 'D', 'A', 'T'};
    std::vector<std::byte> data;
    if (raw_bytes_ == 0) data = {std::byte{0x78}, std::byte{0x01}};  // a zlib stream
    adler_ = static_cast<std::uint32_t>(
        adler32_combine(adler_, block.adler, static_cast<z_off_t>(block.raw_bytes)));
    raw_bytes_ += block.raw_bytes;
    data.insert(data.end(), block.deflated.begin(), block.deflated.end());
    if (raw_bytes_ == (row_bytes_of(spec_) + 1) * spec_.height) {
      for (int shift = 24; shift >= 0; shift -= 8)
        data.push_back(static_cast<std::byte>(adler_ >> shift));
    }
    run([&] {
      png_write_chunk(png_, kIdat.data(), reinterpret_cast<png_const_bytep>(data.data()),
                      data.size());
    });
  }

  template <class Step>
  void run(Step step) {
    const bool did = attempt(png_jmpbuf(png_), step);
    if (context_.failure) std::rethrow_exception(context_.failure);
    if (!did) fail(context_.message.data());
  }

  void write_header() {
    std::vector<std::byte> profile;
    if (spec_.chromaticities) profile = make_icc({*spec_.chromaticities, spec_.linear});
    std::string software = software_name(), job;
    if (!spec_.job.empty()) job = job_description(spec_.job);
    std::array<char, 9> software_key{"Software"};
    std::array<char, 12> job_key{"Description"};
    std::array<png_text, 2> texts{};
    texts[0] = {PNG_TEXT_COMPRESSION_NONE,
                software_key.data(),
                software.data(),
                software.size(),
                0,
                nullptr,
                nullptr};
    texts[1] = {
        PNG_TEXT_COMPRESSION_NONE, job_key.data(), job.data(), job.size(), 0, nullptr, nullptr};
    constexpr std::array kTypes{PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                PNG_COLOR_TYPE_RGB_ALPHA};
    run([&] {
      png_set_write_fn(png_, &context_, on_write, nullptr);
      png_set_user_limits(png_, 0x7FFFFFFF, 0x7FFFFFFF);
      png_set_IHDR(png_, info_, spec_.width, spec_.height, spec_.depth == Depth::u16 ? 16 : 8,
                   kTypes[spec_.channels - 1], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                   PNG_FILTER_TYPE_DEFAULT);
      if (!profile.empty()) {
        png_set_iCCP(png_, info_, "ICC", PNG_COMPRESSION_TYPE_BASE,
                     reinterpret_cast<png_const_bytep>(profile.data()),
                     static_cast<png_uint_32>(profile.size()));
      } else if (spec_.tagged && spec_.linear) {
        png_set_gAMA_fixed(png_, info_, PNG_FP_1);
      } else if (spec_.tagged) {
        png_set_sRGB_gAMA_and_cHRM(png_, info_, PNG_sRGB_INTENT_PERCEPTUAL);
      }
      png_set_text(png_, info_, texts.data(), job.empty() ? 1 : 2);
      png_write_info(png_, info_);
    });
  }

  ImageWriteSpec spec_;
  PngSink context_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  ForEach for_each_;
  EncodedBlocks* const known_;
  std::uint32_t rows_put_ = 0;
  std::vector<std::byte> waiting_;  ///< rows of a block that is not whole
  std::uint32_t adler_ = 1;
  std::uint64_t raw_bytes_ = 0;
};

}  // namespace

std::unique_ptr<RowEncoder> encode_png(ByteSink sink, const ImageWriteSpec& spec, ForEach for_each,
                                       EncodedBlocks* known) {
  return std::make_unique<PngEncoder>(std::move(sink), spec, std::move(for_each), known);
}

std::uint64_t png_encoder_bytes(const ImageWriteSpec& spec) {
  // Of each block: the rows filtered, two of them swapped, and what they deflate to; one block
  // waits for its rows, one is on its way to the file.
  const std::uint64_t row = row_bytes_of(spec) + 1;
  const std::uint64_t block = row * std::min(block_rows(spec), spec.height);
  return kBaseBytes + 2 * block +
         blocks_at_once(spec) * (kDeflaterBytes + 2 * block + 2 * row + block / 8);
}

}  // namespace pounce::io
