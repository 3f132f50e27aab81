// SPDX-License-Identifier: Apache-2.0
#include "core/axes.h"

#include <fmt/format.h>

#include "pounce/error.h"

namespace pounce {
namespace {

[[noreturn]] void fail(std::string_view text) {
  throw Error(ErrorKind::usage,
              fmt::format("\"{}\" does not name axes; write x, y and z once each, in the order "
                          "wanted, with a minus where one turns round, as in x,-y,-z",
                          text));
}

}  // namespace

bool Axes::mirrors() const {
  const bool even = from[1] == (from[0] + 1) % 3;
  return (even ? 1 : -1) * sign[0] * sign[1] * sign[2] < 0;
}

void Axes::apply(Vec3f& sigma, std::array<float, 4>& rotation) const {
  const std::array<float, 3> old{sigma.x, sigma.y, sigma.z};
  sigma = {old[from[0]], old[from[1]], old[from[2]]};
  const float turn = mirrors() ? -1.0F : 1.0F;
  const Vec3f v = apply(Vec3f{rotation[1], rotation[2], rotation[3]}) * turn;
  rotation = {rotation[0], v.x, v.y, v.z};
}

Axes parse_axes(std::string_view text) {
  Axes axes;
  std::string_view rest = text;
  unsigned seen = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t comma = rest.find(',');
    if ((comma == std::string_view::npos) != (i == 2)) fail(text);
    std::string_view name = rest.substr(0, comma);
    if (i < 2) rest.remove_prefix(comma + 1);
    if (name.starts_with('-') || name.starts_with('+')) {
      axes.sign[i] = name.front() == '-' ? -1 : 1;
      name.remove_prefix(1);
    }
    if (name.size() != 1 || name[0] < 'x' || name[0] > 'z') fail(text);
    axes.from[i] = static_cast<std::uint8_t>(name[0] - 'x');
    seen |= 1U << axes.from[i];
  }
  if (seen != 7) fail(text);
  return axes;
}

std::string to_text(const Axes& axes) {
  std::string text;
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0) text += ',';
    if (axes.sign[i] < 0) text += '-';
    text += static_cast<char>('x' + axes.from[i]);
  }
  return text;
}

}  // namespace pounce
