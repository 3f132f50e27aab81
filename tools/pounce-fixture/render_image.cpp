// SPDX-License-Identifier: Apache-2.0
#include "render_image.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <vector>

#include "io/image/write.h"
#include "pounce/error.h"

namespace pounce::fixture {
namespace {

std::size_t sample_bytes(Depth depth) {
  return depth == Depth::u8 ? 1 : depth == Depth::float32 ? 4 : 2;
}

float srgb_to_linear(float v) {
  return v <= 0.04045F ? v / 12.92F : std::pow((v + 0.055F) / 1.055F, 2.4F);
}

/// The half nearest to a value of 0 to 1, ties to even.
std::uint16_t half_bits(float value) {
  constexpr float kSmallestNormal = 6.103515625e-05F;  // 2^-14
  if (value < kSmallestNormal) {
    return static_cast<std::uint16_t>(std::lrint(value * 16777216.0F));
  }
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t rounded = bits + 0xFFFU + ((bits >> 13) & 1U);
  return static_cast<std::uint16_t>((rounded >> 13) - (112U << 10));  // exponent bias 127 -> 15
}

void store_sample(Depth depth, float value, std::byte* out) {
  const float unit = std::clamp(value, 0.0F, 1.0F);
  switch (depth) {
    case Depth::u8:
      *out = static_cast<std::byte>(static_cast<int>(unit * 255.0F + 0.5F));
      break;
    case Depth::u16: {
      const auto code = static_cast<std::uint16_t>(static_cast<int>(unit * 65535.0F + 0.5F));
      std::memcpy(out, &code, sizeof code);
      break;
    }
    case Depth::half: {
      const std::uint16_t bits = half_bits(unit);
      std::memcpy(out, &bits, sizeof bits);
      break;
    }
    case Depth::float32:
      std::memcpy(out, &unit, sizeof unit);
      break;
  }
}

}  // namespace

void render_image(const std::string& path, RenderSpec spec, const RenderRow& render_row) {
  // Wide enough that all threads have several rows, small against any budget: 16384 x RGB x 32 rows
  // = 1.5 MiB.
  constexpr std::uint32_t kStripRows = 32;
  const bool is_exr = path.ends_with(".exr");
  const bool has_alpha = spec.channels == 2 || spec.channels == 4;
  const io::ImageWriteSpec write{.width = spec.width,
                                 .height = spec.height,
                                 .channels = spec.channels,
                                 .depth = io::writable_depth(path, spec.depth),
                                 .linear = is_exr,
                                 .has_alpha = has_alpha};
  if (const std::string why = io::why_not_writable(path, write); !why.empty()) {
    throw Error(ErrorKind::usage, fmt::format("{}: {}", path, why));
  }
  io::ImageWriter writer(path, write);
  const std::size_t sample = sample_bytes(write.depth);
  const std::size_t row_samples = std::size_t{spec.width} * spec.channels;
  std::vector<std::byte> strip(row_samples * sample * kStripRows);
  tbb::enumerable_thread_specific<std::vector<float>> rows(std::vector<float>(row_samples, 0.0F));
  for (std::uint32_t first = 0; first < spec.height; first += kStripRows) {
    const std::uint32_t count = std::min(kStripRows, spec.height - first);
    tbb::parallel_for(std::uint32_t{0}, count, [&](std::uint32_t i) {
      std::vector<float>& row = rows.local();
      render_row(first + i, row);
      std::byte* out = strip.data() + i * row_samples * sample;
      for (std::size_t k = 0; k < row_samples; ++k, out += sample) {
        const bool is_alpha = has_alpha && k % spec.channels == spec.channels - 1;
        const bool decode = is_exr && !spec.is_data && !is_alpha;
        store_sample(write.depth, decode ? srgb_to_linear(row[k]) : row[k], out);
      }
    });
    writer.write_rows(count, strip.data());
  }
  writer.commit();
}

}  // namespace pounce::fixture
