// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "store/blocks/block_store.h"
#include "store/blocks/splat_block.h"

namespace pounce::store {

/// Why a Gaussian of a file is not in the store.
enum class SplatFilter : std::uint8_t {
  not_finite,       ///< NaN or infinity in a column that is needed
  zero_quaternion,  ///< no orientation
  transparent,      ///< alpha below 1/255
  sizeless,         ///< every standard deviation is 0
  exploded,         ///< larger than the whole scene: a standard deviation beyond `far`'s limit
  far,              ///< beyond 65,536 times the half width of the scene's middle
  faint,            ///< less opaque than the user wants
  too_large,        ///< a standard deviation beyond what the user wants
  outside_box,      ///< of the user
  out_of_reach,     ///< of every texel
};
inline constexpr std::size_t kSplatFilters = 10;
/// As in the report: "not_finite", ...
const char* filter_name(SplatFilter filter);
using SplatCounts = std::array<std::uint64_t, kSplatFilters>;  ///< by SplatFilter
/// In words, by left_out_reasons(): "1 transparent, 3 far away from the scene".
std::string filtered_text(const SplatCounts& counts);

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
  std::uint32_t lobes = 0;  ///< that are kept
  bool is_linear = false;   ///< colours are linear light, not sRGB-coded
};

/// A spatial tile: blocks of one size class that are neighbours, and their page of the index.
struct SplatTile {
  Box3f box;
  ChunkRef index_page;
  std::uint32_t blocks = 0;
  std::uint32_t size_class = 0;
};

struct SplatIndex : TileIndex<SplatTile> {
  std::uint64_t splats = 0;       ///< in the store
  std::uint32_t most_splats = 0;  ///< of any block
  std::uint64_t blocks() const {
    std::uint64_t sum = 0;
    for (const SplatTile& tile : tiles) sum += tile.blocks;
    return sum;
  }
};

/// What a splat pack says of itself: the chunk a reader starts from. Small; always in memory. Its
/// box is huge where a trained scene has strays.
struct SplatDirectory : SplatIndex {
  SplatCounts filtered{};  ///< not in the store
  SplatModel model = SplatModel::standard;
  bool has_normals = false;  ///< some block has any
  bool is_linear = false;    ///< colours are linear light, not sRGB-coded
  std::uint32_t lobes = 0;   ///< of every block, one of kLobesOfDegree
  /// Typical distance of a Gaussian from the surface that its neighbours make: the median of
  /// 1.4826 MAD of 16 neighbours' offsets along its normal. 0 where there are too few to tell.
  float surface_noise = 0;
  /// The middle one of a Gaussian's two larger standard deviations over the largest: the median
  /// over a sample. 1: round discs or balls, 0: needles.
  float roundness = 1;
  /// A Gaussian's largest standard deviation: the median over the same sample. 0 for none.
  float typical_size = 0;
  /// The smallest standard deviation over the second largest: the lower quartile over the same
  /// sample. 0: discs without thickness, 1: balls.
  float thickness = 0;
  Box3f middle_box;  ///< of the means without the outer tenth on each side of each axis
};

/// Gaussians, of a scene or of a mesh's texels: see BlockStore.
struct SplatCodec {
  using Entry = SplatEntry;
  using Tile = SplatTile;
  using Index = SplatIndex;
  using Directory = SplatDirectory;
  using Facts = SplatFacts;
  using Block = SplatBlock;
  static constexpr std::size_t kLeastEntryBytes = 48, kMostEntryBytes = kLeastEntryBytes;
  static constexpr std::size_t kMostBlockBytes = kLargestSplatBytes;
  static std::uint64_t most_directory_bytes(const Facts& facts, std::uint64_t pack_bytes);

  static void count(const Entry& entry, Index& index);
  static Tile tile_of(const Entry& first);
  static Box3f box_of(const Entry& entry) { return entry.box; }
  static void put(const Entry& entry, ByteWriter& out);
  static Entry get_entry(ByteReader& in);
  static void put(const Directory& directory, ByteWriter& out);
  static Directory get_directory(ByteReader& in);
  static Block decode(std::span<const std::byte> raw, const std::string& name) {
    return decode_splats(raw, name);
  }
  static std::uint64_t size_bytes(const Directory& directory, const Facts&) {
    return directory.tiles.capacity() * sizeof(Tile);
  }

  static void check(const Directory& directory, const Facts& facts, const std::string& name);
  static void check(const std::vector<Entry>& entries, const Tile& tile, const Directory& directory,
                    const Facts& facts, const std::string& name);
  static void check(const Block& block, const Entry& entry, const Directory& directory,
                    const Facts& facts, const std::string& name);
};
using SplatStoreWriter = BlockStoreWriter<SplatCodec>;
using SplatStore = BlockStore<SplatCodec>;

// --- the order -----------------------------------------------------------------------------------

/// The order of a splat store: a size class, and within it a Morton code on one lattice for the
/// whole scene. The lattice's cells are equal cubes in the middle of the scene, 2^20 across the
/// widest side of what is left of a sample without its outer tenths; outside they grow with the
/// distance, so that a stray Gaussian far away costs no resolution. Thread-safe.
class SplatLattice {
 public:
  /// From Gaussians taken evenly from the scene. None give a lattice of unit cells. Takes 16 bytes
  /// for each of them meanwhile.
  explicit SplatLattice(std::span<const Splat> sample);

  /// Gaussians of no use to anybody: beyond 2^16 times the half width of the middle, or larger.
  std::optional<SplatFilter> filter(const Splat& splat) const;
  /// Smaller comes first. Only for Gaussians that filter() lets through.
  std::uint64_t key(const Splat& splat) const;
  static std::uint64_t key_size_class(std::uint64_t key) {
    return (key >> 63) == 0 ? 0 : key >> kClassShift & 63;
  }
  /// How far apart two neighbours in the order are: the level of the smallest lattice cube that
  /// holds both, largest where the class changes.
  static int distance(std::uint64_t key, std::uint64_t next);

  /// 0 for Gaussians that are not large against their neighbours', then one for each factor of 4.
  std::uint32_t size_class(float size) const;
  const Box3f& middle_box() const { return middle_; }
  double cell() const { return cell_; }

 private:
  static constexpr int kClassShift = 57;

  std::array<double, 3> centre_{};
  double cell_ = 1;         ///< a power of two
  double per_cell_ = 1;     ///< 1 / cell
  float class_0_size_ = 1;  ///< a power of two
  Box3f middle_;
};

/// Where to cut a block (or a tile) off the front of a sequence of keys, at most `most` long: at
/// the widest gap that leaves at least a quarter of `most`, the last such one. Everything if it is
/// no longer than `most` and `ended`. A change of size class always cuts.
std::size_t splat_cut(std::span<const std::uint64_t> keys, std::size_t most, bool ended);

}  // namespace pounce::store
