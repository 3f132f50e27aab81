// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/geometry_store.h"

#include <algorithm>

#include "store/pack/chunk_fields.h"
#include "store/pack/chunk_payload.h"

namespace pounce::store {
namespace {

constexpr std::size_t kLatticeBytes = 60;
constexpr std::size_t kTileBytes = 44;
constexpr std::size_t kHeaderBytes = 80;
constexpr std::size_t kEntryBytes = 44, kBoxBytes = 24;  // an entry has up to kMostBoxesPerBlock

std::vector<std::byte> encode_directory(const GeometryDirectory& directory) {
  std::vector<std::byte> raw;
  ByteWriter out(raw);
  out.put(static_cast<std::uint32_t>(directory.pages.size()));
  out.put(static_cast<std::uint32_t>(directory.tiles.size()));
  for (const std::uint64_t v :
       {directory.texels, directory.overlapping, directory.slivers, directory.degenerate}) {
    out.put(v);
  }
  for (const std::uint32_t v : {directory.most_triangles, directory.most_patches,
                                directory.most_blocks, directory.largest_chunk_bytes}) {
    out.put(v);
  }
  put_box(out, directory.box);
  for (const mesh::Lattice& page : directory.pages) {
    for (const std::uint32_t v : {page.width, page.height, page.uv_set}) out.put(v);
    const mesh::UvTransform& m = page.transform;
    for (const double v : {m.a, m.b, m.c, m.d, m.e, m.f}) out.put(v);
  }
  out.put_span(std::span<const std::uint64_t>(directory.page_texels));
  for (const TileEntry& tile : directory.tiles) {
    put_box(out, tile.box);
    put_chunk(out, tile.index_page);
    out.put(tile.blocks);
  }
  return raw;
}

GeometryDirectory decode_directory(std::span<const std::byte> raw, const std::string& name) {
  ByteReader in(raw, name + ": directory");
  GeometryDirectory directory;
  const auto pages = in.get<std::uint32_t>();
  const auto tiles = in.get<std::uint32_t>();
  for (std::uint64_t* v :
       {&directory.texels, &directory.overlapping, &directory.slivers, &directory.degenerate}) {
    *v = in.get<std::uint64_t>();
  }
  for (std::uint32_t* v : {&directory.most_triangles, &directory.most_patches,
                           &directory.most_blocks, &directory.largest_chunk_bytes}) {
    *v = in.get<std::uint32_t>();
  }
  directory.box = get_box(in);
  if (in.left() != std::uint64_t{pages} * (kLatticeBytes + 8) + std::uint64_t{tiles} * kTileBytes) {
    in.fail("has another size than its counts say");
  }
  directory.pages.resize(pages);
  for (mesh::Lattice& page : directory.pages) {
    for (std::uint32_t* v : {&page.width, &page.height, &page.uv_set}) *v = in.get<std::uint32_t>();
    mesh::UvTransform& m = page.transform;
    for (double* v : {&m.a, &m.b, &m.c, &m.d, &m.e, &m.f}) *v = in.get<double>();
  }
  directory.page_texels.resize(pages);
  in.get_span(std::span(directory.page_texels));
  directory.tiles.resize(tiles);
  for (TileEntry& tile : directory.tiles) {
    tile.box = get_box(in);
    tile.index_page = get_chunk(in);
    tile.blocks = in.get<std::uint32_t>();
  }
  return directory;
}

}  // namespace

Box3f BlockEntry::box() const {
  Box3f all;
  for (std::uint32_t i = 0; i < box_count; ++i) all.extend(boxes[i]);
  return all;
}

GeometryStoreWriter::GeometryStoreWriter(std::unique_ptr<PackWriter> pack)
    : pack_(std::move(pack)) {}

void GeometryStoreWriter::add_block(BlockEntry entry, std::span<const std::byte> stored,
                                    std::uint32_t raw_bytes) {
  entry.chunk = pack_->append(ChunkKind::block, stored, raw_bytes);
  built_.most_triangles = std::max(built_.most_triangles, entry.triangles);
  built_.most_patches = std::max(built_.most_patches, entry.patches);
  built_.largest_chunk_bytes = std::max(built_.largest_chunk_bytes, raw_bytes);
  tile_.push_back(entry);
}

void GeometryStoreWriter::end_tile(Compressor& compressor) {
  if (tile_.empty()) return;
  std::vector<std::byte> raw;
  ByteWriter out(raw);
  TileEntry tile;
  for (const BlockEntry& entry : tile_) {
    out.put(entry.page);
    out.put(entry.x);
    out.put(entry.y);
    for (const std::uint32_t v : {entry.triangles, entry.patches, entry.texels}) out.put(v);
    put_chunk(out, entry.chunk);
    out.put(entry.box_count);
    for (std::uint32_t i = 0; i < entry.box_count; ++i) put_box(out, entry.boxes[i]);
    tile.box.extend(entry.box());
  }
  tile.index_page = append_payload(*pack_, ChunkKind::index_page, raw, compressor);
  tile.blocks = static_cast<std::uint32_t>(tile_.size());
  built_.most_blocks = std::max(built_.most_blocks, tile.blocks);
  built_.box.extend(tile.box);
  built_.tiles.push_back(tile);
  tile_.clear();
}

std::unique_ptr<PackWriter> GeometryStoreWriter::finish(GeometryDirectory directory,
                                                        Compressor& compressor) {
  directory.tiles = std::move(built_.tiles);
  directory.most_triangles = built_.most_triangles;
  directory.most_patches = built_.most_patches;
  directory.most_blocks = built_.most_blocks;
  directory.largest_chunk_bytes = built_.largest_chunk_bytes;
  directory.box = built_.box;
  const auto raw = encode_directory(directory);
  pack_->finish(append_payload(*pack_, ChunkKind::directory, raw, compressor));
  return std::move(pack_);
}

GeometryStore::GeometryStore(std::unique_ptr<PackReader> pack, GeometryFacts facts,
                             Compressor& compressor)
    : pack_(std::move(pack)), facts_(std::move(facts)) {
  const std::uint64_t most_bytes =
      kHeaderBytes + facts_.pages.size() * (kLatticeBytes + 8) + facts_.most_blocks * kTileBytes;
  const auto raw =
      read_payload(*pack_, pack_->directory(), ChunkKind::directory, most_bytes, compressor);
  directory_ = decode_directory(raw, pack_->name());
  check(directory_, facts_, pack_->name() + ": directory");
}

std::vector<BlockEntry> GeometryStore::read_index(std::uint32_t tile,
                                                  Compressor& compressor) const {
  const TileEntry& where = directory_.tiles[tile];
  const auto raw =
      read_payload(*pack_, where.index_page, ChunkKind::index_page,
                   where.blocks * (kEntryBytes + kMostBoxesPerBlock * kBoxBytes), compressor);
  ByteReader in(raw, pack_->name() + ": index page");
  if (where.blocks * kEntryBytes > raw.size()) in.fail("is too small for its blocks");
  std::vector<BlockEntry> entries(where.blocks);
  for (BlockEntry& entry : entries) {
    entry.page = in.get<std::uint32_t>();
    entry.x = in.get<std::int32_t>();
    entry.y = in.get<std::int32_t>();
    for (std::uint32_t* v : {&entry.triangles, &entry.patches, &entry.texels})
      *v = in.get<std::uint32_t>();
    entry.chunk = get_chunk(in);
    entry.box_count = in.get<std::uint32_t>();
    if (entry.box_count > kMostBoxesPerBlock) in.fail("has a block of too many boxes");
    for (std::uint32_t i = 0; i < entry.box_count; ++i) entry.boxes[i] = get_box(in);
  }
  if (in.left() != 0) in.fail("has bytes left over");
  check(entries, directory_, facts_, pack_->name() + ": index page");
  return entries;
}

GeometryBlock GeometryStore::read_block(const BlockEntry& entry, Compressor& compressor) const {
  const auto raw =
      read_payload(*pack_, entry.chunk, ChunkKind::block, kLargestGeometryBytes, compressor);
  GeometryBlock block = decode_geometry(raw, pack_->name() + ": block");
  check(block, entry, facts_, pack_->name() + ": block");
  return block;
}

void GeometryStore::damaged(const char* why) const {
  throw Error(ErrorKind::damaged_store, pack_->name() + ": " + why);
}

std::uint64_t GeometryStore::size_bytes() const {
  return directory_.tiles.capacity() * sizeof(TileEntry) +
         (directory_.pages.capacity() + facts_.pages.capacity()) * sizeof(mesh::Lattice);
}

void cluster_boxes(std::vector<Box3f>& boxes, BlockEntry& entry) {
  struct Cluster {
    std::size_t first, count;
    Box3f box;
  };
  const auto bound = [&](std::size_t first, std::size_t count) {
    Box3f box;
    for (std::size_t i = first; i < first + count; ++i) box.extend(boxes[i]);
    return Cluster{first, count, box};
  };
  const auto extent = [](const Box3f& b) {
    return (b.hi.x - b.lo.x) + (b.hi.y - b.lo.y) + (b.hi.z - b.lo.z);
  };
  std::vector<Cluster> clusters;
  if (!boxes.empty()) clusters.push_back(bound(0, boxes.size()));
  while (clusters.size() < kMostBoxesPerBlock) {
    auto widest =
        std::max_element(clusters.begin(), clusters.end(), [&](const Cluster& a, const Cluster& b) {
          return (a.count > 1 ? extent(a.box) : -1) < (b.count > 1 ? extent(b.box) : -1);
        });
    if (widest == clusters.end() || widest->count < 2) break;
    const Cluster whole = *widest;
    const float dx = whole.box.hi.x - whole.box.lo.x, dy = whole.box.hi.y - whole.box.lo.y,
                dz = whole.box.hi.z - whole.box.lo.z;
    const auto middle = [&](const Box3f& b) {
      return dx >= dy && dx >= dz ? b.lo.x + b.hi.x : dy >= dz ? b.lo.y + b.hi.y : b.lo.z + b.hi.z;
    };
    const float half = middle(whole.box);
    const auto first = boxes.begin() + static_cast<std::ptrdiff_t>(whole.first);
    const auto last = first + static_cast<std::ptrdiff_t>(whole.count);
    auto cut = std::stable_partition(first, last, [&](const Box3f& b) { return middle(b) < half; });
    if (cut == first || cut == last) cut = first + static_cast<std::ptrdiff_t>(whole.count / 2);
    const auto left = static_cast<std::size_t>(cut - first);
    const Cluster a = bound(whole.first, left), b = bound(whole.first + left, whole.count - left);
    if (extent(a.box) + extent(b.box) > 1.3F * extent(whole.box)) break;  // splitting gains nothing
    *widest = a;
    clusters.push_back(b);
  }
  entry.box_count = static_cast<std::uint32_t>(clusters.size());
  for (std::size_t i = 0; i < clusters.size(); ++i) entry.boxes[i] = clusters[i].box;
}

}  // namespace pounce::store
