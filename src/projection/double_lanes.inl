// SPDX-License-Identifier: Apache-2.0
//
// As many lanes of doubles as a register holds 32-bit integers, in two registers. Kernels that need
// doubles go through sixteen lanes in groups of that many, so that a group stays in registers.
// Included after lanes.inl.

constexpr std::size_t kGroup = kWidth;  // lanes of a group
constexpr std::size_t kGroups = kLanes / kGroup;
constexpr std::size_t kHalf = kGroup / 2;

using DoubleRegister = double __attribute__((vector_size(8 * kHalf)));
using UintRegister = std::uint32_t __attribute__((vector_size(4 * kGroup)));

struct Doubles {
  DoubleRegister low, high;
};

inline Doubles doubles(double value) {
  const DoubleRegister all = DoubleRegister{} + value;
  return {all, all};
}

#define POUNCE_ARITHMETIC(op)                                                        \
  inline Doubles operator op(const Doubles& a, const Doubles& b) {                   \
    return {a.low op b.low, a.high op b.high};                                       \
  }                                                                                  \
  inline Doubles operator op(double a, const Doubles& b) { return doubles(a) op b; } \
  inline Doubles operator op(const Doubles& a, double b) { return a op doubles(b); }
POUNCE_ARITHMETIC(+)
POUNCE_ARITHMETIC(-)
POUNCE_ARITHMETIC(*)
POUNCE_ARITHMETIC(/)
#undef POUNCE_ARITHMETIC

inline Doubles load(const double* at) {
  return {load_register<DoubleRegister>(at), load_register<DoubleRegister>(at + kHalf)};
}
inline Doubles doubles_at(const float* at) {
#if defined(__AVX512DQ__)
  const auto half = [](const float* from) { return _mm512_cvtps_pd(_mm256_loadu_ps(from)); };
#elif defined(__AVX2__)
  const auto half = [](const float* from) { return _mm256_cvtps_pd(_mm_loadu_ps(from)); };
#else
  const auto half = [](const float* from) {
    return _mm_cvtps_pd(_mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(from))));
  };
#endif
  return {(DoubleRegister)half(at), (DoubleRegister)half(at + kHalf)};
}
inline void store(double* at, const Doubles& value) {
  store_register(at, value.low);
  store_register(at + kHalf, value.high);
}
inline IntRegister load_ints(const std::int32_t* at) { return load_register<IntRegister>(at); }

/// a < b ? x : y
inline Doubles where_less(const Doubles& a, const Doubles& b, const Doubles& x, const Doubles& y) {
  return {a.low < b.low ? x.low : y.low, a.high < b.high ? x.high : y.high};
}

