// SPDX-License-Identifier: Apache-2.0
//
// Precondition and vectorize: one mesh becomes a store of blocks.
//
// Triangles are binned by the 64x64 windows that they touch, windows grouped into tiles, and each
// tile made, compressed and written on its own: in parallel, in order, under the budget. Source and
// target differ in one thing: a target texel belongs to the first triangle in file order that
// covers its centre; a source keeps every triangle, since a texel that the surface uses twice is
// two Gaussians.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "flow/build_stores.h"
#include "flow/find_store.h"
#include "flow/job.h"
#include "flow/ordered_stream.h"
#include "mesh/uv_raster.h"
#include "source/source_block.h"
#include "target/target_block.h"

namespace pounce::flow {
namespace {

using tiles::kNoTriangle;

/// The Gaussians of a whole triangle that spans more rows than this are counted by its area.
constexpr double kCountedRows = 1 << 20;

struct EncodedBlock {
  tiles::BlockEntry entry;
  std::vector<std::byte> stored;
  std::uint32_t raw_bytes = 0;
};

/// One tile, ready to be written, and what it adds to the directory.
struct EncodedTile {
  std::vector<EncodedBlock> blocks;
  std::uint64_t texels = 0, overlapping = 0, slivers = 0, degenerate = 0;
  std::uint32_t page = 0;
};

mesh::TexelWindow window_of(const mesh::BlockBin& bin) {
  return {std::int64_t{bin.x} * mesh::kBlockEdge, std::int64_t{bin.y} * mesh::kBlockEdge,
          std::int64_t{bin.x + 1} * mesh::kBlockEdge, std::int64_t{bin.y + 1} * mesh::kBlockEdge};
}

class TileMaker {
 public:
  TileMaker(const GeometryRequest& request, const mesh::BlockBins& bins, JobContext& job)
      : request_(request), bins_(bins), job_(job), builder_(*request.mesh) {}

  EncodedTile make(const mesh::TileRange& tile) {
    for (std::uint32_t b = tile.first_block; b < tile.first_block + tile.block_count; ++b) {
      const mesh::BlockBin& bin = bins_.blocks[b];
      out_.page = bin.page;
      request_.is_target ? target_block(bin) : source_blocks(bin);
    }
    return std::move(out_);
  }

 private:
  const mesh::Lattice& lattice(const mesh::BlockBin& bin) const { return request_.pages[bin.page]; }
  const mesh::TriangleInstance& instance(const mesh::BlockBin& bin, std::uint32_t i) const {
    return bins_.instances[bins_.entries[bin.first + i]];
  }

  void source_blocks(const mesh::BlockBin& bin) {
    const mesh::Lattice& l = lattice(bin);
    builder_.start(bin.page, bin.x, bin.y, bin.count);
    std::uint64_t texels = 0;
    for (std::uint32_t i = 0; i < bin.count; ++i) {
      texels += count_texels(bin, instance(bin, i));
      builder_.add(instance(bin, i), l.uv_set, l.width != 0);
      if (builder_.full() || i + 1 == bin.count) {
        finish_source(l, texels);
        texels = 0;
        builder_.start(bin.page, bin.x, bin.y, bin.count - i - 1);
      }
    }
  }

  /// Gaussians of one triangle in this block; a triangle that covers no texel centre still gives
  /// one.
  std::uint64_t count_texels(const mesh::BlockBin& bin, const mesh::TriangleInstance& instance) {
    const mesh::Lattice& l = lattice(bin);
    if (l.width == 0) return 1;
    const auto corners = mesh::texel_corners(*request_.mesh, l, instance);
    const bool whole = mesh::is_whole(corners, l);
    const double area = std::abs(mesh::doubled_area(corners[0], corners[1], corners[2])) / 2;
    const auto [low, high] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
    if (whole && (high - low > kCountedRows || area > double{1} * l.width * l.height))
      return std::max<std::uint64_t>(static_cast<std::uint64_t>(area), 1);
    const mesh::TexelWindow everywhere{INT32_MIN, INT32_MIN, INT32_MAX, INT32_MAX};
    std::uint64_t count = 0;
    mesh::raster_triangle(corners, whole ? everywhere : window_of(bin),
                          [&](std::int64_t, std::int64_t begin, std::int64_t end) {
                            count += static_cast<std::uint64_t>(end - begin);
                          });
    if (count == 0 && whole) {
      ++out_.slivers;
      count = 1;
    }
    return count;
  }

