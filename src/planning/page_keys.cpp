// SPDX-License-Identifier: Apache-2.0
//
// What an image's texels become depends on more than the image: factors, colour spaces, constants
// in its place. A store of texels as they become needs all of that in its key.
#include "planning/page_keys.h"

#include <algorithm>
#include <string_view>

namespace pounce::planning {
namespace {

void add_input(const shading::ColourInput& input, Hasher& hash) {
  hash.add(input.linear);
  for (const double v : input.primaries.value_or(Matrix3{})) hash.add(v);
  if (input.transform == nullptr) return;
  hash.add(input.transform->identity());
}

void add_factor(const shading::Factor& factor, Hasher& hash) {
  for (const double v : factor.scale) hash.add(v);
  for (const double v : factor.offset) hash.add(v);
  hash.add(factor.is_colour);
  hash.add(factor.spreads);
}

}  // namespace

bool texels_are_linear(const SourcePlan& plan) {
  const auto is_linear = [&](const PageTexture& page) {
    if (page.input) return page.input->linear || page.input->primaries.has_value();
    if (page.column >= 0) return plan.columns[static_cast<std::size_t>(page.column)].info.linear;
    if (page.tile_set < 0) return false;
    const TileSetPlan& set = plan.tile_sets[static_cast<std::size_t>(page.tile_set)];
    return std::any_of(set.columns.begin(), set.columns.end(), [&](const auto& column) {
      const auto input = set.inputs.find(column.first);
      if (input == set.inputs.end()) return plan.columns[column.second].info.linear;
      return input->second.linear || input->second.primaries.has_value();
    });
  };
  const auto& pages = plan.channels.front().pages;
  return std::any_of(pages.begin(), pages.end(), is_linear);
}

void add_page(const PageTexture& page, const std::vector<Hash128>& columns, Hasher& hash) {
  hash.add(page.column);
  hash.add(page.tile_set);
  if (page.column >= 0) hash.add(columns[static_cast<std::size_t>(page.column)]);
  for (const double v : page.constant.v) hash.add(v);
  hash.add(page.constant.linear);
  if (page.input) add_input(*page.input, hash);
  if (page.factor) add_factor(*page.factor, hash);
  if (page.tinted) hash.add(std::string_view("tinted"));
}

void add_tile_set(const TileSetPlan& set, const std::vector<Hash128>& columns, Hasher& hash) {
  hash.add(static_cast<std::uint64_t>(set.columns.size()));
  for (const auto& [tile, column] : set.columns) {
    hash.add(tile.column);
    hash.add(tile.row);
    hash.add(columns[column]);
    if (const auto input = set.inputs.find(tile); input != set.inputs.end())
      add_input(input->second, hash);
  }
}

}  // namespace pounce::planning
