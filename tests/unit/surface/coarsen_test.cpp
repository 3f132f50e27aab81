// SPDX-License-Identifier: Apache-2.0
#include "surface/coarsen.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <ctime>
#include <functional>
#include <optional>
#include <set>

#include "support/random.h"

using namespace pounce;
using namespace pounce::surface;
using pounce::test::Random;

namespace {

constexpr std::uint32_t kSize = 256;  // of the image
constexpr mesh::Lattice kImage{kSize, kSize, 0, {}};
constexpr double kTexel = 0.125;  // in space

/// A sheet over a block's texels, and beyond it by `beyond` texels.
struct Sheet {
  double step = 0.5;    ///< texels between its vertices
  double jitter = 0.3;  ///< of a step
  double beyond = 3;
  std::int32_t block_x = 1, block_y = 2;
  std::function<Vec3d(Vec2d)> place = [](Vec2d t) { return Vec3d{kTexel * t.x, kTexel * t.y, 0}; };
};

struct Place {
  Vec3d position, normal;
};

/// All triangles of the mesh as those of one block.
struct Block {
  mesh::Mesh mesh;
  std::vector<mesh::BinEntry> entries;
  std::int32_t x = 0, y = 0;

  void add(const std::array<Vec2d, 3>& texels, const std::array<Vec3d, 3>& positions,
           Vec3f normal) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (std::size_t k = 0; k < 3; ++k) {
      mesh.positions.push_back(Vec3f(positions[k]));
      mesh.normals.push_back(normal);
      mesh.uv_sets[0].push_back({static_cast<float>((texels[k].x + 0.5) / kSize),
                                 static_cast<float>((texels[k].y + 0.5) / kSize)});
    }
    const auto id = static_cast<std::uint32_t>(mesh.triangles.size());
    mesh.triangles.push_back({first, first + 1, first + 2});
    entries.push_back({0, y, x, {id, 0, 0}});
  }

  std::array<Vec2d, 3> texels(std::size_t i) const {
    return mesh::texel_corners(mesh, kImage, entries[i].instance);
  }
  Vec3d corner(std::size_t i, std::size_t k) const {
    return Vec3d(mesh.positions[mesh.triangles[entries[i].instance.triangle][k]]);
  }
  std::array<Place, 3> places(std::size_t i) const {
    std::array<Place, 3> out;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t vertex = mesh.triangles[entries[i].instance.triangle][k];
      out[k] = {Vec3d(mesh.positions[vertex]), Vec3d(mesh.normals[vertex])};
    }
    return out;
  }
  CoarseSurface run() const { return coarsen(mesh, kImage, entries); }
};

Block block_of(const Sheet& sheet) {
  Block block;
  block.x = sheet.block_x, block.y = sheet.block_y;
  block.mesh.uv_sets.resize(1);
  Random random(7);
  const double low = -sheet.beyond;
  const auto across = static_cast<int>((mesh::kBlockEdge + 2 * sheet.beyond) / sheet.step) + 1;
  std::vector<Vec2d> points;
  for (int y = 0; y <= across; ++y) {
    for (int x = 0; x <= across; ++x) {
      const auto off = [&] { return sheet.jitter * random.between(-0.5, 0.5); };
      points.push_back({sheet.block_x * 64 + low + (x + off()) * sheet.step,
                        sheet.block_y * 64 + low + (y + off()) * sheet.step});
    }
  }
  const auto point = [&](int x, int y) {
    return points[static_cast<std::size_t>(y * (across + 1) + x)];
  };
  const auto add = [&](Vec2d a, Vec2d b, Vec2d c) {
    block.add({a, b, c}, {sheet.place(a), sheet.place(b), sheet.place(c)}, {0, 0, 1});
  };
  for (int y = 0; y < across; ++y) {
    for (int x = 0; x < across; ++x) {
      add(point(x, y), point(x + 1, y), point(x + 1, y + 1));
      add(point(x, y), point(x + 1, y + 1), point(x, y + 1));
    }
  }
  return block;
}

