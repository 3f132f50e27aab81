// SPDX-License-Identifier: Apache-2.0
#include "io/image/colour_tags.h"

#include <fmt/format.h>
#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <string_view>

#include "io/image/guard.h"
#include "io/image/icc.h"

namespace pounce::io {
namespace {

using Bytes = std::vector<std::byte>;

std::uint32_t number(const Bytes& data, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = at; i < at + 4; ++i)
    value = value << 8 | (i < data.size() ? std::to_integer<std::uint32_t>(data[i]) : 0U);
  return value;
}

const Bytes* find(const std::vector<ColourPiece>& pieces, std::string_view kind) {
  for (const ColourPiece& piece : pieces) {
    if (piece.kind == kind) return &piece.data;
  }
  return nullptr;
}

/// A name, 0, the method 0, and the profile deflated.
Bytes inflated_profile(const Bytes& chunk) {
  std::size_t name = 0;
  while (name < chunk.size() && chunk[name] != std::byte{0}) ++name;
  if (name + 2 >= chunk.size()) return {};
  Bytes profile(kMostColourBytes);
  uLongf size = profile.size();
  const auto* const deflated = reinterpret_cast<const Bytef*>(chunk.data() + name + 2);
  const int code = ::uncompress(reinterpret_cast<Bytef*>(profile.data()), &size, deflated,
                                static_cast<uLong>(chunk.size() - name - 2));
  profile.resize(code == Z_OK ? size : 0);
  return profile;
}

ColourTags of_profile(const Bytes& bytes) {
  const auto profile = read_icc(bytes);
  if (!profile) return {};  // of grey, or none at all
  if (profile->space) return {profile->space->linear, profile->space->primaries, ""};
  return {{}, {}, fmt::format("its ICC profile \"{}\" is not applied", profile->description)};
}

/// ITU-T H.273's code points.
ColourTags of_cicp(const Bytes& data) {
  const auto code = [&](std::size_t i) {
    return i < data.size() ? std::to_integer<int>(data[i]) : 0;
  };
  constexpr int kBt709 = 1, kP3D65 = 12, kLinear = 8, kSrgb = 13;
  const bool is_known = (code(0) == kBt709 || code(0) == kP3D65) &&
                        (code(1) == kLinear || code(1) == kSrgb) && code(2) == 0;
  if (!is_known) {
    return {
        {}, {}, fmt::format("its cICP code points {}, {} are not understood", code(0), code(1))};
  }
  const Chromaticities p3 = colour_space_from_name("display-p3")->primaries;
  return {code(1) == kLinear, code(0) == kP3D65 ? p3 : kRec709, ""};
}

ColourTags of_gamma(const Bytes* gamma, const Bytes* chromaticities) {
  ColourTags tags;
  if (gamma != nullptr) {
    const double exponent = number(*gamma, 0) / 1e5;
    if (std::fabs(exponent - 1) < 0.01) tags.linear = true;
    // What writers say of sRGB: 1/2.2.
    if (std::fabs(exponent - 1 / 2.2) < 0.01) tags.linear = false;
    if (!tags.linear) tags.problem = fmt::format("its gamma of {:g} is not applied", exponent);
  }
  if (chromaticities == nullptr) return tags;
  Chromaticities said;  // the chunk begins with white
  for (std::size_t i = 0; i < 8; ++i)
    said[(i + 6) % 8] = static_cast<float>(number(*chromaticities, 4 * i) / 1e5);
  if (are_primaries(said)) {
    tags.primaries = said;
  } else {
    tags.problem = "its chromaticities span no colours";
  }
  return tags;
}

}  // namespace

ColourTags read_colour_tags(const std::vector<ColourPiece>& pieces) {
  if (const Bytes* const cicp = find(pieces, "cICP")) return of_cicp(*cicp);
  if (const Bytes* const profile = find(pieces, "ICC")) return of_profile(*profile);
  if (const Bytes* const profile = find(pieces, "iCCP"))
    return of_profile(inflated_profile(*profile));
  if (find(pieces, "sRGB") != nullptr) return {false, kRec709, ""};
  return of_gamma(find(pieces, "gAMA"), find(pieces, "cHRM"));
}

}  // namespace pounce::io