// Instructions that the compiler does not find by itself. lesser() is a < b ? a : b, greater()
// a > b ? a : b: of two zeros, and where one is no number, b.
#if defined(__AVX512DQ__)
#define POUNCE_PD(name) _mm512_##name
#define POUNCE_RD __m512d
#elif defined(__AVX2__)
#define POUNCE_PD(name) _mm256_##name
#define POUNCE_RD __m256d
#else
#define POUNCE_PD(name) _mm_##name
#define POUNCE_RD __m128d
#endif
inline DoubleRegister lesser(DoubleRegister a, DoubleRegister b) {
  return (DoubleRegister)POUNCE_PD(min_pd)((POUNCE_RD)a, (POUNCE_RD)b);
}
inline DoubleRegister greater(DoubleRegister a, DoubleRegister b) {
  return (DoubleRegister)POUNCE_PD(max_pd)((POUNCE_RD)a, (POUNCE_RD)b);
}
inline Doubles lesser(const Doubles& a, const Doubles& b) {
  return {lesser(a.low, b.low), lesser(a.high, b.high)};
}
inline Doubles greater(const Doubles& a, const Doubles& b) {
  return {greater(a.low, b.low), greater(a.high, b.high)};
}
inline Doubles square_root(const Doubles& a) {
  return {(DoubleRegister)POUNCE_PD(sqrt_pd)((POUNCE_RD)a.low),
          (DoubleRegister)POUNCE_PD(sqrt_pd)((POUNCE_RD)a.high)};
}
/// a b + c where both are exact: so it does not matter whether they are rounded once or twice.
inline DoubleRegister exact_sum(DoubleRegister a, DoubleRegister b, DoubleRegister c) {
#if defined(__FMA__)
  return (DoubleRegister)POUNCE_PD(fmadd_pd)((POUNCE_RD)a, (POUNCE_RD)b, (POUNCE_RD)c);
#else
  return a * b + c;
#endif
}
/// a / (255 unit) of what is neither tiny nor huge, to the last bit; `unit` is a power of two.
inline Doubles over_255(const Doubles& a, double unit) {
#if defined(__FMA__)
  // The product with the rounded inverse is off by less than its last place, so one step of
  // Newton's with its exact remainder rounds as the quotient does (P. Markstein, IBM J. Res. Dev.
  // 34, 1990).
  const auto divided = [unit](DoubleRegister x) {
    const POUNCE_RD inverse = POUNCE_PD(set1_pd)(1.0 / 255 / unit),
                    by = POUNCE_PD(set1_pd)(255 * unit);
    const POUNCE_RD near = POUNCE_PD(mul_pd)((POUNCE_RD)x, inverse);
    return (DoubleRegister)POUNCE_PD(fmadd_pd)(POUNCE_PD(fnmadd_pd)(near, by, (POUNCE_RD)x),
                                               inverse, near);
  };
  return {divided(a.low), divided(a.high)};
#else
  return a / (255.0 * unit);
#endif
}
#undef POUNCE_PD
#undef POUNCE_RD
inline DoubleRegister absolute(DoubleRegister a) {
  using Bits = std::int64_t __attribute__((vector_size(sizeof a)));
  return (DoubleRegister)((Bits)a & std::numeric_limits<std::int64_t>::max());
}
/// `size`, which is positive, with the signs of a.
inline Doubles with_sign_of(const Doubles& a, double size) {
  using Bits = std::int64_t __attribute__((vector_size(sizeof a.low)));
  const auto half = [&](DoubleRegister x) {
    const Bits signs = (Bits)x & std::numeric_limits<std::int64_t>::min();
    return (DoubleRegister)(signs | (Bits)(DoubleRegister{} + size));
  };
  return {half(a.low), half(a.high)};
}
inline Doubles absolute(const Doubles& a) { return {absolute(a.low), absolute(a.high)}; }

/// As many integers as a register holds doubles.
inline DoubleRegister half_at(const std::int32_t* at) {
#if defined(__AVX512DQ__)
  return (DoubleRegister)_mm512_cvtepi32_pd(
      _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)));
#elif defined(__AVX2__)
  return (DoubleRegister)_mm256_cvtepi32_pd(_mm_loadu_si128(reinterpret_cast<const __m128i*>(at)));
#else
  return (DoubleRegister)_mm_cvtepi32_pd(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(at)));
#endif
}

#if defined(__AVX512DQ__)
/// Towards zero; what does not fit, or is no number, becomes the least integer.
inline IntRegister truncated(const Doubles& a) {
  const __m256i low = _mm512_cvttpd_epi32((__m512d)a.low),
                high = _mm512_cvttpd_epi32((__m512d)a.high);
  return (IntRegister)_mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
}
inline Doubles doubles_of(IntRegister a) {
  return {(DoubleRegister)_mm512_cvtepi32_pd(_mm512_castsi512_si256((__m512i)a)),
          (DoubleRegister)_mm512_cvtepi32_pd(_mm512_extracti64x4_epi64((__m512i)a, 1))};
}
inline IntRegister lesser(IntRegister a, IntRegister b) {
  return (IntRegister)_mm512_min_epi32((__m512i)a, (__m512i)b);
}
inline IntRegister greater(IntRegister a, IntRegister b) {
  return (IntRegister)_mm512_max_epi32((__m512i)a, (__m512i)b);
}
#elif defined(__AVX2__)
inline IntRegister truncated(const Doubles& a) {
  const __m128i low = _mm256_cvttpd_epi32((__m256d)a.low),
                high = _mm256_cvttpd_epi32((__m256d)a.high);
  return (IntRegister)_mm256_inserti128_si256(_mm256_castsi128_si256(low), high, 1);
}
inline Doubles doubles_of(IntRegister a) {
  return {(DoubleRegister)_mm256_cvtepi32_pd(_mm256_castsi256_si128((__m256i)a)),
          (DoubleRegister)_mm256_cvtepi32_pd(_mm256_extracti128_si256((__m256i)a, 1))};
}
inline IntRegister lesser(IntRegister a, IntRegister b) {
  return (IntRegister)_mm256_min_epi32((__m256i)a, (__m256i)b);
}
inline IntRegister greater(IntRegister a, IntRegister b) {
  return (IntRegister)_mm256_max_epi32((__m256i)a, (__m256i)b);
}
#else
inline IntRegister truncated(const Doubles& a) {
  return (IntRegister)_mm_unpacklo_epi64(_mm_cvttpd_epi32((__m128d)a.low),
                                         _mm_cvttpd_epi32((__m128d)a.high));
}
inline Doubles doubles_of(IntRegister a) {
  return {(DoubleRegister)_mm_cvtepi32_pd((__m128i)a),
          (DoubleRegister)_mm_cvtepi32_pd(_mm_unpackhi_epi64((__m128i)a, (__m128i)a))};
}
#endif

