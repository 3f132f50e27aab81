// SPDX-License-Identifier: Apache-2.0
//
// Sixteen lanes of floats or 32-bit integers in registers of the instruction set's own width: one
// of AVX-512, two of AVX2, four of SSE2. (One GCC vector of sixteen lanes would do on AVX-512; on
// narrower sets GCC 12 takes its comparisons and selections apart lane by lane, 3.6 times slower.)
// Included inside POUNCE_ISA_NAMESPACE.

#if defined(__AVX512DQ__)
constexpr int kWidth = 16;
#elif defined(__AVX2__)
constexpr int kWidth = 8;
#else
constexpr int kWidth = 4;
#endif
constexpr int kParts = kLanes / kWidth;

using FloatRegister = float __attribute__((vector_size(4 * kWidth)));
using IntRegister = std::int32_t __attribute__((vector_size(4 * kWidth)));

template <class Register, class T>
inline Register load_register(const T* at) {
  Register out;
  std::memcpy(&out, at, sizeof out);
  return out;
}
template <class Register, class T>
inline void store_register(T* at, const Register& value) {
  static_assert(sizeof value % sizeof(T) == 0);
  std::memcpy(at, &value, sizeof value);
}

/// Lanes of one type; operations are lane by lane, scalars stand for sixteen of themselves.
template <class Register>
struct Lanes {
  Register part[kParts];
};
using Floats = Lanes<FloatRegister>;
using Ints = Lanes<IntRegister>;

/// f applied to each register of the operands.
template <class F, class... Operands>
inline auto each(F f, const Operands&... operands) {
  Lanes<decltype(f(operands.part[0]...))> out;
  for (int p = 0; p < kParts; ++p) out.part[p] = f(operands.part[p]...);
  return out;
}

inline Floats all(float value) {
  Floats out;
  for (auto& part : out.part) part = value - FloatRegister{};  // + would be one: -0 + 0 is 0
  return out;
}
inline Ints all(std::int32_t value) {
  Ints out;
  for (auto& part : out.part) part = IntRegister{} + value;
  return out;
}

#define POUNCE_ARITHMETIC(op)                                                   \
  inline Floats operator op(const Floats& a, const Floats& b) {                 \
    return each([](FloatRegister x, FloatRegister y) { return x op y; }, a, b); \
  }                                                                             \
  inline Floats operator op(float a, const Floats& b) { return all(a) op b; }   \
  inline Floats operator op(const Floats& a, float b) { return a op all(b); }
POUNCE_ARITHMETIC(+)
POUNCE_ARITHMETIC(-)
POUNCE_ARITHMETIC(*)
POUNCE_ARITHMETIC(/)
#undef POUNCE_ARITHMETIC

#define POUNCE_ARITHMETIC(op)                                               \
  inline Ints operator op(const Ints& a, const Ints& b) {                   \
    return each([](IntRegister x, IntRegister y) { return x op y; }, a, b); \
  }                                                                         \
  inline Ints operator op(const Ints& a, std::int32_t b) { return a op all(b); }
POUNCE_ARITHMETIC(+)
POUNCE_ARITHMETIC(-)
POUNCE_ARITHMETIC(*)
#undef POUNCE_ARITHMETIC

// Comparisons give all bits of a lane or none.
#define POUNCE_COMPARISON(op)                                                                  \
  inline Ints operator op(const Floats& a, const Floats& b) {                                  \
    return each([](FloatRegister x, FloatRegister y) { return (IntRegister)(x op y); }, a, b); \
  }                                                                                            \
  inline Ints operator op(const Floats& a, float b) { return a op all(b); }                    \
  inline Ints operator op(const Ints& a, const Ints& b) {                                      \
    return each([](IntRegister x, IntRegister y) { return (IntRegister)(x op y); }, a, b);     \
  }                                                                                            \
  inline Ints operator op(const Ints& a, std::int32_t b) { return a op all(b); }
POUNCE_COMPARISON(<)
POUNCE_COMPARISON(<=)
POUNCE_COMPARISON(>)
POUNCE_COMPARISON(>=)
POUNCE_COMPARISON(==)
#undef POUNCE_COMPARISON

inline Ints operator&(const Ints& a, const Ints& b) {
  return each([](IntRegister x, IntRegister y) { return x & y; }, a, b);
}
inline Ints operator|(const Ints& a, const Ints& b) {
  return each([](IntRegister x, IntRegister y) { return x | y; }, a, b);
}

/// a where the mask is set, b elsewhere.
inline Floats select(const Ints& mask, const Floats& a, const Floats& b) {
  return each([](IntRegister m, FloatRegister x, FloatRegister y) { return m ? x : y; }, mask, a,
              b);
}
inline Ints select(const Ints& mask, const Ints& a, const Ints& b) {
  return each([](IntRegister m, IntRegister x, IntRegister y) { return m ? x : y; }, mask, a, b);
}

inline Floats absolute(const Floats& a) {
  return each([](FloatRegister x) { return x < 0.0F ? -x : x; }, a);
}
inline Floats square_root(const Floats& a) {
  return each(
      [](FloatRegister x) {
        FloatRegister out;
        for (int lane = 0; lane < kWidth; ++lane) out[lane] = __builtin_sqrtf(x[lane]);
        return out;
      },
      a);
}
inline Ints bits_of(const Floats& a) {
  return each([](FloatRegister x) { return (IntRegister)x; }, a);
}
/// Towards zero; values must fit.
inline Ints to_int(const Floats& a) {
  return each([](FloatRegister x) { return __builtin_convertvector(x, IntRegister); }, a);
}
inline Floats to_float(const Ints& a) {
  return each([](IntRegister x) { return __builtin_convertvector(x, FloatRegister); }, a);
}

// Register by register: what is copied as a whole goes through memory.
inline Floats load(const float* at) {
  Floats out;
  for (int p = 0; p < kParts; ++p) out.part[p] = load_register<FloatRegister>(at + p * kWidth);
  return out;
}
inline Ints load(const std::int32_t* at) {
  Ints out;
  for (int p = 0; p < kParts; ++p) out.part[p] = load_register<IntRegister>(at + p * kWidth);
  return out;
}
inline Floats load(const std::int8_t* at) {
  Floats out;
  for (auto& part : out.part) {
    for (int lane = 0; lane < kWidth; ++lane) part[lane] = static_cast<float>(*at++);
  }
  return out;
}
template <class Register, class T>
inline void store(T* at, const Lanes<Register>& value) {
  static_assert(sizeof(T) == 4);
  for (int p = 0; p < kParts; ++p) store_register(at + p * kWidth, value.part[p]);
}

/// One bit per lane of a comparison's result.
inline unsigned bits(const Ints& mask) {
  unsigned out = 0;
  for (int p = 0; p < kParts; ++p) {
#if defined(__AVX512DQ__)
    out |= _mm512_movepi32_mask(reinterpret_cast<__m512i>(mask.part[p]));
#elif defined(__AVX2__)
    out |= static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask.part[p])))
           << (p * kWidth);
#else
    out |= static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(mask.part[p])))
           << (p * kWidth);
#endif
  }
  return out;
}
inline bool any(const Ints& mask) { return bits(mask) != 0; }
