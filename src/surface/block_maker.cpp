// SPDX-License-Identifier: Apache-2.0
//
// Triangles become blocks: rasterised in windows of 64x64 texels.
//
// Source and target differ in one thing. A target texel belongs to the first triangle in file order
// that covers its centre, so that every texel has one place on the surface, wherever tiles are cut.
// A source keeps all of its surface, since a texel that the surface uses twice is two Gaussians, in
// fewer triangles than the mesh has where these are tiny (coarsen.h).
//
// A block follows from its bin and the request alone, not from tiles, threads or the budget. So
// equal inputs give equal bytes, whatever runs beside this, and a hash of the inputs can be the key
// of the store (geometry_request.cpp).
#include "surface/block_maker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "mesh/uv_raster.h"
#include "surface/coarsen.h"
#include "surface/source_block.h"
#include "surface/target_block.h"

namespace pounce::surface {
namespace {

using store::kNoTriangle;

/// The Gaussians of a whole triangle that spans more rows than this are counted by its area, as are
/// those of one that is larger than its image.
constexpr double kCountedRows = 1 << 20;

/// A target's block whose triangles take no more bytes per covered texel keeps them, and so does
/// one of few texels, which has little to save: their maps are exact.
constexpr std::uint32_t kExactBytes = 8, kFewTexels = 512;
constexpr float kNoEdge = 1e-30F;  // as a bound: none

mesh::TexelWindow window_of(const mesh::BlockBin& bin) {
  return {std::int64_t{bin.x} * mesh::kBlockEdge, std::int64_t{bin.y} * mesh::kBlockEdge,
          std::int64_t{bin.x + 1} * mesh::kBlockEdge, std::int64_t{bin.y + 1} * mesh::kBlockEdge};
}

class TileMaker {
 public:
  TileMaker(const GeometryRequest& request, const mesh::BlockBins& bins,
            store::Compressor& compressor, store::PlainRoom* room)
      : request_(request),
        bins_(bins),
        compressor_(compressor),
        room_(room),
        builder_(*request.mesh, request.colours) {}

  EncodedTile make(const mesh::TileRange& tile, const std::function<void()>& poll) {
    for (std::uint32_t b = tile.first_block; b < tile.first_block + tile.block_count; ++b) {
      poll();
      const mesh::BlockBin& bin = bins_.blocks[b];
      out_.page = bin.page;
      request_.is_target ? target_block(bin) : source_blocks(bin);
    }
    return std::move(out_);
  }

 private:
  const mesh::Lattice& lattice(const mesh::BlockBin& bin) const { return request_.pages[bin.page]; }
  std::span<const mesh::BinEntry> entries(const mesh::BlockBin& bin) const {
    return std::span(bins_.entries).subspan(bin.first, bin.count);
  }
  const mesh::TriangleInstance& instance(const mesh::BlockBin& bin, std::uint32_t i) const {
    return bins_.entries[bin.first + i].instance;
  }

  void source_blocks(const mesh::BlockBin& bin) {
    const mesh::Lattice& l = lattice(bin);
    // A page without an image has no texels, and nothing to measure a deviation by.
    const bool coarsens = request_.coarsens_dense() && l.width != 0 && is_dense(bin.count);
    const CoarseSurface coarse =
        coarsens ? coarsen(*request_.mesh, l, entries(bin)) : CoarseSurface{};
    start_source(bin);
    for (std::uint32_t i = 0; i < bin.count; ++i) {
      const mesh::TriangleInstance& triangle = instance(bin, i);
      source_texels_ += count_texels(bin, triangle);
      if (coarsens && coarse.replaced[i] != 0) continue;
      builder_.add(triangle, l.uv_set, l.width != 0);
      // A block has 4096 triangles at most. What is more becomes a further block with the same
      // place.
      if (builder_.full()) finish_source(bin);
    }
    // These count no texels: the triangles that they replace did, above.
    add_coarse(bin, coarse);
    finish_source(bin);
  }

  void add_coarse(const mesh::BlockBin& bin, const CoarseSurface& coarse) {
    // From points of the coarse surface to vertices of the block being built. A further block
    // begins without any, and gets its own copies.
    std::vector<std::uint16_t> local(coarse.points.size(), kNoTriangle);
    for (const CoarseTriangle& triangle : coarse.triangles) {
      std::array<std::uint16_t, 3> points;
      for (std::size_t k = 0; k < 3; ++k) {
        const SurfacePoint& p = coarse.points[triangle.points[k]];
        std::uint16_t& at = local[triangle.points[k]];
        if (at == kNoTriangle) at = builder_.add_point(p.position, p.normal, p.uv, p.tangent);
        points[k] = at;
      }
      builder_.add(points, triangle.id);
      if (!builder_.full()) continue;
      finish_source(bin);
      std::fill(local.begin(), local.end(), kNoTriangle);
    }
  }

