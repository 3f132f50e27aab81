// SPDX-License-Identifier: Apache-2.0
//
// JPEG by libjpeg-turbo: 4:4:4, its slow and exact DCT. What the file says of itself is an Exif
// block, two texts and a colour space, which is put together here. libjpeg jumps out of errors
// (longjmp): see jpeg_reader.cpp.
#include <fmt/format.h>
#include <jpeglib.h>

#include <array>
#include <csetjmp>
#include <cstdio>  // jpeglib.h wants FILE
#include <cstring>
#include <exception>
#include <string>
#include <vector>

#include "io/codec/colour_tags.h"
#include "io/codec/jump.h"
#include "io/codec/row_encoder.h"
#include "io/files/finished_output.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// What libjpeg's callbacks see; the compressor's client_data.
struct JpegSink {
  jpeg_error_mgr errors{};
  jpeg_destination_mgr destination{};
  std::jmp_buf place{};
  ByteSink sink;
  std::exception_ptr failure;
  std::array<JOCTET, 65536> buffer{};
  std::array<char, JMSG_LENGTH_MAX> message{};
};

JpegSink& sink_of(j_compress_ptr jpeg) { return *static_cast<JpegSink*>(jpeg->client_data); }

[[noreturn]] void on_error(j_common_ptr jpeg) {
  auto& context = *static_cast<JpegSink*>(jpeg->client_data);
  jpeg->err->format_message(jpeg, context.message.data());
  std::longjmp(context.place, 1);
}

void on_message(j_common_ptr, int) {}

void put(JpegSink& context, std::size_t count) {
  context.destination.next_output_byte = context.buffer.data();
  context.destination.free_in_buffer = context.buffer.size();
  if (context.failure || count == 0) return;
  try {  // the caller is C
    context.sink({reinterpret_cast<const std::byte*>(context.buffer.data()), count});
  } catch (...) {
    context.failure = std::current_exception();
  }
}

void on_begin(j_compress_ptr jpeg) { put(sink_of(jpeg), 0); }

boolean on_full(j_compress_ptr jpeg) {
  put(sink_of(jpeg), sink_of(jpeg).buffer.size());
  return TRUE;
}

void on_end(j_compress_ptr jpeg) {
  JpegSink& context = sink_of(jpeg);
  put(context, context.buffer.size() - context.destination.free_in_buffer);
}

/// Appends a big-endian number.
void put(std::string& out, std::uint64_t value, int bytes) {
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8)
    out += static_cast<char>(value >> shift);
}

/// An entry of a TIFF directory: tag, type, count, value or its place.
void put_entry(std::string& out, std::uint16_t tag, std::uint16_t type, std::size_t count,
               std::size_t value) {
  put(out, tag, 2);
  put(out, type, 2);
  put(out, count, 4);
  put(out, value, 4);
}

/// An Exif block (Exif 2.3) is a small TIFF: a directory with the job and the software, in the
/// order of their tags, and one of its own with the colour space, sRGB.
std::string exif_of(const ImageWriteSpec& spec) {
  constexpr std::uint16_t kDescription = 0x010E, kSoftware = 0x0131, kExif = 0x8769;
  constexpr std::uint16_t kVersion = 0x9000, kColourSpace = 0xA001;
  constexpr std::uint16_t kText = 2, kShort = 3, kLong = 4, kBytes = 7;
  const bool is_srgb = spec.tagged && !spec.linear && !spec.chromaticities;
  std::string job = spec.job.empty() ? "" : job_description(spec.job), software = software_name();
  const std::size_t entries = (job.empty() ? 0 : 1) + 1 + (is_srgb ? 1 : 0);
  std::string block("Exif\0\0MM\0*\0\0\0\10", 14), texts;
  put(block, entries, 2);
  const std::size_t end = 8 + 2 + 12 * entries + 4;  // places count from "MM"
  const auto add_text = [&](std::uint16_t tag, const std::string& text) {
    put_entry(block, tag, kText, text.size() + 1, end + texts.size());
    texts += text + std::string(2 - text.size() % 2, '\0');  // each begins at an even place
  };
  if (!job.empty()) add_text(kDescription, job);
  add_text(kSoftware, software);
  if (is_srgb) {
    put_entry(block, kExif, kLong, 1, end + texts.size());
    put(texts, 2, 2);
    put_entry(texts, kVersion, kBytes, 4, 0x30323330);    // "0230"
    put_entry(texts, kColourSpace, kShort, 1, 1U << 16);  // in the upper half of the value
    put(texts, 0, 4);
  }
  put(block, 0, 4);  // no further directory
  return block + texts;
}