/// Where a triangle has texel `p`, if it has.
std::optional<Place> place_of(Vec2d p, const std::array<Vec2d, 3>& t,
                              const std::array<Place, 3>& at) {
  const double all = mesh::doubled_area(t[0], t[1], t[2]);
  const double w1 = mesh::doubled_area(t[0], p, t[2]) / all;
  const double w2 = mesh::doubled_area(t[0], t[1], p) / all;
  constexpr double kRounding = -1e-4;
  if (!(w1 >= kRounding && w2 >= kRounding && 1 - w1 - w2 >= kRounding)) return std::nullopt;
  const auto mixed = [&](Vec3d Place::*what) {
    return at[0].*what + (at[1].*what - at[0].*what) * w1 + (at[2].*what - at[0].*what) * w2;
  };
  return Place{mixed(&Place::position), mixed(&Place::normal)};
}

Vec2d texel_of(const SurfacePoint& point) { return mesh::to_texel(kImage, point.uv); }

Place place_of(const SurfacePoint& point) { return {Vec3d(point.position), Vec3d(point.normal)}; }

/// Every point of the block's surface is still there, moved by no more than a 16th texel, turned by
/// no more than an 8th; and no number stands for two triangles.
void check_surface(const Block& block, const CoarseSurface& coarse) {
  std::set<std::uint32_t> ids;
  for (std::size_t i = 0; i < block.entries.size(); ++i) {
    if (coarse.replaced[i] == 0) ids.insert(block.entries[i].instance.triangle);
  }
  for (const CoarseTriangle& triangle : coarse.triangles) {
    REQUIRE(triangle.id < block.mesh.triangles.size());
    CHECK(ids.insert(triangle.id).second);
  }
  Random random(11);
  int moved = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec2d p{block.x * 64 + random.between(0.0, 64.0),
                  block.y * 64 + random.between(0.0, 64.0)};
    std::vector<Place> before, after;
    for (std::size_t t = 0; t < block.entries.size(); ++t) {
      const auto at = place_of(p, block.texels(t), block.places(t));
      if (!at) continue;
      before.push_back(*at);
      if (coarse.replaced[t] == 0) after.push_back(*at);
    }
    for (const CoarseTriangle& t : coarse.triangles) {
      const SurfacePoint &a = coarse.points[t.points[0]], &b = coarse.points[t.points[1]],
                         &c = coarse.points[t.points[2]];
      const auto at = place_of(p, {texel_of(a), texel_of(b), texel_of(c)},
                               {place_of(a), place_of(b), place_of(c)});
      if (at) after.push_back(*at);
    }
    for (const Place& was : before) {
      moved += std::none_of(after.begin(), after.end(), [&](const Place& is) {
        return length(is.position - was.position) <= kTexel / 16 * 1.001 &&
               length(is.normal - was.normal) <= 0.125 * 1.001;
      });
    }
  }
  CHECK(moved == 0);
}

std::size_t replaced(const CoarseSurface& coarse) {
  return static_cast<std::size_t>(std::count(coarse.replaced.begin(), coarse.replaced.end(), 1));
}

}  // namespace

TEST_CASE("a flat block of tiny triangles becomes 64 windows of 8x8 texels") {
  const Block block = block_of({});
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  CHECK(coarse.triangles.size() == 128);
  CHECK(coarse.points.size() == 81);
  CHECK(replaced(coarse) == block.entries.size());
  for (const SurfacePoint& point : coarse.points) {
    const Vec2d t = texel_of(point);
    CHECK(std::abs(t.x - std::round(t.x)) < 1e-4);
    CHECK(std::abs(point.position.x - kTexel * t.x) < 1e-4);
    CHECK(std::abs(point.position.y - kTexel * t.y) < 1e-4);
  }
  for (const CoarseTriangle& t : coarse.triangles) {
    const auto at = [&](std::size_t k) { return Vec3d(coarse.points[t.points[k]].position); };
    CHECK(cross(at(1) - at(0), at(2) - at(0)).z == Approx(64 * kTexel * kTexel));
  }
}

