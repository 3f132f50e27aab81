// SPDX-License-Identifier: Apache-2.0
//
// Profiles are not applied: they are recognised. Colorants of a matrix profile, which are X, Y, Z
// adapted to D50, are compared with those of the spaces that are known, or else are primaries of
// their own; its curves are compared at some places. Other curves (gamma 2.2), tables and printers
// are told, and left to whoever converts the image.
#include "io/codec/colour_tags.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string_view>

namespace pounce::io {
namespace {

constexpr std::size_t kHeaderBytes = 128, kEntryBytes = 12;
constexpr std::size_t kMostTags = 256;

constexpr Chromaticities kBt2020{0.708F, 0.292F, 0.170F, 0.797F, 0.131F, 0.046F, 0.3127F, 0.3290F};

/// Big-endian numbers; what lies beyond the end is 0.
class Profile {
 public:
  explicit Profile(std::span<const std::byte> bytes) : bytes_(bytes) {}

  std::uint32_t number(std::size_t at, std::size_t size) const {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      const bool is_there = at <= bytes_.size() && i < bytes_.size() - at;
      value = value << 8 | (is_there ? std::to_integer<std::uint32_t>(bytes_[at + i]) : 0U);
    }
    return value;
  }
  bool is(std::size_t at, std::string_view text) const {
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (number(at + i, 1) != static_cast<unsigned char>(text[i])) return false;
    }
    return true;
  }
  /// s15Fixed16Number.
  double fixed(std::size_t at) const {
    return static_cast<double>(static_cast<std::int32_t>(number(at, 4))) / 65536;
  }
  /// Where a tag's data begins; 0 without one.
  std::size_t find(std::string_view tag) const {
    const std::size_t count = std::min<std::size_t>(number(kHeaderBytes, 4), kMostTags);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t entry = kHeaderBytes + 4 + i * kEntryBytes;
      if (is(entry, tag)) return number(entry + 4, 4);
    }
    return 0;
  }
  std::size_t size() const { return bytes_.size(); }

 private:
  std::span<const std::byte> bytes_;
};

/// Of letters that a terminal shows; others become '?'.
std::string description_of(const Profile& profile) {
  const std::size_t at = profile.find("desc");
  std::size_t first = at + 12, count = profile.number(at + 8, 4), step = 1;
  if (profile.is(at, "mluc")) {  // the first of its languages, in UTF-16
    count = profile.number(at + 20, 4) / 2;
    first = at + profile.number(at + 24, 4) + 1;
    step = 2;
  } else if (!profile.is(at, "desc")) {
    return "";
  }
  std::string text;
  for (std::size_t i = 0; i < std::min<std::size_t>(count, 80); ++i) {
    const std::uint32_t letter = profile.number(first + i * step, 1);
    if (letter == 0) break;
    text += letter >= 0x20 && letter < 0x7F ? static_cast<char>(letter) : '?';
  }
  return text;
}

/// A tone curve at x, 0..1; nothing for kinds that are not looked into.
std::optional<double> curve_at(const Profile& profile, std::size_t at, double x) {
  if (profile.is(at, "curv")) {
    const std::uint32_t count = profile.number(at + 8, 4);
    if (count == 0) return x;
    if (count == 1) return std::pow(x, static_cast<double>(profile.number(at + 12, 2)) / 256);
    const double place = x * (count - 1);
    const auto below = static_cast<std::uint32_t>(std::min<double>(place, count - 2));
    const auto value = [&](std::uint32_t i) {
      return static_cast<double>(profile.number(at + 12 + 2 * std::size_t{i}, 2)) / 65535;
    };
    return value(below) + (value(below + 1) - value(below)) * (place - below);
  }
  if (!profile.is(at, "para")) return std::nullopt;
  const std::uint32_t kind = profile.number(at + 8, 2);
  const auto p = [&](std::size_t i) { return profile.fixed(at + 12 + 4 * i); };
  if (kind == 0) return std::pow(x, p(0));
  if (kind == 3) return x >= p(4) ? std::pow(p(1) * x + p(2), p(0)) : p(3) * x;
  return std::nullopt;
}

/// Exact for these purposes: compared, never used.
double srgb_at(double x) { return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4); }