// Integers as something whose lesser and greater cost one instruction each.
#if defined(__AVX2__)
inline IntRegister ordered(IntRegister a) { return a; }
inline IntRegister integers(IntRegister a) { return a; }
#else
/// Of 32 bits SSE2 has these for floats alone. Bits of positive floats are ordered as the floats
/// are, and where |a| is below 2^30 - 2^23, none of them is tiny, infinite or no number.
struct Ordered {
  __m128 bits;
};
constexpr std::int32_t kToPositive = 1 << 30;
inline Ordered ordered(IntRegister a) { return {(__m128)(a + kToPositive)}; }
inline IntRegister integers(const Ordered& a) { return (IntRegister)a.bits - kToPositive; }
inline Ordered lesser(const Ordered& a, const Ordered& b) { return {_mm_min_ps(a.bits, b.bits)}; }
inline Ordered greater(const Ordered& a, const Ordered& b) { return {_mm_max_ps(a.bits, b.bits)}; }
#endif

/// Lanes of doubles: those that a comparison holds for, or that bits name from the lowest on. What
/// is chosen by them is a value or 0.
struct DoubleMask {
#if defined(__AVX512DQ__)
  __mmask8 low, high;
#else
  DoubleRegister low, high;  // all bits of a lane, or none
#endif
};
#if defined(__AVX512DQ__)
inline DoubleMask less(const Doubles& a, const Doubles& b) {
  return {_mm512_cmp_pd_mask((__m512d)a.low, (__m512d)b.low, _CMP_LT_OQ),
          _mm512_cmp_pd_mask((__m512d)a.high, (__m512d)b.high, _CMP_LT_OQ)};
}
inline DoubleMask at_most(const Doubles& a, const Doubles& b) {
  return {_mm512_cmp_pd_mask((__m512d)a.low, (__m512d)b.low, _CMP_LE_OQ),
          _mm512_cmp_pd_mask((__m512d)a.high, (__m512d)b.high, _CMP_LE_OQ)};
}
inline DoubleMask mask_of(unsigned bits) {
  return {static_cast<__mmask8>(bits), static_cast<__mmask8>(bits >> kHalf)};
}
inline unsigned bits_of(const DoubleMask& mask) {
  return mask.low | static_cast<unsigned>(mask.high) << kHalf;
}
inline DoubleMask operator&(const DoubleMask& a, const DoubleMask& b) {
  return {static_cast<__mmask8>(a.low & b.low), static_cast<__mmask8>(a.high & b.high)};
}
inline Doubles only(const DoubleMask& mask, const Doubles& value) {
  return {(DoubleRegister)_mm512_maskz_mov_pd(mask.low, (__m512d)value.low),
          (DoubleRegister)_mm512_maskz_mov_pd(mask.high, (__m512d)value.high)};
}
#else
// By instructions: GCC 12 takes what combines comparisons of 64 bits apart, lane by lane, for SSE2.
#if defined(__AVX2__)
inline DoubleRegister less(DoubleRegister a, DoubleRegister b) {
  return (DoubleRegister)_mm256_cmp_pd((__m256d)a, (__m256d)b, _CMP_LT_OQ);
}
inline DoubleRegister at_most(DoubleRegister a, DoubleRegister b) {
  return (DoubleRegister)_mm256_cmp_pd((__m256d)a, (__m256d)b, _CMP_LE_OQ);
}
inline DoubleRegister both(DoubleRegister a, DoubleRegister b) {
  return (DoubleRegister)_mm256_and_pd((__m256d)a, (__m256d)b);
}
#else
inline DoubleRegister less(DoubleRegister a, DoubleRegister b) {
  return (DoubleRegister)_mm_cmplt_pd((__m128d)a, (__m128d)b);
}
inline DoubleRegister at_most(DoubleRegister a, DoubleRegister b) {
  return (DoubleRegister)_mm_cmple_pd((__m128d)a, (__m128d)b);
}
inline DoubleRegister both(DoubleRegister a, DoubleRegister b) {
  return (DoubleRegister)_mm_and_pd((__m128d)a, (__m128d)b);
}
#endif
inline DoubleMask less(const Doubles& a, const Doubles& b) {
  return {less(a.low, b.low), less(a.high, b.high)};
}
inline DoubleMask at_most(const Doubles& a, const Doubles& b) {
  return {at_most(a.low, b.low), at_most(a.high, b.high)};
}
inline DoubleMask mask_of(unsigned bits) {
  // Words by twos, since SSE2 compares no more than words.
  IntRegister low, high;
  for (std::size_t i = 0; i < kGroup; ++i) {
    low[i] = 1 << i / 2;
    high[i] = 1 << (i / 2 + kHalf);
  }
  const IntRegister all = IntRegister{} + static_cast<std::int32_t>(bits);
  return {(DoubleRegister)((IntRegister)((all & low) == low)),
          (DoubleRegister)((IntRegister)((all & high) == high))};
}
inline unsigned bits_of(const DoubleMask& mask) {
#if defined(__AVX2__)
  const auto half = [](DoubleRegister x) { return _mm256_movemask_pd((__m256d)x); };
#else
  const auto half = [](DoubleRegister x) { return _mm_movemask_pd((__m128d)x); };
#endif
  return static_cast<unsigned>(half(mask.low) | half(mask.high) << kHalf);
}
inline DoubleMask operator&(const DoubleMask& a, const DoubleMask& b) {
  return {both(a.low, b.low), both(a.high, b.high)};
}
inline Doubles only(const DoubleMask& mask, const Doubles& value) {
  return {both(mask.low, value.low), both(mask.high, value.high)};
}
#endif

