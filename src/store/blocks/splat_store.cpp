// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/splat_store.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>

#include "pounce/error.h"
#include "pounce/report.h"
#include "store/pack/chunk_fields.h"

namespace pounce::store {
namespace {

constexpr std::size_t kTileBytes = 48;
constexpr std::size_t kHeaderBytes = 180;
constexpr std::uint32_t kHasNormals = 1, kIsLinear = 2;

[[noreturn]] void fail(const std::string& name, const char* why) {
  throw Error(ErrorKind::damaged_store, name + " " + why);
}

}  // namespace

const char* filter_name(SplatFilter filter) {
  constexpr std::array<const char*, kSplatFilters> kNames{
      "not_finite", "zero_quaternion", "transparent", "sizeless",    "exploded",
      "far",        "faint",           "too_large",   "outside_box", "out_of_reach"};
  return kNames[static_cast<std::size_t>(filter)];
}

std::string filtered_text(const SplatCounts& counts) {
  std::map<std::string_view, std::uint64_t> by_key;
  for (std::size_t k = 0; k < counts.size(); ++k)
    by_key[filter_name(static_cast<SplatFilter>(k))] = counts[k];
  std::string text;
  for (const auto& [key, words] : left_out_reasons()) {
    const std::uint64_t count = by_key[key];
    if (count > 0) text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + words;
  }
  return text;
}

std::uint64_t SplatCodec::most_directory_bytes(const Facts& facts, std::uint64_t pack_bytes) {
  // Every tile has a Gaussian, and two chunks of the pack.
  return kHeaderBytes + facts.rows.value_or(pack_bytes / 32) * kTileBytes;
}

void SplatCodec::count(const Entry& entry, Index& index) {
  index.splats += entry.splats;
  index.most_splats = std::max(index.most_splats, entry.splats);
}

SplatTile SplatCodec::tile_of(const Entry& first) {
  Tile tile;
  tile.size_class = first.size_class;
  return tile;
}

void SplatCodec::put(const Entry& entry, ByteWriter& out) {
  out.put(entry.splats);
  out.put(entry.size_class);
  put_box(out, entry.box);
  put_chunk(out, entry.chunk);
}

SplatEntry SplatCodec::get_entry(ByteReader& in) {
  Entry entry;
  entry.splats = in.get<std::uint32_t>();
  entry.size_class = in.get<std::uint32_t>();
  entry.box = get_box(in);
  entry.chunk = get_chunk(in);
  return entry;
}

void SplatCodec::put(const Directory& directory, ByteWriter& out) {
  out.put(static_cast<std::uint32_t>(directory.tiles.size()));
  out.put((directory.has_normals ? kHasNormals : 0U) | (directory.is_linear ? kIsLinear : 0U));
  out.put(static_cast<std::uint32_t>(directory.model));
  out.put(directory.surface_noise);
  out.put(directory.splats);
  for (const std::uint64_t count : directory.filtered) out.put(count);
  for (const std::uint32_t v : {directory.most_splats, directory.most_blocks,
                                directory.largest_chunk_bytes, directory.lobes}) {
    out.put(v);
  }
  out.put(directory.roundness);
  out.put(directory.typical_size);
  out.put(directory.thickness);
  put_box(out, directory.box);
  put_box(out, directory.middle_box);
  for (const SplatTile& tile : directory.tiles) {
    put_box(out, tile.box);
    put_chunk(out, tile.index_page);
    out.put(tile.blocks);
    out.put(tile.size_class);
  }
}

SplatDirectory SplatCodec::get_directory(ByteReader& in) {
  SplatDirectory directory;
  const auto tiles = in.get<std::uint32_t>();
  const auto flags = in.get<std::uint32_t>();
  const auto model = in.get<std::uint32_t>();
  if ((flags & ~(kHasNormals | kIsLinear)) != 0 ||
      model > static_cast<std::uint32_t>(SplatModel::flat)) {
    in.fail("has impossible flags");
  }
  directory.has_normals = (flags & kHasNormals) != 0;
  directory.is_linear = (flags & kIsLinear) != 0;
  directory.model = static_cast<SplatModel>(model);
  directory.surface_noise = in.get<float>();
  directory.splats = in.get<std::uint64_t>();
  for (std::uint64_t& count : directory.filtered) count = in.get<std::uint64_t>();
  for (std::uint32_t* v : {&directory.most_splats, &directory.most_blocks,
                           &directory.largest_chunk_bytes, &directory.lobes}) {
    *v = in.get<std::uint32_t>();
  }
  directory.roundness = in.get<float>();
  directory.typical_size = in.get<float>();
  directory.thickness = in.get<float>();
  if (directory.most_splats > kMostSplatsPerBlock ||
      directory.most_blocks > kMostBlocksPerSplatTile ||
      directory.largest_chunk_bytes > kLargestSplatBytes ||
      !(directory.surface_noise >= 0 && std::isfinite(directory.surface_noise)) ||
      !(directory.roundness >= 0 && directory.roundness <= 1) ||
      !(directory.thickness >= 0 && directory.thickness <= 1) ||
      !(directory.typical_size >= 0 && std::isfinite(directory.typical_size))) {
    in.fail("has impossible maxima");
  }
  directory.box = get_box(in);
  directory.middle_box = get_box(in);
  if (in.left() != std::uint64_t{tiles} * kTileBytes) {
    in.fail("has another size than its counts say");
  }
  directory.tiles.resize(tiles);
  for (SplatTile& tile : directory.tiles) {
    tile.box = get_box(in);
    tile.index_page = get_chunk(in);
    tile.blocks = in.get<std::uint32_t>();
    tile.size_class = in.get<std::uint32_t>();
    if (tile.blocks == 0 || tile.blocks > directory.most_blocks) {
      in.fail("has a tile of an impossible number of blocks");
    }
  }
  return directory;
}

void SplatCodec::check(const Directory& directory, const Facts& facts, const std::string& name) {
  std::uint64_t rows = directory.splats;
  for (const std::uint64_t count : directory.filtered) rows += count;
  if (rows != facts.rows.value_or(rows) || directory.model != facts.model ||
      directory.lobes != facts.lobes || directory.is_linear != facts.is_linear)
    fail(name, "is of another scene than its key stands for");
}

void SplatCodec::check(const std::vector<Entry>& entries, const Tile& tile,
                       const Directory& directory, const Facts&, const std::string& name) {
  for (const Entry& entry : entries) {
    if (entry.splats == 0 || entry.splats > directory.most_splats ||
        entry.size_class != tile.size_class ||
        entry.chunk.raw_bytes > directory.largest_chunk_bytes) {
      fail(name, "has an impossible block entry");
    }
  }
}

void SplatCodec::check(const Block& block, const Entry& entry, const Directory& directory,
                       const Facts&, const std::string& name) {
  if (block.size() != entry.splats || block.lobes != directory.lobes ||
      (!block.normal[0].empty() && !directory.has_normals))
    fail(name, "is not the one its index names");
}

}  // namespace pounce::store
