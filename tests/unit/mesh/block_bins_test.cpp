// SPDX-License-Identifier: Apache-2.0
#include "mesh/block_bins.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <map>
#include <set>
#include <tuple>

#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::mesh;
using pounce::test::Random;

namespace {

/// (page, block x, block y, triangle, shift x, shift y)
using Placed = std::tuple<std::uint32_t, std::int32_t, std::int32_t, std::uint32_t, std::int32_t,
                          std::int32_t>;

struct Scene {
  Mesh mesh;
  std::vector<Lattice> pages;
  std::vector<std::uint32_t> triangle_page;
  bool wraps = false;

  explicit Scene(std::vector<Lattice> lattices) : pages(std::move(lattices)) {
    mesh.path = "scene.glb";
    mesh.uv_sets.resize(1);
    mesh.uv_present.resize(1);
  }
  void add(Vec2f a, Vec2f b, Vec2f c, std::uint32_t page = 0) {
    const auto first = static_cast<std::uint32_t>(mesh.uv_sets[0].size());
    for (const Vec2f uv : {a, b, c}) mesh.uv_sets[0].push_back(uv);
    mesh.triangles.push_back({first, first + 1, first + 2});
    triangle_page.push_back(page);
  }
  /// Corners in texels of an image: exact when the size is a power of two.
  void add_texels(Vec2d a, Vec2d b, Vec2d c, std::uint32_t page = 0) {
    const auto uv = [&](Vec2d t) {
      return Vec2f{static_cast<float>((t.x + 0.5) / pages[page].width),
                   static_cast<float>((t.y + 0.5) / pages[page].height)};
    };
    add(uv(a), uv(b), uv(c), page);
  }
};

/// All bands one after the other.
struct Bins : BlockBins {
  std::uint64_t counted = 0;  ///< entries, before they were made
  std::size_t bands = 0;
};
Bins bin(const Scene& scene, std::uint64_t cap = 1 << 20,
         std::uint64_t band_entries = kBandEntries) {
  const PageTriangles triangles(std::span(scene.triangle_page), scene.pages.size());
  const BinRequest request{&scene.mesh, scene.pages, &triangles, 0, scene.wraps, std::nullopt, cap};
  const BlockBinner binner(request,
                           std::make_shared<const BlockBands>(count_bands(request, band_entries)));
  Bins all;
  all.counted = binner.entries();
  all.bands = binner.bands();
  for (std::size_t band = 0; band < binner.bands(); ++band) {
    const BlockBins one = binner.bin(band);
    CHECK(one.entries.size() == binner.entries(band));
    CHECK(binner.entries(band) <= binner.most_entries());
    const auto entries = static_cast<std::uint32_t>(all.entries.size());
    const auto blocks = static_cast<std::uint32_t>(all.blocks.size());
    all.entries.insert(all.entries.end(), one.entries.begin(), one.entries.end());
    for (BlockBin block : one.blocks) {
      block.first += entries;
      all.blocks.push_back(block);
    }
    for (TileRange tile : one.tiles) {
      tile.first_block += blocks;
      all.tiles.push_back(tile);
    }
  }
  return all;
}

std::set<Placed> placed(const BlockBins& bins) {
  std::set<Placed> all;
  for (const BlockBin& block : bins.blocks) {
    for (std::uint32_t i = block.first; i < block.first + block.count; ++i) {
      const TriangleInstance& t = bins.entries[i].instance;
      const bool is_new =
          all.insert({block.page, block.x, block.y, t.triangle, t.shift_x, t.shift_y}).second;
      if (!is_new) FAIL("triangle " << t.triangle << " stands twice in a block");
    }
  }
  return all;
}

std::tuple<std::uint32_t, std::int32_t, std::int32_t> file_order(const TriangleInstance& i) {
  return {i.triangle, i.shift_y, i.shift_x};
}

Lattice image(std::uint32_t width, std::uint32_t height) { return {width, height, 0, {}}; }

Vec2f random_uv(Random& random, float low, float high) {
  return {random.between(low, high), random.between(low, high)};
}

std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

/// Three images, `scale` times as large as usual, with triangles of usual sizes in texels and some
/// that repeat their image; and a page without.
Scene random_scene(std::uint64_t seed, bool wraps, std::uint32_t scale = 1) {
  Random random(seed);
  Scene scene({image(200 * scale, 136 * scale), image(640 * scale, 64 * scale), image(1, 1), {}});
  scene.wraps = wraps;
  for (int i = 0; i < 400; ++i) {
    const auto page = static_cast<std::uint32_t>(random.below(4));
    const Vec2f a = random_uv(random, -1.2F, 2.2F);
    const float size = random.one_in(8) ? 2.5F : 0.1F / static_cast<float>(scale);
    const auto near = [&] {
      return Vec2f{a.x + random.between(-size, size), a.y + random.between(-size, size)};
    };
    scene.add(a, near(), near(), page);
    if (random.one_in(10)) scene.triangle_page.back() = kNoPage;
  }
  return scene;
}

}  // namespace

