// SPDX-License-Identifier: Apache-2.0
//
// PNG: libpng writes all chunks; the rows are filtered and deflated here, in blocks of rows that
// know nothing of each other: each begins with a row that is filtered within itself, and ends on a
// whole byte (Z_SYNC_FLUSH), so that blocks one after another are one stream. So they may be coded
// on any number of cores, and are the same bytes on all.
//
// Rows are filtered as they come, which is quick, into the next block. When a block has all of its
// rows, its deflating begins, perhaps on another thread, and further rows may come. Blocks take
// their places by turns: before a place is used again, what was in it goes to the file. So blocks
// leave in their order, and no more are in memory than there are places. A thread that codes never
// waits for the slowest of several blocks.
#include <fmt/format.h>
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <utility>
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
/// Blocks that are under way at the same time, at most.
constexpr std::size_t kMostAtOnce = 6;
/// Rows that are under way together, where these are not more than so many blocks.
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

std::size_t blocks_at_once(const ImageWriteSpec& spec) {
  return std::clamp<std::size_t>(kStripeRows / block_rows(spec), 1, kMostAtOnce);
}

/// deflate() for one block after another, in the same memory.
class Deflater {
 public:
  explicit Deflater(std::uint32_t level) {
    constexpr int kRawWindow = -15, kMemory = 8;
    if (deflateInit2(&zip_, static_cast<int>(level), Z_DEFLATED, kRawWindow, kMemory, Z_FILTERED) !=
        Z_OK)
      fail("out of memory");
  }
  ~Deflater() { deflateEnd(&zip_); }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;

  /// `room`: bytes left free behind `out`.
  void deflate_block(std::span<const std::byte> in, bool is_last, std::size_t room,
                     std::vector<std::byte>& out) {
    deflateReset(&zip_);
    constexpr std::size_t kFlushBytes = 16;
    out.resize(deflateBound(&zip_, static_cast<uLong>(in.size())) + kFlushBytes + room);
    zip_.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(in.data()));
    zip_.avail_in = static_cast<uInt>(in.size());
    zip_.next_out = reinterpret_cast<Bytef*>(out.data());
    zip_.avail_out = static_cast<uInt>(out.size() - room);
    deflate(&zip_, is_last ? Z_FINISH : Z_SYNC_FLUSH);
    out.resize(out.size() - room - zip_.avail_out);
  }

 private:
  z_stream zip_{};  // what is behind it points to it
};

/// Rows, filtered and deflated apart from all others.
struct PngBlock {
  explicit PngBlock(const ImageWriteSpec& spec)
      : filtered((row_bytes_of(spec) + 1) * std::min(block_rows(spec), spec.height)),
        deflater(spec.layout.png_compression) {}

  std::uint32_t number = 0;  ///< in the image
  std::uint32_t rows = 0;    ///< that it has so far
  Hash128 hash;              ///< of these as they came, where somebody wants to know
  std::vector<std::byte> filtered;
  /// What they deflate to, and the Adler-32 of what was filtered, four bytes.
  std::vector<std::byte> encoded;
  bool was_known = false;
  Deflater deflater;
  std::unique_ptr<BegunWork> work;  // the last: it ends before what it uses does

