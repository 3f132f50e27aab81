// SPDX-License-Identifier: Apache-2.0
//
// Rows of texels of 8 bits: four in a row of each lane, loaded from the lanes' runs of a tile, as
// pairs of 16-bit integers by channel. That is the form in which one instruction multiplies a pair
// by two weights and adds the products. Included by blend_lanes.inl, inside POUNCE_ISA_NAMESPACE.

using ShortRegister = std::int16_t __attribute__((vector_size(4 * kGroup)));
using UshortRegister = std::uint16_t __attribute__((vector_size(4 * kGroup)));

#if defined(__AVX512DQ__)
#define POUNCE_SI(name) _mm512_##name
#define POUNCE_REGISTER __m512i
#elif defined(__AVX2__)
#define POUNCE_SI(name) _mm256_##name
#define POUNCE_REGISTER __m256i
#else
#define POUNCE_SI(name) _mm_##name
#define POUNCE_REGISTER __m128i
#endif

/// Products of 16 bits, added in pairs.
inline IntRegister multiply_add(IntRegister a, IntRegister b) {
  return (IntRegister)POUNCE_SI(madd_epi16)((POUNCE_REGISTER)a, (POUNCE_REGISTER)b);
}
inline ShortRegister lesser(ShortRegister a, ShortRegister b) {
  return (ShortRegister)POUNCE_SI(min_epi16)((POUNCE_REGISTER)a, (POUNCE_REGISTER)b);
}
inline ShortRegister greater(ShortRegister a, ShortRegister b) {
  return (ShortRegister)POUNCE_SI(max_epi16)((POUNCE_REGISTER)a, (POUNCE_REGISTER)b);
}
/// Without their sign; of the least integer there is none.
inline ShortRegister absolute(ShortRegister a) {
#if defined(__AVX2__)
  return (ShortRegister)POUNCE_SI(abs_epi16)((POUNCE_REGISTER)a);
#else
  return greater(a, -a);
#endif
}
/// The lower 16 bits of the products.
inline ShortRegister times(ShortRegister a, std::int16_t b) {
  return (ShortRegister)POUNCE_SI(mullo_epi16)((POUNCE_REGISTER)a, POUNCE_SI(set1_epi16)(b));
}

/// Sixteen bytes, or eight, of the lanes `i`, `i` + 4, ...
template <bool kSixteenBytes>
inline POUNCE_REGISTER load_runs(const Runs& runs, std::size_t i, std::ptrdiff_t at) {
  const auto one = [&](std::size_t lane) {
    const auto* from = reinterpret_cast<const __m128i*>(runs[lane] + at);
    return kSixteenBytes ? _mm_loadu_si128(from) : _mm_loadl_epi64(from);
  };
#if defined(__AVX512DQ__)
  __m512i out = _mm512_castsi128_si512(one(i));
  out = _mm512_inserti32x4(out, one(i + 4), 1);
  out = _mm512_inserti32x4(out, one(i + 8), 2);
  return _mm512_inserti32x4(out, one(i + 12), 3);
#elif defined(__AVX2__)
  return _mm256_inserti128_si256(_mm256_castsi128_si256(one(i)), one(i + 4), 1);
#else
  return one(i);
#endif
}

/// The words of the runs, by lanes.
inline std::array<IntRegister, 4> turned(POUNCE_REGISTER a, POUNCE_REGISTER b, POUNCE_REGISTER c,
                                         POUNCE_REGISTER d) {
  const POUNCE_REGISTER ab = POUNCE_SI(unpacklo_epi32)(a, b), cd = POUNCE_SI(unpacklo_epi32)(c, d),
                        ab2 = POUNCE_SI(unpackhi_epi32)(a, b),
                        cd2 = POUNCE_SI(unpackhi_epi32)(c, d);
  return {(IntRegister)POUNCE_SI(unpacklo_epi64)(ab, cd),
          (IntRegister)POUNCE_SI(unpackhi_epi64)(ab, cd),
          (IntRegister)POUNCE_SI(unpacklo_epi64)(ab2, cd2),
          (IntRegister)POUNCE_SI(unpackhi_epi64)(ab2, cd2)};
}

/// Four texels of a row of one channel, as integers of 16 bits: the first and the second, the third
/// and the fourth.
struct Pairs {
  IntRegister first, second;
};

/// The same of texels, and a third pair: the second and the third of them.
struct Texels : Pairs {
  IntRegister middle;
};

/// Bytes 0 and 2 of words, and bytes 1 and 3, as integers of 16 bits.
struct Bytes {
  explicit Bytes(IntRegister words)
      : even(words & 0xFF00FF), odd((IntRegister)((UshortRegister)words >> 8)) {}
  IntRegister even, odd;
};

enum class Half : bool { low, high };
constexpr Half kLow = Half::low, kHigh = Half::high;

/// A half of one word and a half of another.
template <Half kA, Half kB>
inline IntRegister pair(IntRegister a, IntRegister b) {
  const IntRegister low = kA == Half::low ? a & 0xFFFF : (IntRegister)((UintRegister)a >> 16);
  return low | (kB == Half::low ? b << 16 : b & ~0xFFFF);
}

inline Texels texels_of(IntRegister first, IntRegister second) {
  return {{first, second}, pair<kHigh, kLow>(first, second)};
}

