// SPDX-License-Identifier: Apache-2.0
//
// Precondition and vectorize: one mesh becomes a store of blocks.
//
// Triangles are binned by the 64x64 windows that they touch, windows grouped into tiles, and each
// tile made, compressed and written on its own: in parallel, in order, under the budget. Source and
// target differ in one thing: a target texel belongs to the first triangle in file order that
// covers its centre; a source keeps all of its surface, since a texel that the surface uses twice
// is two Gaussians, in fewer triangles than the mesh has where these are tiny (surface/coarsen.h).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

#include "flow/stores/build_stores.h"
#include "flow/stores/find_store.h"
#include "mesh/uv_raster.h"
#include "runtime/ordered_stream.h"
#include "surface/coarsen.h"
#include "surface/source_block.h"
#include "surface/target_block.h"

namespace pounce::flow {
namespace {

using store::kNoTriangle;

/// The Gaussians of a whole triangle that spans more rows than this are counted by its area, as are
/// those of one that is larger than its image.
constexpr double kCountedRows = 1 << 20;

/// A target's block whose triangles take no more bytes per covered texel keeps them, and so does
/// one of few texels, which has little to save: their maps are exact.
constexpr std::uint32_t kExactBytes = 8, kFewTexels = 512;
constexpr float kNoEdge = 1e-30F;  // as a bound: none

/// Are blocks of a source with tiny triangles said in fewer?
bool coarsens_dense(const GeometryRequest& request) { return !request.is_target && !request.exact; }

struct EncodedBlock {
  store::BlockEntry entry;
  std::vector<std::byte> stored;
  std::uint32_t raw_bytes = 0;
};

/// One tile, ready to be written, and what it adds to the directory.
struct EncodedTile {
  std::vector<EncodedBlock> blocks;
  std::uint64_t texels = 0, overlapping = 0, slivers = 0, degenerate = 0;
  std::uint32_t page = 0;
};

/// How many windows of a block a cut triangle has a part in, at most.
std::uint64_t patch_windows(const std::array<Vec2d, 3>& corners, const mesh::BlockBin& block) {
  constexpr std::int64_t kEdge = surface::kPatchWindow;
  const std::int64_t x0 = std::int64_t{block.x} * mesh::kBlockEdge;
  const std::int64_t y0 = std::int64_t{block.y} * mesh::kBlockEdge;
  std::uint64_t windows = 0;
  for (std::int64_t y = y0; y < y0 + mesh::kBlockEdge; y += kEdge) {
    for (std::int64_t x = x0; x < x0 + mesh::kBlockEdge; x += kEdge)
      windows += mesh::triangle_touches(corners, {x, y, x + kEdge, y + kEdge}, 1.0) ? 1 : 0;
  }
  return windows;
}

mesh::TexelWindow window_of(const mesh::BlockBin& bin) {
  return {std::int64_t{bin.x} * mesh::kBlockEdge, std::int64_t{bin.y} * mesh::kBlockEdge,
          std::int64_t{bin.x + 1} * mesh::kBlockEdge, std::int64_t{bin.y + 1} * mesh::kBlockEdge};
}

class TileMaker {
 public:
  TileMaker(const GeometryRequest& request, const mesh::BlockBins& bins, job::JobContext& job)
      : request_(request), bins_(bins), job_(job), builder_(*request.mesh, request.colours) {}