  void finish_source(const mesh::Lattice& l, std::uint64_t texels) {
    tiles::GeometryBlock& block = builder_.block();
    const source::SourceBlock decoded = source::make_source_block(block, l);
    out_.degenerate += decoded.degenerate;
    out_.texels += texels;
    if (decoded.patches.empty()) return;
    std::vector<Box3f> boxes;
    for (const source::Patch& patch : decoded.patches) boxes.push_back(patch.box);
    EncodedBlock encoded = encode(block, boxes);
    encoded.entry.patches = static_cast<std::uint32_t>(decoded.patches.size());
    encoded.entry.texels = static_cast<std::uint32_t>(std::min<std::uint64_t>(texels, UINT32_MAX));
    out_.blocks.push_back(std::move(encoded));
  }

  void target_block(const mesh::BlockBin& bin) {
    constexpr std::uint32_t kFree = 0xFFFFFFFF;
    const mesh::Lattice& l = lattice(bin);
    mesh::TexelWindow window = window_of(bin);
    window.x1 = std::min<std::int64_t>(window.x1, l.width);
    window.y1 = std::min<std::int64_t>(window.y1, l.height);
    std::array<std::uint32_t, tiles::kTexelsPerBlock> claim;
    std::array<bool, tiles::kTexelsPerBlock> contested{};
    claim.fill(kFree);
    for (std::uint32_t i = 0; i < bin.count; ++i) {
      mesh::raster_triangle(
          mesh::texel_corners(*request_.mesh, l, instance(bin, i)), window,
          [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
            for (std::int64_t x = begin; x < end; ++x) {
              const auto t = static_cast<std::size_t>((y - std::int64_t{bin.y} * mesh::kBlockEdge) *
                                                          mesh::kBlockEdge +
                                                      (x - std::int64_t{bin.x} * mesh::kBlockEdge));
              if (claim[t] == kFree) {
                claim[t] = i;
              } else if (!contested[t]) {
                contested[t] = true;
                ++out_.overlapping;
              }
            }
          });
    }
    std::vector<std::uint16_t> local(bin.count, kNoTriangle);
    builder_.start(bin.page, bin.x, bin.y, bin.count);
    tiles::GeometryBlock& block = builder_.block();
    block.owner.assign(tiles::kTexelsPerBlock, kNoTriangle);
    std::uint32_t texels = 0;
    for (std::size_t t = 0; t < claim.size(); ++t) {
      if (claim[t] == kFree) continue;
      if (local[claim[t]] == kNoTriangle)
        local[claim[t]] = builder_.add(instance(bin, claim[t]), l.uv_set, true);
      block.owner[t] = local[claim[t]];
      ++texels;
    }
    if (texels == 0) return;
    std::vector<Box3f> boxes = target::texel_boxes(block, l);
    EncodedBlock encoded = encode(block, boxes);
    encoded.entry.texels = texels;
    out_.texels += texels;
    out_.blocks.push_back(std::move(encoded));
  }

  EncodedBlock encode(const tiles::GeometryBlock& block, std::vector<Box3f>& boxes) {
    EncodedBlock encoded;
    tiles::encode(block, raw_);
    job_.compressor().compress(raw_, encoded.stored);
    encoded.raw_bytes = static_cast<std::uint32_t>(raw_.size());
    encoded.entry.page = block.page;
    encoded.entry.x = block.x;
    encoded.entry.y = block.y;
    encoded.entry.triangles = static_cast<std::uint32_t>(block.triangles.size());
    tiles::cluster_boxes(boxes, encoded.entry);
    return encoded;
  }