/// The lower halves of one's words and the upper ones of another's.
inline IntRegister halves(IntRegister low, IntRegister high) {
#if defined(__AVX2__) && !defined(__AVX512DQ__)
  return (IntRegister)_mm256_blend_epi16((__m256i)low, (__m256i)high, 0xAA);
#else
  return pair<kLow, kHigh>(low, high);
#endif
}

/// The channels of four texels of three or four bytes each, which lie in words one after the other.
template <std::size_t kChannels, class Words>
inline std::array<Texels, kChannels> bytes_of_words(const Words& words) {
  const Bytes a(words[0]), b(words[1]), c(words[2]);
  if constexpr (kChannels == 3) {
    return {texels_of(pair<kLow, kHigh>(a.even, a.odd), pair<kHigh, kLow>(b.even, c.odd)),
            texels_of(pair<kLow, kLow>(a.odd, b.even), pair<kHigh, kHigh>(b.odd, c.even)),
            texels_of(pair<kHigh, kLow>(a.even, b.odd), pair<kLow, kHigh>(c.even, c.odd))};
  } else {
    const Bytes d(words[3]);
    return {texels_of(pair<kLow, kLow>(a.even, b.even), pair<kLow, kLow>(c.even, d.even)),
            texels_of(pair<kLow, kLow>(a.odd, b.odd), pair<kLow, kLow>(c.odd, d.odd)),
            texels_of(pair<kHigh, kHigh>(a.even, b.even), pair<kHigh, kHigh>(c.even, d.even)),
            texels_of(pair<kHigh, kHigh>(a.odd, b.odd), pair<kHigh, kHigh>(c.odd, d.odd))};
  }
}

template <std::size_t kChannels>
[[gnu::always_inline]] inline std::array<Texels, kChannels> load_row(const Runs& runs,
                                                                     std::ptrdiff_t at,
                                                                     bool is_last) {
  if constexpr (kChannels == 1) {
    IntRegister word;
    for (std::size_t lane = 0; lane < kGroup; ++lane) {
      std::int32_t v;
      std::memcpy(&v, runs[lane] + at, sizeof v);
      word[lane] = v;
    }
    const Bytes bytes(word);
    return {texels_of(pair<kLow, kLow>(bytes.even, bytes.odd),
                      pair<kHigh, kHigh>(bytes.even, bytes.odd))};
  } else if constexpr (kChannels == 2) {
    const auto words = turned(load_runs<false>(runs, 0, at), load_runs<false>(runs, 1, at),
                              load_runs<false>(runs, 2, at), load_runs<false>(runs, 3, at));
    const Bytes first(words[0]), second(words[1]);
    return {texels_of(first.even, second.even), texels_of(first.odd, second.odd)};
  } else {
    // Three channels are twelve bytes: what is loaded beside them lies behind, but of the last row,
    // which may be the end of the tile, before.
    constexpr std::ptrdiff_t kBefore = kChannels == 3 ? 4 : 0;
    const auto load = [&](std::size_t i) {
      return load_runs<true>(runs, i, is_last ? at - kBefore : at);
    };
    POUNCE_REGISTER a = load(0), b = load(1), c = load(2), d = load(3);
#if defined(__AVX2__)
#if defined(__AVX512DQ__)
    const auto in_all = [](__m128i one) { return _mm512_broadcast_i32x4(one); };
#else
    const auto in_all = [](__m128i one) { return _mm256_broadcastsi128_si256(one); };
#endif
    // Bytes 0, 2, 1, 3 of each channel become a word.
    const auto order = [&](int skipped) {
      const auto of = [&](int channel) {
        constexpr int kC = static_cast<int>(kChannels);
        const int i = channel + skipped;
        return channel >= kC ? -1 : i | (i + 2 * kC) << 8 | (i + kC) << 16 | (i + 3 * kC) << 24;
      };
      return in_all(_mm_setr_epi32(of(0), of(1), of(2), of(3)));
    };
    const POUNCE_REGISTER by = is_last ? order(kBefore) : order(0);
    const auto words = turned(POUNCE_SI(shuffle_epi8)(a, by), POUNCE_SI(shuffle_epi8)(b, by),
                              POUNCE_SI(shuffle_epi8)(c, by), POUNCE_SI(shuffle_epi8)(d, by));
    // Of a word, bytes 2 and 1 are the two in the middle; -1 are zeros.
    constexpr char k0 = -1;
    const POUNCE_REGISTER middle =
        in_all(_mm_setr_epi8(2, k0, 1, k0, 6, k0, 5, k0, 10, k0, 9, k0, 14, k0, 13, k0));
    std::array<Texels, kChannels> out;
    for (std::size_t channel = 0; channel < kChannels; ++channel) {
      const Bytes bytes(words[channel]);
      out[channel] = {
          {bytes.even, bytes.odd},
          (IntRegister)POUNCE_SI(shuffle_epi8)((POUNCE_REGISTER)words[channel], middle)};
    }
    return out;
#else
    if (is_last && kBefore != 0) {
      a = _mm_srli_si128(a, kBefore);
      b = _mm_srli_si128(b, kBefore);
      c = _mm_srli_si128(c, kBefore);
      d = _mm_srli_si128(d, kBefore);
    }
    return bytes_of_words<kChannels>(turned(a, b, c, d));
#endif
  }
}

#undef POUNCE_SI
#undef POUNCE_REGISTER
