// SPDX-License-Identifier: Apache-2.0
//
// Two images texel by texel, in strips of rows: how alike are they where the second has anything?
// Samples are compared as doubles in the range of their type (0 to 1 for integers), as they are
// stored: no colour is converted, since a result and its reference have one encoding. The sums run
// in the order of the texels, so they are the same for every size of strip.
#include "pounce/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "core/own_errors.h"
#include "io/codec/sample.h"
#include "io/image/read.h"

namespace pounce {
namespace {

/// An image that is read in strips of rows of doubles.
class Strips {
 public:
  Strips(const std::string& path, const ImageTrust& trust) : reader_(path, trust) {}
  const io::ImageInfo& info() const { return reader_.info(); }
  std::uint32_t colours() const { return info().channels - (info().has_alpha ? 1 : 0); }
  void read(std::uint32_t rows) {
    bytes_.resize(rows * reader_.row_bytes());
    samples_.resize(std::size_t{rows} * info().width * info().channels);
    reader_.read_rows(rows, bytes_.data());
    io::samples_to_double(info().depth, samples_.size(), bytes_.data(), samples_.data());
  }
  const double* texel(std::size_t index) const { return samples_.data() + index * info().channels; }

 private:
  io::ImageReader reader_;
  std::vector<std::byte> bytes_;
  std::vector<double> samples_;
};

/// |a - b|; 0 for equal infinities and for two NaNs, infinite if only one is a number.
double difference(double a, double b) {
  // Infinities subtract to NaN, and NaN compares as nothing: without these cases a difference would
  // vanish from the largest error.
  if (a == b || (std::isnan(a) && std::isnan(b))) return 0;
  const double d = std::abs(a - b);
  return std::isnan(d) ? std::numeric_limits<double>::infinity() : d;
}

/// Of the differences so far, and where the largest is.
struct Sums {
  double absolute = 0, squared = 0;
  Comparison result;

  void add(const double* a, const double* b, std::uint32_t channel_a, std::uint32_t channel_b,
           std::uint32_t x, std::uint32_t y) {
    const double d = difference(a[channel_a], b[channel_b]);
    absolute += d;
    squared += d * d;
    // The first of equal ones, in the order of the texels.
    if (d > result.largest_error) {
      result.largest_error = d;
      result.largest_x = x;
      result.largest_y = y;
    }
  }
};

/// Other channels are fine (the fewer of both are compared), another size is not: nothing is
/// resampled.
void check_sizes(const std::string& path, const io::ImageInfo& info, const std::string& other_path,
                 const io::ImageInfo& other) {
  if (info.width == other.width && info.height == other.height) return;
  throw Error(
      ErrorKind::input,
      fmt::format(
          "{} is {} x {} texels, but {} is {} x {}; only images of the same size can be compared",
          path, info.width, info.height, other_path, other.width, other.height));
}

Comparison compare_images(const std::string& a_path, const std::string& b_path,
                          const std::string& mask_path, const ImageTrust& trust) {
  Strips a(a_path, trust), b(b_path, trust);
  check_sizes(a_path, a.info(), b_path, b.info());
  std::optional<Strips> mask;
  if (!mask_path.empty()) {
    mask.emplace(mask_path, trust);
    check_sizes(mask_path, mask->info(), b_path, b.info());
  }
  // What counts: where there is a mask, what it shows; else what the second image shows by its
  // alpha. A mask decides about alpha itself, so only then is alpha compared, too.
  const bool masked_by_alpha = !mask && b.info().has_alpha;
  const bool alpha_compared = mask && a.info().has_alpha && b.info().has_alpha;
  const std::uint32_t colours = std::min(a.colours(), b.colours());

  const std::uint32_t width = b.info().width, height = b.info().height;
  // 65,536 texels at a time, so that memory does not grow with the images.
  const std::uint32_t strip_rows = std::clamp<std::uint32_t>((1U << 16) / width, 1, height);
  Sums sums;
  for (std::uint32_t top = 0; top < height; top += strip_rows) {
    const std::uint32_t rows = std::min(strip_rows, height - top);
    a.read(rows);
    b.read(rows);
    if (mask) mask->read(rows);
    for (std::size_t i = 0; i < std::size_t{rows} * width; ++i) {
      const double* const of_a = a.texel(i);
      const double* const of_b = b.texel(i);
      // A mask is a threshold here: a grey texel counts like a white one. Only its first channel is
      // asked.
      if (mask && mask->texel(i)[0] == 0) continue;
      if (masked_by_alpha && !(of_b[b.colours()] > 0)) continue;
      const auto x = static_cast<std::uint32_t>(i % width);
      const auto y = static_cast<std::uint32_t>(top + i / width);
      for (std::uint32_t c = 0; c < colours; ++c) sums.add(of_a, of_b, c, c, x, y);
      if (alpha_compared) sums.add(of_a, of_b, a.colours(), b.colours(), x, y);
      ++sums.result.texels;
    }
  }
  Comparison& result = sums.result;
  if (result.texels == 0) {
    throw Error(ErrorKind::input, fmt::format("{}: the mask is empty, so nothing can be compared",
                                              mask ? mask_path : b_path + " (its alpha)"));
  }
  result.channels = static_cast<int>(colours) + (alpha_compared ? 1 : 0);
  // The range of samples is 1, so PSNR is the logarithm of the mean square alone.
  const double count = static_cast<double>(result.texels) * result.channels;
  result.similarity = 1 - sums.absolute / count;
  result.psnr_db = sums.squared == 0 ? std::numeric_limits<double>::infinity()
                                     : 10 * std::log10(count / sums.squared);
  return result;
}

}  // namespace

Comparison compare(const std::string& a_path, const std::string& b_path,
                   const std::string& mask_path, const ImageTrust& trust) {
  return with_own_errors([&] { return compare_images(a_path, b_path, mask_path, trust); });
}

}  // namespace pounce