  const GeometryRequest& request_;
  const mesh::BlockBins& bins_;
  JobContext& job_;
  tiles::GeometryBlockBuilder builder_;
  std::vector<std::byte> raw_;
  EncodedTile out_;
};

/// Bytes one tile may need while it is made: its largest block decoded twice over, and all of it
/// encoded.
std::uint64_t tile_cost(const mesh::BlockBins& bins, const mesh::TileRange& tile) {
  constexpr std::uint64_t kPerTriangle = 1000, kStoredPerTriangle = 80, kPerBlock = 12 << 10,
                          kFixed = 256 << 10;
  std::uint64_t largest = 0, all = 0;
  for (std::uint32_t b = tile.first_block; b < tile.first_block + tile.block_count; ++b) {
    largest = std::max<std::uint64_t>(
        largest, std::min(bins.blocks[b].count, tiles::kMostTrianglesPerBlock));
    all += bins.blocks[b].count;
  }
  return kFixed + kPerTriangle * largest + kStoredPerTriangle * all + kPerBlock * tile.block_count;
}

mesh::BinRequest bin_request(const GeometryRequest& request, std::uint64_t tile_cap_bytes) {
  return {request.mesh,
          request.pages,
          request.triangle_page,
          request.is_target,
          request.tile_pages ? &*request.tile_pages : nullptr,
          tile_cap_bytes};
}

/// "scan.glb as a source, 10092 triangles, 2048 x 2048": what `pounce cache list` shows.
std::string label_of(const GeometryRequest& request) {
  const std::string name = std::filesystem::path(request.mesh->path).filename().string();
  std::string label =
      fmt::format("{} as a {}, {} triangles", name, request.is_target ? "target" : "source",
                  request.mesh->triangles.size());
  if (request.pages.size() == 1) {
    label += fmt::format(", {} x {}", request.pages[0].width, request.pages[0].height);
  } else {
    label += fmt::format(", {} pages", request.pages.size());
  }
  return label;
}

tiles::GeometryFacts facts_of(const GeometryRequest& request) {
  return {request.is_target, request.pages, request.mesh->triangles.size(),
          mesh::count_entries(bin_request(request, kTileCapBytes))};
}

std::unique_ptr<tiles::GeometryStore> build(JobContext& job, const GeometryRequest& request,
                                            const Hash128& key) {
  const auto bin_with = bin_request(request, job.tile_cap_bytes);
  const std::uint64_t entries = mesh::count_entries(bin_with);
  const Lease bins_lease(job.budget, mesh::bin_cost_bytes(request.mesh->triangles.size(), entries),
                         "binning the triangles of " + request.mesh->path);
  const mesh::BlockBins bins = mesh::bin_triangles(bin_with);
  std::vector<std::uint64_t> costs;
  for (const mesh::TileRange& tile : bins.tiles) costs.push_back(tile_cost(bins, tile));

  tiles::GeometryStoreWriter writer(
      job.stores->create(tiles::PackKind::geometry, key, label_of(request)));
  tiles::GeometryDirectory directory;
  directory.pages = request.pages;
  directory.page_texels.assign(request.pages.size(), 0);
  run_ordered<EncodedTile>(
      job.budget, costs,
      request.is_target ? "vectorizing the target" : "preconditioning the source",
      [&](std::size_t i) { return TileMaker(request, bins, job).make(bins.tiles[i]); },
      [&](std::size_t, EncodedTile& tile) {
        for (EncodedBlock& block : tile.blocks)
          writer.add_block(block.entry, block.stored, block.raw_bytes);
        writer.end_tile(job.compressor());
        directory.texels += tile.texels;
        directory.page_texels[tile.page] += tile.texels;
        directory.overlapping += tile.overlapping;
        directory.slivers += tile.slivers;
        directory.degenerate += tile.degenerate;
        ++job.report.tiles_written;
        job.meter.advance(1);
      });
  return std::make_unique<tiles::GeometryStore>(
      job.stores->publish(writer.finish(directory, job.compressor())), facts_of(request),
      job.compressor());
}

}  // namespace

Hash128 geometry_key(const GeometryRequest& request) {
  Hasher hash;
  // The number is of the rule that cuts triangles: another one makes other blocks.
  hash.add(std::string_view(request.is_target ? "target geometry" : "source geometry 2"));
  hash.add(tiles::kFormatVersion);
  const mesh::Mesh& m = *request.mesh;
  const auto add = [&](const auto& values) {
    hash.add(static_cast<std::uint64_t>(values.size()));
    hash.add(std::as_bytes(std::span(values)));
  };
  add(m.positions);
  add(m.normals);
  add(m.tangents);
  add(m.triangles);
  add(request.triangle_page);
  hash.add(static_cast<std::uint64_t>(request.tile_pages ? request.tile_pages->all().size() : 0));
  if (request.tile_pages) {
    for (const auto& [tile, page] : request.tile_pages->all()) {
      hash.add(tile.first);
      hash.add(tile.second.column);
      hash.add(tile.second.row);
      hash.add(page);
    }
  }
  for (const mesh::Lattice& page : request.pages) {
    hash.add(page.width);
    hash.add(page.height);
    hash.add(page.uv_set);
    const mesh::UvTransform& t = page.transform;
    for (const double v : {t.a, t.b, t.c, t.d, t.e, t.f}) hash.add(v);
    if (page.width != 0 && page.uv_set < m.uv_sets.size()) add(m.uv_sets[page.uv_set]);
  }
  return hash.digest();
}

std::unique_ptr<tiles::GeometryStore> geometry_store(JobContext& job,
                                                     const GeometryRequest& request, bool* cached) {
  const Hash128 key = geometry_key(request);
  auto store =
      find_store(job, tiles::PackKind::geometry, key, [&](std::unique_ptr<tiles::PackReader> pack) {
        return std::make_unique<tiles::GeometryStore>(std::move(pack), facts_of(request),
                                                      job.compressor());
      });
  *cached = store != nullptr;
  return *cached ? std::move(store) : build(job, request, key);
}

std::uint64_t geometry_least_bytes(const GeometryRequest& request, std::uint64_t tile_cap_bytes) {
  const auto bin_with = bin_request(request, tile_cap_bytes);
  const std::uint64_t bins =
      mesh::bin_cost_bytes(request.mesh->triangles.size(), mesh::count_entries(bin_with));
  // A tile never holds more than all triangles, nor more blocks than its cap lets through.
  const std::uint64_t triangles = request.mesh->triangles.size();
  return bins + (1ULL << 20) +
         1000 * std::min<std::uint64_t>(triangles, tiles::kMostTrianglesPerBlock) +
         80 * std::min<std::uint64_t>(triangles * 4, 1 << 18);
}

GeometrySize geometry_most(const GeometryRequest& request) {
  constexpr std::uint64_t kPerTriangle = 138;  // three vertices that it shares with none
  constexpr std::uint64_t kPerBlock = 320;     // header, place and boxes
  constexpr std::uint64_t kPerRun = 4;         // of texels with one owner
  constexpr std::uint64_t kEdge = mesh::kBlockEdge;
  const std::uint64_t entries = mesh::count_entries(bin_request(request, kTileCapBytes));
  // Each block has a triangle, and the blocks of a target lie in its images.
  std::uint64_t blocks = entries, runs = 0;
  if (request.is_target) {
    std::uint64_t in_images = 0;
    for (const mesh::Lattice& page : request.pages)
      in_images += ((page.width + kEdge - 1) / kEdge) * ((page.height + kEdge - 1) / kEdge);
    blocks = std::min(entries, in_images);
    // A triangle adds two ends of runs to a row of a block at most.
    runs = std::min(blocks * tiles::kTexelsPerBlock, kEdge * blocks + 2 * kEdge * entries);
  }
  const std::uint64_t pages = request.pages.size() * (sizeof(mesh::Lattice) + 16);
  return {entries * kPerTriangle + blocks * kPerBlock + runs * kPerRun + pages, 2 * blocks};
}

}  // namespace pounce::flow
