// SPDX-License-Identifier: Apache-2.0
//
// Rows are read a few hundred KiB at a time and taken apart by column: 256 rows of one column are
// loaded into an array, whatever its type, and the exponentials run over arrays as vector code.
#include "io/splats/ply.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/exp.h"
#include "core/half.h"

namespace pounce::io {
namespace {

using store::Splat;
using store::SplatCounts;
using store::SplatFilter;

constexpr std::size_t kRows = 256;  // at once: 17 columns of them stay in the first-level cache
constexpr std::uint64_t kReadBytes = 256 << 10;
constexpr double kC0 = 0.28209479177387814;  // the first spherical harmonic, 1 / sqrt(4 pi)
constexpr float kLeastAlpha = 1.0F / 255.0F;

enum Column : std::size_t {
  kX,
  kY,
  kZ,
  kDc = 3,
  kOpacity = 6,
  kScale = 7,
  kRot = 10,
  kNormal = 14
};
constexpr std::array<const char*, 17> kNames{
    "x",       "y",     "z",     "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
    "scale_2", "rot_0", "rot_1", "rot_2",  "rot_3",  "nx",     "ny",      "nz"};

using Values = std::array<float, kRows>;

template <class T>
float number(T value) {
  return static_cast<float>(value);
}
float number(std::uint16_t half) { return half_to_float(half); }

template <class T>
void load_as(const std::byte* from, std::size_t stride, std::size_t rows, Values& to) {
  for (std::size_t i = 0; i < rows; ++i) {
    T value;
    std::memcpy(&value, from + i * stride, sizeof value);
    to[i] = number(value);
  }
}

void load(const std::byte* from, PlyType type, std::size_t stride, std::size_t rows, Values& to) {
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

/// Unit vector, or zeros where there is no direction.
template <std::size_t N>
std::array<float, N> unit(const std::array<float, N>& v) {
  double sum = 0;
  for (const float c : v) sum += static_cast<double>(c) * static_cast<double>(c);
  std::array<float, N> result{};
  if (!(sum > 0) || !std::isfinite(sum)) return result;
  const double scale = 1 / std::sqrt(sum);
  for (std::size_t k = 0; k < N; ++k) result[k] = static_cast<float>(v[k] * scale);
  return result;
}

}  // namespace

/// Up to kRows rows, taken apart.
struct SplatPly::Batch {
  std::array<Values, 17> values;
  std::array<Values, 3> sigma;
  Values alpha;

  void compute(std::size_t rows) {
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t i = 0; i < rows; ++i) {
        sigma[k][i] = static_cast<float>(exp_same(static_cast<double>(values[kScale + k][i])));
      }
    }
    for (std::size_t i = 0; i < rows; ++i) {
      alpha[i] =
          static_cast<float>(1.0 / (1.0 + exp_same(-static_cast<double>(values[kOpacity][i]))));
    }
  }

  /// Why row i is of no use, if so. Infinite opacities are meant; a scale of -infinity is a disc.
  bool reject(std::size_t i, SplatFilter* reason) const {
    // A sum is finite or NaN if and only if every term is: 0 times infinity is NaN.
    float zero = 0;
    for (const std::size_t c : {kX, kY, kZ}) zero += values[c][i] * 0;
    for (std::size_t c = kDc; c < kOpacity; ++c) zero += values[c][i] * 0;
    for (std::size_t c = kRot; c < kNormal; ++c) zero += values[c][i] * 0;
    const float largest = std::max({sigma[0][i], sigma[1][i], sigma[2][i]});
    const bool is_number = zero == 0 && !std::isnan(values[kOpacity][i]) &&
                           !std::isnan(sigma[0][i]) && !std::isnan(sigma[1][i]) &&
                           !std::isnan(sigma[2][i]);
    const auto is_zero = [&](std::size_t k) { return values[kRot + k][i] == 0; };
    if (!is_number) {
      *reason = SplatFilter::not_finite;
    } else if (is_zero(0) && is_zero(1) && is_zero(2) && is_zero(3)) {
      *reason = SplatFilter::zero_quaternion;
    } else if (alpha[i] < kLeastAlpha) {
      *reason = SplatFilter::transparent;
    } else if (largest == 0) {
      *reason = SplatFilter::sizeless;
    } else if (!std::isfinite(largest)) {
      *reason = SplatFilter::exploded;
    } else {
      return false;
    }
    return true;
  }

