// SPDX-License-Identifier: Apache-2.0
//
// Why the lattice is bent: a trained scene of 5 m may hold a Gaussian at 1e7 m. Sized by its box, a
// lattice of 21 bits per axis would have cells of 10 m. Bent, it has cells of a thousandth of a
// spacing where the scene is, and 2^15 per doubling of the distance beyond. Any monotone map of
// each axis keeps what matters here: neighbours in the order are neighbours in space, and a range
// of keys is a few boxes.
//
// Why size classes: a block's box holds its largest Gaussian, so one that is a hundred times the
// others would make every ray near it read the block of its small neighbours. Apart, small blocks
// stay small, and the few large ones are blocks of their own (docs/decisions/010).
#include "store/blocks/splat_lattice.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace pounce::store {
namespace {

constexpr int kStraightBits = 19;  // cells on each side of the centre that are equal
constexpr int kOctaves = 16;       // beyond them
constexpr int kOctaveBits = 15;    // cells per octave; 16 * 2^15 = 2^19, so that a side has 2^20
constexpr double kStraight = 1 << kStraightBits;
constexpr double kBeyond = kStraight * (1 << kOctaves);
constexpr int kSideBits = 20;
// Gaussians up to 2-4 times the median size share the first class.
constexpr int kClassSlackBits = 2;

/// Value of that rank among them, 0 lowest, 1 highest.
float quantile(PageVector<float>& values, double rank) {
  const auto at =
      static_cast<std::ptrdiff_t>(std::llround(rank * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

/// The least power of two that is not below.
double power_of_two_above(double value) {
  int exponent;
  const double fraction = std::frexp(value, &exponent);  // in [1/2, 1)
  return std::ldexp(1.0, fraction == 0.5 ? exponent - 1 : exponent);
}

/// Which cell of an axis; rises with `cells`. Beyond the straight part the upper bits of a double
/// are such a code already: its exponent counts octaves, its mantissa divides each evenly.
std::uint64_t axis_code(double cells) {
  const double a = std::abs(cells);
  std::uint64_t code;
  if (a < kStraight) {
    code = static_cast<std::uint64_t>(a);
  } else {
    const auto bits = std::bit_cast<std::uint64_t>(a);
    const std::uint64_t octave = (bits >> 52) - 1023 - kStraightBits;
    code = (1U << kStraightBits) + (octave << kOctaveBits) +
           (bits >> (52 - kOctaveBits) & ((1U << kOctaveBits) - 1));
  }
  constexpr std::uint64_t kMiddle = 1U << kSideBits;
  return std::signbit(cells) ? kMiddle - 1 - code : kMiddle + code;
}

/// Bit i of 21 goes to bit 3 i.
std::uint64_t spread(std::uint64_t v) {
  v = (v | v << 32) & 0x1F00000000FFFFULL;
  v = (v | v << 16) & 0x1F0000FF0000FFULL;
  v = (v | v << 8) & 0x100F00F00F00F00FULL;
  v = (v | v << 4) & 0x10C30C30C30C30C3ULL;
  v = (v | v << 2) & 0x1249249249249249ULL;
  return v;
}

}  // namespace

SplatLattice::SplatLattice(std::span<const Splat> sample) {
  if (sample.empty()) return;
  std::array<PageVector<float>, 3> means;
  PageVector<float> sizes;
  for (auto& axis : means) axis.reserve(sample.size());
  sizes.reserve(sample.size());
  for (const Splat& s : sample) {
    means[0].push_back(s.mean.x);
    means[1].push_back(s.mean.y);
    means[2].push_back(s.mean.z);
    sizes.push_back(size_of(s));
  }
  std::array<float, 3> low, high;
  double half = 0;
  const auto measure = [&](double rank) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = quantile(means[k], rank);
      high[k] = quantile(means[k], 1 - rank);
      centre_[k] = (static_cast<double>(low[k]) + static_cast<double>(high[k])) / 2;
      half = std::max(half, (static_cast<double>(high[k]) - static_cast<double>(low[k])) / 2);
    }
  };
  // Outer tenths left out: a trained scene's background may be most of its extent.
  measure(0.1);
  if (half == 0) measure(0);  // most Gaussians stand in one place
  middle_ = {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
  const auto median = static_cast<double>(quantile(sizes, 0.5));
  if (half == 0) half = median;
  cell_ = power_of_two_above(half) / kStraight;
  per_cell_ = 1 / cell_;
  class_0_size_ = static_cast<float>(std::ldexp(power_of_two_above(median), kClassSlackBits - 1));
}

std::optional<SplatFilter> SplatLattice::filter(const Splat& splat) const {
  const double far = kBeyond * cell_;
  const std::array<float, 3> mean{splat.mean.x, splat.mean.y, splat.mean.z};
  for (std::size_t k = 0; k < 3; ++k) {
    if (std::abs(static_cast<double>(mean[k]) - centre_[k]) >= far) return SplatFilter::far;
  }
  if (static_cast<double>(size_of(splat)) >= far) return SplatFilter::exploded;
  return std::nullopt;
}

std::uint32_t SplatLattice::size_class(float size) const {
  // A class spans two doublings. A change of class ends a block, so more classes would mean more
  // blocks that are not full.
  if (size <= class_0_size_) return 0;
  const double ratio = static_cast<double>(size) / static_cast<double>(class_0_size_);
  return std::min(31U, static_cast<std::uint32_t>(std::ilogb(ratio)) / 2 + 1);
}

std::uint64_t SplatLattice::key(const Splat& splat) const {
  const Vec3f& mean = splat.mean;
  const auto code = [&](float v, std::size_t k) {
    return spread(axis_code((static_cast<double>(v) - centre_[k]) * per_cell_));
  };
  const std::uint64_t morton = code(mean.x, 0) << 2 | code(mean.y, 1) << 1 | code(mean.z, 2);
  const std::uint64_t size_class_of = size_class(size_of(splat));
  if (size_class_of == 0) return morton;
  // Larger ones are content with cells four times as wide: the class takes the bits.
  return 1ULL << 63 | size_class_of << kClassShift | morton >> 6;
}

int SplatLattice::distance(std::uint64_t key, std::uint64_t next) {
  // Three bits of a Morton code to a level: the highest bit in which they differ tells the cube.
  if (key_size_class(key) != key_size_class(next)) return 64;
  return (static_cast<int>(std::bit_width(key ^ next)) + 2) / 3;
}

std::size_t splat_cut(std::span<const std::uint64_t> keys, std::size_t most, bool ended) {
  // A cut at a wide gap makes two small boxes of one large one. None in the first quarter, and the
  // last of equal gaps: where all gaps are alike, as on a grid, blocks stay full.
  const std::size_t last = std::min(most, keys.size());
  std::size_t best = last;
  int widest = -1;
  for (std::size_t i = 1; i <= last; ++i) {
    if (i == keys.size()) {
      if (ended) return i;  // only here: everything fits
      break;
    }
    const int gap = SplatLattice::distance(keys[i - 1], keys[i]);
    if (gap == 64) return i;
    if (i >= most / 4 && gap >= widest) {
      widest = gap;
      best = i;
    }
  }
  return best;
}

}  // namespace pounce::store
