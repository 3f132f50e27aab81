// SPDX-License-Identifier: Apache-2.0
#pragma once

// Convert by arithmetic: the table would have to be linked from libImath for two small functions.
#ifndef IMATH_HALF_NO_LOOKUP_TABLE
#define IMATH_HALF_NO_LOOKUP_TABLE
#endif
#include <Imath/half.h>

#include <cstdint>

namespace pounce {

/// IEEE 754 binary16 to binary32, exact.
inline float half_to_float(std::uint16_t half) { return imath_half_to_float(half); }

/// binary32 to binary16, rounded to nearest even; overflow becomes infinity.
inline std::uint16_t float_to_half(float value) { return imath_float_to_half(value); }

}  // namespace pounce
