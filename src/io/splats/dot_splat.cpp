// SPDX-License-Identifier: Apache-2.0
#include "io/splats/dot_splat.h"

#include <fmt/format.h>

#include "core/input_file.h"
#include "io/splats/raw.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kRecordBytes =
    32;  // mean, sigma: 3 floats each; 4 bytes RGBA; 4 bytes WXYZ

}  // namespace

DotSplat::DotSplat(const std::string& path, const Axes& axes)
    : BatchScene(axes), file_(open_input(path)) {
  const std::uint64_t size = file_->size_bytes();
  if (size == 0 || size % kRecordBytes != 0) {
    throw Error(ErrorKind::input,
                fmt::format("{}: a .splat is a whole number of records of {} bytes, this file has "
                            "{} bytes; it was cut off or is something else, export it again",
                            path, kRecordBytes, size));
  }
  info_.format = ".splat";
  info_.splats = size / kRecordBytes;
  info_.files = {path};
}

std::uint64_t DotSplat::decode_bytes() const { return round_to_pages(kPieceRows * kRecordBytes); }

void DotSplat::decode(std::uint64_t first, std::uint64_t count, std::uint32_t, SplatBatch& batch,
                      const Take& take) const {
  PageVector<std::byte> raw(std::min(count, kPieceRows) * kRecordBytes);
  for (const std::uint64_t end = first + count; first < end;) {
    const std::uint64_t rows = std::min(end - first, kPieceRows);
    file_->read(first * kRecordBytes, std::span(raw).first(rows * kRecordBytes));
    for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i) {
        const std::byte* const at = &raw[(begin + i) * kRecordBytes];
        for (std::size_t k = 0; k < 3; ++k) {
          batch.mean[k][i] = value_at<float>(at + 4 * k);
          batch.sigma[k][i] = value_at<float>(at + 12 + 4 * k);
          batch.colour[k][i] = byte_at(at + 24 + k) / 255;
        }
        batch.alpha[i] = byte_at(at + 27) / 255;
        for (std::size_t k = 0; k < 4; ++k)
          batch.rotation[k][i] = (byte_at(at + 28 + k) - 128) / 128;
      }
      take(n);
    });
    first += rows;
  }
}

}  // namespace pounce::io
