// SPDX-License-Identifier: Apache-2.0
//
// The index of a splat pack as bytes, and what it says held against what the job knows, as in
// geometry_store.cpp. The row of a file ends either in a block or in one of the counts of what was
// left out, so together they must be as many as the file has: a pack that lost some is noticed.
#include "store/blocks/splat_store.h"

#include <algorithm>
#include <bit>
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

// --- the order -----------------------------------------------------------------------------------
//
// Why the lattice is bent: a trained scene of 5 m may hold a Gaussian at 1e7 m. Sized by its box, a
// lattice of 21 bits per axis would have cells of 10 m. Bent, it has cells of a thousandth of a
// spacing where the scene is, and 2^15 per doubling of the distance beyond. Any monotone map of
// each axis keeps what matters here: neighbours in the order are neighbours in space, and a range
// of keys is a few boxes.
//
// Why size classes: a block's box holds its largest Gaussian, so one that is a hundred times the
// others would make every ray near it read the block of its small neighbours. Apart, small blocks
// stay small, and the few large ones are blocks of their own (docs/decisions/010).

namespace {

constexpr int kStraightBits = 19;  // cells on each side of the centre that are equal
constexpr int kOctaves = 16;       // beyond them
constexpr int kOctaveBits = 15;    // cells per octave; 16 * 2^15 = 2^19, so that a side has 2^20
constexpr double kStraight = 1 << kStraightBits;
constexpr double kBeyond = kStraight * (1 << kOctaves);
constexpr int kSideBits = 20;
// Gaussians up to 2-4 times the median size share the first class.
constexpr int kClassSlackBits = 2;

/// Value of that rank among them, 0 lowest, 1 highest.
float quantile(PageVector<float>& values, double rank) {
  const auto at =
      static_cast<std::ptrdiff_t>(std::llround(rank * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

/// The least power of two that is not below.
double power_of_two_above(double value) {
  int exponent;
  const double fraction = std::frexp(value, &exponent);  // in [1/2, 1)
  return std::ldexp(1.0, fraction == 0.5 ? exponent - 1 : exponent);
}

/// Which cell of an axis; rises with `cells`. Beyond the straight part the upper bits of a double
/// are such a code already: its exponent counts octaves, its mantissa divides each evenly.
std::uint64_t axis_code(double cells) {
  const double a = std::abs(cells);
  std::uint64_t code;
  if (a < kStraight) {
    code = static_cast<std::uint64_t>(a);
  } else {
    const auto bits = std::bit_cast<std::uint64_t>(a);
    const std::uint64_t octave = (bits >> 52) - 1023 - kStraightBits;
    code = (1U << kStraightBits) + (octave << kOctaveBits) +
           (bits >> (52 - kOctaveBits) & ((1U << kOctaveBits) - 1));
  }
  constexpr std::uint64_t kMiddle = 1U << kSideBits;
  return std::signbit(cells) ? kMiddle - 1 - code : kMiddle + code;
}

/// Bit i of 21 goes to bit 3 i.
std::uint64_t spread(std::uint64_t v) {
  v = (v | v << 32) & 0x1F00000000FFFFULL;
  v = (v | v << 16) & 0x1F0000FF0000FFULL;
  v = (v | v << 8) & 0x100F00F00F00F00FULL;
  v = (v | v << 4) & 0x10C30C30C30C30C3ULL;
  v = (v | v << 2) & 0x1249249249249249ULL;
  return v;
}

}  // namespace

SplatLattice::SplatLattice(std::span<const Splat> sample) {
  if (sample.empty()) return;
  std::array<PageVector<float>, 3> means;
  PageVector<float> sizes;
  for (auto& axis : means) axis.reserve(sample.size());
  sizes.reserve(sample.size());
  for (const Splat& s : sample) {
    means[0].push_back(s.mean.x);
    means[1].push_back(s.mean.y);
    means[2].push_back(s.mean.z);
    sizes.push_back(size_of(s));
  }
  std::array<float, 3> low, high;
  double half = 0;
  const auto measure = [&](double rank) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = quantile(means[k], rank);
      high[k] = quantile(means[k], 1 - rank);
      centre_[k] = (static_cast<double>(low[k]) + static_cast<double>(high[k])) / 2;
      half = std::max(half, (static_cast<double>(high[k]) - static_cast<double>(low[k])) / 2);
    }
  };
  // Outer tenths left out: a trained scene's background may be most of its extent.
  measure(0.1);
  if (half == 0) measure(0);  // most Gaussians stand in one place
  middle_ = {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
  const auto median = static_cast<double>(quantile(sizes, 0.5));
  if (half == 0) half = median;
  cell_ = power_of_two_above(half) / kStraight;
  per_cell_ = 1 / cell_;
  class_0_size_ = static_cast<float>(std::ldexp(power_of_two_above(median), kClassSlackBits - 1));
}

std::optional<SplatFilter> SplatLattice::filter(const Splat& splat) const {
  const double far = kBeyond * cell_;
  const std::array<float, 3> mean{splat.mean.x, splat.mean.y, splat.mean.z};
  for (std::size_t k = 0; k < 3; ++k) {
    if (std::abs(static_cast<double>(mean[k]) - centre_[k]) >= far) return SplatFilter::far;
  }
  if (static_cast<double>(size_of(splat)) >= far) return SplatFilter::exploded;
  return std::nullopt;
}

std::uint32_t SplatLattice::size_class(float size) const {
  // A class spans two doublings. A change of class ends a block, so more classes would mean more
  // blocks that are not full.
  if (size <= class_0_size_) return 0;
  const double ratio = static_cast<double>(size) / static_cast<double>(class_0_size_);
  return std::min(31U, static_cast<std::uint32_t>(std::ilogb(ratio)) / 2 + 1);
}

std::uint64_t SplatLattice::key(const Splat& splat) const {
  const Vec3f& mean = splat.mean;
  const auto code = [&](float v, std::size_t k) {
    return spread(axis_code((static_cast<double>(v) - centre_[k]) * per_cell_));
  };
  const std::uint64_t morton = code(mean.x, 0) << 2 | code(mean.y, 1) << 1 | code(mean.z, 2);
  const std::uint64_t size_class_of = size_class(size_of(splat));
  if (size_class_of == 0) return morton;
  // Larger ones are content with cells four times as wide: the class takes the bits.
  return 1ULL << 63 | size_class_of << kClassShift | morton >> 6;
}

int SplatLattice::distance(std::uint64_t key, std::uint64_t next) {
  // Three bits of a Morton code to a level: the highest bit in which they differ tells the cube.
  if (key_size_class(key) != key_size_class(next)) return 64;
  return (static_cast<int>(std::bit_width(key ^ next)) + 2) / 3;
}

std::size_t splat_cut(std::span<const std::uint64_t> keys, std::size_t most, bool ended) {
  // A cut at a wide gap makes two small boxes of one large one. None in the first quarter, and the
  // last of equal gaps: where all gaps are alike, as on a grid, blocks stay full.
  const std::size_t last = std::min(most, keys.size());
  std::size_t best = last;
  int widest = -1;
  for (std::size_t i = 1; i <= last; ++i) {
    if (i == keys.size()) {
      if (ended) return i;  // only here: everything fits
      break;
    }
    const int gap = SplatLattice::distance(keys[i - 1], keys[i]);
    if (gap == 64) return i;
    if (i >= most / 4 && gap >= widest) {
      widest = gap;
      best = i;
    }
  }
  return best;
}

}  // namespace pounce::store
