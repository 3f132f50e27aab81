// SPDX-License-Identifier: Apache-2.0
//
// An encoder of its own, although the product has one: what the product's writer and reader got
// wrong alike would pass where only the one feeds the other.
#include "write_spz.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "output_file.h"
#include "pounce/error.h"

namespace pounce::fixture {
namespace {

constexpr std::size_t kBlocks = 6;  // positions, opacities, colours, scales, rotations, harmonics
constexpr int kFractionBits = 20;

unsigned char byte_of(double value) {
  return static_cast<unsigned char>(std::clamp(std::round(value), 0.0, 255.0));
}

/// One row of the PLY, taken apart.
void encode(std::span<const float> row, std::size_t lobes,
            const std::array<unsigned char*, kBlocks>& to) {
  const auto value = [&](std::size_t column) { return static_cast<double>(row[column]); };
  const std::size_t opacity = 9 + 3 * lobes, scale = opacity + 1, rotation = scale + 3;
  for (std::size_t k = 0; k < 3; ++k) {
    constexpr double kMost = (1 << 23) - 1;
    const double scaled = std::ldexp(value(k), kFractionBits);
    const auto fixed = static_cast<std::uint32_t>(std::lround(std::clamp(scaled, -kMost, kMost)));
    for (std::size_t b = 0; b < 3; ++b)
      to[0][3 * k + b] = static_cast<unsigned char>(fixed >> 8 * b);
    to[2][k] = byte_of((value(6 + k) * 0.15 + 0.5) * 255);
    to[3][k] = byte_of((value(scale + k) + 10) * 16);
  }
  to[1][0] = byte_of(255 / (1 + std::exp(-value(opacity))));
  double norm = 0;
  for (std::size_t k = 0; k < 4; ++k) norm += value(rotation + k) * value(rotation + k);
  const double sign = value(rotation) < 0 ? -1 : 1;  // w is what is left, so it is positive
  for (std::size_t k = 0; k < 3; ++k)
    to[4][k] = byte_of(sign * value(rotation + 1 + k) / std::sqrt(norm) * 127.5 + 127.5);
  for (std::size_t k = 0; k < lobes; ++k) {
    for (std::size_t c = 0; c < 3; ++c)
      to[5][3 * k + c] = byte_of(value(9 + c * lobes + k) * 128 + 128);
  }
}

/// Appends to a file as one gzip member.
class Gzip {
 public:
  explicit Gzip(OutputFile& out) : out_(out), buffer_(256 << 10) {
    constexpr int kGzip = 16;
    if (deflateInit2(&stream_, 1, Z_DEFLATED, MAX_WBITS + kGzip, 8, Z_DEFAULT_STRATEGY) != Z_OK)
      throw Error(ErrorKind::internal, "zlib cannot be initialised");
  }
  ~Gzip() { deflateEnd(&stream_); }
  Gzip(const Gzip&) = delete;
  Gzip& operator=(const Gzip&) = delete;

  void append(const void* bytes, std::size_t size_bytes, int flush = Z_NO_FLUSH) {
    stream_.next_in = static_cast<Bytef*>(const_cast<void*>(bytes));
    stream_.avail_in = static_cast<uInt>(size_bytes);
    do {
      stream_.next_out = buffer_.data();
      stream_.avail_out = static_cast<uInt>(buffer_.size());
      deflate(&stream_, flush);
      out_.append(buffer_.data(), buffer_.size() - stream_.avail_out);
    } while (stream_.avail_out == 0);
  }
  void finish() { append(nullptr, 0, Z_FINISH); }

 private:
  OutputFile& out_;
  std::vector<Bytef> buffer_;
  z_stream stream_{};
};

std::string header(const SplatOptions& options) {
  const auto number = [](std::uint32_t value) {
    std::string out;
    for (int b = 0; b < 4; ++b) out += static_cast<char>(value >> 8 * b);
    return out;
  };
  return "NGSP" + number(2) + number(static_cast<std::uint32_t>(options.count)) +
         static_cast<char>(options.sh_degree) + static_cast<char>(kFractionBits) +
         std::string(2, '\0');
}

}  // namespace

void write_spz(const SplatOptions& options, const SplatScene& scene) {
  constexpr std::uint64_t kBatch = 16384;
  const std::size_t columns = scene.columns(), lobes = scene.rest_columns() / 3;
  const std::array<std::size_t, kBlocks> row_bytes{9, 1, 3, 3, 3, 3 * lobes};
  std::deque<RemoveAtEnd> removed;
  std::vector<std::unique_ptr<OutputFile>> blocks;
  std::array<std::vector<unsigned char>, kBlocks> bytes;
  for (std::size_t k = 0; k < kBlocks; ++k) {
    const std::string& path = removed.emplace_back(fmt::format("{}.{}", options.path, k)).path();
    blocks.push_back(std::make_unique<OutputFile>(path));
    bytes[k].resize(row_bytes[k] * kBatch);
  }
  for (std::uint64_t first = 0; first < options.count; first += kBatch) {
    const std::uint64_t here = std::min(kBatch, options.count - first);
    tbb::parallel_for(tbb::blocked_range<std::uint64_t>(0, here, 256), [&](const auto& range) {
      std::vector<float> row(columns);
      for (std::uint64_t i = range.begin(); i < range.end(); ++i) {
        scene.fill(first + i, row);
        std::array<unsigned char*, kBlocks> to{};
        for (std::size_t k = 0; k < kBlocks; ++k) to[k] = bytes[k].data() + i * row_bytes[k];
        encode(row, lobes, to);
      }
    });
    for (std::size_t k = 0; k < kBlocks; ++k)
      blocks[k]->append(bytes[k].data(), here * row_bytes[k]);
  }
  OutputFile file(options.path);
  Gzip gzip(file);
  const std::string start = header(options);
  gzip.append(start.data(), start.size());
  std::vector<char> piece(1 << 20);
  for (std::size_t k = 0; k < kBlocks; ++k) {
    blocks[k]->commit();
    std::ifstream block(removed[k].path(), std::ios::binary);
    do {
      block.read(piece.data(), static_cast<std::streamsize>(piece.size()));
      gzip.append(piece.data(), static_cast<std::size_t>(block.gcount()));
    } while (block);
  }
  gzip.finish();
  file.commit();
}

}  // namespace pounce::fixture
