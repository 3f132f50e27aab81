// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/geometry_store.h"

#include <algorithm>

#include "store/pack/chunk_fields.h"

namespace pounce::store {
namespace {

constexpr std::size_t kLatticeBytes = 60;
constexpr std::size_t kTileBytes = 44;
constexpr std::size_t kHeaderBytes = 80;

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
  out.put(entry.page);
  out.put(entry.x);
  out.put(entry.y);
  for (const std::uint32_t v : {entry.triangles, entry.patches, entry.texels}) out.put(v);
  put_chunk(out, entry.chunk);
  out.put(entry.box_count);
  for (std::uint32_t i = 0; i < entry.box_count; ++i) put_box(out, entry.boxes[i]);
}

BlockEntry GeometryCodec::get_entry(ByteReader& in) {
  Entry entry;
  entry.page = in.get<std::uint32_t>();
  entry.x = in.get<std::int32_t>();
  entry.y = in.get<std::int32_t>();
  for (std::uint32_t* v : {&entry.triangles, &entry.patches, &entry.texels})
    *v = in.get<std::uint32_t>();
  entry.chunk = get_chunk(in);
  entry.box_count = in.get<std::uint32_t>();
  if (entry.box_count > kMostBoxesPerBlock) in.fail("has a block of too many boxes");
  for (std::uint32_t i = 0; i < entry.box_count; ++i) entry.boxes[i] = get_box(in);
  return entry;
}

void GeometryCodec::put(const Directory& directory, ByteWriter& out) {
  out.put(static_cast<std::uint32_t>(directory.pages.size()));
  out.put(static_cast<std::uint32_t>(directory.tiles.size()));
  for (const std::uint64_t v :
       {directory.texels, directory.overlapping, directory.slivers, directory.degenerate}) {
    out.put(v);
  }
  for (const std::uint32_t v : {directory.most_triangles, directory.most_patches,
                                directory.most_blocks, directory.largest_chunk_bytes}) {
    out.put(v);
  }
  put_box(out, directory.box);
  for (const mesh::Lattice& page : directory.pages) {
    for (const std::uint32_t v : {page.width, page.height, page.uv_set}) out.put(v);
    const mesh::UvTransform& m = page.transform;
    for (const double v : {m.a, m.b, m.c, m.d, m.e, m.f}) out.put(v);
  }
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
  for (std::uint64_t* v :
       {&directory.texels, &directory.overlapping, &directory.slivers, &directory.degenerate}) {
    *v = in.get<std::uint64_t>();
  }
  for (std::uint32_t* v : {&directory.most_triangles, &directory.most_patches,
                           &directory.most_blocks, &directory.largest_chunk_bytes}) {
    *v = in.get<std::uint32_t>();
  }
  directory.box = get_box(in);
  if (in.left() != std::uint64_t{pages} * (kLatticeBytes + 8) + std::uint64_t{tiles} * kTileBytes) {
    in.fail("has another size than its counts say");
  }
  directory.pages.resize(pages);
  for (mesh::Lattice& page : directory.pages) {
    for (std::uint32_t* v : {&page.width, &page.height, &page.uv_set}) *v = in.get<std::uint32_t>();
    mesh::UvTransform& m = page.transform;
    for (double* v : {&m.a, &m.b, &m.c, &m.d, &m.e, &m.f}) *v = in.get<double>();
  }
  directory.page_texels.resize(pages);
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
    if (cut == first || cut == last) cut = first + static_cast<std::ptrdiff_t>(whole.count / 2);
    const auto left = static_cast<std::size_t>(cut - first);
    const Cluster a = bound(whole.first, left), b = bound(whole.first + left, whole.count - left);
    if (extent(a.box) + extent(b.box) > 1.3F * extent(whole.box)) break;  // splitting gains nothing
    *widest = a;
    clusters.push_back(b);
  }
  entry.box_count = static_cast<std::uint32_t>(clusters.size());
  for (std::size_t i = 0; i < clusters.size(); ++i) entry.boxes[i] = clusters[i].box;
}

}  // namespace pounce::store
