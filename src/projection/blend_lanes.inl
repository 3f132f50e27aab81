// SPDX-License-Identifier: Apache-2.0
//
// Lookups of sixteen texels, compiled once per instruction set with POUNCE_ISA_NAMESPACE set.
//
// What is averaged, and why, is said in footprint.cpp, blend.cpp and blend.h; here the same is
// done to a group of lanes at once, to the same bits:
//
//   footprint and places     doubles, operation by operation as there
//   weights                  doubles, then integers
//   a row's sum              bytes times weights in 16 bits, in two parts: high x 64 + low
//   the sum of rows          doubles: below 2^53 they hold the integers of blend.cpp exactly, so
//                            that neither order nor type matters
//   the mean                 doubles, in the order of lookups; its quotients by 255 are rounded as
//                            divisions are (over_255())
//
// Other depths than bytes: deep_lanes.inl.
//
// A lane's 4x4 texels lie in four runs of a tile. Registers of 16 bytes are loaded from each lane's
// run and turned over, four lanes by four words: a gather would take as many loads for each word.
#include <immintrin.h>

#include <cstring>
#include <limits>
#include <type_traits>

#include "projection/blend.h"
#include "projection/blend_lanes.h"
#include "projection/footprint.h"

namespace pounce::projection::POUNCE_ISA_NAMESPACE {
namespace {

using surface::kLanes;

#include "projection/lanes.inl"
//
#include "projection/double_lanes.inl"

// --- footprints ----------------------------------------------------------------------------------

void footprints(const HitPacket& hit, const AxesLanes& axes, const Vec2Lanes& scale, unsigned lanes,
                FootprintLanes& out) {
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    const DoubleMask used = mask_of(lanes >> first);  // what others hold may be no number
    using Three = std::array<Doubles, 3>;
    const auto three = [first](const auto& of) -> Three {
      return {doubles_at(&of[0][first]), doubles_at(&of[1][first]), doubles_at(&of[2][first])};
    };
    const auto along = [used](const Three& by, const Three& way, const Doubles& times) {
      return only(used, (by[0] * way[0] + by[1] * way[1] + by[2] * way[2]) * times);
    };
    // All is read before anything is written, of which the compiler cannot know where it lies.
    const Three x_by = three(hit.x_by), y_by = three(hit.y_by);
    const Doubles times_x = load(scale.x.data() + first), times_y = load(scale.y.data() + first);
    const Three way_a = three(axes.x), way_b = three(axes.y);
    const Doubles ax = along(x_by, way_a, times_x), ay = along(y_by, way_a, times_y),
                  bx = along(x_by, way_b, times_x), by = along(y_by, way_b, times_y);
    store(out.ax.data() + first, ax);
    store(out.ay.data() + first, ay);
    store(out.bx.data() + first, bx);
    store(out.by.data() + first, by);
  }
}

/// One side's lookups.
struct Side {
  Doubles step_x, step_y, count;
};

/// As spread() in footprint.cpp.
inline Side spread(const Doubles& x, const Doubles& y, const Doubles& texel) {
  const Doubles length2 = x * x + y * y, own = kExact * texel, own2 = own * own;
  const Doubles zero = doubles(0), one = doubles(1);
  const DoubleMask is_long = less(own2, length2);
  // Square roots and quotients take longer than all else here.
  if (bits_of(is_long) == 0) return {zero, zero, one};
  const Doubles width = square_root(length2 - own2);
  const Doubles wanted = lesser(width / (kSpacing * texel), doubles(kMostLookups));
  const Doubles below = whole_below(wanted);
  const Doubles count = greater(below + only(less(below, wanted), one), doubles(2));
  const Doubles scale = width / square_root(length2 * (count * count - 1.0));
  return {only(is_long, x * scale), only(is_long, y * scale), one + only(is_long, count - 1.0)};
}

/// As lookups_at(); returns the number of lookups. Not inlined: both of its calls would take
/// registers from what is around them.
[[gnu::noinline]] Doubles lookups_at(const Doubles& ax, const Doubles& ay, const Doubles& bx,
                                     const Doubles& by, const Doubles& level, const Doubles& texel,
                                     const Doubles& share, std::size_t first, LookupsLanes& out) {
  const Side a = spread(ax, ay, texel), b = spread(bx, by, texel);
  const Doubles count = a.count * b.count;
  store(out.step_ax.data() + first, a.step_x);
  store(out.step_ay.data() + first, a.step_y);
  store(out.step_bx.data() + first, b.step_x);
  store(out.step_by.data() + first, b.step_y);
  store(out.share.data() + first, share / count);
  store_register(out.level.data() + first, truncated(level));
  store_register(out.count_a.data() + first, truncated(a.count));
  store_register(out.count_b.data() + first, truncated(b.count));
  return count;
}

/// As sharpening_of(), along one axis of the image.
inline IntRegister sharpening(const Doubles& a, const Doubles& b) {
  const Doubles finer = kFine * kFine - (a * a + b * b);
  const DoubleMask is_finer = less(doubles(0), finer);
  if (bits_of(is_finer) == 0) return IntRegister{};
  return truncated(only(is_finer, kSharpest * finer / (kFine * kFine) + 0.5));
}

/// As lookups_of(), for the group from lane `first` on.
void lookups_of_group(const FootprintLanes& footprints, const Sixteen<std::int32_t>& last_level,
                      std::size_t first, FootprintLookupsLanes& out) {
  const Doubles zero = doubles(0), one = doubles(1);
  Doubles ax = load(footprints.ax.data() + first), ay = load(footprints.ay.data() + first),
          bx = load(footprints.bx.data() + first), by = load(footprints.by.data() + first);
  store_register(out.across.data() + first, sharpening(ax, bx));
  store_register(out.down.data() + first, sharpening(ay, by));
  Doubles aa = ax * ax + ay * ay, bb = bx * bx + by * by;
  const Doubles most = doubles(kMostTexels2);
  const DoubleMask is_wide =
      less(aa, most) & less(bb, most) & less(doubles(kExact * kExact), greater(aa, bb));
  constexpr unsigned kAll = (1U << kGroup) - 1;
  if (bits_of(is_wide) == 0) {
    lookups_at(zero, zero, zero, zero, zero, one, one, first, out.sets[0]);
    out.single |= kAll << first;
    return;
  }
  // What is not, is one lookup: as a footprint without sides is.
  ax = only(is_wide, ax);
  ay = only(is_wide, ay);
  bx = only(is_wide, bx);
  by = only(is_wide, by);
  aa = only(is_wide, aa);
  bb = only(is_wide, bb);
  const Doubles sum = aa + bb, area = ax * by - ay * bx;
  const Doubles apart = square_root(greater(sum * sum - 4.0 * area * area, zero));
  const Doubles wide = square_root((sum + apart) / 2.0);
  const Doubles narrow = only(less(zero, wide), absolute(area) / wide);
  Doubles size = greater(narrow / kNarrow, wide / kLong);
  const Doubles last = doubles_of(load_ints(last_level.data() + first));
  Doubles level = zero, texel = one;
  for (;;) {
    const DoubleMask deeper = less(level, last) & at_most(doubles(2), size);
    if (bits_of(deeper) == 0) break;
    size = size - only(deeper, size / 2.0);
    texel = texel + only(deeper, texel);
    level = level + only(deeper, one);
  }
  const DoubleMask is_between = less(level, last) & less(doubles(kBlendFrom), size);
  const Doubles next = only(is_between, (size - kBlendFrom) / (2 - kBlendFrom));
  const unsigned two = bits_of(is_between);
  const Doubles count = lookups_at(ax, ay, bx, by, level, texel, 1.0 - next, first, out.sets[0]);
  const unsigned several = bits_of(less(one, count));
  if (two != 0) lookups_at(ax, ay, bx, by, level + 1.0, texel * 2.0, next, first, out.sets[1]);
  out.two |= two << first;
  out.single |= (kAll & ~two & ~several) << first;
}

void lookups(const FootprintLanes& footprints, const Sixteen<std::int32_t>& last_level,
             FootprintLookupsLanes& out) {
  out.two = out.single = 0;
  for (std::size_t first = 0; first < kLanes; first += kGroup)
    lookups_of_group(footprints, last_level, first, out);
}

#include "projection/place_lanes.inl"
//
#include "projection/weight_lanes.inl"

/// Where the runs of a group's lanes begin.
using Runs = std::array<const std::byte*, kGroup>;

inline Runs runs_of(const std::byte* tile, const PlacesLanes& places, std::size_t first,
                    std::size_t texel_bytes) {
  Runs runs;
  for (std::size_t lane = 0; lane < kGroup; ++lane)
    runs[lane] = tile + static_cast<std::size_t>(places.offset[first + lane]) * texel_bytes;
  return runs;
}

#include "projection/byte_rows.inl"

// --- sums ----------------------------------------------------------------------------------------

constexpr int kSteps = 20;  // bits of a weight
static_assert(kOne == 1 << kSteps);
constexpr double kPerOne = 1.0 / kOne;

// Weights do not fit 16 bits, so they are split: high x 64 + low.
constexpr int kLowBits = 6;
inline IntRegister high_part(IntRegister weight) { return weight >> kLowBits; }
inline IntRegister low_part(IntRegister weight) { return weight & ((1 << kLowBits) - 1); }

/// Weights of a row.
struct RowWeights {
  explicit RowWeights(const Four& w) : high(parts(w, high_part)), low(parts(w, low_part)) {}
  IntRegister sum(const Pairs& texels) const {
    return (sum_of(high, texels) << kLowBits) + sum_of(low, texels);
  }
  static IntRegister sum_of(const Pairs& weights, const Pairs& texels) {
    return multiply_add(texels.first, weights.first) + multiply_add(texels.second, weights.second);
  }

