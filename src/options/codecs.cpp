// SPDX-License-Identifier: Apache-2.0
//
// How each kind of value is read from text and printed again.
//
// Printing is the inverse of parsing, digit by digit: a report is read back as a job, and the hash
// of a job is made of these texts. So numbers are printed with the fewest digits that name the same
// double, and never rounded for people. What equals its default in meaning prints as nothing or as
// the default, however it was typed.
//
// `is_checked` marks codecs whose range a C++ caller can miss, who sets members without a parser.
// Such a value is printed and read once more, and the parser refuses what the command line would
// (check_ranges() in option_table.cpp).
#include "options/codecs.h"

#include <fmt/ranges.h>

#include "io/image/write.h"

namespace pounce::options {
namespace {

constexpr double kLeastOpacity = 0.0039;  // what people write for 1/255
constexpr double kLargestScale = 1e30;    // a float holds it

// fmt's shortest form: it reads back as the same double.
std::string digits(double value) { return fmt::format("{}", value); }

}  // namespace

Codec<double> number(double lowest, double highest) {
  return {[=](const std::string& option, const std::string& text) {
            return parse_number(option, text, lowest, highest);
          },
          digits, fmt::format("{:g} to {:g}", lowest, highest), true};
}

Codec<double> above_zero() {
  return {[](const std::string& option, const std::string& text) {
            // As a closed interval, which is all that parse_number() knows.
            return parse_number(option, text, 1 / kLargestScale, kLargestScale);
          },
          digits, "above 0", true};
}

Codec<double> sigma() { return number(0.1, 4); }

Codec<std::string> text(std::string (*check)(const std::string&, const std::string&)) {
  return {check, [](const std::string& value) { return value; }};
}

Codec<std::string> any_text() {
  return {[](const std::string&, const std::string& text) { return text; },
          [](const std::string& value) { return value; }};
}

Codec<std::string> exr_compression() {
  Codec<std::string> codec = any_text();
  codec.parse = [](const std::string& option, const std::string& text) {
    // The writer knows which compressions there are. One list is enough.
    const std::string why = io::why_no_exr_compression(text);
    if (!why.empty()) throw Error(ErrorKind::usage, option + ": " + why);
    return text;
  };
  codec.is_checked = true;
  return codec;
}

Codec<std::uint32_t> tile_edge() {
  // TIFF requires multiples of 16. EXR does not, but one rule serves both.
  constexpr std::uint32_t kStep = 16, kLargest = 1024;
  Codec<std::uint32_t> codec = integer<std::uint32_t>(kStep, kLargest);
  codec.parse = [](const std::string& option, const std::string& text) {
    const auto edge = static_cast<std::uint32_t>(parse_integer(option, text, kStep, kLargest));
    if (edge % kStep != 0) refuse_value(option, text, "a multiple of 16 from 16 to 1024");
    return edge;
  };
  return codec;
}

// Printed as plain bytes: a value in units would have to be rounded.
Codec<std::uint64_t> bytes() {
  return {parse_bytes, [](const std::uint64_t& value) { return std::to_string(value); }};
}

// No limit is 0 inside and a word outside: as a number it would read like the opposite.
Codec<std::uint64_t> limit() {
  return {parse_limit, [](const std::uint64_t& value) {
            return value == 0 ? std::string("none") : std::to_string(value);
          }};
}

Codec<ImageSize> image_size() {
  return {parse_image_size,
          [](const ImageSize& size) { return fmt::format("{}x{}", size.width, size.height); }, "",
          true};
}

Codec<Length> length() {
  return {
      parse_length,
      [](const Length& length) { return digits(length.value) + (length.is_percent ? "%" : ""); },
      "", true};
}

Codec<AxisBox> box() {
  return {parse_box,
          [](const AxisBox& box) {
            return fmt::format("{},{}", fmt::join(box.lowest, ","), fmt::join(box.highest, ","));
          },
          "", true};
}

Codec<AirPoint> air_point() {
  return {parse_air_point,
          [](const AirPoint& point) {
            return point.at ? fmt::format("{}", fmt::join(*point.at, ",")) : std::string("middle");
          },
          "", true};
}

// Lists are parsed as a whole and printed one element at a time: a report has them as a JSON list.
// Ranges are not restored; their numbers are.
Codec<std::vector<std::uint32_t>, std::uint32_t> udims() {
  return {parse_udims, [](const std::uint32_t& udim) { return std::to_string(udim); }, "", true};
}

Codec<std::vector<Channel>, Channel> baked() {
  return {parse_baked, [](const Channel& channel) { return std::string(channel_name(channel)); }};
}

Codec<double> least_opacity() {
  Codec<double> codec = number(kLeastOpacity, 1);
  // Between what people write for 1/255 and the exact number nothing is skipped that is not skipped
  // anyway, so all of it is the default.
  codec.print = [](const double& value) {
    return value >= kLeastOpacity && value <= kDefaultMinOpacity ? "" : digits(value);
  };
  return codec;
}

Codec<std::string> axes(bool as_stored) {
  return {parse_axes, [=](std::string value) {
            // "+x" is "x". Where axes have a default it is the identity, which prints as nothing;
            // elsewhere the identity is a choice of its own: pounce gaussians rotates some scenes
            // without it.
            std::erase(value, '+');
            return as_stored && value == "x,y,z" ? "" : value;
          }};
}

}  // namespace pounce::options
