// SPDX-License-Identifier: Apache-2.0
#include "flow/build/source_columns.h"

#include <fmt/format.h>

#include <algorithm>

namespace pounce::flow {

std::vector<PageColour> SourceColumns::pages_of(const ChannelPlan& channel) const {
  std::vector<PageColour> pages;
  for (const PageTexture& page : channel.pages) {
    pages.push_back(
        {page.column < 0 ? nullptr : columns[static_cast<std::size_t>(page.column)].get(),
         page.tile_set < 0 ? nullptr : &tile_sets[static_cast<std::size_t>(page.tile_set)],
         page.constant, page.input, page.factor, page.tinted});
  }
  return pages;
}

std::uint64_t SourceColumns::most_tile_bytes() const {
  std::uint64_t most = 0;
  for (const auto& column : columns) most = std::max(most, column->store().tile_bytes());
  return most;
}

std::uint64_t SourceColumns::bytes_read() const {
  std::uint64_t bytes = 0;
  for (const auto& column : columns) bytes += column->store().pack().bytes_read();
  return bytes;
}

SourceColumns build_columns(JobContext& job, const Plan& plan, double progress_end) {
  SourceColumns made;
  made.levels = std::make_unique<ColourLevels>(job);
  std::uint64_t rows = 0;
  for (const ColumnPlan& column : plan.columns) rows += (column.info.height + 63) / 64;
  job.meter.begin("source colours", rows, "rows of tiles", progress_end);
  for (const ColumnPlan& column : plan.columns) {
    bool cached = false;
    const ColourRequest request{&column.image, &column.info, column.wrap_u, column.wrap_v};
    const Hash128 key = colour_key(job, request);
    auto opened = colour_store(job, request, key, &cached);
    made.all_cached = made.all_cached && cached;
    made.columns.push_back(
        std::make_unique<ColourCache>(job.budget, ColourReader{&job, std::move(opened)}));
    made.levels->add(*made.columns.back(), key);
    const store::ColourStore& store = made.columns.back()->store();
    const std::uint64_t nonfinite = store.directory().nonfinite;
    if (nonfinite > 0) {
      job.report.source_filtered["nonfinite samples"] += nonfinite;
      job.report.warnings.push_back(fmt::format("{}: {} samples are NaN or infinite and count as 0",
                                                column.image.label, nonfinite));
    }
    job.count_store(store.pack(), cached);
    job.report.source_store_bytes += store.pack().size_bytes();
  }
  for (const TileSetPlan& set : plan.tile_sets) {
    made.tile_sets.push_back({set.size.width, set.size.height, {}});
    for (const auto& [tile, column] : set.columns) {
      const auto input = set.inputs.find(tile);
      made.tile_sets.back().tiles[tile] = {
          made.columns[column].get(),
          input == set.inputs.end() ? std::nullopt : std::optional(input->second)};
    }
  }
  job.meter.end();
  return made;
}

}  // namespace pounce::flow