/// Is the curve of all three linear (or sRGB's)? To 0.002: gamma 2.2 is off by 0.006.
bool have_curve(const Profile& profile, bool linear) {
  for (const std::string_view tag : {"rTRC", "gTRC", "bTRC"}) {
    const std::size_t at = profile.find(tag);
    for (int i = 0; at != 0 && i <= 32; ++i) {
      const double x = i / 32.0;
      const std::optional<double> y = curve_at(profile, at, x);
      if (!y || !(std::fabs(*y - (linear ? x : srgb_at(x))) < 0.002)) return false;
    }
    if (at == 0) return false;
  }
  return true;
}

bool has_primaries(const Profile& profile, const Chromaticities& primaries) {
  constexpr std::array<std::string_view, 3> kTags{"rXYZ", "gXYZ", "bXYZ"};
  const Matrix3 m = matrix_to_d50(primaries);
  for (std::size_t column = 0; column < 3; ++column) {
    const std::size_t at = profile.find(kTags[column]);
    if (at == 0 || !profile.is(at, "XYZ ")) return false;
    for (std::size_t row = 0; row < 3; ++row) {
      if (std::fabs(profile.fixed(at + 8 + 4 * row) - m[3 * row + column]) > 0.002) return false;
    }
  }
  return true;
}

/// The colorants as primaries of the white that they are adapted to; nothing if they span none.
std::optional<Chromaticities> own_primaries(const Profile& profile) {
  constexpr std::array<std::string_view, 3> kTags{"rXYZ", "gXYZ", "bXYZ"};
  Chromaticities found{};
  std::array<double, 3> white{};
  const auto place = [&](const std::array<double, 3>& xyz, std::size_t which) {
    const double sum = xyz[0] + xyz[1] + xyz[2];
    found[2 * which] = static_cast<float>(xyz[0] / sum);
    found[2 * which + 1] = static_cast<float>(xyz[1] / sum);
  };
  for (std::size_t colour = 0; colour < 3; ++colour) {
    const std::size_t at = profile.find(kTags[colour]);
    if (at == 0 || !profile.is(at, "XYZ ")) return std::nullopt;
    std::array<double, 3> xyz;
    for (std::size_t i = 0; i < 3; ++i) {
      xyz[i] = profile.fixed(at + 8 + 4 * i);
      white[i] += xyz[i];
    }
    place(xyz, colour);
  }
  place(white, 3);
  if (!are_primaries(found)) return std::nullopt;
  return found;
}

