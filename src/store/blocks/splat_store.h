// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "store/blocks/splat_block.h"
#include "store/pack/codec.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// Why a Gaussian of a file is not in the store.
enum class SplatFilter : std::uint8_t {
  not_finite,       ///< NaN or infinity in a column that is needed
  zero_quaternion,  ///< no orientation
  transparent,      ///< alpha below 1/255
  sizeless,         ///< every standard deviation is 0
  exploded,         ///< larger than the whole scene: a standard deviation beyond `far`'s limit
  far,              ///< beyond 65,536 times the half width of the scene's middle
};
inline constexpr std::size_t kSplatFilters = 6;
/// As in the report: "not_finite", ...
const char* filter_name(SplatFilter filter);
using SplatCounts = std::array<std::uint64_t, kSplatFilters>;  ///< by SplatFilter
std::string filtered_text(const SplatCounts& counts);          ///< "3 far, 1 transparent"

/// What the trainer's rasteriser did to the Gaussians on the screen.
enum class SplatModel : std::uint32_t {
  standard,     ///< grown by 0.3 px^2, opacity as it is
  antialiased,  ///< grown, opacity times sqrt(det / det')
  flat,         ///< "2dgs": discs
};

/// What a join needs to know of a block before it is read.
struct SplatEntry {
  std::uint32_t splats = 0;
  std::uint32_t size_class = 0;
  Box3f box;  ///< of the 3-sigma ellipsoids
  ChunkRef chunk;
};

/// No tile holds more blocks.
inline constexpr std::uint32_t kMostBlocksPerSplatTile = 32;
/// What a job knows of a splat pack before it has seen it.
struct SplatFacts {
  std::optional<std::uint64_t> rows;  ///< of the scene's file; of a mesh's texels not known
  SplatModel model = SplatModel::standard;
};

/// A spatial tile: blocks of one size class that are neighbours, and their page of the index.
struct SplatTile {
  Box3f box;
  ChunkRef index_page;
  std::uint32_t blocks = 0;
  std::uint32_t size_class = 0;
};

/// What a splat pack says of itself: the chunk a reader starts from. Small; always in memory.
struct SplatDirectory {
  std::vector<SplatTile> tiles;
  std::uint64_t splats = 0;  ///< in the store
  SplatCounts filtered{};    ///< not in the store
  SplatModel model = SplatModel::standard;
  bool has_normals = false;  ///< some block has any
  /// Typical distance of a Gaussian from the surface that its neighbours make: the median of
  /// 1.4826 MAD of 16 neighbours' offsets along its normal. 0 where there are too few to tell.
  float surface_noise = 0;
  Box3f box;         ///< of everything; the strays of a trained scene make it huge
  Box3f middle_box;  ///< of the means without the outer tenth on each side of each axis
  std::uint32_t most_splats = 0;          ///< of any block
  std::uint32_t most_blocks = 0;          ///< of any tile
  std::uint32_t largest_chunk_bytes = 0;  ///< raw, of a block
};

/// Writes blocks in their order.
class SplatStoreWriter {
 public:
  explicit SplatStoreWriter(std::unique_ptr<PackWriter> pack);
  /// One encoded block and its entry (without chunk) belongs to the tile that end_tile() closes.
  void add_block(SplatEntry entry, bool has_normals, std::span<const std::byte> stored,
                 std::uint32_t raw_bytes);
  void end_tile(Compressor& compressor);
  std::size_t tile_blocks() const { return tile_.size(); }  ///< of the tile that is open
  /// Of the tile that is open, which has blocks.
  std::uint32_t tile_class() const { return tile_.front().size_class; }
  /// Writes the directory (its tiles, number of splats, maxima, box and has_normals are filled in
  /// here) and the footer.
  std::unique_ptr<PackWriter> finish(SplatDirectory directory, Compressor& compressor);

 private:
  std::unique_ptr<PackWriter> pack_;
  std::vector<SplatEntry> tile_;
  SplatDirectory built_;
};

/// Reads a splat pack. Whatever the pack holds, what comes out of here agrees with `facts` and with
/// itself, or Error(damaged_store) is thrown. Const members are thread-safe.
class SplatStore {
 public:
  SplatStore(std::unique_ptr<PackReader> pack, const SplatFacts& facts, Compressor& compressor);
  const SplatDirectory& directory() const { return directory_; }
  std::vector<SplatEntry> read_index(std::uint32_t tile, Compressor& compressor) const;
  SplatBlock read_block(const SplatEntry& entry, Compressor& compressor) const;
  const PackReader& pack() const { return *pack_; }
  /// Memory that stays in use while the store is open.
  std::uint64_t size_bytes() const;

 private:
  std::unique_ptr<PackReader> pack_;
  SplatDirectory directory_;
};

}  // namespace pounce::store
