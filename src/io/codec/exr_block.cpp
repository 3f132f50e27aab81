// SPDX-License-Identifier: Apache-2.0
#include "io/codec/exr_block.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <vector>

namespace pounce::io {
namespace {

enum DwaScheme : std::uint8_t { kByDeflate = 0, kByCosines = 1, kByRuns = 2 };

/// Channels whose last name is `suffix` and whose type is `type` are stored so.
struct DwaRule {
  std::string suffix;
  DwaScheme scheme = kByDeflate;
  std::uint32_t type = 0;
  bool any_case = false;
};

std::string lowered(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

/// Those of blocks of versions 0 and 1, which bring none.
std::vector<DwaRule> old_rules() {
  std::vector<DwaRule> rules;
  for (const char* name : {"r", "red", "g", "grn", "green", "b", "blu", "blue", "y", "by", "ry"}) {
    for (const std::uint32_t type : {1U, 2U}) rules.push_back({name, kByCosines, type, true});
  }
  for (const std::uint32_t type : {0U, 1U, 2U}) rules.push_back({"a", kByRuns, type, true});
  return rules;
}

/// Name, zero, case and scheme, type; damaged ones end the list, which the decoder refuses then.
std::vector<DwaRule> read_rules(Cursor& at, std::uint64_t begin, std::uint64_t end) {
  std::vector<DwaRule> rules;
  while (begin < end) {
    DwaRule rule;
    while (begin < end) {
      const std::uint8_t c = at.u8(begin++);
      if (c == 0) break;
      rule.suffix += static_cast<char>(c);
    }
    if (end - begin < 2) break;
    const std::uint8_t how = at.u8(begin);
    rule.any_case = (how & 1) != 0;
    rule.scheme = static_cast<DwaScheme>(how >> 2 & 3);
    rule.type = at.u8(begin + 1);
    begin += 2;
    rules.push_back(rule);
  }
  return rules;
}

/// The last rule that fits holds; without any a channel is deflated.
DwaScheme scheme_of(const ExrChannel& channel, const std::vector<DwaRule>& rules) {
  const std::string suffix = channel.name.substr(channel.name.rfind('.') + 1);
  DwaScheme scheme = kByDeflate;
  for (const DwaRule& rule : rules) {
    const std::string name = rule.any_case ? lowered(suffix) : suffix;
    if (rule.type == channel.type && name == rule.suffix) scheme = rule.scheme;
  }
  return scheme;
}

}  // namespace

std::uint64_t inflated_bytes(Cursor& cursor, std::uint64_t begin, std::uint64_t size,
                             std::uint64_t most) {
  z_stream zip{};
  if (inflateInit(&zip) != Z_OK) return most;
  std::array<Bytef, 16384> out;
  std::vector<std::byte> in;
  std::uint64_t decoded = 0;
  int state = Z_OK;
  for (std::uint64_t at = begin; state == Z_OK && decoded <= most && at < begin + size;) {
    in.clear();
    cursor.copy(at, std::min<std::uint64_t>(16384, begin + size - at), in);
    at += in.size();
    zip.next_in = reinterpret_cast<Bytef*>(in.data());
    zip.avail_in = static_cast<uInt>(in.size());
    do {
      zip.next_out = out.data();
      zip.avail_out = static_cast<uInt>(out.size());
      state = inflate(&zip, Z_NO_FLUSH);
      decoded += out.size() - zip.avail_out;
    } while (state == Z_OK && zip.avail_out == 0 && decoded <= most);
    if (state == Z_BUF_ERROR) state = Z_OK;  // all of it was taken before
  }
  inflateEnd(&zip);
  return decoded;
}

std::string why_dwa_is_short(Cursor& at, std::uint64_t begin, std::uint64_t size,
                             std::span<const ExrChannel> channels, std::uint64_t width,
                             std::uint64_t rows) {
  // Eleven numbers come first.
  constexpr std::uint64_t kNumbers = 11 * 8;
  if (size < kNumbers + 2) return fmt::format("has {} bytes, fewer than a DWA header", size);
  const auto number = [&](std::uint64_t index) { return at.number(begin + 8 * index, 8); };
  const std::uint64_t version = number(0), deflated = number(1), deflated_size = number(2),
                      runs = number(7), coefficients = number(8), means = number(9);
  std::uint64_t data = kNumbers;
  std::vector<DwaRule> rules = old_rules();
  if (version >= 2) {
    const std::uint64_t rule_bytes = at.u16(begin + kNumbers);
    data += rule_bytes;
    if (rule_bytes < 2 || data > size) return "has DWA channel rules of an invalid size";
    rules = read_rules(at, begin + kNumbers + 2, begin + data);
  }
  if (deflated_size > size - data) return "has deflated data that extend past its end";

  const std::uint64_t texels = width * rows;
  const std::uint64_t squares = ((width + 7) / 8) * ((rows + 7) / 8);
  std::array<std::uint64_t, 4> bytes{};
  std::uint64_t transformed = 0;
  for (const ExrChannel& channel : channels) {
    const DwaScheme scheme = scheme_of(channel, rules);
    bytes[scheme] += texels * channel.bytes();
    transformed += scheme == kByCosines ? squares : 0;
  }
  if (deflated != bytes[kByDeflate] ||
      (deflated > 0 && inflated_bytes(at, begin + data, deflated_size, deflated) != deflated)) {
    return fmt::format("does not contain the {} bytes of its deflated channels", bytes[kByDeflate]);
  }
  if (runs != bytes[kByRuns])
    return fmt::format("has {} bytes of run-length encoded channels instead of {}", runs,
                       bytes[kByRuns]);
  // A mean for each square, and one word at least for what its coefficients are.
  if (means != transformed || coefficients < transformed ||
      (transformed > 0 && (number(3) == 0 || number(4) == 0))) {
    return fmt::format("has {} DC and {} AC values for {} blocks of 8 x 8 texels", means,
                       coefficients, transformed);
  }
  return "";
}

}  // namespace pounce::io