  Pairs high, low;

 private:
  template <class Part>
  static Pairs parts(const Four& w, const Part& part) {
    return {pair<kLow, kLow>(part(w[0]), part(w[1])), pair<kLow, kLow>(part(w[2]), part(w[3]))};
  }
};

/// Weights of a row that is sharpened, and of the bends of the two in the middle.
struct SharpRowWeights {
  SharpRowWeights(const Four& w, const Moves& moves)
      : weights(w),
        high(pair<kLow, kLow>(high_part(moves.first), high_part(moves.second))),
        low(pair<kLow, kLow>(low_part(moves.first), low_part(moves.second))),
        left_high(
            pair<kLow, kLow>(high_part(moves.first + moves.second), IntRegister{} + kHighOne)),
        left_low(low_part(moves.first + moves.second)),
        right_high(pair<kHigh, kLow>(left_high, left_high)),
        right_low(left_low << 16) {}
  /// `bends`: of the left one and the right one.
  IntRegister sum(const Pairs& texels, IntRegister bends) const {
    const IntRegister coarse = RowWeights::sum_of(weights.high, texels) + multiply_add(bends, high);
    return (coarse << kLowBits) + RowWeights::sum_of(weights.low, texels) +
           multiply_add(bends, low);
  }
  /// One of the two in the middle and all that is taken of its bend.
  IntRegister left(IntRegister bend_and_texel) const {
    return (multiply_add(bend_and_texel, left_high) << kLowBits) +
           multiply_add(bend_and_texel, left_low);
  }
  IntRegister right(IntRegister texel_and_bend) const {
    return (multiply_add(texel_and_bend, right_high) << kLowBits) +
           multiply_add(texel_and_bend, right_low);
  }

