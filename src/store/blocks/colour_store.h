// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/page_pool.h"
#include "mesh/lattice.h"
#include "mesh/mesh.h"
#include "pounce/options.h"
#include "store/pack/codec.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// Texels around a colour tile that are stored with it: the widest kernel's reach, so that a blend
/// never needs a second tile. What lies beyond the image follows the wrap mode.
inline constexpr int kApron = 2;
inline constexpr int kColourTileEdge = mesh::kBlockEdge + 2 * kApron;

/// No image has more texels along a side.
inline constexpr std::uint32_t kLargestImageSide = 65536;
/// Nor a column more below each other, nor more samples in each: the views of a scene are one tall
/// image of five (src/views/).
inline constexpr std::uint32_t kTallestColumn = 1U << 20, kMostSamples = 5;

std::size_t depth_bytes(Depth depth);
constexpr bool is_float(Depth depth) { return depth == Depth::half || depth == Depth::float32; }

/// One channel's image as a column of tiles.
struct ColourDirectory {
  std::uint32_t width = 0, height = 0;
  std::uint32_t channels = 0;
  Depth depth = Depth::u8;
  bool linear = false;
  bool has_alpha = false;      ///< the last channel is alpha
  bool premultiplied = false;  ///< float images alone: colours are stored times alpha
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
  std::uint64_t nonfinite = 0;      ///< NaN and infinite samples, stored as 0
  std::vector<ChunkRef> row_pages;  ///< per row of tiles: the index page with its chunks

  std::uint32_t tiles_x() const { return (width + mesh::kBlockEdge - 1) / mesh::kBlockEdge; }
  std::uint32_t tiles_y() const { return (height + mesh::kBlockEdge - 1) / mesh::kBlockEdge; }
  std::size_t texel_bytes() const { return channels * depth_bytes(depth); }
};

/// The texel of an image of `size` texels that a coordinate outside it means.
std::int64_t wrapped(std::int64_t texel, std::int64_t size, mesh::Wrap wrap);

/// Samples of one tile and its apron, kColourTileEdge wide and high, texels interleaved, as in the
/// image.
using ColourTile = UnsetPageVector<std::byte>;

/// Serialises a tile for compression (differences between neighbours, byte planes), and back.
void filter_colours(const ColourDirectory& image, std::span<const std::byte> tile,
                    std::vector<std::byte>& raw);
void unfilter_colours(const ColourDirectory& image, std::span<const std::byte> raw,
                      std::span<std::byte> tile);
/// Replaces `stored` by what a pack holds of a tile: filtered and compressed, or as it is where
/// there is `room` for that.
void encode_tile(const ColourDirectory& image, std::span<const std::byte> tile,
                 Compressor& compressor, int level, PlainRoom* room,
                 std::vector<std::byte>& stored);

/// Writes the tiles of one image, or some of them. Rows of tiles may come in any order.
class ColourStoreWriter {
 public:
  explicit ColourStoreWriter(std::unique_ptr<PackWriter> pack, std::uint32_t tile_rows);
  /// An empty tile is one that is left out.
  void add_row(std::uint32_t tile_row, const std::vector<std::vector<std::byte>>& stored_tiles,
               std::uint32_t raw_bytes, Compressor& compressor);
  /// The same in parts: the tiles of a row from left to right, then its end.
  void add_tile(std::span<const std::byte> stored_tile, std::uint32_t raw_bytes);
  void end_row(std::uint32_t tile_row, Compressor& compressor);
  std::unique_ptr<PackWriter> finish(ColourDirectory directory, Compressor& compressor);

 private:
  std::unique_ptr<PackWriter> pack_;
  std::vector<std::byte> row_;  ///< the index page of the row at hand
  std::vector<ChunkRef> row_pages_;
};

/// Of a tile that was left out: such a chunk has no bytes.
inline bool is_left_out(const ChunkRef& tile) { return tile.raw_bytes == 0; }

/// Reads a colour pack. Const members are thread-safe.
class ColourStore {
 public:
  /// `image` is what the job knows of it: all but the samples that are not finite and the places of
  /// rows. Throws Error(damaged_store) if the pack says anything else. `leaves_out`: not every tile
  /// of it needs to be there.
  ColourStore(std::unique_ptr<PackReader> pack, const ColourDirectory& image,
              Compressor& compressor, bool leaves_out = false);
  /// Of an image of which every tile is left out: nothing is stored.
  explicit ColourStore(const ColourDirectory& image);
  const ColourDirectory& directory() const { return directory_; }
  bool leaves_out() const { return leaves_out_; }
  std::vector<ChunkRef> read_row(std::uint32_t tile_row, Compressor& compressor) const;
  /// Throws Error(damaged_store) also for one that was left out.
  ColourTile read_tile(const ChunkRef& chunk, Compressor& compressor) const;
  bool has_pack() const { return pack_ != nullptr; }
  const PackReader& pack() const { return *pack_; }
  /// Bytes of a decoded tile.
  std::uint64_t tile_bytes() const;

 private:
  std::unique_ptr<PackReader> pack_;
  ColourDirectory directory_;
  bool leaves_out_;
};

}  // namespace pounce::store
