// SPDX-License-Identifier: Apache-2.0
//
// The sharp part is laid out in bands of latitude. Every shape says, besides its ink, how far its
// nearest edge is at least: most texels of a large image lie farther from any edge than their own
// size, and then one evaluation is the exact mean. That, and not fewer samples, is what makes area
// sampling affordable at 16384².
#include "texture_pattern.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "glyphs.h"

namespace pounce::fixture {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr std::uint8_t kBlack = 1, kWhite = 2, kRed = 3, kBlue = 4, kBrown = 5;

double round_to_integer(double x) {
  constexpr double kMagic = 6755399441055744.0;  // 1.5 * 2^52: adding it drops the fraction
  return (x + kMagic) - kMagic;
}

double floor_of(double x) {
  const double r = round_to_integer(x);
  return r > x ? r - 1 : r;
}

/// Distance from x to the nearest integer.
double to_line(double x) { return std::abs(x - round_to_integer(x)); }

/// Where a direction is, in degrees; `squeeze` = cos(latitude) turns degrees of longitude into
/// length.
struct Place {
  Vec3d direction;
  double longitude, latitude, squeeze;
};

enum class Band { plain, rings, letters, checker, face };

struct BandRow {
  double low, high;  // degrees of latitude
  Band band;
  double cell_longitude, cell_latitude;  // checkers: one field; letters: cell of one letter
  std::string_view text;                 // repeats round the head
};

constexpr BandRow kBands[] = {
    {-90, -56, Band::rings, 0, 5, {}},
    {-56, -46, Band::plain, 0, 0, {}},
    {-46, -35, Band::letters, 10, 11, "STRIP 0123456789 MEETS ITSELF AT SEAM "},
    {-35, -33, Band::plain, 0, 0, {}},
    {-33, -25, Band::checker, 2, 2, {}},
    {-25, 20, Band::face, 7.5, 9, {}},
    {20, 22, Band::plain, 0, 0, {}},
    {22, 34, Band::letters, 10, 12, "POUNCE 0123456789 HEAD "},
    {34, 36, Band::plain, 0, 0, {}},
    {36, 48, Band::checker, 6, 4, {}},
    {48, 50, Band::plain, 0, 0, {}},
    {50, 56, Band::letters, 6, 6, "FINE PRINT 987654321 "},
    {56, 62, Band::plain, 0, 0, {}},
    {62, 91, Band::rings, 0, 4, {}},
};

Ink checker(const Place& p, const BandRow& row) {
  const double x = (p.longitude + 180) / row.cell_longitude;
  const double y = (p.latitude - row.low) / row.cell_latitude;
  const bool odd = (static_cast<int>(floor_of(x)) + static_cast<int>(floor_of(y))) % 2 != 0;
  return {odd ? kBlack : kWhite,
          std::min(to_line(x) * row.cell_longitude * p.squeeze, to_line(y) * row.cell_latitude)};
}

Ink rings(const Place& p, const BandRow& row) {
  const double y = (90 - std::abs(p.latitude)) / row.cell_latitude;
  const double fraction = y - floor_of(y);
  const double margin = std::min({fraction, std::abs(fraction - 0.3), 1 - fraction});
  return {fraction < 0.3 ? kBrown : std::uint8_t{0}, margin * row.cell_latitude};
}

/// Letters of 5 x 7 pixels in cells of 6 x 7: the sixth column is the gap.
Ink letters(const Place& p, const BandRow& row) {
  const double cell = (p.longitude + 180) / row.cell_longitude;
  const double x = cell * 6, y = (row.high - p.latitude) / row.cell_latitude * 7;
  const double margin =
      std::min(to_line(x) * row.cell_longitude / 6 * p.squeeze, to_line(y) * row.cell_latitude / 7);
  // Text begins at longitude -60, on the face; cells are counted from there.
  const int cells = static_cast<int>(360 / row.cell_longitude);
  const int column = static_cast<int>(floor_of(x));
  const int from_face = (column / 6 + cells - static_cast<int>(120 / row.cell_longitude)) % cells;
  const char letter = row.text[static_cast<std::size_t>(from_face) % row.text.size()];
  const int bit = 4 - column % 6, line = std::clamp(static_cast<int>(floor_of(y)), 0, 6);
  const bool set = bit >= 0 && ((glyph(letter)[static_cast<std::size_t>(line)] >> bit) & 1) != 0;
  return {set ? kBlack : std::uint8_t{0}, margin};
}

/// Two eyes and a mouth on the front, a net of thin lines elsewhere.
Ink face(const Place& p, const BandRow& row) {
  constexpr double kFaceEdge = 50;  // degrees of longitude
  const double to_edge = std::abs(std::abs(p.longitude) - kFaceEdge) * p.squeeze;
  if (std::abs(p.longitude) > kFaceEdge) {
    constexpr double kHalfWidth = 0.35;  // degrees: two texels wide at 1024
    const double x = to_line(p.longitude / row.cell_longitude) * row.cell_longitude * p.squeeze;
    const double y = to_line(p.latitude / row.cell_latitude) * row.cell_latitude;
    const double margin = std::min({std::abs(x - kHalfWidth), std::abs(y - kHalfWidth), to_edge});
    return {x < kHalfWidth || y < kHalfWidth ? kBlue : std::uint8_t{0}, margin};
  }
  static const std::array<Vec3d, 2> kEyes = [] {
    const double lon = 22 * kDegree, lat = 10 * kDegree;
    const double x = std::sin(lon) * std::cos(lat), z = std::cos(lon) * std::cos(lat);
    return std::array<Vec3d, 2>{Vec3d{x, std::sin(lat), z}, Vec3d{-x, std::sin(lat), z}};
  }();
  const Vec3d away = p.direction - kEyes[p.longitude < 0 ? 1 : 0];
  const double radius =
      std::sqrt(dot(away, away)) / kDegree;  // a chord is never longer than its arc
  double margin = std::min(to_edge, std::abs(p.longitude) * p.squeeze);
  std::uint8_t ink = 0;
  constexpr std::pair<double, std::uint8_t> kDiscs[] = {{7.5, kWhite}, {4, kBlue}, {1.8, kBlack}};
  for (const auto& [disc_radius, disc_ink] : kDiscs) {
    if (radius < disc_radius) ink = disc_ink;
    margin = std::min(margin, std::abs(radius - disc_radius));
  }
  // The mouth: |latitude + 16| < 4 (1 - (longitude / 18)^2), and a dark line through it.
  const double open = 4 * (1 - p.longitude * p.longitude / (18.0 * 18.0));
  const double off = std::abs(p.latitude + 16);
  if (off < open) ink = off < 0.4 ? kBlack : kRed;
  // Slope of `open` is below 1/2 inside, so half the vertical distance is a lower bound.
  margin = std::min({margin, std::abs(off - open) * 0.5, std::abs(off - 0.4)});
  return {ink, margin};
}

}  // namespace

