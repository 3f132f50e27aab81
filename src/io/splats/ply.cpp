// SPDX-License-Identifier: Apache-2.0
//
// Rows are read a few hundred KiB at a time and taken apart by column: 256 rows of one column are
// loaded into an array, whatever its type, and the exponentials run over arrays as vector code.
#include "io/splats/ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/input_file.h"
#include "core/portable_math.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kReadBytes = 256 << 10;

enum Column : std::size_t { kMean, kColour = 3, kOpacity = 6, kScale = 7, kRot = 10, kNormal = 14 };
constexpr std::array<const char*, 17> kNames{
    "x",       "y",     "z",     "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
    "scale_2", "rot_0", "rot_1", "rot_2",  "rot_3",  "nx",     "ny",      "nz"};

/// Where the column kNames[c] goes, before it is converted.
SplatBatch::Column& column_of(SplatBatch& batch, std::size_t c) {
  if (c < kColour) return batch.mean[c];
  if (c < kOpacity) return batch.colour[c - kColour];
  if (c < kScale) return batch.alpha;
  if (c < kRot) return batch.sigma[c - kScale];
  if (c < kNormal) return batch.rotation[c - kRot];
  return batch.normal[c - kNormal];
}

template <class T>
float number(T value) {
  return static_cast<float>(value);
}
float number(std::uint16_t half) { return half_to_float(half); }

template <class T>
void load_as(const std::byte* from, std::size_t stride, std::size_t rows, SplatBatch::Column& to) {
  for (std::size_t i = 0; i < rows; ++i) {
    T value;
    std::memcpy(&value, from + i * stride, sizeof value);
    to[i] = number(value);
  }
}

void load(const std::byte* from, PlyType type, std::size_t stride, std::size_t rows,
          SplatBatch::Column& to) {
  switch (type) {
    case PlyType::i8:
      return load_as<std::int8_t>(from, stride, rows, to);
    case PlyType::u8:
      return load_as<std::uint8_t>(from, stride, rows, to);
    case PlyType::i16:
      break;  // refused with the header
    case PlyType::u16:
      return load_as<std::uint16_t>(from, stride, rows, to);
    case PlyType::i32:
      return load_as<std::int32_t>(from, stride, rows, to);
    case PlyType::u32:
      return load_as<std::uint32_t>(from, stride, rows, to);
    case PlyType::f32:
      return load_as<float>(from, stride, rows, to);
    case PlyType::f64:
      return load_as<double>(from, stride, rows, to);
  }
}

}  // namespace

SplatPly::SplatPly(const std::string& path, const Axes& axes)
    : BatchScene(axes), file_(open_input(path)), header_(read_splat_ply_header(*file_, path)) {
  find_columns(path);
  info_.format = "3DGS PLY";
  info_.splats = header_.splats;
  info_.sh_degree = header_.sh_degree;
  info_.model = header_.model;
  info_.files = {path};
}

void SplatPly::find_columns(const std::string& path) {
  for (std::size_t c = 0; c < kNames.size(); ++c) {
    if (const PlyColumn* column = header_.find(kNames[c])) columns_[c] = *column;
  }
  // Two of three are no normal.
  if (std::any_of(columns_.begin() + kNormal, columns_.end(),
                  [](const PlyColumn& column) { return column.name.empty(); }))
    std::fill(columns_.begin() + kNormal, columns_.end(), PlyColumn{});
  constexpr std::array<std::uint32_t, 5> kPerChannel{0, 3, 8, 15, 24};
  const std::uint32_t stored = kPerChannel[header_.sh_degree];
  for (std::uint32_t k = 0; k < std::min(stored, store::kMostLobes); ++k) {
    for (std::uint32_t channel = 0; channel < 3; ++channel) {
      const std::string name = fmt::format("f_rest_{}", channel * stored + k);
      const PlyColumn* column = header_.find(name);
      if (column == nullptr) {
        throw Error(ErrorKind::input,
                    fmt::format("{}: the splat PLY has {} columns f_rest_0, f_rest_1, ..., but no "
                                "\"{}\"; export it again",
                                path, 3 * stored, name));
      }
      harmonics_.push_back(*column);
    }
  }
}

std::uint64_t SplatPly::piece_rows() const {
  return std::max<std::uint64_t>(1, kReadBytes / header_.row_bytes);
}

std::uint64_t SplatPly::decode_bytes() const {
  return round_to_pages(piece_rows() * header_.row_bytes);
}

void SplatPly::decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                      SplatBatch& batch, const Take& take) const {
  const std::size_t stride = header_.row_bytes;
  const std::size_t harmonics = std::min<std::size_t>(harmonics_.size(), 3 * lobes);
  PageVector<std::byte> raw(std::min(count, piece_rows()) * stride);
  for (const std::uint64_t end = first + count; first < end;) {
    const std::uint64_t rows = std::min(end - first, piece_rows());
    file_->read(header_.rows_at + first * stride, std::span(raw).first(rows * stride));
    for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
      const auto load_column = [&](const PlyColumn& from, SplatBatch::Column& to) {
        load(&raw[begin * stride + from.offset], from.type, stride, n, to);
      };
      for (std::size_t c = 0; c < kNames.size(); ++c) {
        if (!columns_[c].name.empty()) load_column(columns_[c], column_of(batch, c));
      }
      for (std::size_t k = 0; k < harmonics; ++k) load_column(harmonics_[k], batch.sh[k]);
      for (std::size_t k = 0; k < 3; ++k) {  // a disc has no third scale: sigma stays 0
        if (!columns_[kScale + k].name.empty()) exponential(batch.sigma[k], n);
        colour_of_dc(batch.colour[k], n);
      }
      logistic(batch.alpha, n);
      take(n);
    });
    first += rows;
  }
}

}  // namespace pounce::io