/// Writes a profile, big-endian.
class ProfileMaker {
 public:
  void number(std::uint64_t value, std::size_t size) {
    for (std::size_t i = size; i-- > 0;) bytes_.push_back(static_cast<std::byte>(value >> 8 * i));
  }
  void text(std::string_view letters) {
    for (const char c : letters) bytes_.push_back(static_cast<std::byte>(c));
  }
  void fixed(double value) {
    const auto steps = static_cast<std::int32_t>(std::floor(value * 65536 + 0.5));
    number(static_cast<std::uint32_t>(steps), 4);
  }
  void pad_to_four() {
    while (bytes_.size() % 4 != 0) number(0, 1);
  }
  std::vector<std::byte>& bytes() { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

std::vector<std::byte> unicode_tag(const std::string& text) {
  ProfileMaker tag;
  tag.text("mluc");
  tag.number(0, 4);
  tag.number(1, 4);   // one record
  tag.number(12, 4);  // of so many bytes
  tag.text("enUS");
  tag.number(2 * text.size(), 4);
  tag.number(28, 4);  // where it is
  for (const char c : text) tag.number(static_cast<unsigned char>(c), 2);
  tag.pad_to_four();
  return tag.bytes();
}

std::vector<std::byte> numbers_tag(std::string_view type, std::span<const double> values) {
  ProfileMaker tag;
  tag.text(type);
  tag.number(0, 4);
  for (const double v : values) tag.fixed(v);
  return tag.bytes();
}

std::vector<std::byte> curve_tag(bool linear) {
  ProfileMaker tag;
  tag.text(linear ? "curv" : "para");
  tag.number(0, 4);
  if (linear) {
    tag.number(0, 4);
    return tag.bytes();
  }
  tag.number(3, 2);  // (a x + b)^g from d on, c x before
  tag.number(0, 2);
  for (const double v : {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045}) tag.fixed(v);
  return tag.bytes();
}

}  // namespace

std::optional<IccProfile> read_icc(std::span<const std::byte> bytes) {
  const Profile profile(bytes);
  if (!profile.is(36, "acsp") || !profile.is(16, "RGB ")) return std::nullopt;
  IccProfile found{description_of(profile), std::nullopt};
  const ColourSpace p3 = *colour_space_from_name("display-p3"),
                    ap1 = *colour_space_from_name("acescg"),
                    ap0 = *colour_space_from_name("aces2065-1");
  for (const Chromaticities& primaries :
       {kRec709, p3.primaries, ap1.primaries, ap0.primaries, kBt2020}) {
    if (!has_primaries(profile, primaries)) continue;
    for (const bool linear : {false, true}) {
      if (have_curve(profile, linear)) found.space = ColourSpace{primaries, linear};
    }
  }
  if (found.space) return found;
  for (const bool linear : {false, true}) {
    const auto primaries = have_curve(profile, linear) ? own_primaries(profile) : std::nullopt;
    if (primaries) found.space = ColourSpace{*primaries, linear};
  }
  return found;
}

std::vector<std::byte> make_icc(const ColourSpace& space) {
  const Matrix3 m = matrix_to_d50(space.primaries);
  const Matrix3 adaptation = adaptation_to_d50(space.primaries);
  const auto colorant = [&](std::size_t column) {
    return numbers_tag("XYZ ", std::array{m[column], m[3 + column], m[6 + column]});
  };
  const std::vector<std::byte> curve = curve_tag(space.linear);
  const std::vector<std::pair<std::string_view, std::vector<std::byte>>> tags{
      {"desc", unicode_tag(colour_space_name(space))},
      {"cprt", unicode_tag("No copyright, use freely")},
      {"wtpt", numbers_tag("XYZ ", std::array{0.9642, 1.0, 0.8249})},
      {"chad", numbers_tag("sf32", adaptation)},
      {"rXYZ", colorant(0)},
      {"gXYZ", colorant(1)},
      {"bXYZ", colorant(2)},
      {"rTRC", curve},
      {"gTRC", curve},
      {"bTRC", curve}};
  std::size_t end = kHeaderBytes + 4 + tags.size() * kEntryBytes;
  ProfileMaker entries, data;
  for (const auto& [name, bytes] : tags) {
    entries.text(name);
    entries.number(end, 4);
    entries.number(bytes.size(), 4);
    data.bytes().insert(data.bytes().end(), bytes.begin(), bytes.end());
    end += bytes.size();
  }
  ProfileMaker profile;
  profile.number(end, 4);
  profile.number(0, 4);           // no preferred engine
  profile.number(0x04300000, 4);  // version
  profile.text("mntrRGB XYZ ");
  for (const int part : {2026, 1, 1, 0, 0, 0}) profile.number(static_cast<unsigned>(part), 2);
  profile.text("acsp");
  for (int i = 0; i < 7; ++i) profile.number(0, 4);  // platform, flags, maker, ..., intent
  for (const double v : {0.9642, 1.0, 0.8249}) profile.fixed(v);
  while (profile.bytes().size() < kHeaderBytes) profile.number(0, 1);
  profile.number(tags.size(), 4);
  for (ProfileMaker* part : {&entries, &data})
    profile.bytes().insert(profile.bytes().end(), part->bytes().begin(), part->bytes().end());
  return profile.bytes();
}

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
    return {{}, {}, fmt::format("its cICP code points {}, {} are not supported", code(0), code(1))};
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
    tags.problem = "its chromaticities are invalid: they enclose no colours";
  }
  return tags;
}

}  // namespace

void add_piece(const std::string& kind, std::span<const std::byte> data,
               std::vector<ColourPiece>& pieces) {
  if (data.size() > kMostColourBytes || find(pieces, kind) != nullptr) return;
  pieces.push_back({kind, {data.begin(), data.end()}});
}

ColourTags read_colour_tags(const std::vector<ColourPiece>& pieces) {
  if (const Bytes* const cicp = find(pieces, "cICP")) return of_cicp(*cicp);
  if (const Bytes* const profile = find(pieces, "ICC")) return of_profile(*profile);
  if (const Bytes* const profile = find(pieces, "iCCP"))
    return of_profile(inflated_profile(*profile));
  if (find(pieces, "sRGB") != nullptr) return {false, kRec709, ""};
  return of_gamma(find(pieces, "gAMA"), find(pieces, "cHRM"));
}

}  // namespace pounce::io