  EncodedTile make(const mesh::TileRange& tile) {
    for (std::uint32_t b = tile.first_block; b < tile.first_block + tile.block_count; ++b) {
      job_.meter.advance(0);  // stops here if the caller asked to
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
    const bool is_dense = coarsens_dense(request_) && l.width != 0 && surface::is_dense(bin.count);
    const surface::CoarseSurface coarse =
        is_dense ? surface::coarsen(*request_.mesh, l, entries(bin)) : surface::CoarseSurface{};
    start_source(bin);
    for (std::uint32_t i = 0; i < bin.count; ++i) {
      const mesh::TriangleInstance& triangle = instance(bin, i);
      if (counts_in(bin, triangle)) source_texels_ += count_texels(bin, triangle);
      if (is_dense && coarse.replaced[i] != 0) continue;
      builder_.add(triangle, l.uv_set, l.width != 0);
      if (builder_.full()) finish_source(bin);
    }
    add_coarse(bin, coarse);
    finish_source(bin);
  }

  void add_coarse(const mesh::BlockBin& bin, const surface::CoarseSurface& coarse) {
    std::vector<std::uint16_t> local(coarse.points.size(), kNoTriangle);
    for (const surface::CoarseTriangle& triangle : coarse.triangles) {
      std::array<std::uint16_t, 3> points;
      for (std::size_t k = 0; k < 3; ++k) {
        const surface::SurfacePoint& p = coarse.points[triangle.points[k]];
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
  bool counts_in(const mesh::BlockBin& bin, const mesh::TriangleInstance& triangle) const {
    const mesh::Lattice& l = lattice(bin);
    if (!coarsens_dense(request_) || l.width == 0) return true;
    const auto corners = mesh::texel_corners(*request_.mesh, l, triangle);
    if (!mesh::is_whole(corners, l)) return true;
    const mesh::HomeBlock home = mesh::home_block(corners);
    return home.x == bin.x && home.y == bin.y;
  }

  /// Gaussians of one triangle in this block; a triangle that covers no texel centre still gives
  /// one.
  std::uint64_t count_texels(const mesh::BlockBin& bin, const mesh::TriangleInstance& instance) {
    const mesh::Lattice& l = lattice(bin);
    if (l.width == 0) return 1;
    const auto corners = mesh::texel_corners(*request_.mesh, l, instance);
    const bool whole = mesh::is_whole(corners, l);
    const double area = std::abs(mesh::doubled_area(corners[0], corners[1], corners[2])) / 2;
    const auto [low, high] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
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
    const surface::SourceBlock decoded = surface::make_source_block(block, lattice(bin));
    if (decoded.degenerate > 0) count_degenerate(bin, decoded);
    out_.texels += texels;
    if (decoded.patches.empty()) return;
    std::vector<Box3f> boxes;
    for (const surface::Patch& patch : decoded.patches) boxes.push_back(patch.box);
    EncodedBlock encoded = encode(block, boxes);
    encoded.entry.patches = static_cast<std::uint32_t>(decoded.patches.size());
    encoded.entry.texels = static_cast<std::uint32_t>(std::min<std::uint64_t>(texels, UINT32_MAX));
    out_.blocks.push_back(std::move(encoded));
  }

  /// Triangles of the builder's block that became no facet.
  void count_degenerate(const mesh::BlockBin& bin, const surface::SourceBlock& decoded) {
    auto facet = decoded.facets.begin();  // in the order of the triangles
    for (const std::uint32_t id : builder_.block().ids) {
      if (facet != decoded.facets.end() && static_cast<std::uint32_t>(facet->id) == id) {
        ++facet;
      } else if (counts_in(bin, {id, 0, 0})) {
        ++out_.degenerate;
      }
    }
  }

  void target_block(const mesh::BlockBin& bin) {
    constexpr std::uint32_t kFree = 0xFFFFFFFF;
    const mesh::Lattice& l = lattice(bin);
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
              if (claim[t] == kFree) {
                claim[t] = i;
              } else if (!contested[t]) {
                contested[t] = true;
                ++out_.overlapping;
              }
            }
          });
    }
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
    std::vector<Box3f> boxes = surface::texel_boxes(block, l);
    EncodedBlock encoded = encode_target(block, l, texels, boxes);
    encoded.entry.texels = texels;
    out_.texels += texels;
    out_.blocks.push_back(std::move(encoded));
  }

