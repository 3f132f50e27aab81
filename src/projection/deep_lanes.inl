// SPDX-License-Identifier: Apache-2.0
//
// Lookups of a wide kernel in images of 16 bits, half and float: doubles, in the order of
// blend.cpp. Included by blend_lanes.inl, inside POUNCE_ISA_NAMESPACE.
//
// Sums of float and half samples are doubles, operation by operation as there. Sums of 16 bits are
// integers, of 58 bits where rows are summed: more than a double holds. So rows are split, high x
// 2^20 + low; both parts' sums are exact, and what adds them rounds once, as turning an integer of
// 64 bits into a double does.
//
// Only the sign of a zero may differ from there, where samples are -0: who cares looks one by one.

/// Samples of four texels in a row, by lane.
template <std::size_t kChannels>
using DeepRow = float[4 * kChannels][kGroup];

/// The lanes' halves, or integers of 16 bits, as floats.
template <Depth kDepth>
inline FloatRegister floats_of(UintRegister bits) {
  if constexpr (kDepth == Depth::u16)
    return __builtin_convertvector((IntRegister)bits, FloatRegister);
#if defined(__AVX512DQ__)
  return (FloatRegister)_mm512_cvtph_ps(_mm512_cvtepi32_epi16((__m512i)bits));
#else
  // Exponent and mantissa are moved to where a float has them; its exponent counts from elsewhere.
  constexpr float kBias = 0x1p112F;
  const FloatRegister magnitude = (FloatRegister)((bits & 0x7FFFU) << 13) * kBias;
  return (FloatRegister)((UintRegister)magnitude | (bits & 0x8000U) << 16);
#endif
}

/// Words of the lanes' runs, an even number of them.
template <std::size_t kWords>
inline std::array<IntRegister, kWords> load_words(const Runs& runs, std::ptrdiff_t at) {
  std::array<IntRegister, kWords> out;
  const auto load = [&]<bool kFour>(std::size_t first) {
    const auto one = [&](std::size_t lane) {
      return load_runs<kFour>(runs, lane, at + static_cast<std::ptrdiff_t>(4 * first));
    };
    const auto words = turned(one(0), one(1), one(2), one(3));
    for (std::size_t i = 0; i < (kFour ? 4 : 2); ++i) out[first + i] = words[i];
  };
  for (std::size_t first = 0; first + 4 <= kWords; first += 4)
    load.template operator()<true>(first);
  if constexpr (kWords % 4 != 0) load.template operator()<false>(kWords - 2);
  return out;
}

template <std::size_t kChannels, Depth kDepth>
inline void load_deep(const Runs& runs, std::ptrdiff_t at, DeepRow<kChannels>& row) {
  if constexpr (kDepth == Depth::float32) {
    const auto words = load_words<4 * kChannels>(runs, at);
    std::memcpy(row, words.data(), sizeof row);
  } else {
    const auto words = load_words<2 * kChannels>(runs, at);
    for (std::size_t i = 0; i < words.size(); ++i) {
      const auto pair = (UintRegister)words[i];
      const FloatRegister both[] = {floats_of<kDepth>(pair & 0xFFFFU),
                                    floats_of<kDepth>(pair >> 16)};
      std::memcpy(row[2 * i], both, sizeof both);
    }
  }
}

using FourDoubles = std::array<Doubles, 4>;
constexpr double kScale = kOne, kPerSquare = kPerOne * kPerOne;

inline FourDoubles doubles_of(const Four& weights) {
  return {doubles_of(weights[0]), doubles_of(weights[1]), doubles_of(weights[2]),
          doubles_of(weights[3])};
}

/// As weighted() in blend.h.
inline Doubles weighted(const FourDoubles& weights, const FourDoubles& values) {
  Doubles sum = 0.0 + weights[0] * values[0];
  for (std::size_t i = 1; i < 4; ++i) sum = sum + weights[i] * values[i];
  return sum;
}

/// As bend() there, of values that are never below 0 unless they are floats.
template <bool kIsFloat>
inline Doubles bend_deep(const Doubles& value, const Doubles& to, const Doubles& from, double one) {
  Doubles room = lesser(value, one - value);
  if constexpr (kIsFloat) {
    constexpr double kLargest = std::numeric_limits<float>::max();
    room = lesser(lesser(absolute(value), absolute(one - value)), one * kLargest - absolute(value));
  }
  const Doubles most = lesser(12.0 * lesser(absolute(to), absolute(from)), 24.0 * room);
  return lesser(greater(to - from, 0.0 - most), most);
}

/// What the sum takes of the moves of the two in the middle, as doubles.
struct DeepMoves {
  Doubles first, second, both;
  explicit DeepMoves(const Moves& moves)
      : first(doubles_of(moves.first)),
        second(doubles_of(moves.second)),
        both(doubles_of(moves.first + moves.second)) {}
};

/// How far the two in the middle are moved.
struct Bends {
  Doubles left, right;
};
template <bool kIsFloat>
inline Bends bends_of(const FourDoubles& values, double one) {
  const Doubles between = values[2] - values[1];
  return {bend_deep<kIsFloat>(values[1], values[1] - values[0], between, one),
          bend_deep<kIsFloat>(values[2], between, values[3] - values[2], one)};
}

