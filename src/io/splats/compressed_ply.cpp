// SPDX-License-Identifier: Apache-2.0
#include "io/splats/compressed_ply.h"

#include <array>

#include "core/directions.h"
#include "core/input_file.h"
#include "io/splats/raw.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kChunkRows = 256;
static_assert(kChunkRows == SplatBatch::kRows);

/// `bits` bits from `shift` up, as 0..1.
float unorm(std::uint32_t packed, int shift, int bits) {
  const std::uint32_t most = (1U << bits) - 1;
  return static_cast<float>(packed >> shift & most) / static_cast<float>(most);
}

/// 11, 10 and 11 bits.
std::array<float, 3> unorm_3(std::uint32_t packed) {
  return {unorm(packed, 21, 11), unorm(packed, 11, 10), unorm(packed, 0, 11)};
}

float between(float low, float high, float t) { return low * (1 - t) + high * t; }

/// w, x, y, z.
std::array<float, 4> rotation_of(std::uint32_t packed) {
  constexpr float kSqrt2 = 1.41421356F;
  const std::array<float, 3> rest{(unorm(packed, 20, 10) - 0.5F) * kSqrt2,
                                  (unorm(packed, 10, 10) - 0.5F) * kSqrt2,
                                  (unorm(packed, 0, 10) - 0.5F) * kSqrt2};
  const std::size_t largest = packed >> 30;
  std::array<float, 4> q;
  for (std::size_t k = 0, next = 0; k < 4; ++k)
    q[k] = k == largest ? largest_of_four(rest[0], rest[1], rest[2]) : rest[next++];
  return q;
}

/// The ends of a byte's range are exact, what is between lies in the middle of its step.
float harmonic_of(std::byte value) {
  const auto b = std::to_integer<unsigned>(value);
  const float n = b == 0 ? 0 : b == 255 ? 1 : (static_cast<float>(b) + 0.5F) / 256;
  return (n - 0.5F) * 8;
}

}  // namespace

CompressedPly::CompressedPly(const std::string& path, const Axes& axes)
    : BatchScene(axes), file_(open_input(path)), header_(read_compressed_ply_header(*file_, path)) {
  info_.format = "SuperSplat compressed PLY";
  info_.splats = header_.splats;
  info_.sh_degree = header_.sh_degree;
  info_.model = header_.model;
  info_.files = {path};
}

std::uint64_t CompressedPly::decode_bytes() const {
  return round_to_pages(kChunkRows * (header_.row_bytes + header_.harmonics)) +
         round_to_pages(header_.chunk_bytes);
}

void CompressedPly::decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                           SplatBatch& batch, const Take& take) const {
  const std::uint64_t row_bytes = header_.row_bytes;
  const std::uint32_t stored = header_.harmonics / 3;
  const std::uint32_t harmonics = std::min(lobes, stored);
  PageVector<std::byte> rows(kChunkRows * row_bytes), bytes(kChunkRows * header_.harmonics);
  PageVector<std::byte> bounds(header_.chunk_bytes);
  const auto bound = [&](std::size_t k) {
    return header_.bounds[k] ? value_at<float>(&bounds[*header_.bounds[k]]) : k < 15 ? 0.0F : 1.0F;
  };
  for (const std::uint64_t end = first + count; first < end;) {
    const std::size_t n = std::min(end - first, kChunkRows - first % kChunkRows);
    file_->read(header_.chunks_at + first / kChunkRows * header_.chunk_bytes, bounds);
    file_->read(header_.rows_at + first * row_bytes, std::span(rows).first(n * row_bytes));
    std::array<float, kCompressedBounds> box;
    for (std::size_t k = 0; k < box.size(); ++k) box[k] = bound(k);
    for (std::size_t i = 0; i < n; ++i) {
      const auto packed = [&](std::size_t column) {
        return value_at<std::uint32_t>(&rows[i * row_bytes + header_.packed[column]]);
      };
      const auto mean = unorm_3(packed(0)), scale = unorm_3(packed(2));
      const auto q = rotation_of(packed(1));
      const std::uint32_t colour = packed(3);
      for (std::size_t k = 0; k < 3; ++k) {
        batch.mean[k][i] = between(box[k], box[3 + k], mean[k]);
        batch.sigma[k][i] = between(box[6 + k], box[9 + k], scale[k]);
        batch.colour[k][i] =
            between(box[12 + k], box[15 + k], unorm(colour, 24 - 8 * static_cast<int>(k), 8));
      }
      for (std::size_t k = 0; k < 4; ++k) batch.rotation[k][i] = q[k];
      batch.alpha[i] = unorm(colour, 0, 8);
    }
    if (harmonics > 0) {
      file_->read(header_.harmonics_at + first * header_.harmonics,
                  std::span(bytes).first(n * header_.harmonics));
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t k = 0; k < harmonics; ++k) {
          for (std::size_t c = 0; c < 3; ++c) {
            batch.sh[3 * k + c][i] = harmonic_of(bytes[i * header_.harmonics + c * stored + k]);
          }
        }
      }
    }
    for (auto& sigma : batch.sigma) exponential(sigma, n);
    take(n);
    first += n;
  }
}

}  // namespace pounce::io
