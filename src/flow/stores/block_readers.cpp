// SPDX-License-Identifier: Apache-2.0
//
// The rest of an image of which a job kept only the tiles that its mesh shows. It is built when a
// lookup first reaches beyond these, in the middle of a projection, so the rules are those of
// smaller levels (below): one maker at a time, under a lease that the job took beforehand. It
// differs in one point. Decoding and cutting run in parallel, hence the isolation.
//
// The bytes of a tile are the same in both columns, so it does not show which one a lookup used.
#include "flow/stores/block_readers.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <mutex>

#include "planning/seen_images.h"
#include "shading/mip_levels.h"

namespace pounce::flow {
namespace {

/// Of a request for some tiles, that for all.
ColourRequest all_of(ColourRequest request) {
  request.wanted = nullptr;
  request.level = 0;
  return request;
}

}  // namespace

WholeColumn::WholeColumn(job::JobContext& job, const ColourRequest& request, const Hash128& key)
    : job_(job), request_(all_of(request)), key_(key) {}

store::ColourTile WholeColumn::tile(const store::ChunkRef& left_out) {
  const store::ColourStore& store = made();
  // The place of a tile that was left out is its number (WholeColumn::left_out). Shifted, it stays
  // a multiple of 8 like every offset: BlockCache uses the low bit.
  const std::uint64_t tile = (left_out.offset & ~kLeftOut) >> 3;
  const std::uint32_t columns = store.directory().tiles_x();
  const auto row = store.read_row(static_cast<std::uint32_t>(tile / columns), job_.compressor());
  return store.read_tile(row[tile % columns], job_.compressor());
}

const store::ColourStore& WholeColumn::made() {
  if (const auto* ready = ready_.load(std::memory_order_acquire)) return *ready;
  const std::lock_guard lock(job_.making);
  if (store_ == nullptr) {
    // Who waits for the parts of the building may not begin other work, which may want this lock.
    FoundColumn column =
        tbb::this_task_arena::isolate([this] { return whole_colours(job_, request_, key_); });
    if (!column.cached) ++job_.report.images_decoded;
    job_.count_store(column.store->pack(), column.cached);
    job_.report.source_store_bytes += column.store->pack().size_bytes();
    store_ = std::move(column.store);
    ready_.store(store_.get(), std::memory_order_release);
  }
  return *store_;
}

// --- smaller levels ------------------------------------------------------------------------------
//
// Smaller versions of images, for targets whose texels cover more than one texel of the source.
//
// A level is made from the tiles of the level before, tile by tile: no image is decoded again, and
// a handful of tiles is all that is in memory (shading/mip_levels.h).
//
// A level that nobody asks for is not made: making all of them while decoding would cost every job.
// So levels are made while a projection runs, by the piece that needs one first; others wait for
// the lock. That must not deadlock, hence the rules: the maker takes no lease (its piece's includes
// the tiles), starts no parallel work, whose waiting thread might pick up a piece that wants this
// lock, and its memory is a few tiles (docs/decisions/033-footprints.md).
//
// A level is a column like any other; one of more than a few tiles has a key of its own in the
// cache.

void ColourLevels::add(const ColourCache& column, const Hash128& key) {
  Levels& levels = images_[&column];
  levels.key = key;
  levels.made = std::vector<Level>(shading::last_level(column.store().directory()));
}

void ColourLevels::add_made(const ColourCache& column, std::uint32_t level,
                            std::unique_ptr<store::ColourStore> store) {
  Level& made = images_.at(&column).made.at(level - 1);
  made.cache =
      std::make_unique<ColourCache>(job_.budget, ColourReader{&job_, std::move(store), nullptr});
  made.ready.store(made.cache.get(), std::memory_order_release);
}

const ColourCache& ColourLevels::get(const ColourCache& column, std::uint32_t level) {
  Levels& levels = images_.at(&column);
  Level& wanted = levels.made[level - 1];
  // Without the lock once the level exists: `made` never grows.
  if (const ColourCache* const ready = wanted.ready.load(std::memory_order_acquire)) return *ready;
  const std::lock_guard lock(job_.making);
  if (wanted.cache != nullptr) return *wanted.cache;
  // From the one before. The lock is recursive: that may have to be made, too, and reading a tile
  // of the image may build the whole image.
  wanted.cache = make(level == 1 ? column : get(column, level - 1), levels.key, level);
  wanted.ready.store(wanted.cache.get(), std::memory_order_release);
  return *wanted.cache;
}

std::unique_ptr<ColourCache> ColourLevels::make(const ColourCache& before, const Hash128& image_key,
                                                std::uint32_t level) {
  const store::ColourDirectory& source = before.store().directory();
  const store::ColourDirectory image = shading::level_of(source, 1);
  const Hash128 key = level_key(image_key, level);
  // Of a few tiles, making them again costs less than a file.
  const bool is_small = planning::has_few_tiles(image);
  store::StoreFolder& stores = is_small ? *job_.scratch : *job_.stores;
  std::unique_ptr<store::ColourStore> found;
  if (!is_small) {
    found = find_store(
        job_, store::PackKind::colour, key, [&](std::unique_ptr<store::PackReader> pack) {
          return std::make_unique<store::ColourStore>(std::move(pack), image, job_.compressor());
        });
  }
  const bool cached = found != nullptr;
  if (!cached) {
    store::ColourStoreWriter writer(
        stores.create(store::PackKind::colour, key,
                      fmt::format("level {}, {} x {}, {} x {}", level, image.width, image.height,
                                  image.channels, depth_name(image.depth))),
        image.tiles_y());
    std::vector<std::byte> tile(std::size_t{store::kColourTileEdge} * store::kColourTileEdge *
                                image.texel_bytes());
    std::vector<std::byte> stored;
    for (std::uint32_t y = 0; y < image.tiles_y(); ++y) {
      const shading::LevelAxis rows(y, source.height, image.wrap_v);
      for (std::uint32_t x = 0; x < image.tiles_x(); ++x) {
        // With its apron a tile of a level covers parts of several tiles of the level before,
        // beyond the image's border as it wraps.
        const shading::LevelAxis columns(x, source.width, image.wrap_u);
        std::fill(tile.begin(), tile.end(), std::byte{0});
        for (const std::uint32_t tile_y : rows.tiles) {
          const auto index = before.index(tile_y);
          for (const std::uint32_t tile_x : columns.tiles)
            shading::fill_level_tile(image, *before.block((*index)[tile_x]), tile_x, tile_y,
                                     columns, rows, tile);
        }
        store::encode_tile(image, tile, job_.compressor(), store::kZstdLevel, job_.stores_room(),
                           stored);
        writer.add_tile(stored, static_cast<std::uint32_t>(tile.size()));
      }
      writer.end_row(y, job_.compressor());
      job_.meter.advance(0);  // stops here if the caller asked to
    }
    found = std::make_unique<store::ColourStore>(
        stores.publish(writer.finish(image, job_.compressor())), image, job_.compressor());
  }
  job_.count_store(found->pack(), cached);
  job_.report.source_store_bytes += found->pack().size_bytes();
  return std::make_unique<ColourCache>(job_.budget, ColourReader{&job_, std::move(found), nullptr});
}

}  // namespace pounce::flow