 private:
  static constexpr int kHighOne = kOne >> kLowBits;
  RowWeights weights;
  IntRegister high, low, left_high, left_low, right_high, right_low;
};

/// As kept_sum() of a row.
[[gnu::always_inline]] inline IntRegister row_sum(const RowWeights& weights, const Pairs& texels) {
  // Halves of 16 bits: what the upper ones hold is shifted out.
  const auto left = (ShortRegister)((UintRegister)texels.first >> 16);
  const auto right = (ShortRegister)texels.second;
  const IntRegister least = (IntRegister)lesser(left, right) << kSteps,
                    most = (IntRegister)greater(left, right) << kSteps;
  return integers(lesser(greater(ordered(weights.sum(texels)), ordered(least)), ordered(most)));
}

template <class T>
inline T kept(const T& sum, const T& a, const T& b) {
  return lesser(greater(sum, lesser(a, b)), greater(a, b));
}

/// As sharpened_sum() of a row.
[[gnu::always_inline]] inline IntRegister row_sum(const SharpRowWeights& weights,
                                                  const Texels& texels) {
  const auto own = (ShortRegister)texels.middle;
  const ShortRegister to = own - (ShortRegister)texels.first,
                      from = (ShortRegister)texels.second - own;
  const ShortRegister room = lesser(own, 255 - own);
  const ShortRegister step = lesser(absolute(to), absolute(from));
  const ShortRegister most = times(lesser(step, room + room), 12);
  const auto bends = (IntRegister)lesser(greater(to - from, -most), most);
  const IntRegister left = weights.left(halves(bends, texels.first)),
                    right = weights.right(halves(texels.second, bends));
  return integers(kept(ordered(weights.sum(texels, bends)), ordered(left), ordered(right)));
}

// What follows takes half a group at a time: more would not stay in registers.
using Rows = std::array<DoubleRegister, 4>;

/// The sum of rows; shares are a whole number of steps of kPerOne each.
inline DoubleRegister weighted_rows(const Rows& shares, const Rows& rows) {
  DoubleRegister sum = shares[0] * rows[0];
  for (std::size_t i = 1; i < 4; ++i) sum = exact_sum(shares[i], rows[i], sum);
  return sum;
}

/// As kept_sum() of rows.
[[gnu::always_inline]] inline DoubleRegister column_sum(const Rows& shares, const Rows& rows) {
  return kept(weighted_rows(shares, rows), rows[1], rows[2]);
}

/// As bend() of rows.
[[gnu::always_inline]] inline DoubleRegister bend_of(DoubleRegister row, DoubleRegister to,
                                                     DoubleRegister from) {
  constexpr double kMost = 255.0 * kOne;
  const DoubleRegister room = lesser(row, kMost - row);
  const DoubleRegister most = 12.0 * lesser(lesser(absolute(to), absolute(from)), room + room);
  return lesser(greater(to - from, -most), most);
}

/// As sharpened_sum() of rows; so are moves.
[[gnu::always_inline]] inline DoubleRegister column_sum(const Rows& shares,
                                                        const std::array<DoubleRegister, 2>& moves,
                                                        const Rows& rows) {
  const DoubleRegister left = rows[1], right = rows[2], between = right - left;
  const DoubleRegister bend_left = bend_of(left, left - rows[0], between),
                       bend_right = bend_of(right, between, rows[3] - right);
  const DoubleRegister whole = moves[0] + moves[1];
  const DoubleRegister sum =
      exact_sum(moves[1], bend_right, exact_sum(moves[0], bend_left, weighted_rows(shares, rows)));
  return kept(sum, exact_sum(whole, bend_left, left), exact_sum(whole, bend_right, right));
}

/// One lookup of the group from lane `first` on: sums by channel, in the steps of rows.
template <std::size_t kChannels, bool kAcross, bool kDown>
[[gnu::always_inline]] inline std::array<Doubles, kChannels> sums_u8(const std::byte* tile,
                                                                     const PlacesLanes& places,
                                                                     const WeightsLanes& lanes,
                                                                     std::size_t first) {
  const Runs runs = runs_of(tile, places, first, kChannels);
  const Four across = load_four(lanes.across, first);
  const auto weights = [&] {
    if constexpr (kAcross) {
      return SharpRowWeights(across, load_moves(lanes.move_across, first));
    } else {
      return RowWeights(across);
    }
  }();
  alignas(64) std::int32_t sums[kChannels][4][kGroup];
  for (std::size_t y = 0; y < 4; ++y) {
    const auto texels = load_row<kChannels>(
        runs, static_cast<std::ptrdiff_t>(y * store::kColourTileEdge * kChannels), y == 3);
    for (std::size_t c = 0; c < kChannels; ++c)
      store_register(sums[c][y], row_sum(weights, texels[c]));
  }
  std::array<Doubles, kChannels> out;
  const auto columns = [&](std::size_t at, DoubleRegister Doubles::*half)
      __attribute__((always_inline)) {
    const auto share_of = [&](const Sixteen<std::int32_t>& weight) {
      return half_at(weight.data() + first + at) * kPerOne;
    };
    Rows shares;
    for (std::size_t y = 0; y < 4; ++y) shares[y] = share_of(lanes.down[y]);
    for (std::size_t c = 0; c < kChannels; ++c) {
      Rows rows;
      for (std::size_t y = 0; y < 4; ++y) rows[y] = half_at(sums[c][y] + at);
      if constexpr (kDown) {
        out[c].*half =
            column_sum(shares, {share_of(lanes.move_down[0]), share_of(lanes.move_down[1])}, rows);
      } else {
        out[c].*half = column_sum(shares, rows);
      }
    }
  };
  columns(0, &Doubles::low);
  columns(kHalf, &Doubles::high);
  return out;
}

/// Of a tent: sums by channel, and of the weights.
template <std::size_t kChannels>
struct TentSums {
  std::array<Doubles, kChannels> sums;
  Doubles total;
};

/// Of the group from lane `first` on.
template <std::size_t kChannels>
[[gnu::always_inline]] inline TentSums<kChannels> tent_u8(const std::byte* tile,
                                                          const PlacesLanes& places,
                                                          const WeightsLanes& lanes,
                                                          std::size_t first) {
  const Runs runs = runs_of(tile, places, first, kChannels);
  const Four weights = load_four(lanes.across, first);
  std::array<IntRegister, kChannels> sums{};
  for (std::size_t y = 0; y < 2; ++y) {  // the two in the middle
    const auto texels = load_row<kChannels>(
        runs, static_cast<std::ptrdiff_t>((y + 1) * store::kColourTileEdge * kChannels), false);
    for (std::size_t c = 0; c < kChannels; ++c) {
      const auto left = (IntRegister)((UintRegister)texels[c].first >> 16);
      const IntRegister right = texels[c].second & 0xFFFF;
      sums[c] += weights[2 * y] * left + weights[2 * y + 1] * right;
    }
  }
  TentSums<kChannels> out;
  for (std::size_t c = 0; c < kChannels; ++c) out.sums[c] = doubles_of(sums[c]);
  out.total = doubles_of(weights[0] + weights[1] + weights[2] + weights[3]);
  return out;
}

template <std::size_t kChannels>
void add_tents_u8(const std::byte* tile, const PlacesLanes& places, const WeightsLanes& weights,
                  const Sixteen<double>& share, MeansLanes& means) {
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    const auto tent = tent_u8<kChannels>(tile, places, weights, first);
    const Doubles by = load(share.data() + first);
    for (std::size_t c = 0; c < kChannels; ++c) {
      double* const mean = means[c].data() + first;
      store(mean, load(mean) + by * (tent.sums[c] / (tent.total * 255.0)));
    }
  }
}