  /// As triangles, or as records where the block is so dense that these are smaller.
  EncodedBlock encode_target(const store::GeometryBlock& block, const mesh::Lattice& l,
                             std::uint32_t texels, std::vector<Box3f>& boxes) {
    store::encode(block, raw_);
    const std::size_t exact = std::size_t{kExactBytes} * std::max(texels, kFewTexels);
    if (request_.exact || raw_.size() <= exact) return compress(block, raw_, boxes);
    const std::uint64_t as_triangles = store::estimated_bytes(raw_);
    if (as_triangles > exact) {
      const auto records =
          surface::TargetBlock(block, l, kNoEdge, surface::TargetBlock::Start::inset)
              .as_records(block);
      if (records) {
        store::encode(*records, records_raw_);
        if (store::estimated_bytes(records_raw_) < as_triangles) {
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
    job_.compressor().compress(raw, encoded.stored);
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
  job::JobContext& job_;
  store::GeometryBlockBuilder builder_;
  std::uint64_t source_texels_ = 0;  ///< Gaussians of what the builder holds
  std::vector<std::byte> raw_, records_raw_;
  EncodedTile out_;
};

/// Bytes that a tile may need while it is made: its largest block decoded twice over and coarsened,
/// and all of it encoded. `largest`, `all`: triangles.
std::uint64_t tile_bytes(const GeometryRequest& request, std::uint64_t largest, std::uint64_t all,
                         std::uint64_t blocks) {
  constexpr std::uint64_t kPerTriangle = 1000, kStoredPerTriangle = 80, kPerBlock = 12 << 10,
                          kFixed = 256 << 10;
  // Three colours: as built, encoded twice over, and as stored.
  constexpr std::uint64_t kColours = 3 * sizeof(Vec4f);
  const std::uint64_t in_block = std::min<std::uint64_t>(largest, store::kMostTrianglesPerBlock);
  const std::uint64_t colours = request.colours ? kColours * (4 * in_block + all) : 0;
  const bool coarsens = coarsens_dense(request) && surface::is_dense(largest);
  return kFixed + kPerTriangle * in_block + colours +
         (coarsens ? surface::coarsen_bytes(largest) : 0) + kStoredPerTriangle * all +
         kPerBlock * blocks;
}

std::uint64_t tile_cost(const GeometryRequest& request, const mesh::BlockBins& bins,
                        const mesh::TileRange& tile) {
  std::uint64_t largest = 0, all = 0;
  for (std::uint32_t b = tile.first_block; b < tile.first_block + tile.block_count; ++b) {
    largest = std::max<std::uint64_t>(largest, bins.blocks[b].count);
    all += bins.blocks[b].count;
  }
  return tile_bytes(request, largest, all, tile.block_count);
}

mesh::BinRequest bin_request(const GeometryRequest& request, std::uint64_t tile_cap_bytes) {
  return {request.mesh,      request.pages, request.triangles.get(), request.first_page,
          request.is_target, request.tile,  tile_cap_bytes,          coarsens_dense(request)};
}

/// Its bands are counted once, whoever asks first.
mesh::BlockBinner binner_of(const GeometryRequest& request, std::uint64_t tile_cap_bytes) {
  const mesh::BinRequest bins = bin_request(request, tile_cap_bytes);
  std::shared_ptr<const mesh::BlockBands>& bands = request.counted->bands;
  if (bands == nullptr) bands = std::make_shared<const mesh::BlockBands>(mesh::count_bands(bins));
  return {bins, bands};
}

/// "scan.glb as a source, 10092 triangles, 2048 x 2048": what `pounce cache list` shows.
std::string label_of(const GeometryRequest& request) {
  const std::string name = std::filesystem::path(request.mesh->path).filename().string();
  std::string label =
      fmt::format("{} as a {}, {} triangles", name, request.is_target ? "target" : "source",
                  request.mesh->triangles.size());
  if (request.tile) {
    label += fmt::format(", UDIM {}", mesh::udim_number(*request.tile).value_or(0));
  }
  if (request.pages.size() == 1) {
    label += fmt::format(", {} x {}", request.pages[0].width, request.pages[0].height);
  } else {
    label += fmt::format(", {} pages", request.pages.size());
  }
  return label;
}

void add(const Hash128& part, Hasher& hash) {
  hash.add(part.hi);
  hash.add(part.lo);
}

template <class Values>
void add(const Values& values, Hasher& hash) {
  hash.add(static_cast<std::uint64_t>(values.size()));
  hash.add(std::as_bytes(std::span(values)));
}

/// `entries`: of blocks and triangles; no block is without a triangle.
store::GeometryFacts facts_of(const GeometryRequest& request, std::uint64_t entries) {
  return {request.is_target, request.pages, request.mesh->triangles.size(), entries,
          request.colours};
}

/// Makes the tiles of one band, in order, and adds them up in `directory`.
void build_band(job::JobContext& job, const GeometryRequest& request, const mesh::BlockBins& bins,
                store::GeometryStoreWriter& writer, store::GeometryDirectory& directory) {
  std::vector<std::uint64_t> costs;
  for (const mesh::TileRange& tile : bins.tiles) costs.push_back(tile_cost(request, bins, tile));
  runtime::run_ordered<EncodedTile>(
      job.budget, costs,
      request.is_target ? "vectorizing the target" : "preconditioning the source",
      [&](std::size_t i) { return TileMaker(request, bins, job).make(bins.tiles[i]); },
      [&](std::size_t, EncodedTile& tile) {
        for (EncodedBlock& block : tile.blocks)
          writer.add_block(block.entry, block.stored, block.raw_bytes);
        writer.end_tile(job.compressor());
        directory.texels += tile.texels;
        directory.page_texels[tile.page] += tile.texels;
        directory.overlapping += tile.overlapping;
        directory.slivers += tile.slivers;
        directory.degenerate += tile.degenerate;
        ++job.report.tiles_written;
        job.meter.advance(1);
      });
}

std::unique_ptr<store::GeometryStore> build(job::JobContext& job, const GeometryRequest& request,
                                            const Hash128& key) {
  const mesh::BlockBinner binner = binner_of(request, job.tile_cap_bytes);
  store::GeometryStoreWriter writer(
      job.stores->create(store::PackKind::geometry, key, label_of(request)));
  store::GeometryDirectory directory;
  directory.pages = request.pages;
  directory.page_texels.assign(request.pages.size(), 0);
  if (!request.is_target && !request.exact)
    directory.coincident = mesh::count_coincident(*request.mesh);
  for (std::size_t band = 0; band < binner.bands(); ++band) {
    const runtime::Lease lease(job.budget, binner.cost_bytes(binner.entries(band)),
                               "binning the triangles of " + request.mesh->path);
    build_band(job, request, binner.bin(band), writer, directory);
  }
  return std::make_unique<store::GeometryStore>(
      job.stores->publish(writer.finish(directory, job.compressor())),
      facts_of(request, binner.entries()), job.compressor());
}

}  // namespace

const Hash128& MeshHashes::shape() {
  if (shape_) return *shape_;
  Hasher hash;
  add(mesh_->positions, hash);
  add(mesh_->normals, hash);
  add(mesh_->tangents, hash);
  add(mesh_->triangles, hash);
  return shape_.emplace(hash.digest());
}

const Hash128& MeshHashes::colours() {
  if (colours_) return *colours_;
  Hasher hash;
  add(mesh_->colours, hash);
  return colours_.emplace(hash.digest());
}

const Hash128& MeshHashes::uvs(std::uint32_t uv_set) {
  const auto [at, fresh] = uvs_.try_emplace(uv_set);
  if (fresh) {
    Hasher hash;
    if (uv_set < mesh_->uv_sets.size()) add(mesh_->uv_sets[uv_set], hash);
    at->second = hash.digest();
  }
  return at->second;
}

Hash128 geometry_key(const GeometryRequest& request) {
  Hasher hash;
  // The numbers are of the rules that cut triangles and pages: others make other blocks.
  hash.add(std::string_view(request.is_target ? "target geometry 2" : "source geometry 5"));
  hash.add(std::uint32_t{request.exact ? 1U : 0U});
  hash.add(store::kFormatVersion);
  add(request.hashes->shape(), hash);
  if (request.colours) add(request.hashes->colours(), hash);
  hash.add(static_cast<std::uint64_t>(request.pages.size()));
  for (std::size_t p = 0; p < request.pages.size(); ++p) {
    const mesh::Lattice& page = request.pages[p];
    hash.add(page.width);
    hash.add(page.height);
    hash.add(page.uv_set);
    const mesh::UvTransform& t = page.transform;
    for (const double v : {t.a, t.b, t.c, t.d, t.e, t.f}) hash.add(v);
    if (page.width != 0) add(request.hashes->uvs(page.uv_set), hash);
    add(request.triangles->of(request.first_page + p), hash);
  }
  // Coincident triangles are told apart by all of their UVs.
  for (std::uint32_t k = 0; !request.is_target && k < request.mesh->uv_sets.size(); ++k)
    add(request.hashes->uvs(k), hash);
  hash.add(std::uint32_t{request.tile ? 1U : 0U});
  if (request.tile) {
    hash.add(request.tile->column);
    hash.add(request.tile->row);
  }
  return hash.digest();
}

std::unique_ptr<store::GeometryStore> geometry_store(job::JobContext& job,
                                                     const GeometryRequest& request, bool* cached) {
  const Hash128 key = geometry_key(request);
  auto store =
      find_store(job, store::PackKind::geometry, key, [&](std::unique_ptr<store::PackReader> pack) {
        const std::uint64_t entries = binner_of(request, job::kTileCapBytes).entries();
        return std::make_unique<store::GeometryStore>(std::move(pack), facts_of(request, entries),
                                                      job.compressor());
      });
  *cached = store != nullptr;
  return *cached ? std::move(store) : build(job, request, key);
}

std::uint64_t geometry_least_bytes(const GeometryRequest& request, std::uint64_t tile_cap_bytes) {
  const mesh::BlockBinner binner = binner_of(request, tile_cap_bytes);
  const std::uint64_t bins = binner.cost_bytes(binner.most_entries());
  // A tile has no more triangles than its cap has room for, and one window; nor more than all of
  // them, four times each.
  const std::uint64_t in_cap = tile_cap_bytes / mesh::kTileBytesPerTriangle;
  const std::uint64_t all = std::min(binner.entries(), in_cap + binner.most_in_block());
  const std::uint64_t triangles = request.mesh->triangles.size();
  const std::uint64_t largest = std::min(triangles, binner.most_in_block());
  return bins +
         tile_bytes(request, largest, std::min(all, 4 * triangles), mesh::kMostBlocksPerTile);
}

std::uint64_t geometry_directory_bytes(const GeometryRequest& request,
                                       std::uint64_t tile_cap_bytes) {
  const std::uint64_t entries = binner_of(request, tile_cap_bytes).entries();
  // The k-d split leaves tiles half full, of bytes or of blocks; each page and band begins one.
  const std::uint64_t weight = (256 + mesh::kTileBytesPerTriangle) * entries;
  const std::uint64_t tiles =
      std::min(entries, 4 * weight / std::max<std::uint64_t>(tile_cap_bytes, 1) +
                            4 * entries / mesh::kMostBlocksPerTile + 2 * request.pages.size() + 8);
  return 2 * tiles * sizeof(store::TileEntry) + 4 * request.pages.size() * sizeof(mesh::Lattice);
}

SourceShape source_shape(const GeometryRequest& request) {
  constexpr std::uint64_t kMost = store::kMostTrianglesPerBlock;
  constexpr std::uint64_t kPatchesPerTriangle =
      (mesh::kBlockEdge / surface::kPatchWindow) * (mesh::kBlockEdge / surface::kPatchWindow);
  const std::uint64_t triangles = std::min<std::uint64_t>(request.mesh->triangles.size(), kMost);
  SourceShape shape{static_cast<std::uint32_t>(triangles), static_cast<std::uint32_t>(triangles)};
  // Only triangles that are cut have more than one patch.
  const mesh::PageTriangles cut(request.pages.size(), [&](auto&& put) {
    for (std::uint32_t p = 0; p < request.pages.size(); ++p) {
      const mesh::Lattice& page = request.pages[p];
      if (page.width == 0) continue;
      for (const std::uint32_t t : request.triangles->of(p)) {
        if (!mesh::is_whole(mesh::texel_corners(*request.mesh, page, {t, 0, 0}), page)) put(p, t);
      }
    }
  });
  mesh::BinRequest bins = bin_request(request, job::kTileCapBytes);
  bins.triangles = &cut;
  const mesh::BlockBinner binner(bins);
  for (std::size_t band = 0; band < binner.bands(); ++band) {
    const mesh::BlockBins made = binner.bin(band);
    for (const mesh::BlockBin& block : made.blocks) {
      std::uint64_t patches = 0;
      for (std::uint32_t i = 0; i < block.count; ++i) {
        patches += patch_windows(mesh::texel_corners(*request.mesh, request.pages[block.page],
                                                     made.entries[block.first + i].instance),
                                 block);
      }
      const std::uint64_t count = std::min<std::uint64_t>(block.count, triangles);
      patches = std::min(patches, count * kPatchesPerTriangle) + triangles - count;
      shape.most_patches = std::max(shape.most_patches, static_cast<std::uint32_t>(patches));
    }
  }
  return shape;
}

GeometrySize geometry_most(const GeometryRequest& request) {
  // Three vertices that it shares with none.
  const std::uint64_t per_triangle = 138 + (request.colours ? 3 * sizeof(Vec4f) : 0);
  constexpr std::uint64_t kPerBlock = 320;  // header, place and boxes
  constexpr std::uint64_t kPerRun = 4;      // of texels with one owner
  constexpr std::uint64_t kEdge = mesh::kBlockEdge;
  const std::uint64_t entries = binner_of(request, job::kTileCapBytes).entries();
  // Each block has a triangle, and the blocks of a target lie in its images.
  std::uint64_t blocks = entries, runs = 0;
  if (request.is_target) {
    std::uint64_t in_images = 0;
    for (const mesh::Lattice& page : request.pages)
      in_images += ((page.width + kEdge - 1) / kEdge) * ((page.height + kEdge - 1) / kEdge);
    blocks = std::min(entries, in_images);
    // A triangle adds two ends of runs to a row of a block at most.
    runs = std::min(blocks * store::kTexelsPerBlock, kEdge * blocks + 2 * kEdge * entries);
  }
  const std::uint64_t pages = request.pages.size() * (sizeof(mesh::Lattice) + 16);
  return {entries * per_triangle + blocks * kPerBlock + runs * kPerRun + pages, 2 * blocks,
          entries};
}

}  // namespace pounce::flow
