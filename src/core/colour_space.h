// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>

#include "core/hash.h"

namespace pounce {

/// x and y (CIE 1931) of red, green, blue and white: a colour space's primaries, in the order of
/// EXR's attribute.
using Chromaticities = std::array<float, 8>;

inline constexpr Chromaticities kRec709{0.64F, 0.33F, 0.30F, 0.60F, 0.15F, 0.06F, 0.3127F, 0.3290F};

/// How an image's numbers mean a colour: linear light of these primaries, or that in sRGB's coding
/// (IEC 61966-2-1), which Display P3 has as well; or what a colour configuration says.
struct ColourSpace {
  Chromaticities primaries = kRec709;
  bool linear = false;
  std::string config_name = {};  ///< of a space in a configuration: the rest says nothing then
  bool operator==(const ColourSpace&) const = default;
};

/// Do two files mean the same primaries? Files round the last digits.
bool same_primaries(const Chromaticities& a, const Chromaticities& b) noexcept;

/// "srgb", "lin_rec709" (also "linear"), "acescg", "aces2065-1", "display-p3", in any case of
/// letters; nothing for other names.
std::optional<ColourSpace> colour_space_from_name(const std::string& name);
/// The names, for messages.
std::string colour_space_names();
/// Its name, or "linear light of red .64 .33, ...".
std::string colour_space_name(const ColourSpace& space);

/// Do these primaries span anything? Files may say what they like.
bool are_primaries(const Chromaticities& c) noexcept;

/// Row by row: (r, g, b) of one as (r, g, b) or (X, Y, Z) of the other.
using Matrix3 = std::array<double, 9>;

/// From linear light of `from` to linear light of `to`; where their whites differ they are adapted
/// by Bradford's cones (Lam 1985; Lindbloom's figures), as ACES does. Both must be are_primaries().
/// By + - * / in double: the same everywhere.
Matrix3 primaries_matrix(const Chromaticities& from, const Chromaticities& to) noexcept;
/// To X, Y, Z as ICC's connection space has them: white is D50.
Matrix3 matrix_to_d50(const Chromaticities& from) noexcept;
/// What adapts the white of these to D50.
Matrix3 adaptation_to_d50(const Chromaticities& from) noexcept;

/// The sRGB transfer function (IEC 61966-2-1) and its inverse by +, *, / and sqrt alone, so that
/// every machine agrees.
double srgb_to_linear(double coded) noexcept;
double linear_to_srgb(double linear) noexcept;

/// From one colour space to another where no matrix and curve do: what a colour configuration says.
/// Thread-safe.
class ColourTransform {
 public:
  virtual ~ColourTransform() = default;
  /// r, g, b in place, of any size and sign. Single precision; its last bits may differ from one
  /// kind of processor to another.
  virtual void apply(std::array<double, 3>& rgb) const noexcept = 0;
  /// The same for transforms that do the same.
  virtual Hash128 identity() const = 0;
};

}  // namespace pounce
