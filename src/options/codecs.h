// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "options/parse.h"
#include "options/row.h"

namespace pounce::options {

// How each kind of value is read and printed. What is printed is read again as the same value.

/// A whole number of `lowest`..`highest`.
template <class Integer>
Codec<Integer> integer(std::uint64_t lowest, std::uint64_t highest) {
  const bool is_bounded = highest < std::numeric_limits<std::uint64_t>::max();
  return {[=](const std::string& option, const std::string& text) {
            return static_cast<Integer>(parse_integer(option, text, lowest, highest));
          },
          [](const Integer& value) { return std::to_string(value); },
          is_bounded ? fmt::format("{} to {}", lowest, highest) : "", true};
}
/// A number of `lowest`..`highest`, printed with all its digits.
Codec<double> number(double lowest, double highest);
/// A number above 0.
Codec<double> above_zero();
/// The standard deviation of a texel's Gaussian.
Codec<double> sigma();
/// One of the names that `from_name` knows.
template <class Enum>
Codec<Enum> name(std::optional<Enum> (*from_name)(const std::string&) noexcept,
                 const char* (*name_of)(Enum) noexcept, const std::string& expected) {
  return {[=](const std::string& option, const std::string& text) {
            const std::optional<Enum> value = from_name(text);
            if (!value) refuse_value(option, text, expected);
            return *value;
          },
          [=](const Enum& value) { return std::string(name_of(value)); }};
}
/// Text that `check` accepts as it is.
Codec<std::string> text(std::string (*check)(const std::string& option, const std::string& text));
Codec<std::string> any_text();
Codec<std::string> exr_compression();
/// The edge of a tile: a multiple of 16 up to 1024.
Codec<std::uint32_t> tile_edge();
/// Bytes, 0 being what holds if nothing is set; and a limit, 0 being "none".
Codec<std::uint64_t> bytes();
Codec<std::uint64_t> limit();
Codec<ImageSize> image_size();
Codec<Length> length();
Codec<AxisBox> box();
Codec<AirPoint> air_point();
Codec<std::vector<std::uint32_t>, std::uint32_t> udims();
Codec<std::vector<Channel>, Channel> baked();
/// The opacity below which Gaussians are skipped; prints nothing where it skips none.
Codec<double> least_opacity();
/// Axes, without what changes nothing: plus signs and, `as_stored`, x,y,z.
Codec<std::string> axes(bool as_stored);

}  // namespace pounce::options