template <std::size_t kChannels>
void round_tents_u8(const std::byte* tile, const PlacesLanes& places, const WeightsLanes& weights,
                    Sixteen<std::uint32_t>& texels) {
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    const auto tent = tent_u8<kChannels>(tile, places, weights, first);
    const Doubles per_sum = 1.0 / tent.total;
    IntRegister texel{};
    for (std::size_t c = 0; c < kChannels; ++c)
      texel |= truncated(tent.sums[c] * per_sum + 0.5) << static_cast<int>(8 * c);
    store_register(texels.data() + first, texel);
  }
}

template <std::size_t kChannels, bool kAcross, bool kDown>
void add_sums_u8(const std::byte* tile, const PlacesLanes& places, const WeightsLanes& weights,
                 const Sixteen<double>& share, MeansLanes& means) {
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    const auto sums = sums_u8<kChannels, kAcross, kDown>(tile, places, weights, first);
    const Doubles by = load(share.data() + first);
    for (std::size_t c = 0; c < kChannels; ++c) {
      double* const mean = means[c].data() + first;
      store(mean, load(mean) + by * over_255(sums[c], kOne));
    }
  }
}

template <std::size_t kChannels>
void add_u8(const std::byte* tile, const PlacesLanes& places, const WeightsLanes& weights,
            const Sixteen<double>& share, MeansLanes& means) {
  if (weights.is_tent) return add_tents_u8<kChannels>(tile, places, weights, share, means);
  for_sharpening(weights, [&]<bool kAcross, bool kDown>() {
    add_sums_u8<kChannels, kAcross, kDown>(tile, places, weights, share, means);
  });
}

