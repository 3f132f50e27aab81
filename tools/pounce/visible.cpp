// SPDX-License-Identifier: Apache-2.0
#include "visible.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>

namespace pounce::cli {
namespace {

/// One character, or a byte that begins none: then size is 0.
struct Character {
  std::uint32_t code = 0;
  std::size_t size = 0;
};

Character first_character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t size = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || size > text.size()) return {};
  std::uint32_t code = lead & (0x7FU >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return {};
    code = code << 6 | (byte(i) & 0x3FU);
  }
  // Longer than needed, half of a pair, beyond the last: terminals differ in what they make of it.
  const bool too_long = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
  if (too_long || (code >= 0xD800 && code < 0xE000) || code > 0x10FFFF) return {};
  return {code, size};
}

bool is_obeyed(std::uint32_t code) {
  const bool turns_direction = (code >= 0x202A && code <= 0x202E) ||  // embeddings, overrides
                               (code >= 0x2066 && code <= 0x2069);    // isolates
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x2028 || code == 0x2029 ||
         turns_direction;
}

std::string visible_but(std::string_view kept, std::string_view text) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const auto [code, size] = first_character(text);
    if (size == 0) {
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[0]));
    } else if (is_obeyed(code) && kept.find(text[0]) == std::string_view::npos) {
      out += fmt::format("\\u{:04x}", code);
    } else {
      out += text.substr(0, size);
    }
    text.remove_prefix(size == 0 ? 1 : size);
  }
  return out;
}

}  // namespace

std::string visible(std::string_view text) { return visible_but("\n\t", text); }

std::string visible_line(std::string_view text) { return visible_but("\t", text); }

}  // namespace pounce::cli