TEST_CASE("on a target every covered texel's block holds the triangle, with the period it is in") {
  const Scene scene = random_scene(3, true);
  const Bins bins = bin(scene);
  const std::set<Placed> all = placed(bins);
  CHECK(bins.entries.size() == bins.counted);
  std::size_t texels = 0;
  for (std::uint32_t t = 0; t < scene.mesh.triangles.size(); ++t) {
    const std::uint32_t page = scene.triangle_page[t];
    if (page == kNoPage || scene.pages[page].width == 0) continue;
    const Lattice& lattice = scene.pages[page];
    const std::int64_t w = lattice.width, h = lattice.height;
    const TexelWindow everywhere{-100000, -100000, 100000, 100000};
    raster_triangle(texel_corners(scene.mesh, lattice, {t, 0, 0}), everywhere,
                    [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
                      for (std::int64_t x = begin; x < end; ++x) {
                        const std::int64_t sx = floor_div(x, w), sy = floor_div(y, h);
                        const Placed expected{page,
                                              static_cast<std::int32_t>((x - sx * w) / kBlockEdge),
                                              static_cast<std::int32_t>((y - sy * h) / kBlockEdge),
                                              t,
                                              static_cast<std::int32_t>(sx),
                                              static_cast<std::int32_t>(sy)};
                        if (all.count(expected) == 0)
                          FAIL("triangle " << t << " lacks " << x << "," << y);
                        ++texels;
                      }
                    });
  }
  CHECK(texels > 100000);
  for (const auto& [page, x, y, t, sx, sy] : all) {
    CHECK(t < scene.mesh.triangles.size());
    if (scene.pages[page].width == 0) continue;
    CHECK((x >= 0 && x * kBlockEdge < static_cast<std::int64_t>(scene.pages[page].width)));
    CHECK((y >= 0 && y * kBlockEdge < static_cast<std::int64_t>(scene.pages[page].height)));
  }
}

TEST_CASE("on a source every covered texel's block holds a cut triangle, none is wrapped") {
  const Scene scene = random_scene(4, false, 10);
  const std::set<Placed> all = placed(bin(scene));
  std::size_t cut = 0, whole = 0;
  for (std::uint32_t t = 0; t < scene.mesh.triangles.size(); ++t) {
    const std::uint32_t page = scene.triangle_page[t];
    if (page == kNoPage || scene.pages[page].width == 0) continue;
    const auto corners = texel_corners(scene.mesh, scene.pages[page], {t, 0, 0});
    if (is_whole(corners, scene.pages[page])) {
      std::size_t times = 0;
      for (const Placed& p : all) times += std::get<3>(p) == t;
      if (times != 1) FAIL("whole triangle " << t << " is in " << times << " blocks");
      ++whole;
      continue;
    }
    raster_triangle(corners, {-100000, -100000, 100000, 100000},
                    [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
                      for (std::int64_t x = begin; x < end; ++x) {
                        const Placed expected{page,
                                              static_cast<std::int32_t>(floor_div(x, kBlockEdge)),
                                              static_cast<std::int32_t>(floor_div(y, kBlockEdge)),
                                              t,
                                              0,
                                              0};
                        if (all.count(expected) == 0) FAIL("triangle " << t << " lacks " << x);
                      }
                    });
    ++cut;
  }
  CHECK(cut > 30);
  CHECK(whole > 30);
}

