// SPDX-License-Identifier: Apache-2.0
//
// A pack of hits is read by place in the image, so its directory is a table of places: 16 bytes per
// block, all of it in memory. What a block holds is projection's (projection/hit_block.h).
//
// Blocks come in any order, as pieces finish, and are written as they come: a place is fixed, so no
// index pages and no spatial tiles are needed as in a geometry pack. A block without hits costs its
// 16 bytes, and reading it costs nothing.
#include "store/blocks/hit_store.h"

#include "core/bytes.h"
#include "mesh/lattice.h"
#include "store/pack/pack_layout.h"

namespace pounce::store {
namespace {

/// Instead of a block without hits: the first place that a chunk may have.
constexpr ChunkRef kNoHits{kPackHeaderBytes, 0, 0};
constexpr std::size_t kHeaderBytes = 8, kChunkRefBytes = 16;

std::uint32_t blocks_along(std::uint32_t texels) {
  return (texels + mesh::kBlockEdge - 1) / mesh::kBlockEdge;
}

}  // namespace

HitGrid::HitGrid(ImageSize image)
    : across(blocks_along(image.width)), down(blocks_along(image.height)) {}

HitStoreWriter::HitStoreWriter(std::unique_ptr<PackWriter> pack, HitGrid grid)
    : pack_(std::move(pack)), grid_(grid), blocks_(grid.blocks(), kNoHits) {}

void HitStoreWriter::add(std::uint32_t x, std::uint32_t y, std::span<const std::byte> stored,
                         std::uint32_t raw_bytes) {
  blocks_[std::size_t{y} * grid_.across + x] = pack_->append(ChunkKind::block, stored, raw_bytes);
}

std::unique_ptr<PackWriter> HitStoreWriter::finish(Compressor& compressor) {
  std::vector<std::byte> raw;
  ByteWriter out(raw);
  out.put_all(grid_.across, grid_.down);
  for (const ChunkRef& block : blocks_) put_chunk(out, block);
  pack_->finish(append_payload(*pack_, ChunkKind::directory, raw, compressor));
  return std::move(pack_);
}

HitStore::HitStore(std::unique_ptr<PackReader> pack, Facts facts, Compressor& compressor)
    : pack_(std::move(pack)), facts_(facts), grid_(facts.image) {
  const auto raw = read_payload(*pack_, pack_->directory(), ChunkKind::directory,
                                kHeaderBytes + grid_.blocks() * kChunkRefBytes, compressor);
  ByteReader in(raw, pack_->name() + ": directory");
  std::uint32_t across = 0, down = 0;
  in.get_all(across, down);
  // The key names both surfaces and the image's size, so another size means damage, not another
  // job.
  if (across != grid_.across || down != grid_.down)
    in.fail("belongs to an image of a different size");
  if (in.left() != grid_.blocks() * kChunkRefBytes)
    in.fail("has a different size than its image requires");
  blocks_.resize(grid_.blocks());
  for (ChunkRef& block : blocks_) block = get_chunk(in);
}

UnsetBytes HitStore::read(std::uint32_t x, std::uint32_t y, Compressor& compressor) const {
  const ChunkRef& block = blocks_[std::size_t{y} * grid_.across + x];
  if (block == kNoHits) return {};
  return read_payload(*pack_, block, ChunkKind::block, facts_.most_bytes, compressor);
}

}  // namespace pounce::store
