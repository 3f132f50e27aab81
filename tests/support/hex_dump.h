// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <fstream>
#include <span>
#include <sstream>
#include <string>
#include <vector>

namespace pounce::test {

/// Sixteen bytes a line: offset, hex, letters. The form of the dumps in docs/tile-format.md.
inline std::string hex_dump(std::span<const std::byte> bytes) {
  std::string text;
  for (std::size_t at = 0; at < bytes.size(); at += 16) {
    std::string hex, letters;
    for (std::size_t i = at; i < std::min(at + 16, bytes.size()); ++i) {
      const auto value = std::to_integer<unsigned char>(bytes[i]);
      hex += fmt::format("{:02x} ", value);
      letters += value >= 0x20 && value < 0x7f ? static_cast<char>(value) : '.';
    }
    text += fmt::format("{:04x}  {:<48} |{}|\n", at, hex, letters);
  }
  return text;
}

/// The inverse.
inline std::vector<std::byte> bytes_of_hex_dump(const std::string& dump) {
  std::vector<std::byte> bytes;
  std::istringstream lines(dump);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream hex(line.substr(6, 48));
    for (unsigned value = 0; hex >> std::hex >> value;) bytes.push_back(std::byte(value));
  }
  return bytes;
}

/// The dump in docs/tile-format*.md that is fenced as "```" + name; "" if there is none.
inline std::string documented_dump(const std::string& name) {
  std::stringstream pages;
  for (const char* part : {"", "-geometry", "-records", "-colours", "-splats"})
    pages << std::ifstream(std::string(POUNCE_SOURCE_DIR) + "/docs/tile-format" + part + ".md")
                 .rdbuf();
  const std::string text = pages.str();
  const std::string opening = "```" + name + "\n";
  const std::size_t begin = text.find(opening);
  if (begin == std::string::npos) return {};
  const std::size_t from = begin + opening.size();
  return text.substr(from, text.find("```", from) - from);
}

}  // namespace pounce::test