TEST_CASE(
    "a triangle that covers a 256th of its image is in one block, however often it repeats it") {
  Scene scene({image(1024, 1024)});
  scene.add_texels({0, 0}, {120, 0}, {0, 60});      // 3600 texels: less
  scene.add_texels({0, 0}, {128, 0}, {0, 64});      // 4096
  scene.add_texels({0, 0}, {3.6e6, 0}, {0, 1024});  // one stray corner
  const std::set<Placed> all = placed(bin(scene));
  std::map<std::uint32_t, int> times;
  for (const Placed& p : all) ++times[std::get<3>(p)];
  CHECK(times[0] == 2);
  CHECK(times[1] == 1);
  CHECK(times[2] == 1);
}

TEST_CASE("a triangle that hangs over u = 0 stands at both ends of the image") {
  Scene scene({image(128, 64)});
  scene.wraps = true;
  scene.add_texels({-2, 10}, {6, 10}, {-2, 30});  // covers texel columns -2..6
  CHECK(placed(bin(scene)) == std::set<Placed>{{0, 0, 0, 0, 0, 0}, {0, 1, 0, 0, -1, 0}});
}

TEST_CASE("a triangle that only leans over u = 0 without covering a centre there stays once") {
  Scene scene({image(128, 64)});
  scene.wraps = true;
  scene.add_texels({-0.75, 10}, {6, 10}, {-0.75, 30});
  CHECK(placed(bin(scene)) == std::set<Placed>{{0, 0, 0, 0, 0, 0}});
}

TEST_CASE("UVs over three periods make three instances") {
  Scene scene({image(64, 64)});
  scene.wraps = true;
  scene.add({0.25F, 0.25F}, {2.75F, 0.25F}, {2.75F, 0.75F});
  CHECK(placed(bin(scene)) ==
        std::set<Placed>{{0, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 1, 0}, {0, 0, 0, 0, 2, 0}});
}

TEST_CASE("a source triangle of 32 texels is whole where its middle is, of 33 it is cut") {
  Scene scene({image(4096, 4096)});
  scene.add_texels({50, 10}, {82, 10}, {50, 42});      // middle at 66
  scene.add_texels({50, 10}, {83, 10}, {50, 42});      // in both blocks
  scene.add_texels({10, 10}, {210, 10}, {110, 10.9});  // thin: 0.9 texels high
  scene.add_texels({10, 10}, {210, 10}, {110, 11.1});
  CHECK(placed(bin(scene)) == std::set<Placed>{{0, 1, 0, 0, 0, 0},
                                               {0, 0, 0, 1, 0, 0},
                                               {0, 1, 0, 1, 0, 0},
                                               {0, 1, 0, 2, 0, 0},
                                               {0, 0, 0, 3, 0, 0},
                                               {0, 1, 0, 3, 0, 0},
                                               {0, 2, 0, 3, 0, 0},
                                               {0, 3, 0, 3, 0, 0}});
}

TEST_CASE("triangles of a page without an image are stored in runs of file order") {
  Scene scene({Lattice{}});
  for (int i = 0; i < 2500; ++i) scene.add({0, 0}, {9e30F, 0}, {0, 0});
  const Bins bins = bin(scene);
  REQUIRE(bins.blocks.size() == 3);
  CHECK(bins.blocks[0].count == 1024);
  CHECK(bins.blocks[2].count == 452);
  CHECK(bins.entries[bins.blocks[1].first].instance.triangle == 1024);
}

TEST_CASE("tiles cover each block once, respect the cap and never mix pages") {
  const std::uint64_t cap = GENERATE(1, 5000, 40000, 1 << 20, 1 << 30);
  const bool wraps = GENERATE(false, true);
  const Scene scene = random_scene(5, wraps);
  const Bins bins = bin(scene, cap);
  std::uint32_t next = 0, entries = 0;
  for (const TileRange& tile : bins.tiles) {
    CHECK(tile.first_block == next);
    REQUIRE(tile.block_count > 0);
    next += tile.block_count;
    std::uint64_t weight = 0;
    for (std::uint32_t b = tile.first_block; b < next; ++b) {
      weight += 256 + 80 * bins.blocks[b].count;
      CHECK(bins.blocks[b].page == bins.blocks[tile.first_block].page);
    }
    if (tile.block_count > 1) CHECK(weight <= cap);
    CHECK(tile.block_count <= 64);
  }
  CHECK(next == bins.blocks.size());
  std::set<std::tuple<std::uint32_t, std::int32_t, std::int32_t>> seen;
  for (const BlockBin& block : bins.blocks) {
    CHECK(seen.insert({block.page, block.x, block.y}).second);
    entries += block.count;
    for (std::uint32_t i = block.first; i + 1 < block.first + block.count; ++i)
      CHECK(file_order(bins.entries[i].instance) < file_order(bins.entries[i + 1].instance));
  }
  CHECK(entries == bins.entries.size());
  if (cap == 1) CHECK(bins.tiles.size() == bins.blocks.size());
  if (cap == 1 << 30) CHECK(bins.tiles.size() < bins.blocks.size() / 4);
}

