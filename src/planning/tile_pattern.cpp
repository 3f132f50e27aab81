// SPDX-License-Identifier: Apache-2.0
//
// Names of UDIM tiles in both directions: a pattern becomes the name of a tile, and the name of one
// tile becomes the pattern of its set.
//
// A name may have several numbers ("scan_2023_skin.1001.png"). Exporters put the tile last, so the
// last one counts, and the number of a tile counts before "u1_v1". Whether a set is meant at all is
// not decided here.
#include "planning/tile_pattern.h"

#include <cstdint>
#include <filesystem>

#include "planning/output_names.h"

namespace pounce::planning {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The number whose digits begin at `at`, and the place behind them; 0 for none, or one too long.
std::uint32_t number_at(const std::string& text, std::size_t& at) {
  std::uint32_t number = 0;
  const std::size_t begin = at;
  for (; at < text.size() && is_digit(text[at]); ++at)
    // Longer runs of digits are no UDIM. They are read to their end, so that their tail is not one
    // either.
    number = at - begin < 4 ? number * 10 + static_cast<std::uint32_t>(text[at] - '0') : 0;
  return number;
}

std::optional<mesh::UvTile> uvtile_at(const std::string& text, std::size_t& at) {
  const std::size_t begin = at++;
  const std::uint32_t column = number_at(text, at);
  if (column == 0 || text.compare(at, 2, "_v") != 0) return std::nullopt;
  at += 2;
  const std::uint32_t row = number_at(text, at);
  const mesh::UvTile tile{static_cast<std::int32_t>(column) - 1,
                          static_cast<std::int32_t>(row) - 1};
  if (row == 0 || text.substr(begin, at - begin) != mesh::uvtile_name(tile)) return std::nullopt;
  return tile;
}

}  // namespace

bool is_tile_pattern(const std::string& path) {
  return has_token(path, "UDIM") || has_token(path, "UVTILE");
}

std::string tile_path(const std::string& pattern, mesh::UvTile tile) {
  return expand_pattern(pattern, {{"UDIM", std::to_string(mesh::udim_number(tile).value_or(0))},
                                  {"UVTILE", mesh::uvtile_name(tile)}});
}

std::optional<NamedTile> named_tile(const std::string& path) {
  if (path.find('<') != std::string::npos) return std::nullopt;  // it would not stay a name
  const std::filesystem::path whole(path);
  const std::string name = whole.filename().string();
  const std::size_t stem = whole.stem().string().size();
  const auto with = [&](std::size_t begin, std::size_t end, const char* token) {
    return (whole.parent_path() / (name.substr(0, begin) + token + name.substr(end))).string();
  };
  std::optional<NamedTile> by_number, by_tile;
  for (std::size_t at = 0; at < stem;) {
    const std::size_t begin = at;
    if (is_digit(name[at])) {
      const std::uint32_t number = number_at(name, at);
      if (at - begin == 4 && at <= stem && number >= mesh::kFirstUdim)
        by_number = NamedTile{with(begin, at, "<UDIM>"), mesh::udim_tile(number)};
    } else if (name[at] == 'u') {
      const auto tile = uvtile_at(name, at);
      if (tile && at <= stem) by_tile = NamedTile{with(begin, at, "<UVTILE>"), *tile};
      // The letter may be part of a word ("skull"); what follows it is looked at again.
      if (!tile) at = begin + 1;
    } else {
      ++at;
    }
  }
  return by_number ? by_number : by_tile;
}

}  // namespace pounce::planning