  void encode(std::size_t row_bytes, bool is_last) {
    const auto bytes = std::span(filtered).first((row_bytes + 1) * rows);
    const auto adler = static_cast<std::uint32_t>(
        adler32_z(1, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
    deflater.deflate_block(bytes, is_last, sizeof adler, encoded);
    encoded.resize(encoded.size() + sizeof adler);
    std::memcpy(&encoded[encoded.size() - sizeof adler], &adler, sizeof adler);
  }
};

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
  PngEncoder(ByteSink sink, const ImageWriteSpec& spec, BeginWork begin_work, EncodedBlocks* known)
      : spec_(spec),
        row_bytes_(row_bytes_of(spec)),
        block_rows_(block_rows(spec)),
        begin_work_(std::move(begin_work)),
        known_(known),
        kept_rows_(2 * row_bytes_) {
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
    for (std::uint32_t row = first; row < first + count; ++row, rows += row_bytes_) {
      if (row % block_rows_ == 0) take_place();
      add_row(row, rows);
      if (row % block_rows_ + 1 == block_rows_ || row + 1 == spec_.height) begin_block();
    }
    // The row above the next one, which the caller is about to take away.
    if (above_ != nullptr && !swaps_) {
      std::copy_n(above_, row_bytes_, kept_rows_.data());
      above_ = kept_rows_.data();
    }
  }

  void next_level(std::uint32_t, std::uint32_t) override { fail("PNG has no levels"); }

  void finish() override {
    // From the oldest on: the place after the newest one's, where all are in use.
    for (std::size_t i = 1; i <= blocks_.size(); ++i) put(*blocks_[(newest_ + i) % blocks_.size()]);
    static constexpr std::array<png_byte, 4> kIend{'I', 'E', 'N', 'D'};
    run([&] { png_write_chunk(png_, kIend.data(), nullptr, 0); });
  }

 private:
  /// The place of the next block: a new one or the oldest block's, which goes to the file.
  void take_place() {
    newest_ = blocks_.empty() ? 0 : (newest_ + 1) % blocks_at_once(spec_);
    if (newest_ == blocks_.size()) {
      blocks_.push_back(std::make_unique<PngBlock>(spec_));
    } else {
      put(*blocks_[newest_]);
    }
    blocks_[newest_]->number = next_block_++;
    if (known_ != nullptr) hasher_.emplace();
    above_ = nullptr;
  }

  void add_row(std::uint32_t row, const std::byte* samples) {
    PngBlock& block = *blocks_[newest_];
    if (known_ != nullptr) hasher_->add(std::span(samples, row_bytes_));
    if (swaps_) {  // this row and the one above, by turns
      std::byte* const big_endian = kept_rows_.data() + row % 2 * row_bytes_;
      swap_pairs(samples, row_bytes_, big_endian);
      samples = big_endian;
    }
    filter_row(samples, above_, row_bytes_, spec_.channels * sample_bytes(spec_.depth),
               block.filtered.data() + block.rows++ * (row_bytes_ + 1));
    above_ = samples;
  }

  /// A block has all of its rows: as it is known, or soon deflated.
  void begin_block() {
    PngBlock& block = *blocks_[newest_];
    above_ = nullptr;
    if (known_ != nullptr) {
      block.hash = hasher_->digest();
      block.was_known = known_->find(block.number, block.hash, block.encoded) &&
                        block.encoded.size() > sizeof(std::uint32_t);
      if (block.was_known) return;
    }
    const bool is_last = block.number * block_rows_ + block.rows == spec_.height;
    block.work = begin_work_(
        [&block, is_last, row_bytes = row_bytes_] { block.encode(row_bytes, is_last); });
  }

  /// To the file, and to who keeps it for the next run; its place is free then.
  void put(PngBlock& block) {
    if (const auto work = std::move(block.work)) work->wait();
    if (known_ != nullptr && !block.was_known) known_->put(block.number, block.hash, block.encoded);
    std::uint32_t adler = 0;
    const std::size_t size = block.encoded.size() - sizeof adler;
    std::memcpy(&adler, &block.encoded[size], sizeof adler);
    const std::uint64_t raw_bytes = (row_bytes_ + 1) * block.rows;
    adler_ =
        static_cast<std::uint32_t>(adler32_combine(adler_, adler, static_cast<z_off_t>(raw_bytes)));
    const bool is_first = block.number == 0;
    const bool is_last = block.number * block_rows_ + block.rows == spec_.height;
    write_data(is_first, std::span(block.encoded).first(size), is_last);
    block.rows = 0;
    block.was_known = false;
  }

  /// A chunk of what is in all of them together one zlib stream.
  void write_data(bool is_first, std::span<const std::byte> deflated, bool is_last) {
    static constexpr std::array<png_byte, 4> kIdat{'I', 'D', 'A', 'T'};
    static constexpr std::array<png_byte, 2> kZlibHeader{0x78, 0x01};
    std::array<png_byte, 4> sum{};
    for (std::size_t i = 0; i < sum.size(); ++i)
      sum[i] = static_cast<png_byte>(adler_ >> (24 - 8 * i));
    const std::size_t head = is_first ? kZlibHeader.size() : 0, tail = is_last ? sum.size() : 0;
    run([&] {
      png_write_chunk_start(png_, kIdat.data(),
                            static_cast<png_uint_32>(head + deflated.size() + tail));
      png_write_chunk_data(png_, kZlibHeader.data(), head);
      png_write_chunk_data(png_, reinterpret_cast<png_const_bytep>(deflated.data()),
                           deflated.size());
      png_write_chunk_data(png_, sum.data(), tail);
      png_write_chunk_end(png_);
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

  const ImageWriteSpec spec_;
  const std::size_t row_bytes_;
  const std::uint32_t block_rows_;
  const bool swaps_ = spec_.depth == Depth::u16 && std::endian::native == std::endian::little;
  PngSink context_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  const BeginWork begin_work_;
  EncodedBlocks* const known_;
  std::uint32_t adler_ = 1;
  std::vector<std::byte> kept_rows_;
  const std::byte* above_ = nullptr;  ///< the row above the next one, where its block has it
  std::vector<std::unique_ptr<PngBlock>> blocks_;  ///< by their places
  std::size_t newest_ = 0;
  std::uint32_t next_block_ = 0;
  std::optional<Hasher> hasher_;  ///< of the newest block's rows
};

}  // namespace

std::unique_ptr<RowEncoder> encode_png(ByteSink sink, const ImageWriteSpec& spec,
                                       BeginWork begin_work, EncodedBlocks* known) {
  return std::make_unique<PngEncoder>(std::move(sink), spec, std::move(begin_work), known);
}

std::uint64_t png_block_bytes(const ImageWriteSpec& spec) {
  // What does not deflate is stored, five bytes more for each 16 KiB.
  const std::uint64_t filtered = (row_bytes_of(spec) + 1) * std::min(block_rows(spec), spec.height);
  return filtered + filtered / 1024 + 64;
}

std::uint64_t png_encoder_bytes(const ImageWriteSpec& spec) {
  // Of each block: the rows filtered, and what they deflate to. Beside them two rows.
  return kBaseBytes + 2 * row_bytes_of(spec) +
         blocks_at_once(spec) * (kDeflaterBytes + 2 * png_block_bytes(spec));
}

}  // namespace pounce::io