  /// A whole triangle counts once, however many blocks have it; of a cut one, each counts its part.
  bool counts_in(const mesh::BlockBin& bin, const std::array<Vec2d, 3>& corners,
                 bool is_whole) const {
    if (!request_.coarsens_dense() || !is_whole) return true;
    const mesh::HomeBlock home = mesh::home_block(corners);
    return home.x == bin.x && home.y == bin.y;
  }

  /// Gaussians of one triangle in this block, where it counts; one that covers no texel centre
  /// still gives one.
  std::uint64_t count_texels(const mesh::BlockBin& bin, const mesh::TriangleInstance& instance) {
    const mesh::Lattice& l = lattice(bin);
    if (l.width == 0) return 1;
    const auto corners = mesh::texel_corners(*request_.mesh, l, instance);
    const bool whole = mesh::is_whole(corners, l);
    if (!counts_in(bin, corners, whole)) return 0;
    const double area = std::abs(mesh::doubled_area(corners[0], corners[1], corners[2])) / 2;
    const auto [low, high] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
    // To visit all rows of such a triangle would take long, and its area is as good a number.
    if (whole && (high - low > kCountedRows || area > double{1} * l.width * l.height))
      return std::max<std::uint64_t>(static_cast<std::uint64_t>(area), 1);
    const mesh::TexelWindow everywhere{INT32_MIN, INT32_MIN, INT32_MAX, INT32_MAX};
    std::uint64_t count = 0;
    mesh::raster_triangle(corners, whole ? everywhere : window_of(bin),
                          [&](std::int64_t, std::int64_t begin, std::int64_t end) {
                            count += static_cast<std::uint64_t>(end - begin);
                          });
    if (count == 0 && whole) {
      ++out_.slivers;
      count = 1;
    }
    return count;
  }

  void start_source(const mesh::BlockBin& bin) {
    builder_.start(bin.page, bin.x, bin.y, bin.count);
    source_texels_ = 0;
  }

  /// Encodes what was added and begins the next part of the bin.
  void finish_source(const mesh::BlockBin& bin) {
    encode_source(bin, source_texels_);
    start_source(bin);
  }

  void encode_source(const mesh::BlockBin& bin, std::uint64_t texels) {
    const store::GeometryBlock& block = builder_.block();
    // Decoded as projection will decode it: the index states how many patches a block has and where
    // they are, so that a reader can decide on the block, and lease its memory, before reading it.
    const SourceBlock decoded = make_source_block(block, lattice(bin));
    if (decoded.degenerate > 0) count_degenerate(bin, decoded);
    out_.texels += texels;
    if (decoded.patches.empty()) return;
    std::vector<Box3f> boxes;
    for (const Patch& patch : decoded.patches) boxes.push_back(patch.box);
    EncodedBlock encoded = encode(block, boxes);
    encoded.entry.patches = static_cast<std::uint32_t>(decoded.patches.size());
    encoded.entry.texels = static_cast<std::uint32_t>(std::min<std::uint64_t>(texels, UINT32_MAX));
    out_.blocks.push_back(std::move(encoded));
  }

  bool counts_in(const mesh::BlockBin& bin, std::uint32_t triangle) const {
    const mesh::Lattice& l = lattice(bin);
    if (l.width == 0) return true;
    const auto corners = mesh::texel_corners(*request_.mesh, l, {triangle, 0, 0});
    return counts_in(bin, corners, mesh::is_whole(corners, l));
  }

  /// Triangles of the builder's block that became no facet.
  void count_degenerate(const mesh::BlockBin& bin, const SourceBlock& decoded) {
    // The facets are the triangles in their order, some left out, so one walk along both finds
    // which.
    auto facet = decoded.facets.begin();  // in the order of the triangles
    for (const std::uint32_t id : builder_.block().ids) {
      if (facet != decoded.facets.end() && static_cast<std::uint32_t>(facet->id) == id) {
        ++facet;
      } else if (counts_in(bin, id)) {
        ++out_.degenerate;
      }
    }
  }

