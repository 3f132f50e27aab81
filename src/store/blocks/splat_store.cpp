// SPDX-License-Identifier: Apache-2.0
//
// The index of a splat pack as bytes, and what it says held against what the job knows, as in
// geometry_store.cpp. The row of a file ends either in a block or in one of the counts of what was
// left out, so together they must be as many as the file has: a pack that lost some is noticed.
#include "store/blocks/splat_store.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <tuple>

#include "pounce/error.h"
#include "pounce/report.h"
#include "store/pack/pack_layout.h"

namespace pounce::store {
namespace {

constexpr std::size_t kTileBytes = 48;
constexpr std::size_t kHeaderBytes = 180;
constexpr std::uint32_t kHasNormals = 1, kIsLinear = 2;

/// Calls visit(fields...) with the numbers of a directory, in the order of the format.
constexpr auto for_directory = [](auto& d, const auto& visit) {
  std::apply(
      [&](auto&... filtered) {
        visit(d.surface_noise, d.splats, filtered..., d.most_splats, d.most_blocks,
              d.largest_chunk_bytes, d.lobes, d.roundness, d.typical_size, d.thickness);
      },
      d.filtered);
};

[[noreturn]] void fail(const std::string& name, const char* why) {
  throw Error(ErrorKind::damaged_store, name + " " + why);
}

}  // namespace

const char* filter_name(SplatFilter filter) {
  // In the order of the enumeration, which is that of the format.
  constexpr std::array<const char*, kSplatFilters> kNames{
      "not_finite", "zero_quaternion", "transparent", "sizeless",    "exploded",
      "far",        "faint",           "too_large",   "outside_box", "out_of_reach"};
  return kNames[static_cast<std::size_t>(filter)];
}

// In the order of left_out_reasons() and not of the format: users read what they asked for first.
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
  // Every tile has a Gaussian, and two chunks of the pack. Where the number of rows is not known
  // beforehand (a mesh's texels) the pack's own size bounds it: a small file cannot ask for much.
  return kHeaderBytes + facts.rows.value_or(pack_bytes / 32) * kTileBytes;
}

void SplatCodec::count(const Entry& entry, Index& index) {
  index.splats += entry.splats;
  index.most_splats = std::max(index.most_splats, entry.splats);
}

// A change of class cuts blocks and tiles (splat_cut()), so the first entry speaks for all.
SplatTile SplatCodec::tile_of(const Entry& first) {
  Tile tile;
  tile.size_class = first.size_class;
  return tile;
}

void SplatCodec::put(const Entry& entry, ByteWriter& out) {
  out.put_all(entry.splats, entry.size_class);
  put_box(out, entry.box);
  put_chunk(out, entry.chunk);
}

SplatEntry SplatCodec::get_entry(ByteReader& in) {
  Entry entry;
  in.get_all(entry.splats, entry.size_class);
  entry.box = get_box(in);
  entry.chunk = get_chunk(in);
  return entry;
}

void SplatCodec::put(const Directory& directory, ByteWriter& out) {
  out.put_all(static_cast<std::uint32_t>(directory.tiles.size()),
              (directory.has_normals ? kHasNormals : 0U) | (directory.is_linear ? kIsLinear : 0U),
              static_cast<std::uint32_t>(directory.model));
  for_directory(directory, [&](const auto&... fields) { out.put_all(fields...); });
  put_box(out, directory.box);
  put_box(out, directory.middle_box);
  for (const SplatTile& tile : directory.tiles) {
    put_box(out, tile.box);
    put_chunk(out, tile.index_page);
    out.put_all(tile.blocks, tile.size_class);
  }
}

SplatDirectory SplatCodec::get_directory(ByteReader& in) {
  SplatDirectory directory;
  std::uint32_t tiles, flags, model;
  in.get_all(tiles, flags, model);
  if ((flags & ~(kHasNormals | kIsLinear)) != 0 ||
      model > static_cast<std::uint32_t>(SplatModel::flat)) {
    in.fail("has impossible flags");
  }
  directory.has_normals = (flags & kHasNormals) != 0;
  directory.is_linear = (flags & kIsLinear) != 0;
  directory.model = static_cast<SplatModel>(model);
  for_directory(directory, [&](auto&... fields) { in.get_all(fields...); });
  // These size buffers and steer the search, so a NaN or a number beyond reason ends here.
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
    in.fail("has a different size than its counts state");
  }
  directory.tiles.resize(tiles);
  for (SplatTile& tile : directory.tiles) {
    tile.box = get_box(in);
    tile.index_page = get_chunk(in);
    in.get_all(tile.blocks, tile.size_class);
    if (tile.blocks == 0 || tile.blocks > directory.most_blocks) {
      in.fail("has a tile with an impossible number of blocks");
    }
  }
  return directory;
}

void SplatCodec::check(const Directory& directory, const Facts& facts, const std::string& name) {
  // A row of the file is either in a block or in one of the counts.
  // What was left out is checked with the rest: a user reads these counts in the summary.
  std::uint64_t rows = directory.splats;
  for (const std::uint64_t count : directory.filtered) rows += count;
  if (rows != facts.rows.value_or(rows) || directory.model != facts.model ||
      directory.lobes != facts.lobes || directory.is_linear != facts.is_linear)
    fail(name, "belongs to a different scene than its key");
}

// The index sizes the buffers of a walk before any block is read, so each entry must keep to what
// the directory said of all.
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

// decode_splats() has looked at every Gaussian; what is left is whether it is the block meant.
void SplatCodec::check(const Block& block, const Entry& entry, const Directory& directory,
                       const Facts&, const std::string& name) {
  if (block.size() != entry.splats || block.lobes != directory.lobes ||
      (!block.normal[0].empty() && !directory.has_normals))
    fail(name, "is not the block that its index names");
}

}  // namespace pounce::store