/// The nearest whole numbers that are not above: of zeros 0, not -0, as integers have it. Where
/// they do not fit 32 bits some number.
inline Doubles whole_below(const Doubles& a) {
#if defined(__AVX512DQ__)
  const auto half = [](DoubleRegister x) {
    return (DoubleRegister)_mm512_roundscale_pd((__m512d)x, _MM_FROUND_TO_NEG_INF) + 0.0;
  };
  return {half(a.low), half(a.high)};
#elif defined(__AVX2__)
  const auto half = [](DoubleRegister x) {
    return (DoubleRegister)_mm256_floor_pd((__m256d)x) + 0.0;
  };
  return {half(a.low), half(a.high)};
#else
  const Doubles to_zero = doubles_of(truncated(a));
  return to_zero - only(less(a, to_zero), doubles(1));
#endif
}

/// All bits of the lanes in which a < b.
inline IntRegister lanes_of_less(const Doubles& a, const Doubles& b) {
  const DoubleMask mask = less(a, b);
#if defined(__AVX512DQ__)
  return (IntRegister)_mm512_movm_epi32(static_cast<__mmask16>(bits_of(mask)));
#elif defined(__AVX2__)
  // Halves of 128 bits are shuffled each by itself.
  const auto mixed = (__m256i)_mm256_shuffle_ps((__m256)mask.low, (__m256)mask.high, 0x88);
  return (IntRegister)_mm256_permute4x64_epi64(mixed, 0xD8);
#else
  return (IntRegister)_mm_shuffle_ps((__m128)mask.low, (__m128)mask.high, 0x88);
#endif
}

/// One bit per lane whose integer is not zero.
inline unsigned bits_of_group(IntRegister mask) {
  unsigned out = 0;
#if defined(__AVX512DQ__)
  out = _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask);
#elif defined(__AVX2__)
  out = static_cast<unsigned>(_mm256_movemask_ps((__m256)(IntRegister)(mask != 0)));
#else
  out = static_cast<unsigned>(_mm_movemask_ps((__m128)(IntRegister)(mask != 0)));
#endif
  return out;
}
/// All bits of the lanes whose bit is set, from the lowest on.
inline IntRegister lanes_of(unsigned bits) {
  IntRegister lane;
  for (std::size_t i = 0; i < kGroup; ++i) lane[i] = 1 << i;
  return ((IntRegister{} + static_cast<std::int32_t>(bits)) & lane) != 0;
}