TEST_CASE("windows of a mirrored chart are wound as its triangles are") {
  Block block = block_of({});
  for (auto& triangle : block.mesh.triangles) std::swap(triangle[1], triangle[2]);
  const CoarseSurface coarse = block.run();
  CHECK(coarse.triangles.size() == 128);
  for (const CoarseTriangle& t : coarse.triangles) {
    const auto at = [&](std::size_t k) { return Vec3d(coarse.points[t.points[k]].position); };
    CHECK(cross(at(1) - at(0), at(2) - at(0)).z < 0);
  }
}

TEST_CASE("a bent surface is followed by smaller windows, to a 16th of a texel") {
  // Sagitta of a window of e texels: e^2 / (8 R). For R of 20, 50, 150 and 500 texels.
  for (const double radius : {20.0, 50.0, 150.0, 500.0}) {
    Sheet sheet;
    sheet.place = [radius](Vec2d t) {
      const double angle = (t.x - 96) / radius;
      return Vec3d{kTexel * radius * std::sin(angle), kTexel * t.y,
                   kTexel * radius * std::cos(angle)};
    };
    const Block block = block_of(sheet);
    const CoarseSurface coarse = block.run();
    CAPTURE(radius);
    check_surface(block, coarse);
    const std::size_t windows = coarse.triangles.size() / 2;
    const std::size_t expected = radius < 32 ? 1024 : radius < 128 ? 256 : 64;
    CHECK(windows == expected);
  }
}

TEST_CASE("rough surfaces stay where they are") {
  Sheet sheet;
  Random random(3);
  sheet.place = [&](Vec2d t) {
    return Vec3d{kTexel * t.x, kTexel * t.y, kTexel * random.between(0.0, 1.0)};
  };
  const Block block = block_of(sheet);
  const CoarseSurface coarse = block.run();
  CHECK(coarse.triangles.empty());
  CHECK(replaced(coarse) == 0);
}

TEST_CASE("a tear between charts that touch in the image is kept") {
  Sheet sheet;
  sheet.jitter = 0;
  sheet.place = [](Vec2d t) { return Vec3d{kTexel * t.x, kTexel * t.y, t.x > 84 ? 10.0 : 0}; };
  Block block = block_of(sheet);  // a column of triangles goes from one height to the other
  std::erase_if(block.entries, [&](const mesh::BinEntry& e) {
    const auto& t = block.mesh.triangles[e.instance.triangle];
    const auto z = [&](std::size_t k) { return block.mesh.positions[t[k]].z; };
    return z(0) != z(1) || z(1) != z(2);
  });
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  CHECK(coarse.triangles.size() > 100);
  for (const CoarseTriangle& t : coarse.triangles) {
    const auto z = [&](std::size_t k) { return coarse.points[t.points[k]].position.z; };
    CHECK((z(0) == z(1) && z(1) == z(2)));
  }
}

TEST_CASE("where a texel is used twice, all of its triangles stay") {
  Sheet above;
  above.place = [](Vec2d t) { return Vec3d{kTexel * t.x, kTexel * t.y, 1}; };
  Block block = block_of({});
  const Block second = block_of(above);
  for (std::size_t i = 0; i < second.entries.size(); ++i) {
    const auto t = second.texels(i);
    if (std::min({t[0].x, t[1].x, t[2].x}) < 64 + 32) continue;
    block.add(t, {second.corner(i, 0), second.corner(i, 1), second.corner(i, 2)}, {0, 0, 1});
  }
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  CHECK(coarse.triangles.size() == 64);  // the left half
}

TEST_CASE("a hole stays a hole, and an open border where it was") {
  Block block = block_of({});
  const auto middle = [&](const mesh::BinEntry& e) {
    const auto t = mesh::texel_corners(block.mesh, kImage, e.instance);
    return Vec2d{(t[0].x + t[1].x + t[2].x) / 3 - 64 - 20,
                 (t[0].y + t[1].y + t[2].y) / 3 - 128 - 20};
  };
  std::erase_if(block.entries,
                [&](const mesh::BinEntry& e) { return std::hypot(middle(e).x, middle(e).y) < 3; });
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  for (const CoarseTriangle& t : coarse.triangles) {
    Vec2d sum;
    for (const std::uint16_t p : t.points) sum = sum + texel_of(coarse.points[p]);
    CHECK(std::hypot(sum.x / 3 - 64 - 20, sum.y / 3 - 128 - 20) > 2);
  }
}