double cosine_turns(double turns) {
  // cos(2 pi t) = -sin(2 pi (|t| - 1/4)), and |t| - 1/4 is within a quarter turn: an odd Taylor
  // series of degree 13 there errs by less than 1e-9.
  const double t = std::abs(turns - round_to_integer(turns)) - 0.25;
  const double x = t * 6.283185307179586, s = x * x;
  return -x * (1 + s * (-1.0 / 6 +
                        s * (1.0 / 120 +
                             s * (-1.0 / 5040 +
                                  s * (1.0 / 362880 + s * (-1.0 / 39916800 + s / 6227020800.0))))));
}

Rgb smooth_colour(Vec3d d) {
  struct Wave {
    Vec3d turns;  // periods per radian
    double phase;
    Rgb amplitude;
  };
  static constexpr Wave kWaves[] = {
      {{0.31, 0.22, -0.17}, 0.10, {0.08F, 0.05F, -0.06F}},
      {{-0.9, 1.3, 0.7}, 0.37, {0.06F, 0.04F, 0.08F}},
      {{2.9, -1.7, 3.1}, 0.73, {0.03F, 0.04F, 0.03F}},
      {{-5.3, 4.1, 4.7}, 0.21, {0.03F, 0.01F, -0.02F}},
      {{8.1, 9.7, -6.3}, 0.59, {0.02F, 0.03F, 0.02F}},
      {{-11.0, 9.0, 13.5}, 0.87, {0.02F, 0.02F, 0.03F}},
  };
  Rgb colour{0.76F, 0.60F, 0.49F};
  for (const Wave& wave : kWaves) {
    const auto value = static_cast<float>(cosine_turns(dot(wave.turns, d) + wave.phase));
    for (std::size_t c = 0; c < 3; ++c) colour[c] += wave.amplitude[c] * value;
  }
  return colour;
}

Ink ink_at(Vec3d direction) {
  const double squeeze = std::sqrt(direction.x * direction.x + direction.z * direction.z);
  const Place p{direction, std::atan2(direction.x, direction.z) / kDegree,
                std::atan2(direction.y, squeeze) / kDegree, squeeze};
  const BandRow* row = std::begin(kBands);
  while (p.latitude >= row->high) ++row;
  Ink ink{0, std::numeric_limits<double>::infinity()};
  switch (row->band) {
    case Band::plain:
      break;
    case Band::rings:
      ink = rings(p, *row);
      break;
    case Band::letters:
      ink = letters(p, *row);
      break;
    case Band::checker:
      ink = checker(p, *row);
      break;
    case Band::face:
      ink = face(p, *row);
      break;
  }
  // In a band the squeeze changes with latitude by less than 2 % over a texel; 0.9 covers that.
  ink.margin =
      std::min({ink.margin * 0.9, p.latitude - row->low, row->high - p.latitude}) * kDegree;
  return ink;
}

const Rgb& ink_colour(std::uint8_t ink) {
  static constexpr Rgb kColours[kInkCount] = {{0, 0, 0},
                                              {0.08F, 0.07F, 0.09F},
                                              {0.93F, 0.93F, 0.9F},
                                              {0.75F, 0.16F, 0.18F},
                                              {0.13F, 0.32F, 0.66F},
                                              {0.30F, 0.18F, 0.10F}};
  return kColours[ink];
}

Rgb pattern_colour(Vec3d direction) {
  const Ink ink = ink_at(direction);
  return ink.ink == 0 ? smooth_colour(direction) : ink_colour(ink.ink);
}

}  // namespace pounce::fixture
