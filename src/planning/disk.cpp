// SPDX-License-Identifier: Apache-2.0
//
// How much room on disk a job takes, at most: known before it begins.
//
// Every bound assumes that nothing compresses. What lives as long as the job (stores) adds up; of
// what comes and goes (results of a page, runs of a sort) the largest counts.
//
// The bounds are generous on purpose: --plan and the message of --max-temp promise that the job
// does not need more. An estimate of compression would be wrong for noise, and a job that fills the
// disk in its middle costs more than a forecast that is too high.
#include "planning/disk.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/image/write.h"
#include "job/job_context.h"
#include "planning/load_mesh.h"
#include "planning/seen_images.h"
#include "projection/hit_block.h"
#include "shading/mip_levels.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/splat_block.h"
#include "views/grid.h"

namespace pounce::planning {
namespace {

/// A pack of chunks that do not compress: zstd adds a 256th and some bytes, each chunk has a header
/// and a place in an index.
std::uint64_t pack_bytes(std::uint64_t raw_bytes, std::uint64_t chunks) {
  constexpr std::uint64_t kPerChunk = 256, kFixed = 16 << 10;
  return raw_bytes + raw_bytes / 128 + chunks * kPerChunk + kFixed;
}

std::uint64_t blocks_of(ImageSize size) {
  return ((size.width + 63) / 64) * std::uint64_t{(size.height + 63) / 64};
}

/// A column, or a level of one.
std::uint64_t column_bytes(const store::ColourDirectory& image) {
  constexpr std::uint64_t kTile = std::uint64_t{store::kColourTileEdge} * store::kColourTileEdge;
  const std::uint64_t tiles = blocks_of({image.width, image.height});
  return pack_bytes(tiles * kTile * image.texel_bytes(), tiles + image.height / 64 + 1);
}

store::ColourDirectory column_of(const io::ImageInfo& info) {
  store::ColourDirectory image;
  image.width = info.width;
  image.height = info.height;
  image.channels = info.channels;
  image.depth = info.depth;
  return image;
}

/// An image file whose encoder finds nothing to save.
std::uint64_t image_bytes(ImageSize size, std::uint64_t texel_bytes) {
  constexpr std::uint64_t kPerRow = 16, kFixed = 64 << 10;
  const std::uint64_t raw = std::uint64_t{size.width} * size.height * texel_bytes;
  return raw + raw / 64 + kPerRow * size.height + kFixed;
}

}  // namespace

void DiskPlan::add_column(const io::ImageInfo& info) { stores_ += column_bytes(column_of(info)); }

void DiskPlan::add_seen_column(const io::ImageInfo& info, bool in_part) {
  const store::ColourDirectory image = column_of(info);
  stores_ += column_bytes(image);
  // Less than half of it may be kept first, and all of it after that.
  if (in_part) stores_ += column_bytes(image) / 2;
  const std::uint32_t last = shading::last_level(image);
  bool any_small = false;
  for (std::uint32_t level = 1; level <= last; ++level) {
    const store::ColourDirectory of_level = shading::level_of(image, level);
    const std::uint64_t bytes = column_bytes(of_level);
    const bool is_small = keeps_ && has_few_tiles(of_level);
    if (is_small) small_levels_ += bytes;
    // One of the small ones may be stored in the image's place: the first is the largest.
    if (!is_small || !any_small) stores_ += bytes;
    any_small = any_small || is_small;
  }
}

void DiskPlan::add_geometry(const surface::GeometryRequest& request) {
  const surface::GeometrySize size = surface::geometry_most(request);
  stores_ += pack_bytes(size.bytes, size.chunks);
}

/// As if every texel hit a triangle of its own, while there are others.
void DiskPlan::add_hits(const PassPlan& pass, const surface::GeometryRequest& target) {
  // A facet is stored in each block that hits it, so all facets may count in every block, but no
  // texel hits two.
  const std::uint64_t blocks = blocks_of(pass.size);
  const std::uint64_t texels = std::uint64_t{pass.size.width} * pass.size.height;
  const std::uint64_t facets =
      std::min(texels, blocks * surface::geometry_most(pass.source).entries);
  const std::uint64_t axes = std::min(texels, surface::geometry_most(target).entries);
  stores_ += pack_bytes(projection::most_hit_bytes(blocks, texels, facets, axes), 2 * blocks);
}

void DiskPlan::add_map(ImageSize size, std::uint64_t images) {
  const std::uint64_t blocks = blocks_of(size);
  const std::uint64_t texels = std::uint64_t{size.width} * size.height;
  stores_ +=
      images * pack_bytes(projection::most_hit_bytes(blocks, texels, texels, texels), 2 * blocks);
}

void DiskPlan::add_splats(std::uint64_t splats, std::uint32_t lobes, std::uint64_t unpacked_bytes) {
  // A chunk of a run is a thousand Gaussians, a block of the store hundreds at least; runs are
  // merged into new ones at times, while the old ones are still there.
  const std::uint64_t pack =
      pack_bytes(splats * (sizeof(store::Splat) + store::lobe_bytes(lobes) + sizeof(std::uint64_t)),
                 splats / 64 + 64);
  stores_ += pack;
  // Runs before a merge, runs after it, and the unpacked scene from which the first were read.
  passing_ = std::max(passing_, 2 * pack + unpacked_bytes);
  needed_ = std::max(needed_, 2 * pack + unpacked_bytes);
}

namespace {

/// What is kept of a channel's image in PNG, and of its mask, until the image is there: whoever
/// goes on later need not encode it again.
std::uint64_t encoded_bytes(const ChannelPlan& channel, const std::vector<ImageOutput>& images) {
  const auto is_png = [](const std::string& path) {
    return !path.empty() && io::format_look(path, Depth::u8).name == "PNG";
  };
  std::uint64_t most = 0;
  for (const ImageOutput& image : images) {
    std::uint64_t bytes = 0;
    if (is_png(image.path)) bytes += image_bytes(channel.size, channel.format.texel_bytes());
    if (is_png(image.coverage_path)) bytes += image_bytes(channel.size, sizeof(std::uint16_t));
    most = std::max(most, bytes);
  }
  return most;
}

}  // namespace

void DiskPlan::add_views(std::uint32_t count, const mesh::Mesh& target) {
  // Pixels as fine as any texels ask for. A region fills half of a view's square, or less, and what
  // is compressed takes half of its bytes, or less: what a cache keeps, and what is drawn of the
  // inside of a room, which is known once its target is drawn.
  const std::uint64_t across = views::Grid(planning::box_of(target), 0, count).tiles_across(),
                      tiles = count * (across * across / 2),
                      scene_bytes = tiles * views::tile_bytes(views::kSceneSamples),
                      target_bytes = tiles * views::tile_bytes(views::kTargetSamples);
  stores_ += pack_bytes(keeps_ ? scene_bytes / 2 : scene_bytes, tiles);
  const std::uint64_t inside_bytes = (scene_bytes + target_bytes) / 2;
  beside_ = std::max(beside_, pack_bytes(target_bytes + inside_bytes, 3 * tiles));
}

void DiskPlan::add_target(const SourcePlan& plan, const TargetPlan& target, const mesh::Mesh& mesh,
                          bool is_model, LevelsBytes levels_bytes) {
  if (plan.views > 0) add_views(plan.views, mesh);
  std::uint64_t results = 0, kept = 0, images = 0, levels = 0;
  for (std::size_t p = 0; p < plan.passes.size(); ++p) {
    const std::uint64_t blocks = blocks_of(plan.passes[p].size);
    // Stores of pages are kept in the cache and add up. Results of a page are scratch: the largest
    // counts.
    for (const surface::GeometryRequest& request : target.requests[p]) {
      add_geometry(request);
      if (keeps_ && plan.passes[p].keeps_hits) add_hits(plan.passes[p], request);
    }
    std::uint64_t of_page = 0, kept_of_page = 0;
    for (const std::size_t c : plan.passes[p].channels) {
      const std::uint64_t block =
          store::kTexelsPerBlock * plan.channels[c].format.texel_bytes() + shading::kMaskBytes + 64;
      of_page += pack_bytes(blocks * block, blocks);
      kept_of_page += encoded_bytes(plan.channels[c], target.images[c]);
    }
    // Records of what is made, as if each block had one of its own (flow/project/results.cpp).
    constexpr std::uint64_t kRecord = 192, kRecordOfChannel = 17;
    of_page += blocks * (kRecord + kRecordOfChannel * plan.passes[p].channels.size());
    const std::size_t pages = target.images[plan.passes[p].channels.front()].size();
    if (keeps_ && plan.passes[p].keeps_results) stores_ += of_page * pages;
    // The results of a model's pages stay until it is there: a later run may need them all.
    results = is_model ? results + of_page * pages : std::max(results, of_page);
    kept = is_model ? kept + kept_of_page * pages : std::max(kept, kept_of_page);
  }
  for (std::size_t c = 0; c < target.images.size(); ++c) {
    const ChannelPlan& channel = plan.channels[c];
    for (const ImageOutput& image : target.images[c]) {
      if (image.keep) continue;
      images += image_bytes(channel.size, channel.format.texel_bytes());
      const std::uint64_t of_image = levels_bytes(image, channel.format);
      outputs_ += of_image;
      levels = std::max(levels, of_image);
      if (image.coverage_path.empty()) continue;
      const Depth depth = io::writable_depth(image.coverage_path, Depth::u8);
      outputs_ += image_bytes(channel.size, store::depth_bytes(depth));
    }
  }
  outputs_ += images;
  if (is_model)
    outputs_ += job::size_on_disk(mesh.files) + job::size_on_disk(target.inputs) + (1ULL << 20);
  // One page's results at a time; a model's images wait in a file until all are there.
  needed_ = std::max(needed_, results + levels + (is_model ? images : 0));
  passing_ = std::max(passing_, results + kept + levels + (is_model ? images : 0));
}

std::uint64_t DiskPlan::spare_bytes(std::uint64_t limit_bytes) const {
  if (limit_bytes == 0) return UINT64_MAX;
  const std::uint64_t needed = forecast().scratch_bytes - passing_ + needed_;
  return limit_bytes - std::min(limit_bytes, needed);
}

std::uint64_t DiskPlan::plain_bytes(std::uint64_t limit_bytes, std::uint64_t largest_file_bytes,
                                    std::uint64_t memory_bytes) const {
  // So little stays in the system's cache of files, and its room is given back to whoever needs it.
  // Beyond that the disk is what waits, and compressing is cheaper. What the process itself takes
  // is as much as the least.
  constexpr std::uint64_t kShare = 8, kLeast = 32 << 20;
  const std::uint64_t most = forecast().scratch_bytes;
  const bool fits = (limit_bytes == 0 || most <= limit_bytes) && most <= largest_file_bytes;
  return fits ? std::max(memory_bytes / kShare, kLeast) : 0;
}

DiskForecast DiskPlan::forecast() const {
  DiskForecast forecast;
  // A cache that may run full gives nothing back to the forecast: any store may be the one without
  // space.
  const bool is_limited = keeps_ && cache_limit_bytes_ != 0 && stores_ > cache_limit_bytes_;
  if (keeps_) forecast.cache_bytes = is_limited ? cache_limit_bytes_ : stores_;
  // What the cache has no room for lives in scratch files.
  forecast.scratch_bytes =
      passing_ + beside_ + small_levels_ + (keeps_ && !is_limited ? 0 : stores_);
  forecast.output_bytes = outputs_;
  return forecast;
}

std::string scratch_note(const DiskForecast& disk) {
  if (disk.scratch_limit_bytes == 0 || disk.scratch_bytes <= disk.scratch_limit_bytes) return {};
  return fmt::format(
      "scratch files may need {} if nothing compresses, but their limit is {}: the job fails when "
      "it is reached; raise it with --max-temp, or choose another folder with --temp",
      runtime::format_bytes(disk.scratch_bytes), runtime::format_bytes(disk.scratch_limit_bytes));
}

}  // namespace pounce::planning