  Splat splat(std::size_t i) const {
    Splat s;
    s.mean = {values[kX][i], values[kY][i], values[kZ][i]};
    s.sigma = {sigma[0][i], sigma[1][i], sigma[2][i]};
    s.rotation =
        unit<4>({values[kRot][i], values[kRot + 1][i], values[kRot + 2][i], values[kRot + 3][i]});
    s.alpha = alpha[i];
    const auto colour = [&](std::size_t c) {
      return static_cast<float>(0.5 + kC0 * static_cast<double>(values[kDc + c][i]));
    };
    s.colour = {colour(0), colour(1), colour(2)};
    const auto n = unit<3>({values[kNormal][i], values[kNormal + 1][i], values[kNormal + 2][i]});
    s.normal = {n[0], n[1], n[2]};
    return s;
  }
};

SplatPly::SplatPly(const std::string& path, const Axes& axes)
    : file_(posix_file_system().open(path)),
      header_(read_splat_ply_header(*file_, path)),
      axes_(axes) {
  has_normals_ = true;
  for (std::size_t c = 0; c < kNames.size(); ++c) {
    if (const PlyColumn* column = header_.find(kNames[c])) {
      columns_[c] = *column;
      has_scale_2_ |= c == kScale + 2;
    } else {
      has_normals_ &= c < kNormal;
    }
  }
}

std::uint64_t SplatPly::batch_rows() const {
  return std::max<std::uint64_t>(1, kReadBytes / header_.row_bytes);
}

PageVector<Splat> SplatPly::sample() const {
  constexpr std::uint64_t kRowsPerSpot = 64, kSpots = kSampleSplats / kRowsPerSpot;
  const std::uint64_t rows = header_.splats;
  PageVector<Splat> splats;
  splats.reserve(std::min(rows, kSampleSplats));
  SplatCounts ignored{};
  if (rows <= kSampleSplats) {
    read(0, rows, splats, ignored);
    return splats;
  }
  for (std::uint64_t i = 0; i < kSpots; ++i)
    read(rows / kSpots * i + rows % kSpots * i / kSpots, kRowsPerSpot, splats, ignored);
  return splats;
}

std::uint64_t SplatPly::read_bytes() const {
  return round_to_pages(batch_rows() * header_.row_bytes) + round_to_pages(sizeof(Batch));
}

void SplatPly::read(std::uint64_t first_row, std::uint64_t rows, PageVector<Splat>& out,
                    SplatCounts& filtered) const {
  const std::size_t stride = header_.row_bytes;
  PageVector<std::byte> raw(std::min(rows, batch_rows()) * stride);
  PageVector<Batch> storage(1);
  Batch& batch = storage.front();
  for (auto& column : batch.values) column.fill(0);
  if (!has_scale_2_) batch.values[kScale + 2].fill(-std::numeric_limits<float>::infinity());
  const bool turned = axes_ != Axes{};
  for (const std::uint64_t end = first_row + rows; first_row < end;) {
    const std::uint64_t count = std::min(end - first_row, batch_rows());
    file_->read(header_.rows_at + first_row * stride, std::span(raw).first(count * stride));
    for (std::uint64_t begin = 0; begin < count; begin += kRows) {
      const std::size_t n = std::min<std::uint64_t>(kRows, count - begin);
      for (std::size_t c = 0; c < columns_.size(); ++c) {
        if (c == kScale + 2 ? !has_scale_2_ : c >= kNormal && !has_normals_) continue;
        load(&raw[begin * stride + columns_[c].offset], columns_[c].type, stride, n,
             batch.values[c]);
      }
      batch.compute(n);
      for (std::size_t i = 0; i < n; ++i) {
        SplatFilter reason;
        if (batch.reject(i, &reason)) {
          ++filtered[static_cast<std::size_t>(reason)];
          continue;
        }
        Splat splat = batch.splat(i);
        if (turned) {
          splat.mean = axes_.apply(splat.mean);
          splat.normal = axes_.apply(splat.normal);
          axes_.apply(splat.sigma, splat.rotation);
        }
        out.push_back(splat);
      }
    }
    first_row += count;
  }
}

}  // namespace pounce::io
