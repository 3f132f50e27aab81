// SPDX-License-Identifier: Apache-2.0
//
// Numbers in text. They go through from_chars(), which knows no locale and rounds to the nearest;
// "nan", "inf" and "1,5" are none. A mesh of a million triangles has ten million numbers, nearly
// all of the kind "-0.5176431", so these are read without it, to the same bits: up to 15 digits and
// the power of ten below them are exact in double precision, hence their quotient is rounded once.
// To round it again, to a float, is wrong only where the first rounding may have met the middle of
// two floats.
#include "io/obj/numbers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace pounce::io {
namespace {

/// The powers of ten by which read_plain() divides.
constexpr std::array<double, 16> kPowers{1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                         1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};

/// Is that bit set, and none of the lower ones of what a float leaves out of a double's fraction?
bool is_between_floats(double value) {
  constexpr int kLeftOut = std::numeric_limits<double>::digits - std::numeric_limits<float>::digits;
  constexpr std::uint64_t kHalf = std::uint64_t{1} << (kLeftOut - 1);
  return (std::bit_cast<std::uint64_t>(value) & (2 * kHalf - 1)) == kHalf;
}

/// Reads a number without sign and exponent whose value takes no more than a division; returns how
/// many characters it has, 0 where from_chars() is to read it.
template <class T>
std::size_t read_plain(std::string_view word, T& value) {
  const char* const first = word.data();
  // A digit too many is refused below.
  const char* const end = first + std::min(word.size(), kPowers.size() + 1);
  const char* at = first;
  std::uint64_t digits = 0;
  const auto take_digits = [&] {
    const char* const from = at;
    for (; at != end && is_digit(*at); ++at)
      digits = 10 * digits + static_cast<std::uint64_t>(*at - '0');
    return static_cast<std::size_t>(at - from);
  };
  const std::size_t whole = take_digits();
  std::size_t fraction = 0;
  if (at != end && *at == '.') {
    ++at;
    fraction = take_digits();
    if (fraction == 0) return 0;
  }
  if (whole == 0 || whole + fraction >= kPowers.size()) return 0;
  const auto length = static_cast<std::size_t>(at - first);
  if (length < word.size() && (*at == 'e' || *at == 'E')) return 0;
  const double exact = static_cast<double>(digits) / kPowers[fraction];
  if (std::is_same_v<T, float> && is_between_floats(exact)) return 0;
  value = static_cast<T>(exact);
  return length;
}

/// Of a decimal number without sign that no such number can hold: is it too large, not too small?
bool is_large(std::string_view number) {
  const std::size_t mantissa = std::min(number.find_first_of("eE"), number.size());
  const std::size_t point = std::min(number.find('.'), mantissa);
  const std::size_t first = number.find_first_not_of("0.");
  std::string_view exponent = number.substr(std::min(mantissa + 1, number.size()));
  if (exponent.starts_with('+')) exponent.remove_prefix(1);
  // from_chars() says that a number is out of range, but not on which side. What decides is where
  // its first digit other than 0 stands after the exponent has moved the point.
  std::int64_t moved = 0;
  const auto result = std::from_chars(exponent.data(), exponent.data() + exponent.size(), moved);
  if (result.ec == std::errc::result_out_of_range) return exponent[0] != '-';
  return moved > static_cast<std::int64_t>(first) - static_cast<std::int64_t>(point);
}

/// Reads the number at the front of `word`; returns how many characters it has, 0 for none.
template <class T>
std::size_t read_number(std::string_view word, T& value) {
  const std::size_t sign = word.starts_with('+') || word.starts_with('-') ? 1 : 0;
  // from_chars() knows "inf" and "nan", and no "+".
  if (sign == word.size() || (word[sign] != '.' && !is_digit(word[sign]))) return 0;
  if (const std::size_t digits = read_plain(word.substr(sign), value)) {
    if (word[0] == '-') value = -value;
    return sign + digits;
  }
  const auto [end, error] = std::from_chars(word.data() + sign, word.data() + word.size(), value);
  if (error == std::errc::invalid_argument) return 0;
  const auto length = static_cast<std::size_t>(end - word.data());
  if (error == std::errc::result_out_of_range) {
    value = is_large(word.substr(sign, length - sign)) ? std::numeric_limits<T>::infinity() : 0;
  }
  if (word[0] == '-') value = -value;
  return length;
}

template <class T>
std::optional<T> whole_number(std::string_view word) {
  T value = 0;
  const std::size_t length = read_number(word, value);
  return length > 0 && length == word.size() ? std::optional(value) : std::nullopt;
}

}  // namespace

std::optional<float> to_float(std::string_view word) { return whole_number<float>(word); }

std::optional<double> to_double(std::string_view word) { return whole_number<double>(word); }

// As MTL files are read by others: "0.5f" and "1,5" begin with a number, which counts.
float to_float_or(std::string_view word, float otherwise) {
  float value = 0;
  return read_number(word, value) > 0 && std::isfinite(value) ? value : otherwise;
}

}  // namespace pounce::io