TEST_CASE("a hole between texel centres stays a hole") {
  Sheet sheet;
  sheet.step = 0.25, sheet.jitter = 0;
  Block block = block_of(sheet);
  const auto is_hole = [&](const mesh::BinEntry& e) {  // a square of a quarter texel
    const auto t = mesh::texel_corners(block.mesh, kImage, e.instance);
    const auto inside = [](Vec2d p) {
      return p.x > 84.2 && p.x < 84.55 && p.y > 148.2 && p.y < 148.55;
    };
    return inside(t[0]) && inside(t[1]) && inside(t[2]);
  };
  const std::size_t whole = block.entries.size();
  std::erase_if(block.entries, is_hole);
  REQUIRE(block.entries.size() == whole - 2);
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  for (const CoarseTriangle& t : coarse.triangles) {
    Vec2d low{1e9, 1e9}, high{-1e9, -1e9};
    for (const std::uint16_t p : t.points) {
      const Vec2d at = texel_of(coarse.points[p]);
      low = {std::min(low.x, at.x), std::min(low.y, at.y)};
      high = {std::max(high.x, at.x), std::max(high.y, at.y)};
    }
    CHECK_FALSE((low.x < 84.3 && high.x > 84.4 && low.y < 148.3 && high.y > 148.4));
  }
}

TEST_CASE("no window has two sides of a surface in front") {
  Block block = block_of({});
  for (std::size_t i = 0; i < block.entries.size(); ++i) {
    const auto t = block.texels(i);
    if ((t[0].x + t[1].x + t[2].x) / 3 < 84.5)
      std::swap(block.mesh.triangles[i][1], block.mesh.triangles[i][2]);
  }
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  CHECK(coarse.triangles.size() > 128);
  for (const CoarseTriangle& t : coarse.triangles) {
    const auto at = [&](std::size_t k) { return Vec3d(coarse.points[t.points[k]].position); };
    const double x = (at(0).x + at(1).x + at(2).x) / 3 / kTexel;
    CHECK((cross(at(1) - at(0), at(2) - at(0)).z < 0) == (x < 84.5));
  }
}

TEST_CASE("what only this block has stays, if it leaves it") {
  // A strip of 26.5 x 5 texels across the border: whole, and not tiny, so the next block lacks it.
  Sheet sheet;
  sheet.jitter = 0;
  Block block = block_of(sheet);
  const double left = 64 + 50, right = 64 + 76.5, top = 128 + 20, bottom = 128 + 25;
  std::erase_if(block.entries, [&](const mesh::BinEntry& e) {
    const auto t = mesh::texel_corners(block.mesh, kImage, e.instance);
    return std::all_of(t.begin(), t.end(), [&](Vec2d p) {
      return p.x >= left && p.x <= right && p.y >= top && p.y <= bottom;
    });
  });
  const std::size_t tiny = block.entries.size();
  const auto at = [](Vec2d t) { return Vec3d{kTexel * t.x, kTexel * t.y, 0}; };
  const Vec2d a{left, top}, b{right, top}, c{right, bottom}, d{left, bottom};
  block.add({a, b, c}, {at(a), at(b), at(c)}, {0, 0, 1});
  block.add({a, c, d}, {at(a), at(c), at(d)}, {0, 0, 1});
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  CHECK(coarse.replaced[tiny] == 0);
  CHECK(coarse.replaced[tiny + 1] == 0);
  CHECK(replaced(coarse) > tiny * 3 / 4);
}