class JpegEncoder : public RowEncoder {
 public:
  JpegEncoder(ByteSink sink, const ImageWriteSpec& spec) : spec_(spec) {
    context_.sink = std::move(sink);
    jpeg_.err = jpeg_std_error(&context_.errors);
    context_.errors.error_exit = on_error;
    context_.errors.emit_message = on_message;
    jpeg_.client_data = &context_;
    try {
      begin();
    } catch (...) {
      jpeg_destroy_compress(&jpeg_);
      throw;
    }
  }
  ~JpegEncoder() override { jpeg_destroy_compress(&jpeg_); }

  void write_rows(std::uint32_t, std::uint32_t count, const std::byte* rows) override {
    const std::size_t size = row_bytes_of(spec_);
    run([&] {
      for (std::uint32_t y = 0; y < count; ++y) {
        // It does not write into its input, whatever its type says.
        auto* row = const_cast<JSAMPROW>(reinterpret_cast<const JSAMPLE*>(rows + y * size));
        jpeg_write_scanlines(&jpeg_, &row, 1);
      }
    });
  }
  void next_level(std::uint32_t, std::uint32_t) override {
    throw Error(ErrorKind::internal, "JPEG has no levels");
  }
  void finish() override {
    run([this] { jpeg_finish_compress(&jpeg_); });
  }

 private:
  template <class Step>
  void run(Step step) {
    const bool did = attempt(context_.place, step);
    if (context_.failure) std::rethrow_exception(context_.failure);
    if (!did) {
      throw Error(ErrorKind::storage,
                  fmt::format("cannot encode an image: {}", context_.message.data()));
    }
  }

  void begin() {
    const std::string exif = exif_of(spec_);
    std::vector<std::byte> profile;
    if (spec_.chromaticities) profile = make_icc({*spec_.chromaticities, spec_.linear});
    run([&] {
      jpeg_create_compress(&jpeg_);
      context_.destination.init_destination = on_begin;
      context_.destination.empty_output_buffer = on_full;
      context_.destination.term_destination = on_end;
      jpeg_.dest = &context_.destination;
      jpeg_.image_width = spec_.width;
      jpeg_.image_height = spec_.height;
      jpeg_.input_components = static_cast<int>(spec_.channels);
      jpeg_.in_color_space = spec_.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
      jpeg_set_defaults(&jpeg_);
      jpeg_set_quality(&jpeg_, static_cast<int>(spec_.layout.jpeg_quality), TRUE);
      jpeg_.comp_info[0].h_samp_factor = jpeg_.comp_info[0].v_samp_factor = 1;
      jpeg_start_compress(&jpeg_, TRUE);
      jpeg_write_marker(&jpeg_, JPEG_APP0 + 1, reinterpret_cast<const JOCTET*>(exif.data()),
                        static_cast<unsigned>(exif.size()));
      if (!profile.empty()) {
        jpeg_write_icc_profile(&jpeg_, reinterpret_cast<const JOCTET*>(profile.data()),
                               static_cast<unsigned>(profile.size()));
      }
    });
  }

  ImageWriteSpec spec_;
  JpegSink context_;
  jpeg_compress_struct jpeg_{};
};

}  // namespace

std::unique_ptr<RowEncoder> encode_jpeg(ByteSink sink, const ImageWriteSpec& spec) {
  return std::make_unique<JpegEncoder>(std::move(sink), spec);
}

}  // namespace pounce::io
