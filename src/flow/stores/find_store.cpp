// SPDX-License-Identifier: Apache-2.0
//
// Packs of the cache, opened and held against what the job knows.
//
// A checksum says that bytes are those that somebody wrote, not that pounce wrote them. Opening a
// store checks its directory; a job that found damage, or may not be run twice, has every block
// checked.
//
// What is found to be damaged is thrown as Error(damaged_store). While a store is opened that costs
// one rebuild of it (find_store()), later the whole job begins again, once, and checks all packs
// first (job/run_job.cpp). So checking everything always would protect little and cost a reading of
// every block.
#include "flow/stores/find_store.h"

#include <algorithm>
#include <tuple>
#include <vector>

namespace pounce::flow {

namespace {

/// A target's block stands in its image once, and images follow each other.
void check_places(const store::GeometryStore& store,
                  std::vector<std::tuple<std::uint32_t, std::int32_t, std::int32_t>> places) {
  const auto page = [](const auto& a, const auto& b) { return std::get<0>(a) < std::get<0>(b); };
  if (!std::is_sorted(places.begin(), places.end(), page))
    store.damaged("its pages are out of order");
  std::sort(places.begin(), places.end());
  if (std::adjacent_find(places.begin(), places.end()) != places.end())
    store.damaged("duplicate block");
}

}  // namespace

void check_store(job::JobContext& job, const store::GeometryStore& store) {
  std::vector<std::tuple<std::uint32_t, std::int32_t, std::int32_t>> places;
  for (std::uint32_t tile = 0; tile < store.directory().tiles.size(); ++tile) {
    for (const store::BlockEntry& entry : store.read_index(tile, job.compressor())) {
      const store::GeometryBlock block = store.read_block(entry, job.compressor());
      if (store.facts().is_target) {
        places.emplace_back(entry.page, entry.y, entry.x);
      } else {
        decoded_source(store, entry, block);
      }
    }
    job.meter.advance(0);  // stops here if the caller asked to
  }
  check_places(store, std::move(places));
}

void check_store(job::JobContext& job, const store::ColourStore& store) {
  for (std::uint32_t row = 0; row < store.directory().tiles_y(); ++row) {
    for (const store::ChunkRef& chunk : store.read_row(row, job.compressor())) {
      const bool is_there = !store.leaves_out() || !store::is_left_out(chunk);
      if (is_there) (void)store.read_tile(chunk, job.compressor());
    }
    job.meter.advance(0);
  }
}

void check_store(job::JobContext& job, const store::SplatStore& store) {
  for (std::uint32_t tile = 0; tile < store.directory().tiles.size(); ++tile) {
    for (const store::SplatEntry& entry : store.read_index(tile, job.compressor()))
      (void)store.read_block(entry, job.compressor());
    job.meter.advance(0);
  }
}

void check_largest(job::JobContext& job, const store::GeometryStore& store) {
  const store::GeometryDirectory& says = store.directory();
  // Entries may claim what they like as well. A block that would set a new maximum is decoded,
  // which refuses a false claim; all others cannot make the maxima larger.
  std::uint32_t triangles = 0, patches = 0, chunk_bytes = 0;
  for (std::uint32_t tile = 0; tile < says.tiles.size(); ++tile) {
    for (const store::BlockEntry& entry : store.read_index(tile, job.compressor())) {
      const bool is_larger = entry.triangles > triangles || entry.patches > patches ||
                             entry.chunk.raw_bytes > chunk_bytes;
      if (!is_larger) continue;
      decoded_source(store, entry, store.read_block(entry, job.compressor()));
      triangles = std::max(triangles, entry.triangles);
      patches = std::max(patches, entry.patches);
      chunk_bytes = std::max(chunk_bytes, entry.chunk.raw_bytes);
    }
    job.meter.advance(0);  // stops here if the caller asked to
  }
  if (triangles != says.most_triangles || patches != says.most_patches ||
      chunk_bytes != says.largest_chunk_bytes) {
    store.damaged("its blocks are smaller than it states");
  }
}

surface::SourceBlock decoded_source(const store::GeometryStore& store,
                                    const store::BlockEntry& entry,
                                    const store::GeometryBlock& block, bool with_attributes) {
  surface::SourceBlock made =
      surface::make_source_block(block, store.directory().pages[entry.page], with_attributes);
  if (made.patches.size() != entry.patches)
    store.damaged("a block decodes to a different number of patches than its index states");
  return made;
}

}  // namespace pounce::flow