TEST_CASE("numbers are of triangles that no other block has") {
  Sheet sheet;
  sheet.jitter = 0;
  sheet.beyond = 0;  // so that vertices lie on the border itself
  const Block block = block_of(sheet);
  const CoarseSurface coarse = block.run();
  CHECK(coarse.triangles.size() > 100);
  for (const CoarseTriangle& t : coarse.triangles) {
    for (const std::uint32_t vertex : block.mesh.triangles[t.id]) {
      const Vec2d texel = mesh::to_texel(kImage, block.mesh.uv_sets[0][vertex]);
      CHECK((texel.x < 128 && texel.y < 192));
    }
  }
}

TEST_CASE("needles across a block cost next to nothing") {
  Block block = block_of({});
  block.entries.clear();
  const auto at = [](Vec2d t) { return Vec3d{kTexel * t.x, kTexel * t.y, 0}; };
  // Strips side by side along the diagonal: they cover each texel centre once.
  const auto first = [](double off) {
    return Vec2d{64 + std::max(0.0, -off), 128 + std::max(0.0, off)};
  };
  const auto last = [](double off) {
    return Vec2d{64 + std::min(64.0, 64 - off), 128 + std::min(64.0, 64 + off)};
  };
  constexpr int kStrips = 20000;
  for (int i = 0; i < kStrips; ++i) {
    const double off = -63 + 126.0 * i / kStrips, next = -63 + 126.0 * (i + 1) / kStrips;
    const Vec2d a = first(off), b = last(off), c = last(next), d = first(next);
    block.add({a, b, c}, {at(a), at(b), at(c)}, {0, 0, 1});
    block.add({a, c, d}, {at(a), at(c), at(d)}, {0, 0, 1});
  }
  const std::clock_t begin = std::clock();  // of the CPU: other programs do not count
  CHECK(block.run().triangles.size() < 16);
  CHECK(std::clock() - begin < 2 * CLOCKS_PER_SEC);
}

TEST_CASE("tangents come along, and no window mixes their handedness") {
  Block block = block_of({});
  for (std::size_t i = 0; i < block.entries.size(); ++i) {
    const auto t = block.texels(i);
    const float w = (t[0].x + t[1].x + t[2].x) / 3 < 84.5 ? -1.0F : 1.0F;
    for (int k = 0; k < 3; ++k) block.mesh.tangents.push_back({0, 1, 0, w});
  }
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  CHECK(coarse.triangles.size() > 128);
  for (const CoarseTriangle& t : coarse.triangles) {
    for (const std::uint16_t p : t.points) {
      const Vec4f& tangent = coarse.points[p].tangent;
      CHECK((tangent.x == 0 && tangent.y == 1 && tangent.z == 0));
      CHECK(tangent.w == coarse.points[t.points[0]].tangent.w);
    }
  }
}

TEST_CASE("a crease that normals alone show is followed, too") {
  Block block = block_of({});
  for (std::size_t i = 0; i < block.mesh.normals.size(); ++i) {
    const double angle = block.mesh.positions[i].x > kTexel * 96 ? 0.4 : 0.0;
    block.mesh.normals[i] = {static_cast<float>(std::sin(angle)), 0,
                             static_cast<float>(std::cos(angle))};
  }
  const CoarseSurface coarse = block.run();
  check_surface(block, coarse);
  CHECK(coarse.triangles.size() > 128);  // smaller ones along the fold
}

TEST_CASE("triangles without area in space are left to be counted") {
  Sheet sheet;
  sheet.place = [](Vec2d t) { return Vec3d{kTexel * t.x, 0, 0}; };
  const CoarseSurface coarse = block_of(sheet).run();
  CHECK(coarse.triangles.empty());
  CHECK(replaced(coarse) == 0);
}

TEST_CASE("coarsening costs no more than it says") {
  CHECK(is_dense(1024));
  CHECK_FALSE(is_dense(1023));
  const Block block = block_of({});
  const CoarseSurface coarse = block.run();
  const std::uint64_t result = coarse.points.capacity() * sizeof(SurfacePoint) +
                               coarse.triangles.capacity() * sizeof(CoarseTriangle) +
                               coarse.replaced.capacity();
  CHECK(result < coarsen_bytes(block.entries.size()));
}