TEST_CASE("absurd UVs are refused at once") {
  const bool wraps = GENERATE(false, true);
  const float far = GENERATE(1e3F, 1e6F, 1e12F, 3e38F);
  Scene scene({image(65536, 65536)});
  scene.wraps = wraps;
  scene.add({0, 0}, {far, 0}, {far, far});
  if (!wraps && far == 1e3F) return;  // an image repeated that often is kept whole, see below
  CAPTURE(wraps, far);
  const auto start = std::chrono::steady_clock::now();
  std::string message;
  CHECK(test::error_kind([&] { bin(scene); }, &message) == static_cast<int>(ErrorKind::input));
  CHECK(message.find("scene.glb") != std::string::npos);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(20));
}

TEST_CASE("a source triangle over a million repeats of its image is one entry") {
  Scene scene({image(65536, 65536)});
  scene.wraps = false;
  scene.add({0, 0}, {1000, 0}, {1000, 1000});
  CHECK(bin(scene).entries.size() == 1);
}

TEST_CASE("UVs over thousands of periods are refused or binned without visiting every block") {
  Scene scene({image(65536, 65536)});
  scene.wraps = true;
  const auto start = std::chrono::steady_clock::now();
  SECTION("a triangle over 20,000 periods") {
    scene.add({0, 0}, {200, 0}, {200, 200});
    CHECK(test::error_kind([&] { bin(scene); }) == static_cast<int>(ErrorKind::input));
  }
  SECTION("a needle along their diagonal") {
    scene.add({0, 0}, {200, 199.999F}, {200, 200});
    const std::uint64_t entries = bin(scene).counted;
    CHECK(entries >= 200 * 1024);
    CHECK(entries < 4 * 200 * 1024);
  }
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(20));
}

TEST_CASE("bands hold the same blocks as one, each whole, and no more entries than they may") {
  const bool wraps = GENERATE(false, true);
  const std::uint64_t most = GENERATE(1, 50, 400);
  const Scene scene = random_scene(6, wraps, wraps ? 3 : 10);
  const Bins one = bin(scene, 1 << 20, UINT64_MAX), many = bin(scene, 1 << 20, most);
  CHECK(one.bands == 1);
  CHECK(many.bands > (most < 100 ? 4 : 0));
  CHECK(placed(one) == placed(many));
  CHECK(one.blocks.size() == many.blocks.size());
  std::map<std::pair<std::uint32_t, std::int32_t>, std::uint64_t> rows;
  for (const BinEntry& entry : one.entries) ++rows[{entry.page, entry.y}];
  std::uint64_t largest_row = 0;
  for (const auto& [row, count] : rows) largest_row = std::max(largest_row, count);
  const PageTriangles triangles(std::span(scene.triangle_page), scene.pages.size());
  const BinRequest request{&scene.mesh, scene.pages,  &triangles, 0,
                           scene.wraps, std::nullopt, 1 << 20};
  const BlockBinner binner(request, std::make_shared<const BlockBands>(count_bands(request, most)));
  CHECK(binner.most_entries() <= std::max(most, largest_row));
}

