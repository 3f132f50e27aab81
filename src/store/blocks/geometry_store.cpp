// SPDX-License-Identifier: Apache-2.0
//
// The index of a geometry pack as bytes, and what a pack says compared with what it may say.
//
// A cache may be written by others. A checksum tells that bytes are those that somebody wrote, not
// that pounce wrote them; so every field that becomes an index, a size or a count is held against
// what the job knows, here and before it is used. Legal values: docs/tile-format.md.
//
// Each list of fields stands once and serves both ways, so what is written and what is read cannot
// come apart.
//
// There are three layers of it, read in this order: the directory (held in memory while a pack is
// open), the index page of a tile, the block. Each is checked against the one before, and the
// directory against the job; so memory for a layer is only ever sized by numbers that were checked.
#include "store/blocks/geometry_store.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "pounce/error.h"
#include "store/pack/pack_layout.h"

namespace pounce::store {
namespace {

// What one of each takes in the file, as written below: docs/tile-format.md.
constexpr std::size_t kLatticeBytes = 60;
constexpr std::size_t kTileBytes = 44;
constexpr std::size_t kHeaderBytes = 88;

// Each calls visit(fields...) in the order of the format.
constexpr auto for_entry = [](auto& e, const auto& visit) {
  visit(e.page, e.x, e.y, e.triangles, e.patches, e.texels);
};
constexpr auto for_page = [](auto& p, const auto& visit) {
  auto& m = p.transform;
  visit(p.width, p.height, p.uv_set, m.a, m.b, m.c, m.d, m.e, m.f);
};
constexpr auto for_directory = [](auto& d, const auto& visit) {
  visit(d.texels, d.overlapping, d.slivers, d.degenerate, d.most_triangles, d.most_patches,
        d.most_blocks, d.largest_chunk_bytes, d.coincident);
};

/// Beyond this no coordinate of a texel leads: 2^24 blocks.
constexpr std::int64_t kMostBlocksAcross = std::int64_t{1} << 24;
/// A unit vector whose coordinates were rounded to floats is not longer than this, squared.
constexpr float kLongestSquared = 1.0001F;

[[noreturn]] void fail(const std::string& name, const char* why) {
  throw Error(ErrorKind::damaged_store, name + " " + why);
}

/// The same bits: NaN, which a broken mesh may have in a transform, equals itself.
bool same(const mesh::Lattice& a, const mesh::Lattice& b) {
  const auto bits = [](const mesh::UvTransform& m) {
    return std::bit_cast<std::array<std::uint64_t, 6>>(
        std::array<double, 6>{m.a, m.b, m.c, m.d, m.e, m.f});
  };
  return a.width == b.width && a.height == b.height && a.uv_set == b.uv_set &&
         bits(a.transform) == bits(b.transform);
}

std::int64_t blocks_across(std::uint32_t texels) {
  return (std::int64_t{texels} + mesh::kBlockEdge - 1) / mesh::kBlockEdge;
}

bool is_inside(const BlockEntry& entry, const mesh::Lattice& page, bool is_target) {
  if (is_target) {
    return entry.x >= 0 && entry.x < blocks_across(page.width) && entry.y >= 0 &&
           entry.y < blocks_across(page.height);
  }
  return std::abs(std::int64_t{entry.x}) <= kMostBlocksAcross &&
         std::abs(std::int64_t{entry.y}) <= kMostBlocksAcross;
}

bool is_finite(Vec3f v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

void check_vertices(const GeometryBlock& block, const mesh::Lattice& page,
                    const std::string& name) {
  for (const Vec3f& position : block.positions) {
    if (!is_finite(position)) fail(name, "has a position that is not finite");
  }
  for (const Vec3f& normal : block.normals) {
    // A normal of length 0 is legal: it faces nothing. NaN fails.
    if (!(dot(normal, normal) <= kLongestSquared)) fail(name, "has an invalid normal");
  }
  for (const Vec4f& c : block.colours) {
    if (!is_finite({c.x, c.y, c.z}) || !std::isfinite(c.w))
      fail(name, "has a colour that is not finite");
  }
  if (page.width == 0) return;  // no image, no texels
  for (const Vec2f& uv : block.uvs) {
    const Vec2d texel = mesh::to_texel(page, uv);
    if (!(std::abs(texel.x) < mesh::kLargestTexel && std::abs(texel.y) < mesh::kLargestTexel)) {
      fail(name, "has UVs that span too many texels");
    }
  }
}

/// Every texel of a target's block has one owner or none, and none lies outside the image.
void check_owners(const GeometryBlock& block, const BlockEntry& entry, const mesh::Lattice& page,
                  const std::string& name) {
  if (block.owner.size() != kTexelsPerBlock) fail(name, "has no texel runs");
  const std::int64_t columns = page.width - std::int64_t{block.x} * mesh::kBlockEdge;
  const std::int64_t rows = page.height - std::int64_t{block.y} * mesh::kBlockEdge;
  // Results are written by texel: one outside the image would be written beyond its buffer.
  std::uint32_t texels = 0;
  for (std::size_t t = 0; t < kTexelsPerBlock; ++t) {
    if (block.owner[t] == kNoTriangle) continue;
    const auto x = static_cast<std::int64_t>(t % mesh::kBlockEdge);
    const auto y = static_cast<std::int64_t>(t / mesh::kBlockEdge);
    if (x >= columns || y >= rows) fail(name, "covers texels outside its image");
    ++texels;
  }
  if (texels != entry.texels)
    fail(name, "covers a different number of texels than its index states");
}

}  // namespace

Box3f BlockEntry::box() const {
  Box3f all;
  for (std::uint32_t i = 0; i < box_count; ++i) all.extend(boxes[i]);
  return all;
}

std::uint64_t GeometryCodec::most_directory_bytes(const Facts& facts, std::uint64_t) {
  return kHeaderBytes + facts.pages.size() * (kLatticeBytes + 8) + facts.most_blocks * kTileBytes;
}

void GeometryCodec::count(const Entry& entry, Index& index) {
  index.most_triangles = std::max(index.most_triangles, entry.triangles);
  index.most_patches = std::max(index.most_patches, entry.patches);
}

void GeometryCodec::put(const Entry& entry, ByteWriter& out) {
  for_entry(entry, [&](const auto&... fields) { out.put_all(fields...); });
  put_chunk(out, entry.chunk);
  out.put(entry.box_count);
  for (std::uint32_t i = 0; i < entry.box_count; ++i) put_box(out, entry.boxes[i]);
}

BlockEntry GeometryCodec::get_entry(ByteReader& in) {
  Entry entry;
  for_entry(entry, [&](auto&... fields) { in.get_all(fields...); });
  entry.chunk = get_chunk(in);
  entry.box_count = in.get<std::uint32_t>();
  if (entry.box_count > kMostBoxesPerBlock) in.fail("has a block with too many boxes");
  for (std::uint32_t i = 0; i < entry.box_count; ++i) entry.boxes[i] = get_box(in);
  return entry;
}

void GeometryCodec::put(const Directory& directory, ByteWriter& out) {
  out.put_all(static_cast<std::uint32_t>(directory.pages.size()),
              static_cast<std::uint32_t>(directory.tiles.size()));
  for_directory(directory, [&](const auto&... fields) { out.put_all(fields...); });
  put_box(out, directory.box);
  for (const mesh::Lattice& page : directory.pages)
    for_page(page, [&](const auto&... fields) { out.put_all(fields...); });
  out.put_span(std::span<const std::uint64_t>(directory.page_texels));
  for (const TileEntry& tile : directory.tiles) {
    put_box(out, tile.box);
    put_chunk(out, tile.index_page);
    out.put(tile.blocks);
  }
}

GeometryDirectory GeometryCodec::get_directory(ByteReader& in) {
  GeometryDirectory directory;
  const auto pages = in.get<std::uint32_t>();
  const auto tiles = in.get<std::uint32_t>();
  for_directory(directory, [&](auto&... fields) { in.get_all(fields...); });
  directory.box = get_box(in);
  // Before anything is allocated: the counts are those of bytes that are there.
  if (in.left() != std::uint64_t{pages} * (kLatticeBytes + 8) + std::uint64_t{tiles} * kTileBytes) {
    in.fail("has a different size than its counts state");
  }
  directory.pages.resize(pages);
  for (mesh::Lattice& page : directory.pages)
    for_page(page, [&](auto&... fields) { in.get_all(fields...); });
  directory.page_texels.resize(pages);  // one for each, after all of the pages
  in.get_span(std::span(directory.page_texels));
  directory.tiles.resize(tiles);
  for (TileEntry& tile : directory.tiles) {
    tile.box = get_box(in);
    tile.index_page = get_chunk(in);
    tile.blocks = in.get<std::uint32_t>();
  }
  return directory;
}

std::uint64_t GeometryCodec::size_bytes(const Directory& directory, const Facts& facts) {
  return directory.tiles.capacity() * sizeof(Tile) +
         (directory.pages.capacity() + facts.pages.capacity()) * sizeof(mesh::Lattice);
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
  // A block's surface may be a thin sheet across its box, or two sheets: one box of it would meet
  // rays that its surface does not. The widest cluster is halved until that gains nothing.
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
    // All middles on one side: halves by number, or the loop would not end.
    if (cut == first || cut == last) cut = first + static_cast<std::ptrdiff_t>(whole.count / 2);
    const auto left = static_cast<std::size_t>(cut - first);
    const Cluster a = bound(whole.first, left), b = bound(whole.first + left, whole.count - left);
    // The boxes' edges together stand for how many rays meet them. Two halves are worth their test
    // unless they overlap so much that nearly every ray meets both.
    if (extent(a.box) + extent(b.box) > 1.3F * extent(whole.box)) break;  // splitting gains nothing
    *widest = a;
    clusters.push_back(b);
  }
  entry.box_count = static_cast<std::uint32_t>(clusters.size());
  for (std::size_t i = 0; i < clusters.size(); ++i) entry.boxes[i] = clusters[i].box;
}

void GeometryCodec::check(const Directory& directory, const Facts& facts, const std::string& name) {
  // The key was made from these: others under the same key are forged.
  if (!std::equal(directory.pages.begin(), directory.pages.end(), facts.pages.begin(),
                  facts.pages.end(), same)) {
    fail(name, "has different pages than its key");
  }
  std::uint64_t texels = 0;
  for (std::size_t p = 0; p < directory.pages.size(); ++p) {
    const mesh::Lattice& page = directory.pages[p];
    if (facts.is_target && directory.page_texels[p] > std::uint64_t{page.width} * page.height) {
      fail(name, "has a page with more texels than its image");
    }
    texels += directory.page_texels[p];
  }
  if (texels != directory.texels) fail(name, "has a different number of texels than its pages");
  // Users are warned of these, so they must at least be possible.
  if (directory.overlapping > directory.texels || directory.slivers > facts.triangles ||
      directory.degenerate > facts.triangles || directory.coincident > facts.triangles) {
    fail(name, "counts more texels or triangles than possible");
  }
  if (directory.most_triangles > kMostTrianglesPerBlock ||
      directory.most_patches > directory.most_triangles ||
      directory.largest_chunk_bytes > kLargestGeometryBytes) {
    fail(name, "has impossible maxima");
  }
  // What sizes the buffers of index pages is bounded by the mesh that the job has read itself.
  // A window of more triangles than a block holds becomes several blocks.
  const std::uint64_t most_blocks =
      mesh::kMostBlocksPerTile * (1 + facts.triangles / kMostTrianglesPerBlock);
  if (directory.most_blocks > most_blocks) fail(name, "has impossible maxima");
  for (const TileEntry& tile : directory.tiles) {
    if (tile.blocks == 0 || tile.blocks > directory.most_blocks) {
      fail(name, "has a tile with an impossible number of blocks");
    }
  }
}

void GeometryCodec::check(const std::vector<Entry>& entries, const Tile&,
                          const Directory& directory, const Facts& facts, const std::string& name) {
  // Binning never mixes pages in a tile.
  for (const BlockEntry& entry : entries) {
    if (entry.page >= directory.pages.size() || entry.page != entries.front().page ||
        !is_inside(entry, directory.pages[entry.page], facts.is_target)) {
      fail(name, "has a block outside of its page");
    }
    if ((entry.triangles == 0 && !facts.is_target) || entry.triangles > directory.most_triangles ||
        entry.patches > std::min(directory.most_patches, entry.triangles) ||
        entry.chunk.raw_bytes > directory.largest_chunk_bytes ||
        (facts.is_target && (entry.texels == 0 || entry.texels > kTexelsPerBlock))) {
      fail(name, "has an impossible block entry");
    }
  }
}

void GeometryCodec::check(const Block& block, const Entry& entry, const Directory&,
                          const Facts& facts, const std::string& name) {
  if (block.page != entry.page || block.x != entry.x || block.y != entry.y ||
      block.triangles.size() != entry.triangles) {
    fail(name, "is not the block that its index names");
  }
  // Facets carry it into the search, where the triangle that a texel is on is looked up by it.
  for (const std::uint32_t id : block.ids) {
    if (id >= facts.triangles) fail(name, "refers to a triangle that the mesh does not have");
  }
  if (block.colours.empty() == facts.has_colours && !block.triangles.empty())
    fail(name, "has or lacks colours, contrary to its key");
  const mesh::Lattice& page = facts.pages[block.page];
  check_vertices(block, page, name);
  if (facts.is_target) {
    check_owners(block, entry, page, name);
  } else if (!block.owner.empty() || !block.shifts.empty()) {
    fail(name, "has texel runs, records or periods, which a source does not have");
  }
  // Shifts are subtracted from texels: a large one would leave doubles no digits for the texel.
  for (const auto& shift : block.shifts) {
    if (std::abs(static_cast<double>(page.width) * shift[0]) > 2 * mesh::kLargestTexel ||
        std::abs(static_cast<double>(page.height) * shift[1]) > 2 * mesh::kLargestTexel) {
      fail(name, "has periods that span too many texels");
    }
  }
}

}  // namespace pounce::store
