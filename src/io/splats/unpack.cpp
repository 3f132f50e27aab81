// SPDX-License-Identifier: Apache-2.0
#include "io/splats/unpack.h"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <new>

#include "io/splats/raw.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kPieceBytes = 64 << 10;
constexpr int kMostWindowLog = 27;
constexpr std::uint64_t kZstdOverhead = 1 << 20;  // measured: below 500 KiB beside the window

[[noreturn]] void fail(const std::string& name, const std::string& what) {
  throw Error(ErrorKind::input, fmt::format("{}: {}; copy or export it again", name, what));
}

/// The compressed bytes, a piece at a time.
class Pieces {
 public:
  Pieces(const ReadFile& file, std::uint64_t offset, std::uint64_t size)
      : file_(file), at_(offset), end_(offset + size), bytes_(kPieceBytes) {}
  bool at_end() const { return at_ == end_; }
  std::span<const std::byte> next() {
    const auto piece = std::span(bytes_).first(std::min(kPieceBytes, end_ - at_));
    file_.read(at_, piece);
    at_ += piece.size();
    return piece;
  }

 private:
  const ReadFile& file_;
  std::uint64_t at_, end_;
  PageVector<std::byte> bytes_;
};

}  // namespace

struct GzipReader::State {
  State(const ReadFile& file, const std::string& reader_name)
      : name(reader_name), pieces(file, 0, file.size_bytes()) {
    constexpr int kGzipWrapper = 16;
    if (inflateInit2(&stream, MAX_WBITS + kGzipWrapper) != Z_OK) throw std::bad_alloc();
  }
  ~State() { inflateEnd(&stream); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  std::string name;
  Pieces pieces;
  z_stream stream{};
  bool ended = false;
};

GzipReader::GzipReader(const ReadFile& file, const std::string& name)
    : state_(std::make_unique<State>(file, name)) {}
GzipReader::~GzipReader() = default;

std::size_t GzipReader::read(std::span<std::byte> out) {
  State& s = *state_;
  std::size_t done = 0;
  while (done < out.size() && !s.ended) {
    if (s.stream.avail_in == 0 && !s.pieces.at_end()) {
      const auto piece = s.pieces.next();
      // zlib's interface is older than const.
      s.stream.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(piece.data()));
      s.stream.avail_in = static_cast<uInt>(piece.size());
    }
    const auto room = static_cast<uInt>(std::min<std::size_t>(out.size() - done, 1 << 30));
    s.stream.next_out = reinterpret_cast<Bytef*>(out.data() + done);
    s.stream.avail_out = room;
    const int code = inflate(&s.stream, Z_NO_FLUSH);
    done += room - s.stream.avail_out;
    if (code == Z_STREAM_END) {
      s.ended = true;
    } else if (code == Z_MEM_ERROR) {
      throw std::bad_alloc();
    } else if (code == Z_BUF_ERROR || (code == Z_OK && s.stream.avail_out == room &&
                                       s.stream.avail_in == 0 && s.pieces.at_end())) {
      fail(s.name, "its gzip data are cut off");
    } else if (code != Z_OK) {
      fail(s.name, fmt::format("its gzip data are damaged ({})",
                               s.stream.msg != nullptr ? s.stream.msg : "zlib does not say how"));
    }
  }
  return done;
}

struct ZstdReader::State {
  State(const ReadFile& file, std::uint64_t offset, std::uint64_t size,
        const std::string& reader_name)
      : name(reader_name), pieces(file, offset, size), context(ZSTD_createDCtx()) {
    if (context == nullptr) throw std::bad_alloc();
    ZSTD_DCtx_setParameter(context, ZSTD_d_windowLogMax, kMostWindowLog);
  }
  ~State() { ZSTD_freeDCtx(context); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  std::string name;
  Pieces pieces;
  ZSTD_DCtx* context;
  ZSTD_inBuffer in{};
  bool ended = false;
};

ZstdReader::ZstdReader(const ReadFile& file, std::uint64_t offset, std::uint64_t size,
                       const std::string& name)
    : state_(std::make_unique<State>(file, offset, size, name)) {}
ZstdReader::~ZstdReader() = default;

std::size_t ZstdReader::read(std::span<std::byte> out) {
  State& s = *state_;
  ZSTD_outBuffer to{out.data(), out.size(), 0};
  while (to.pos < to.size && !s.ended) {
    if (s.in.pos == s.in.size && !s.pieces.at_end()) {
      const auto piece = s.pieces.next();
      s.in = {piece.data(), piece.size(), 0};
    }
    const std::size_t before = to.pos, input = s.in.pos;
    const std::size_t left = ZSTD_decompressStream(s.context, &to, &s.in);
    if (ZSTD_isError(left) != 0) {
      fail(s.name, fmt::format("its zstd data are damaged ({})", ZSTD_getErrorName(left)));
    }
    if (left == 0) {
      s.ended = true;
      if (s.in.pos != s.in.size || !s.pieces.at_end())
        fail(s.name, "bytes follow a zstd frame that should be the last");
    } else if (to.pos == before && s.in.pos == input && s.pieces.at_end()) {
      fail(s.name, "its zstd data are cut off");
    }
  }
  return to.pos;
}

std::uint64_t ZstdReader::bytes(const ReadFile& file, std::uint64_t offset, std::uint64_t size) {
  // Frame: magic, descriptor, then the window's size as a power of two and eighths of it, or, where
  // the whole content is the window, the content's size.
  std::array<std::byte, 13> head{};
  file.read(offset, std::span(head).first(std::min<std::uint64_t>(size, head.size())));
  const auto descriptor = std::to_integer<unsigned>(head[4]);
  const unsigned dictionary = std::array<unsigned, 4>{0, 1, 2, 4}[descriptor & 3];
  const std::byte* const at = &head[5];
  std::uint64_t window = 0;
  if ((descriptor >> 5 & 1) == 0) {
    const auto code = std::to_integer<unsigned>(*at);
    window = std::uint64_t{1} << (10 + (code >> 3));
    window += window / 8 * (code & 7);
  } else if (dictionary == 0) {  // nothing that is read has one
    const unsigned width = descriptor >> 6;
    window = width == 0   ? std::to_integer<unsigned>(*at)
             : width == 1 ? value_at<std::uint16_t>(at) + 256U
             : width == 2 ? value_at<std::uint32_t>(at)
                          : value_at<std::uint64_t>(at);
  }
  return round_to_pages(std::min(window, std::uint64_t{1} << kMostWindowLog)) + kZstdOverhead;
}

}  // namespace pounce::io