/// As kept_sum() and sharpened_sum(), where doubles hold every sum.
inline Doubles sum_of(const FourDoubles& weights, const FourDoubles& values) {
  return kept(weighted(weights, values), values[1] * kScale, values[2] * kScale);
}
template <bool kIsFloat>
inline Doubles sum_of(const FourDoubles& weights, const DeepMoves& moves, const FourDoubles& values,
                      double one) {
  const Bends bends = bends_of<kIsFloat>(values, one);
  const Doubles sum =
      weighted(weights, values) + moves.first * bends.left + moves.second * bends.right;
  return kept(sum, values[1] * kScale + moves.both * bends.left,
              values[2] * kScale + moves.both * bends.right);
}

/// An integer of up to 58 bits, or a sum of products of such parts.
struct Split {
  Doubles high, low;
  explicit Split(const Doubles& value)
      : high(doubles_of(truncated(value * (1 / kScale)))), low(value - high * kScale) {}
  Split(const Doubles& high_part, const Doubles& low_part) : high(high_part), low(low_part) {}
  Doubles rounded() const { return high * kScale + low; }
};
inline Split operator+(const Split& a, const Split& b) { return {a.high + b.high, a.low + b.low}; }
inline Split operator*(const Doubles& by, const Split& a) { return {by * a.high, by * a.low}; }

inline Split weighted_split(const FourDoubles& weights, const FourDoubles& values) {
  Split sum = weights[0] * Split(values[0]);
  for (std::size_t i = 1; i < 4; ++i) sum = sum + weights[i] * Split(values[i]);
  return sum;
}

/// The same of rows of 16 bits. Rounding keeps an order, so what is rounded may be compared.
inline Doubles split_sum(const FourDoubles& weights, const FourDoubles& rows) {
  return kept(weighted_split(weights, rows).rounded(), rows[1] * kScale, rows[2] * kScale);
}
inline Doubles split_sum(const FourDoubles& weights, const DeepMoves& moves,
                         const FourDoubles& rows, double one) {
  const Bends bends = bends_of<false>(rows, one);
  const Split left(bends.left), right(bends.right);
  const auto moved = [&](const Doubles& row, const Split& bend) {
    return (doubles(kScale) * Split(row) + moves.both * bend).rounded();
  };
  const Split sum = weighted_split(weights, rows) + moves.first * left + moves.second * right;
  return kept(sum.rounded(), moved(rows[1], left), moved(rows[2], right));
}

template <std::size_t kChannels, Depth kDepth, bool kAcross, bool kDown>
void add_deep_sums(const std::byte* tile, const PlacesLanes& places, const WeightsLanes& weights,
                   const Sixteen<double>& share, MeansLanes& means) {
  constexpr bool kIsFloat = kDepth != Depth::u16;
  constexpr double kLargest = kIsFloat ? 1 : 65535;
  constexpr std::size_t kTexelBytes = kChannels * (kDepth == Depth::float32 ? 4 : 2);
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    const Runs runs = runs_of(tile, places, first, kTexelBytes);
    const Four across = load_four(weights.across, first), down = load_four(weights.down, first);
    Moves by_column{}, by_row{};
    if constexpr (kAcross) by_column = load_moves(weights.move_across, first);
    if constexpr (kDown) by_row = load_moves(weights.move_down, first);
    const FourDoubles columns = doubles_of(across), rows = doubles_of(down);
    const DeepMoves move_across(by_column), move_down(by_row);
    std::array<FourDoubles, kChannels> sums;
    for (std::size_t y = 0; y < 4; ++y) {
      alignas(64) DeepRow<kChannels> row;
      load_deep<kChannels, kDepth>(
          runs, static_cast<std::ptrdiff_t>(y * store::kColourTileEdge * kTexelBytes), row);
      for (std::size_t c = 0; c < kChannels; ++c) {
        const FourDoubles values{doubles_at(row[c]), doubles_at(row[kChannels + c]),
                                 doubles_at(row[2 * kChannels + c]),
                                 doubles_at(row[3 * kChannels + c])};
        sums[c][y] = kAcross ? sum_of<kIsFloat>(columns, move_across, values, kLargest)
                             : sum_of(columns, values);
      }
    }
    const Doubles by = load(share.data() + first);
    for (std::size_t c = 0; c < kChannels; ++c) {
      Doubles sum;
      if constexpr (kIsFloat) {
        sum = kDown ? sum_of<true>(rows, move_down, sums[c], kScale) : sum_of(rows, sums[c]);
      } else {
        sum = kDown ? split_sum(rows, move_down, sums[c], kLargest * kScale)
                    : split_sum(rows, sums[c]);
      }
      double* const mean = means[c].data() + first;
      const Doubles value = kIsFloat ? kPerSquare * sum : sum * kPerSquare / kLargest;
      store(mean, load(mean) + by * value);
    }
  }
}

template <std::size_t kChannels, Depth kDepth>
void add_deep(const std::byte* tile, const PlacesLanes& places, const WeightsLanes& weights,
              const Sixteen<double>& share, MeansLanes& means) {
  for_sharpening(weights, [&]<bool kAcross, bool kDown>() {
    add_deep_sums<kChannels, kDepth, kAcross, kDown>(tile, places, weights, share, means);
  });
}