TEST_CASE("entries are in order however many windows there are, in however long a file") {
  // One triangle a window, or five in each of few; the file goes through them in leaps.
  const std::int32_t edge = GENERATE(2, 200);
  const auto size = static_cast<std::uint32_t>(edge * kBlockEdge);
  Scene scene({{size, size, 0, {}}, {size, size, 0, {}}});
  const auto windows = static_cast<std::uint32_t>(edge * edge);
  const std::uint32_t count = std::max(windows, 20U);
  for (std::uint32_t page : {1U, 0U}) {
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t w = i * 7919 % windows;
      const Vec2d at{w % static_cast<std::uint32_t>(edge) * 64.0 + 8,
                     w / static_cast<std::uint32_t>(edge) * 64.0 + 8};
      scene.add_texels(at, {at.x + 8, at.y}, {at.x, at.y + 8}, page);
    }
  }
  scene.wraps = GENERATE(false, true);
  const Bins bins = bin(scene, 1 << 20, GENERATE(std::uint64_t{500}, UINT64_MAX));
  CHECK(bins.entries.size() == 2 * count);
  CHECK(bins.blocks.size() == 2 * windows);
  for (const BlockBin& block : bins.blocks) {
    for (std::uint32_t i = block.first; i < block.first + block.count; ++i) {
      const BinEntry& entry = bins.entries[i];
      REQUIRE((entry.page == block.page && entry.y == block.y && entry.x == block.x));
      REQUIRE(scene.triangle_page[entry.instance.triangle] == block.page);
      const bool is_later =
          i == block.first || entry.instance.triangle > bins.entries[i - 1].instance.triangle;
      REQUIRE(is_later);
    }
  }
}

TEST_CASE("a page of one tile of UV space has what that tile shows") {
  Scene scene({image(64, 64)});
  scene.wraps = true;
  scene.add({0.25F, 0.25F}, {2.75F, 0.25F}, {2.75F, 0.75F});
  scene.add({1.25F, -0.75F}, {1.75F, -0.75F}, {1.75F, -0.25F});  // one tile up
  const PageTriangles triangles(std::span(scene.triangle_page), 1);
  const auto in_tile = [&](UvTile tile) {
    const BlockBinner binner({&scene.mesh, scene.pages, &triangles, 0, true, tile, 1 << 20});
    return binner.bands() == 0 ? std::set<Placed>{} : placed(binner.bin(0));
  };
  CHECK(in_tile({1, 0}) == std::set<Placed>{{0, 0, 0, 0, 1, 0}});
  CHECK(in_tile({1, 1}) == std::set<Placed>{{0, 0, 0, 1, 1, -1}});
  CHECK(in_tile({5, 0}).empty());
}

TEST_CASE("200 tiles of 65536 texels each with 40 triangles are counted in no time and no memory") {
  Scene scene({image(65536, 65536)});
  scene.wraps = true;
  for (int i = 0; i < 20; ++i) {
    const float x0 = static_cast<float>(i) / 20, x1 = static_cast<float>(i + 1) / 20;
    scene.add({x0, 0}, {x1, 0}, {x1, 1});
    scene.add({x0, 0}, {x1, 1}, {x0, 1});
  }
  const PageTriangles triangles(std::span(scene.triangle_page), 1);
  const auto start = std::chrono::steady_clock::now();
  for (int tile = 0; tile < 200; ++tile) {
    const BlockBinner binner(
        {&scene.mesh, scene.pages, &triangles, 0, true, UvTile{0, 0}, 1 << 20});
    CHECK(binner.entries() >= 1024 * 1024);
    CHECK(binner.entries() < 2 * 1024 * 1024);
    CHECK(binner.most_entries() <= kBandEntries);
  }
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(20));
}

TEST_CASE("the fullest window of a dense mesh is counted") {
  Scene scene({image(256, 256)});
  scene.wraps = GENERATE(false, true);
  Random random(7);
  for (int i = 0; i < 70000; ++i) {
    const double x = random.between(0.0F, 255.0F), y = random.between(0.0F, 255.0F);
    scene.add_texels({x, y}, {x + 1, y}, {x, y + 1});
  }
  const Bins bins = bin(scene);
  std::uint64_t most = 0;
  for (const BlockBin& block : bins.blocks) most = std::max<std::uint64_t>(most, block.count);
  const PageTriangles triangles(std::span(scene.triangle_page), 1);
  const BinRequest request{&scene.mesh, scene.pages,  &triangles, 0,
                           scene.wraps, std::nullopt, 1 << 20};
  CHECK(count_bands(request).most_in_block == most);
}
