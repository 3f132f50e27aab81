// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/geometry_check.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "pounce/error.h"
#include "store/blocks/geometry_store.h"

namespace pounce::store {
namespace {

/// Windows that a large triangle is cut into within its block: source/source_block.cpp.
constexpr std::uint32_t kMostPatchesPerTriangle = 16;
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
    if (!(dot(normal, normal) <= kLongestSquared)) fail(name, "has a normal that is none");
  }
  for (const Vec4f& c : block.colours) {
    if (!is_finite({c.x, c.y, c.z}) || !std::isfinite(c.w))
      fail(name, "has a colour that is not finite");
  }
  if (page.width == 0) return;
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
  std::uint32_t texels = 0;
  for (std::size_t t = 0; t < kTexelsPerBlock; ++t) {
    if (block.owner[t] == kNoTriangle) continue;
    const auto x = static_cast<std::int64_t>(t % mesh::kBlockEdge);
    const auto y = static_cast<std::int64_t>(t / mesh::kBlockEdge);
    if (x >= columns || y >= rows) fail(name, "covers texels outside its image");
    ++texels;
  }
  if (texels != entry.texels) fail(name, "covers another number of texels than its index says");
}

}  // namespace

void check(const GeometryDirectory& directory, const GeometryFacts& facts,
           const std::string& name) {
  if (!std::equal(directory.pages.begin(), directory.pages.end(), facts.pages.begin(),
                  facts.pages.end(), same)) {
    fail(name, "has other pages than its key stands for");
  }
  std::uint64_t texels = 0;
  for (std::size_t p = 0; p < directory.pages.size(); ++p) {
    const mesh::Lattice& page = directory.pages[p];
    if (facts.is_target && directory.page_texels[p] > std::uint64_t{page.width} * page.height) {
      fail(name, "has a page of more texels than its image");
    }
    texels += directory.page_texels[p];
  }
  if (texels != directory.texels) fail(name, "has another number of texels than its pages");
  if (directory.most_triangles > kMostTrianglesPerBlock ||
      directory.most_patches > kMostPatchesPerTriangle * kMostTrianglesPerBlock ||
      directory.largest_chunk_bytes > kLargestGeometryBytes) {
    fail(name, "has impossible maxima");
  }
  // A window of more triangles than a block holds becomes several blocks.
  const std::uint64_t most_blocks =
      mesh::kMostBlocksPerTile * (1 + facts.triangles / kMostTrianglesPerBlock);
  if (directory.most_blocks > most_blocks) fail(name, "has impossible maxima");
  for (const TileEntry& tile : directory.tiles) {
    if (tile.blocks == 0 || tile.blocks > directory.most_blocks) {
      fail(name, "has a tile of an impossible number of blocks");
    }
  }
}

void check(const std::vector<BlockEntry>& entries, const GeometryDirectory& directory,
           const GeometryFacts& facts, const std::string& name) {
  for (const BlockEntry& entry : entries) {
    if (entry.page >= directory.pages.size() || entry.page != entries.front().page ||
        !is_inside(entry, directory.pages[entry.page], facts.is_target)) {
      fail(name, "has a block outside its page");
    }
    if ((entry.triangles == 0 && !facts.is_target) || entry.triangles > directory.most_triangles ||
        entry.patches >
            std::min(directory.most_patches, kMostPatchesPerTriangle * entry.triangles) ||
        entry.chunk.raw_bytes > directory.largest_chunk_bytes ||
        (facts.is_target && (entry.texels == 0 || entry.texels > kTexelsPerBlock))) {
      fail(name, "has an impossible block entry");
    }
  }
}

void check(const GeometryBlock& block, const BlockEntry& entry, const GeometryFacts& facts,
           const std::string& name) {
  if (block.page != entry.page || block.x != entry.x || block.y != entry.y ||
      block.triangles.size() != entry.triangles) {
    fail(name, "is not the one its index names");
  }
  for (const std::uint32_t id : block.ids) {
    if (id >= facts.triangles) fail(name, "names a triangle that the mesh lacks");
  }
  if (block.colours.empty() == facts.has_colours && !block.triangles.empty())
    fail(name, "has colours, or has none, against its key");
  const mesh::Lattice& page = facts.pages[block.page];
  check_vertices(block, page, name);
  if (facts.is_target) {
    check_owners(block, entry, page, name);
  } else if (!block.owner.empty() || !block.shifts.empty()) {
    fail(name, "has texel runs, records or periods, which a source has not");
  }
  for (const auto& shift : block.shifts) {
    if (std::abs(static_cast<double>(page.width) * shift[0]) > 2 * mesh::kLargestTexel ||
        std::abs(static_cast<double>(page.height) * shift[1]) > 2 * mesh::kLargestTexel) {
      fail(name, "has periods that span too many texels");
    }
  }
}

}  // namespace pounce::store