  void target_block(const mesh::BlockBin& bin) {
    constexpr std::uint32_t kFree = 0xFFFFFFFF;
    const mesh::Lattice& l = lattice(bin);
    // Blocks at the right and lower border reach beyond the image, where no texel exists.
    mesh::TexelWindow window = window_of(bin);
    window.x1 = std::min<std::int64_t>(window.x1, l.width);
    window.y1 = std::min<std::int64_t>(window.y1, l.height);
    std::array<std::uint32_t, store::kTexelsPerBlock> claim;
    std::array<bool, store::kTexelsPerBlock> contested{};
    claim.fill(kFree);
    for (std::uint32_t i = 0; i < bin.count; ++i) {
      mesh::raster_triangle(
          mesh::texel_corners(*request_.mesh, l, instance(bin, i)), window,
          [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
            for (std::int64_t x = begin; x < end; ++x) {
              const auto t = static_cast<std::size_t>((y - std::int64_t{bin.y} * mesh::kBlockEdge) *
                                                          mesh::kBlockEdge +
                                                      (x - std::int64_t{bin.x} * mesh::kBlockEdge));
              // Entries of a bin are in file order, so the first claim is that of the first
              // triangle.
              if (claim[t] == kFree) {
                claim[t] = i;
              } else if (!contested[t]) {
                contested[t] = true;
                ++out_.overlapping;
              }
            }
          });
    }
    // Only triangles that own a texel are stored, in the order of their first texels.
    std::vector<std::uint16_t> local(bin.count, kNoTriangle);
    builder_.start(bin.page, bin.x, bin.y, bin.count);
    store::GeometryBlock& block = builder_.block();
    block.owner.assign(store::kTexelsPerBlock, kNoTriangle);
    std::uint32_t texels = 0;
    for (std::size_t t = 0; t < claim.size(); ++t) {
      if (claim[t] == kFree) continue;
      if (local[claim[t]] == kNoTriangle)
        local[claim[t]] = builder_.add(instance(bin, claim[t]), l.uv_set, true);
      block.owner[t] = local[claim[t]];
      ++texels;
    }
    if (texels == 0) return;
    std::vector<Box3f> boxes = texel_boxes(block, l);
    EncodedBlock encoded = encode_target(block, l, texels, boxes);
    encoded.entry.texels = texels;
    out_.texels += texels;
    out_.blocks.push_back(std::move(encoded));
  }

  /// As triangles, or as records where the block is so dense that these are smaller.
  EncodedBlock encode_target(const store::GeometryBlock& block, const mesh::Lattice& l,
                             std::uint32_t texels, std::vector<Box3f>& boxes) {
    store::encode(block, raw_);
    // From cheap to dear: the raw size settles sparse blocks, the entropy most others, and records
    // are only computed where they may be smaller. The entropy is computed in integers, not read
    // off zstd's output: another version of zstd must not change the choice (docs/decisions/020).
    const std::size_t exact = std::size_t{kExactBytes} * std::max(texels, kFewTexels);
    if (request_.exact || raw_.size() <= exact) return compress(block, raw_, boxes);
    const std::uint64_t as_triangles = store::estimated_bytes(raw_);
    if (as_triangles > exact) {
      const auto records =
          TargetBlock(block, l, kNoEdge, TargetBlock::Start::inset).as_records(block);
      if (records) {
        store::encode(*records, records_raw_);
        if (store::estimated_bytes(records_raw_) < as_triangles) {
          // A rounded position may be half a step outside of the box of the exact ones, on each
          // axis.
          for (Box3f& box : boxes) box = box.grown(records->step);
          return compress(*records, records_raw_, boxes);
        }
      }
    }
    return compress(block, raw_, boxes);
  }

  EncodedBlock encode(const store::GeometryBlock& block, std::vector<Box3f>& boxes) {
    store::encode(block, raw_);
    return compress(block, raw_, boxes);
  }

  EncodedBlock compress(const store::GeometryBlock& block, std::span<const std::byte> raw,
                        std::vector<Box3f>& boxes) {
    EncodedBlock encoded;
    compressor_.compress(raw, encoded.stored, store::kZstdLevel, room_);
    encoded.raw_bytes = static_cast<std::uint32_t>(raw.size());
    encoded.entry.page = block.page;
    encoded.entry.x = block.x;
    encoded.entry.y = block.y;
    encoded.entry.triangles = static_cast<std::uint32_t>(block.triangles.size());
    store::cluster_boxes(boxes, encoded.entry);
    return encoded;
  }

  const GeometryRequest& request_;
  const mesh::BlockBins& bins_;
  store::Compressor& compressor_;
  store::PlainRoom* room_;
  store::GeometryBlockBuilder builder_;
  std::uint64_t source_texels_ = 0;  ///< Gaussians of what the builder holds
  std::vector<std::byte> raw_, records_raw_;
  EncodedTile out_;
};

}  // namespace

EncodedTile make_tile(const GeometryRequest& request, const mesh::BlockBins& bins,
                      const mesh::TileRange& tile, store::Compressor& compressor,
                      store::PlainRoom* room, const std::function<void()>& poll) {
  return TileMaker(request, bins, compressor, room).make(tile, poll);
}

}  // namespace pounce::surface
