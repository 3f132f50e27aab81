// SPDX-License-Identifier: Apache-2.0
//
// An image is stored as tiles of 64x64 texels with two more on each side, which belong to their
// neighbours. So a texel's blend reads one tile, whatever its place, for 13 % more bytes. What
// those two are at the image's border depends on how the texture repeats; that is part of the image
// then.
//
// Directory and index pages say little: sizes and where chunks are. All of it is compared with what
// the job knows of the image, since a tile of another depth would be read beyond its end.
//
// A mesh may show only a part of an image; then the other tiles are left out. Whoever needs one
// after all gets the whole column (flow/stores/block_readers.h); here it is an error.
#include "store/blocks/colour_store.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/portable_math.h"
#include "store/pack/codec.h"
#include "store/pack/pack_layout.h"

namespace pounce::store {
namespace {

constexpr std::size_t kTileTexels = std::size_t{kColourTileEdge} * kColourTileEdge;
/// In an index, instead of a tile that is not there: the first place that a chunk may have.
constexpr ChunkRef kLeftOut{kPackHeaderBytes, 0, 0};
constexpr std::size_t kHeaderBytes = 25, kChunkRefBytes = 16;

std::vector<std::byte> encode_directory(const ColourDirectory& d) {
  std::vector<std::byte> raw;
  ByteWriter out(raw);
  const auto byte = [](auto value) { return static_cast<std::uint8_t>(value); };
  out.put_all(d.width, d.height, d.channels, byte(d.depth), byte(d.linear),
              byte(d.has_alpha + d.premultiplied), byte(d.wrap_u), byte(d.wrap_v), d.nonfinite);
  for (const ChunkRef& page : d.row_pages) put_chunk(out, page);
  return raw;
}

std::vector<ChunkRef> get_chunks(ByteReader& in, std::size_t count) {
  if (in.left() != count * kChunkRefBytes) in.fail("has a different size than its counts state");
  std::vector<ChunkRef> chunks(count);
  for (ChunkRef& chunk : chunks) chunk = get_chunk(in);
  return chunks;
}

ColourDirectory decode_directory(std::span<const std::byte> raw, const std::string& name) {
  ByteReader in(raw, name + ": directory");
  ColourDirectory d;
  std::uint8_t depth, linear, alpha, wrap_u, wrap_v;
  in.get_all(d.width, d.height, d.channels, depth, linear, alpha, wrap_u, wrap_v, d.nonfinite);
  if (d.width == 0 || d.width > kLargestImageSide || d.height == 0 || d.height > kTallestColumn ||
      d.channels == 0 || d.channels > kMostSamples || depth > 3 || linear > 1 || alpha > 2 ||
      (alpha > 0 && d.channels < 2) || (alpha > 1 && depth < 2) || wrap_u > 2 || wrap_v > 2) {
    in.fail("has an impossible image header");
  }
  d.depth = static_cast<Depth>(depth);
  // Users are warned of these: integers have none, and no image more than it has samples.
  const std::uint64_t samples = std::uint64_t{d.width} * d.height * d.channels;
  if (d.nonfinite > (is_float(d.depth) ? samples : 0))
    in.fail("counts more non-finite samples than it has");
  d.linear = linear != 0;
  d.has_alpha = alpha > 0;
  d.premultiplied = alpha > 1;
  d.wrap_u = static_cast<mesh::Wrap>(wrap_u);
  d.wrap_v = static_cast<mesh::Wrap>(wrap_v);
  d.row_pages = get_chunks(in, d.tiles_y());
  return d;
}

/// All but what only decoding tells.
bool is_of(const ColourDirectory& d, const ColourDirectory& image) {
  return d.width == image.width && d.height == image.height && d.channels == image.channels &&
         d.depth == image.depth && d.linear == image.linear && d.has_alpha == image.has_alpha &&
         d.premultiplied == image.premultiplied && d.wrap_u == image.wrap_u &&
         d.wrap_v == image.wrap_v;
}

/// Float samples are summed as mantissas and exponents (projection/blend.cpp), which NaN and
/// infinity have not.
bool are_finite(const ColourDirectory& image, std::span<const std::byte> tile) {
  if (!is_float(image.depth)) return true;
  const std::size_t size = depth_bytes(image.depth);
  for (std::size_t at = 0; at < tile.size(); at += size) {
    float sample;
    if (image.depth == Depth::half) {
      std::uint16_t bits;
      std::memcpy(&bits, tile.data() + at, sizeof bits);
      sample = half_to_float(bits);
    } else {
      std::memcpy(&sample, tile.data() + at, sizeof sample);
    }
    if (!std::isfinite(sample)) return false;
  }
  return true;
}

}  // namespace

std::size_t depth_bytes(Depth depth) {
  return depth == Depth::u8 ? 1 : depth == Depth::float32 ? 4 : 2;
}

std::int64_t wrapped(std::int64_t texel, std::int64_t size, mesh::Wrap wrap) {
  if (wrap == mesh::Wrap::clamp) return std::clamp<std::int64_t>(texel, 0, size - 1);
  // Mirrored, an image and its mirror image are one period.
  const std::int64_t period = wrap == mesh::Wrap::repeat ? size : 2 * size;
  // The remainder of a negative number is negative.
  const std::int64_t inside = ((texel % period) + period) % period;
  return inside < size ? inside : period - 1 - inside;
}

void filter_colours(const ColourDirectory& image, std::span<const std::byte> tile,
                    std::vector<std::byte>& raw) {
  // To the texel on the left, sample by sample; planes then are of all channels of a texel.
  std::vector<std::byte> differences(tile.begin(), tile.end());
  delta(differences, depth_bytes(image.depth), image.channels);
  raw.resize(tile.size());
  shuffle(differences, image.texel_bytes(), raw);
}

void unfilter_colours(const ColourDirectory& image, std::span<const std::byte> raw,
                      std::span<std::byte> tile) {
  unshuffle(raw, image.texel_bytes(), tile);
  undelta(tile, depth_bytes(image.depth), image.channels);
}

void encode_tile(const ColourDirectory& image, std::span<const std::byte> tile,
                 Compressor& compressor, int level, PlainRoom* room,
                 std::vector<std::byte>& stored) {
  if (Compressor::keep_as_is(tile, stored, room)) return;
  std::vector<std::byte> raw;
  filter_colours(image, tile, raw);
  compressor.compress(raw, stored, level);
}

ColourStoreWriter::ColourStoreWriter(std::unique_ptr<PackWriter> pack, std::uint32_t tile_rows)
    : pack_(std::move(pack)), row_pages_(tile_rows) {}

void ColourStoreWriter::add_row(std::uint32_t tile_row,
                                const std::vector<std::vector<std::byte>>& stored_tiles,
                                std::uint32_t raw_bytes, Compressor& compressor) {
  for (const auto& tile : stored_tiles) add_tile(tile, raw_bytes);
  end_row(tile_row, compressor);
}

void ColourStoreWriter::add_tile(std::span<const std::byte> stored_tile, std::uint32_t raw_bytes) {
  ByteWriter out(row_);
  put_chunk(out, stored_tile.empty() ? kLeftOut
                                     : pack_->append(ChunkKind::block, stored_tile, raw_bytes));
}

// Rows come in any order, since strips are decoded in parallel; an index page is written with its
// row, and the directory puts them in order.
void ColourStoreWriter::end_row(std::uint32_t tile_row, Compressor& compressor) {
  row_pages_[tile_row] = append_payload(*pack_, ChunkKind::index_page, row_, compressor);
  row_.clear();
}

std::unique_ptr<PackWriter> ColourStoreWriter::finish(ColourDirectory directory,
                                                      Compressor& compressor) {
  directory.row_pages = std::move(row_pages_);
  const auto raw = encode_directory(directory);
  pack_->finish(append_payload(*pack_, ChunkKind::directory, raw, compressor));
  return std::move(pack_);
}

ColourStore::ColourStore(std::unique_ptr<PackReader> pack, const ColourDirectory& image,
                         Compressor& compressor, bool leaves_out)
    : pack_(std::move(pack)), leaves_out_(leaves_out) {
  const auto raw = read_payload(*pack_, pack_->directory(), ChunkKind::directory,
                                kHeaderBytes + image.tiles_y() * kChunkRefBytes, compressor);
  directory_ = decode_directory(raw, pack_->name());
  if (!is_of(directory_, image)) {
    // Everything that sizes a buffer or chooses a kernel is in is_of().
    throw Error(ErrorKind::damaged_store,
                pack_->name() + ": directory belongs to a different image than its key");
  }
}

ColourStore::ColourStore(const ColourDirectory& image) : directory_(image), leaves_out_(true) {
  // Places that no chunk has, each of its own: whoever keeps what was read goes by them.
  for (std::uint64_t y = 0; y < image.tiles_y(); ++y)
    directory_.row_pages.push_back({y * sizeof(std::uint64_t), 0, 0});
}

std::vector<ChunkRef> ColourStore::read_row(std::uint32_t tile_row, Compressor& compressor) const {
  if (pack_ == nullptr) return std::vector<ChunkRef>(directory_.tiles_x(), kLeftOut);
  const ChunkRef& page = directory_.row_pages[tile_row];
  const auto raw = read_payload(*pack_, page, ChunkKind::index_page,
                                directory_.tiles_x() * kChunkRefBytes, compressor);
  ByteReader in(raw, pack_->name() + ": index page");
  return get_chunks(in, directory_.tiles_x());
}

ColourTile ColourStore::read_tile(const ChunkRef& chunk, Compressor& compressor) const {
  const std::size_t size = kTileTexels * directory_.texel_bytes();
  // Also of a tile that was left out: who asks for it was wrong about what its texels need.
  if (chunk.raw_bytes != size)
    throw Error(ErrorKind::damaged_store, pack_->name() + ": a tile has the wrong size");
  StoredChunk stored = pack_->read(chunk, ChunkKind::block);
  ColourTile tile;
  if (is_as_is(stored.payload())) {
    tile.resize(size);
    compressor.decompress(stored.payload(), tile);
  } else {
    UnsetBytes raw(size);
    compressor.decompress(stored.payload(), raw);
    stored = {};  // its memory
    tile.resize(size);
    unfilter_colours(directory_, raw, tile);
  }
  if (!are_finite(directory_, tile))
    throw Error(ErrorKind::damaged_store, pack_->name() + ": a tile has non-finite samples");
  return tile;
}

std::uint64_t ColourStore::tile_bytes() const {
  return round_to_pages(kTileTexels * directory_.texel_bytes());
}

}  // namespace pounce::store
