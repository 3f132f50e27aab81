// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <cstddef>
#include <optional>
#include <string_view>
#include <system_error>

namespace pounce::io {

/// The float nearest to a decimal number; infinite where that is too large. Nothing for any other
/// word, such as "nan", "inf" and "1,5".
std::optional<float> to_float(std::string_view word);
/// The same in double precision.
std::optional<double> to_double(std::string_view word);
/// The float of the number that a word begins with; `otherwise` where that is none or too large.
float to_float_or(std::string_view word, float otherwise);
inline bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// std::from_chars(), faster for an index of a few digits.
inline std::from_chars_result read_index(const char* first, const char* end, int& index) {
  constexpr std::ptrdiff_t kFewDigits = 9;
  const char* at = first;
  int value = 0;
  while (at != end && is_digit(*at) && at - first < kFewDigits) value = 10 * value + (*at++ - '0');
  if (at == first || (at != end && is_digit(*at))) return std::from_chars(first, end, index);
  index = value;
  return {at, std::errc()};
}

}  // namespace pounce::io