template <std::size_t kChannels, bool kAcross, bool kDown>
void round_sums_u8(const std::byte* tile, const PlacesLanes& places, const WeightsLanes& weights,
                   Sixteen<std::uint32_t>& texels) {
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    const auto sums = sums_u8<kChannels, kAcross, kDown>(tile, places, weights, first);
    IntRegister texel{};
    for (std::size_t c = 0; c < kChannels; ++c)
      texel |= truncated(sums[c] * kPerOne + 0.5) << static_cast<int>(8 * c);
    store_register(texels.data() + first, texel);
  }
}

template <std::size_t kChannels>
void round_u8(const std::byte* tile, const PlacesLanes& places, const WeightsLanes& weights,
              Sixteen<std::uint32_t>& texels) {
  if (weights.is_tent) return round_tents_u8<kChannels>(tile, places, weights, texels);
  for_sharpening(weights, [&]<bool kAcross, bool kDown>() {
    round_sums_u8<kChannels, kAcross, kDown>(tile, places, weights, texels);
  });
}

#include "projection/deep_lanes.inl"

void round_means(const MeansLanes& means, std::size_t channels, Sixteen<std::uint32_t>& texels) {
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    IntRegister texel{};
    for (std::size_t c = 0; c < channels; ++c) {
      const Doubles mean = load(means[c].data() + first);
      const Doubles clamped = lesser(greater(mean, doubles(0)), doubles(1));
      texel |= truncated(clamped * 255.0 + 0.5) << static_cast<int>(8 * c);
    }
    store_register(texels.data() + first, texel);
  }
}

}  // namespace

template <Depth kDepth>
constexpr std::array<BlendLanes::Add, 4> kAddDeep{add_deep<1, kDepth>, add_deep<2, kDepth>,
                                                  add_deep<3, kDepth>, add_deep<4, kDepth>};

extern const BlendLanes kBlendLanes;
const BlendLanes kBlendLanes{POUNCE_ISA_NAME,
                             footprints,
                             lookups,
                             place,
                             place_hits,
                             weigh,
                             {{{add_u8<1>, add_u8<2>, add_u8<3>, add_u8<4>},
                               kAddDeep<Depth::u16>,
                               kAddDeep<Depth::half>,
                               kAddDeep<Depth::float32>}},
                             round_means,
                             {round_u8<1>, round_u8<2>, round_u8<3>, round_u8<4>}};

}  // namespace pounce::projection::POUNCE_ISA_NAMESPACE
