// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/splat_store.h"

#include <algorithm>
#include <cmath>

#include "store/pack/chunk_fields.h"
#include "store/pack/chunk_payload.h"

namespace pounce::store {
namespace {

constexpr std::size_t kEntryBytes = 48;
constexpr std::size_t kTileBytes = 48;
constexpr std::size_t kHeaderBytes = 136;
constexpr std::uint32_t kHasNormals = 1;

std::vector<std::byte> encode_directory(const SplatDirectory& directory) {
  std::vector<std::byte> raw;
  ByteWriter out(raw);
  out.put(static_cast<std::uint32_t>(directory.tiles.size()));
  out.put(directory.has_normals ? kHasNormals : 0U);
  out.put(static_cast<std::uint32_t>(directory.model));
  out.put(directory.surface_noise);
  out.put(directory.splats);
  for (const std::uint64_t count : directory.filtered) out.put(count);
  for (const std::uint32_t v :
       {directory.most_splats, directory.most_blocks, directory.largest_chunk_bytes, 0U}) {
    out.put(v);
  }
  put_box(out, directory.box);
  put_box(out, directory.middle_box);
  for (const SplatTile& tile : directory.tiles) {
    put_box(out, tile.box);
    put_chunk(out, tile.index_page);
    out.put(tile.blocks);
    out.put(tile.size_class);
  }
  return raw;
}

SplatDirectory decode_directory(std::span<const std::byte> raw, const std::string& name) {
  ByteReader in(raw, name + ": directory");
  SplatDirectory directory;
  const auto tiles = in.get<std::uint32_t>();
  const auto flags = in.get<std::uint32_t>();
  const auto model = in.get<std::uint32_t>();
  if ((flags & ~kHasNormals) != 0 || model > static_cast<std::uint32_t>(SplatModel::flat)) {
    in.fail("has impossible flags");
  }
  directory.has_normals = flags != 0;
  directory.model = static_cast<SplatModel>(model);
  directory.surface_noise = in.get<float>();
  directory.splats = in.get<std::uint64_t>();
  for (std::uint64_t& count : directory.filtered) count = in.get<std::uint64_t>();
  for (std::uint32_t* v :
       {&directory.most_splats, &directory.most_blocks, &directory.largest_chunk_bytes}) {
    *v = in.get<std::uint32_t>();
  }
  if (in.get<std::uint32_t>() != 0) in.fail("has a reserved field that is not 0");
  if (directory.most_splats > kMostSplatsPerBlock ||
      directory.most_blocks > kMostBlocksPerSplatTile ||
      directory.largest_chunk_bytes > kLargestSplatBytes ||
      !(directory.surface_noise >= 0 && std::isfinite(directory.surface_noise))) {
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

}  // namespace

const char* filter_name(SplatFilter filter) {
  constexpr std::array<const char*, kSplatFilters> kNames{
      "not_finite", "zero_quaternion", "transparent", "sizeless", "exploded", "far"};
  return kNames[static_cast<std::size_t>(filter)];
}

std::string filtered_text(const SplatCounts& counts) {
  std::string text;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (counts[k] == 0) continue;
    text += (text.empty() ? "" : ", ") + std::to_string(counts[k]) + " " +
            filter_name(static_cast<SplatFilter>(k));
  }
  return text;
}

SplatStoreWriter::SplatStoreWriter(std::unique_ptr<PackWriter> pack) : pack_(std::move(pack)) {}

void SplatStoreWriter::add_block(SplatEntry entry, bool has_normals,
                                 std::span<const std::byte> stored, std::uint32_t raw_bytes) {
  entry.chunk = pack_->append(ChunkKind::block, stored, raw_bytes);
  built_.splats += entry.splats;
  built_.has_normals |= has_normals;
  built_.most_splats = std::max(built_.most_splats, entry.splats);
  built_.largest_chunk_bytes = std::max(built_.largest_chunk_bytes, raw_bytes);
  tile_.push_back(entry);
}

void SplatStoreWriter::end_tile(Compressor& compressor) {
  if (tile_.empty()) return;
  std::vector<std::byte> raw;
  ByteWriter out(raw);
  SplatTile tile;
  tile.size_class = tile_.front().size_class;
  for (const SplatEntry& entry : tile_) {
    out.put(entry.splats);
    out.put(entry.size_class);
    put_box(out, entry.box);
    put_chunk(out, entry.chunk);
    tile.box.extend(entry.box);
  }
  tile.index_page = append_payload(*pack_, ChunkKind::index_page, raw, compressor);
  tile.blocks = static_cast<std::uint32_t>(tile_.size());
  built_.most_blocks = std::max(built_.most_blocks, tile.blocks);
  built_.box.extend(tile.box);
  built_.tiles.push_back(tile);
  tile_.clear();
}

std::unique_ptr<PackWriter> SplatStoreWriter::finish(SplatDirectory directory,
                                                     Compressor& compressor) {
  directory.tiles = std::move(built_.tiles);
  directory.splats = built_.splats;
  directory.has_normals = built_.has_normals;
  directory.box = built_.box;
  directory.most_splats = built_.most_splats;
  directory.most_blocks = built_.most_blocks;
  directory.largest_chunk_bytes = built_.largest_chunk_bytes;
  const auto raw = encode_directory(directory);
  pack_->finish(append_payload(*pack_, ChunkKind::directory, raw, compressor));
  return std::move(pack_);
}

SplatStore::SplatStore(std::unique_ptr<PackReader> pack, const SplatFacts& facts,
                       Compressor& compressor)
    : pack_(std::move(pack)) {
  // Every tile has a Gaussian, and two chunks of the pack.
  const std::uint64_t tiles = facts.rows.value_or(pack_->size_bytes() / 32);
  const auto raw = read_payload(*pack_, pack_->directory(), ChunkKind::directory,
                                kHeaderBytes + tiles * kTileBytes, compressor);
  directory_ = decode_directory(raw, pack_->name());
  std::uint64_t rows = directory_.splats;
  for (const std::uint64_t count : directory_.filtered) rows += count;
  if (rows != facts.rows.value_or(rows) || directory_.model != facts.model) {
    throw Error(ErrorKind::damaged_store,
                pack_->name() + ": directory is of another scene than its key stands for");
  }
}

std::vector<SplatEntry> SplatStore::read_index(std::uint32_t tile, Compressor& compressor) const {
  const SplatTile& where = directory_.tiles[tile];
  const auto raw = read_payload(*pack_, where.index_page, ChunkKind::index_page,
                                where.blocks * kEntryBytes, compressor);
  ByteReader in(raw, pack_->name() + ": index page");
  if (std::uint64_t{where.blocks} * kEntryBytes != raw.size()) {
    in.fail("has another size than its blocks");
  }
  std::vector<SplatEntry> entries(where.blocks);
  for (SplatEntry& entry : entries) {
    entry.splats = in.get<std::uint32_t>();
    entry.size_class = in.get<std::uint32_t>();
    entry.box = get_box(in);
    entry.chunk = get_chunk(in);
    if (entry.splats == 0 || entry.splats > directory_.most_splats ||
        entry.size_class != where.size_class ||
        entry.chunk.raw_bytes > directory_.largest_chunk_bytes) {
      in.fail("has an impossible block entry");
    }
  }
  return entries;
}

SplatBlock SplatStore::read_block(const SplatEntry& entry, Compressor& compressor) const {
  const auto raw =
      read_payload(*pack_, entry.chunk, ChunkKind::block, kLargestSplatBytes, compressor);
  SplatBlock block = decode_splats(raw, pack_->name() + ": block");
  if (block.size() != entry.splats || (!block.normal[0].empty() && !directory_.has_normals)) {
    throw Error(ErrorKind::damaged_store,
                pack_->name() + ": a block is not the one its index names");
  }
  return block;
}

std::uint64_t SplatStore::size_bytes() const {
  return directory_.tiles.capacity() * sizeof(SplatTile);
}

}  // namespace pounce::store
