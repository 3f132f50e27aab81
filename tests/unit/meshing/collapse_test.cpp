// SPDX-License-Identifier: Apache-2.0
#include "meshing/collapse.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "meshing/simplify_wedges.h"
#include "unit/meshing/wedge_grids.h"

namespace pounce::meshing {
namespace {

/// A wavy sheet of three charts, the third with another material: left, right below, right above.
WedgeSurface wavy_sheet(std::uint32_t n) {
  Builder b;
  const auto wave = [](float x, float y) {
    return Vec3f{x, y, 0.1F * std::sin(5 * x) * std::cos(4 * y)};
  };
  for (const float half : {0.0F, 0.5F}) {
    b.grid(
        n, 0, [&](float s, float t) { return wave(s / 2, half + t / 2); },
        [&](float s, float t) {
          return Vec2f{0.4F * s, half + t / 2};
        });
  }
  b.grid(
      n, 0, [&](float s, float t) { return wave(0.5F + s / 2, t / 2); },
      [](float s, float t) {
        return Vec2f{0.5F + 0.4F * s, 0.4F * t};
      });
  b.grid(
      n, 1, [&](float s, float t) { return wave(0.5F + s / 2, 0.5F + t / 2); },
      [](float s, float t) {
        return Vec2f{0.5F + 0.4F * s, 0.4F * t};
      });
  return b.made();
}

/// The unit cube, each side a chart of its own, and the sides up and down of another material.
WedgeSurface cube(std::uint32_t n) {
  Builder b;
  for (std::uint32_t side = 0; side < 6; ++side) {
    const auto place = [side](float s, float t) {
      const float at = side % 2 == 0 ? 0.0F : 1.0F, turned = side % 2 == 0 ? 1 - s : s;
      return side / 2 == 0   ? Vec3f{at, turned, t}
             : side / 2 == 1 ? Vec3f{t, at, turned}
                             : Vec3f{turned, t, at};
    };
    b.grid(n, side / 2 == 2 ? 1 : 0, place, [side](float s, float t) {
      return Vec2f{(static_cast<float>(side % 3) + 0.1F + 0.8F * s) / 3,
                   (static_cast<float>(side / 3) + 0.1F + 0.8F * t) / 3};
    });
  }
  return b.made();
}

using Corner = std::tuple<float, float, float, float, float, std::uint32_t>;

std::set<Corner> corners_of(const WedgeSurface& s, bool with_places) {
  std::set<Corner> corners;
  for (const Wedge& w : s.wedges) {
    const Vec3f p = with_places ? s.places[w.place] : Vec3f{};
    corners.insert({p.x, p.y, p.z, w.uv.x, w.uv.y, w.material});
  }
  return corners;
}

bool includes(const std::set<Corner>& all, const std::set<Corner>& some) {
  return std::includes(all.begin(), all.end(), some.begin(), some.end());
}

TEST_CASE("a cube of six charts and two materials comes down to its corners") {
  const WedgeSurface heavy = cube(8);
  REQUIRE(heavy.triangles.size() == 768);
  WedgeSurface light = heavy;
  auto covers = covers_of(light, kEdge);
  collapse(light, covers, 0, 1e-4, kNothing);
  CHECK(light.triangles.size() == 12);
  CHECK(light.places.size() == 8);
  CHECK(light.wedges.size() == 24);
  CHECK(includes(corners_of(heavy, true), corners_of(light, true)));
  CHECK(open_edges(light) == 0);
  for (const std::uint32_t material : {0U, 1U})
    CHECK(uv_area(light, material) == Approx(uv_area(heavy, material)));
}

TEST_CASE("where three charts meet, their corner stays however few triangles are asked for") {
  WedgeSurface light = cube(8);
  auto covers = covers_of(light, kEdge);
  collapse(light, covers, 0, kAnyDistance, kNothing);
  CHECK(light.triangles.size() == 12);
  CHECK(light.places.size() == 8);
  CHECK(open_edges(light) == 0);
}

TEST_CASE("a tube stays a tube") {
  // Of three sides: around it go three edges that have no triangle between them.
  Builder b;
  b.grid(
      3, 0,
      [](float s, float t) {
        const float k = std::round(3 * s);
        return Vec3f{k == 1 ? 1.0F : 0, k == 2 ? 1.0F : 0, 5 * t};
      },
      [](float, float) {
        return Vec2f{0.5F, 0.5F};
      });
  WedgeSurface light = b.made();
  CHECK(open_edges(light) == 6);
  auto covers = covers_of(light, kEdge);
  collapse(light, covers, 0, kAnyDistance, kNothing);
  CHECK(light.triangles.size() == 6);
  CHECK(open_edges(light) == 6);
}

TEST_CASE("what is left when a surface is simplified has the UVs that it had") {
  const WedgeSurface heavy = cube(16);
  WedgeSurface light = heavy;
  auto covers = covers_of(light, kEdge);
  collapse(light, covers, 300, kAnyDistance, kNothing);
  CHECK(light.triangles.size() <= 300);
  CHECK(light.triangles.size() >= 298);
  CHECK(includes(corners_of(heavy, true), corners_of(light, true)));
  CHECK(open_edges(light) == 0);
  for (const Triangle& t : light.triangles) CHECK(turn_of(uvs_of(light, t)) != 0);
  const WedgeSurface before = light;
  collapse(light, covers, 300, kAnyDistance, kNothing);  // nothing to do
  CHECK(light.triangles == before.triangles);
}

TEST_CASE("fitted, the wedges of a place stay together, and UVs as they were") {
  const WedgeSurface heavy = wavy_sheet(24);
  WedgeSurface light = heavy;
  const SharedTexels texels = simplify_fitted(light, 400, kEdge, kNothing);
  CHECK(texels.before == 0);
  CHECK(texels.after == 0);
  CHECK(light.triangles.size() <= 400);
  CHECK(light.triangles.size() > 360);
  CHECK(includes(corners_of(heavy, false), corners_of(light, false)));
  CHECK_FALSE(includes(corners_of(heavy, true), corners_of(light, true)));  // places have moved
  for (const Triangle& t : light.triangles) CHECK(turn_of(uvs_of(light, t)) > 0);
  for (const std::uint32_t material : {0U, 1U})
    CHECK(uv_area(light, material) == Approx(uv_area(heavy, material)).epsilon(1e-4));
  // It lies on both sides of the heavy one.
  double sum = 0;
  for (const Vec3f p : light.places)
    sum += double{p.z} - 0.1 * std::sin(5.0 * p.x) * std::cos(4.0 * p.y);
  CHECK(std::abs(sum) / static_cast<double>(light.places.size()) < 2e-3);
}

TEST_CASE("by distance there are fewer triangles the more it may be off") {
  std::size_t before = std::numeric_limits<std::size_t>::max();
  for (const double distance : {1e-4, 1e-3, 1e-2}) {
    WedgeSurface light = wavy_sheet(24);
    simplify_within(light, distance, kEdge, kNothing);
    CHECK(light.triangles.size() < before);
    before = light.triangles.size();
  }
  CHECK(before < 200);
}

/// A flat strip that is bent around in its texture: three quarters of a ring, between radii.
void add_ring(Builder& b, std::uint32_t n, double inner, double outer) {
  b.grid(
      n, 0,
      [](float s, float t) {
        return Vec3f{4 * s, t, 0};
      },
      [=](float s, float t) {
        const double angle = 4.5 * double{s}, radius = outer + (inner - outer) * double{t};
        return Vec2f{static_cast<float>(0.5 + radius * std::cos(angle)),
                     static_cast<float>(0.5 + radius * std::sin(angle))};
      });
}

TEST_CASE("no triangle turns over in the texture, though in space all is flat") {
  Builder b;
  add_ring(b, 16, 0.2, 0.45);
  const WedgeSurface heavy = b.made();
  WedgeSurface light = heavy;
  auto covers = covers_of(light, kEdge);
  collapse(light, covers, 0, 1e-3, kNothing);
  CHECK(light.triangles.size() < 100);
  for (const Triangle& t : light.triangles) CHECK(turn_of(uvs_of(light, t)) > 0);
  CHECK(covers.front().shared() == 0);
}

TEST_CASE("a place does not go where a triangle would turn over in the texture") {
  // A hexagon that is a pinwheel in its texture: from none of its corners all of it is seen.
  std::vector<Vec3f> positions{{0, 0, 0}};
  std::vector<Vec2f> at{{0.5F, 0.5F}};
  constexpr double kDegree = 3.14159265358979 / 180;
  for (int k = 0; k < 6; ++k) {
    const double angle = 60 * k * kDegree, turned = (k / 2 * 120 + (k % 2) * 5) * kDegree;
    const double radius = k % 2 == 0 ? 0.4 : 0.12;
    positions.push_back(Vec3f(Vec3d{std::cos(angle), std::sin(angle), 0}));
    at.push_back({static_cast<float>(0.5 + radius * std::cos(turned)),
                  static_cast<float>(0.5 + radius * std::sin(turned))});
  }
  const auto left = [&](const std::vector<Vec2f>& uv) {
    std::vector<Triangle> triangles;
    std::vector<std::array<Vec2f, 3>> uvs;
    for (std::uint32_t k = 0; k < 6; ++k) {
      triangles.push_back({0, 1 + k, 1 + (k + 1) % 6});
      uvs.push_back({uv[0], uv[triangles[k][1]], uv[triangles[k][2]]});
    }
    WedgeSurface s = joined(positions, triangles, uvs, std::vector<std::uint32_t>(6));
    auto covers = covers_of(s, kEdge);
    collapse(s, covers, 0, 1e-3, kNothing);
    return s.triangles.size();
  };
  std::vector<Vec2f> regular;
  for (const Vec3f p : positions) regular.push_back({0.5F + p.x / 4, 0.5F + p.y / 4});
  CHECK(left(regular) == 4);
  CHECK(left(at) == 6);
}

/// Flat, 1 x 1, with a slit in its texture from the middle of the upper side to its own middle.
WedgeSurface slit_sheet(std::uint32_t n) {
  Builder b;
  for (const float left : {0.0F, 0.5F}) {
    for (const float low : {0.0F, 0.5F}) {
      b.grid(
          n, 0,
          [&](float s, float t) {
            return Vec3f{left + s / 2, low + t / 2, 0};
          },
          [&](float s, float t) {
            const float apart = low > 0 ? 0.001F * t : 0;
            return Vec2f{0.1F + 0.8F * (left + s / 2) + (left > 0 ? apart : -apart),
                         0.1F + 0.8F * (low + t / 2)};
          });
    }
  }
  return b.made();
}

TEST_CASE("each side of a seam stays on its side to where that ends") {
  for (const std::size_t triangles : {128U, 64U, 32U, 16U, 8U}) {
    WedgeSurface light = slit_sheet(8);
    auto covers = covers_of(light, kEdge);
    collapse(light, covers, triangles, kAnyDistance, kNothing);
    CHECK(light.triangles.size() <= triangles + 4);
    for (const Triangle& t : light.triangles) {
      double middle = 0;
      for (const std::uint32_t w : t) middle += double{light.places[light.wedges[w].place].x} / 3;
      for (const std::uint32_t w : t) {
        const Vec3f p = light.places[light.wedges[w].place];
        if (p.x == 0.5F && p.y > 0.5F) CHECK((light.wedges[w].uv.x < 0.5F) == (middle < 0.5));
      }
    }
  }
}

TEST_CASE("a flat sheet of three charts comes down to their corners") {
  Builder b;
  for (const float half : {0.0F, 0.5F}) {
    b.grid(
        8, 0,
        [&](float s, float t) {
          return Vec3f{s / 2, half + t / 2, 0};
        },
        [&](float s, float t) {
          return Vec2f{0.4F * s, half + t / 2};
        });
    b.grid(
        8, half > 0 ? 1 : 0,
        [&](float s, float t) {
          return Vec3f{0.5F + s / 2, half + t / 2, 0};
        },
        [&](float s, float t) {
          return Vec2f{0.5F + 0.4F * s, 0.4F * t};
        });
  }
  WedgeSurface light = b.made();
  auto covers = covers_of(light, kEdge);
  collapse(light, covers, 0, 1e-4, kNothing);
  // On the left there is a fifth corner, where the two on the right meet it.
  CHECK(light.triangles.size() == 3 + 2 + 2);
  CHECK(light.places.size() == 8);
  CHECK(light.wedges.size() == 5 + 4 + 4);
  CHECK(uv_area(light, 0) == Approx(0.4 + 0.16));
  CHECK(uv_area(light, 1) == Approx(0.16));
}

TEST_CASE("a closed surface stays closed however few triangles are asked for") {
  for (const std::uint32_t n : {2U, 5U}) {
    Builder b;  // a ball: opposite sides of the texture's square meet nowhere
    b.grid(
        4 * n, 0,
        [](float s, float t) {
          const double a = 3.14159265358979 * double{t}, c = 2 * 3.14159265358979 * double{s};
          return s == 1 || t == 0 || t == 1 ? Vec3f(Vec3d{t == 0 || t == 1 ? 0 : std::sin(a), 0,
                                                          t == 1 ? -1 : std::cos(a)})
                                            : Vec3f(Vec3d{std::sin(a) * std::cos(c),
                                                          std::sin(a) * std::sin(c), std::cos(a)});
        },
        [](float, float) {
          return Vec2f{0.5F, 0.5F};
        });  // a palette's colour
    WedgeSurface light = b.made();
    CHECK(open_edges(light) == 0);
    auto covers = covers_of(light, kEdge);
    collapse(light, covers, 0, kAnyDistance, kNothing);
    CHECK(light.triangles.size() < 12);
    CHECK(open_edges(light) == 0);
    std::set<std::set<std::uint32_t>> distinct;
    for (const Triangle& t : light.triangles) distinct.insert({t[0], t[1], t[2]});
    CHECK(distinct.size() == light.triangles.size());
  }
}

TEST_CASE("where all is flat, the texture says what is missed least") {
  // u is the square of x: a straight line through it is off by at most a quarter of a square.
  Builder b;
  b.grid(
      24, 0,
      [](float s, float t) {
        return Vec3f{s, t, 0};
      },
      [](float s, float t) {
        return Vec2f{s * s, t};
      });
  WedgeSurface light = b.made();
  auto covers = covers_of(light, kEdge);
  collapse(light, covers, 60, kAnyDistance, kNothing);
  double worst = 0;
  for (const Triangle& t : light.triangles) {
    double x = 0, u = 0;
    for (const std::uint32_t w : t) {
      x += double{light.places[light.wedges[w].place].x} / 3;
      u += double{light.wedges[w].uv.x} / 3;
    }
    worst = std::max(worst, u - x * x);
  }
  CHECK(worst < 0.03);
}

TEST_CASE("a mirrored chart stays mirrored") {
  Builder b;
  add_ring(b, 16, 0.45, 0.2);
  WedgeSurface light = b.made();
  auto covers = covers_of(light, kEdge);
  collapse(light, covers, 0, 1e-3, kNothing);
  CHECK(light.triangles.size() < 100);
  for (const Triangle& t : light.triangles) CHECK(turn_of(uvs_of(light, t)) < 0);
}

TEST_CASE("an outline does not move over another chart") {
  // A square in the middle of the ring, whose corners nearly touch it: chords of the ring would.
  const auto shared_after = [](bool with_square) {
    Builder b;
    add_ring(b, 32, 0.25, 0.45);
    if (with_square) {
      b.grid(
          4, 0,
          [](float s, float t) {
            return Vec3f{s, t, 5};
          },
          [](float s, float t) {
            return Vec2f{0.5F + 0.34F * (s - 0.5F), 0.5F + 0.34F * (t - 0.5F)};
          });
    }
    WedgeSurface light = b.made();
    auto covers = covers_of(light, kEdge);
    CHECK(covers.front().shared() == 0);
    collapse(light, covers, 0, 1e-3, kNothing);
    CHECK(covers_of(light, kEdge).front().shared() == covers.front().shared());
    return std::pair(light.triangles.size(), covers.front().shared());
  };
  const auto alone = shared_after(false), together = shared_after(true);
  CHECK(together.second == 0);
  CHECK(together.first > alone.first + 2);  // the square has two
}

TEST_CASE("charts that lie on each other may both be simplified") {
  Builder b;
  add_ring(b, 16, 0.2, 0.45);
  Builder both = b;
  both.grid(
      16, 0,
      [](float s, float t) {
        return Vec3f{4 * s, t, 5};
      },
      [](float s, float t) {
        const double angle = 4.5 * double{s}, radius = 0.45 - 0.25 * double{t};
        return Vec2f{static_cast<float>(0.5 + radius * std::cos(angle)),
                     static_cast<float>(0.5 + radius * std::sin(angle))};
      });
  const auto left = [](const Builder& of) {
    WedgeSurface light = of.made();
    auto covers = covers_of(light, kEdge);
    collapse(light, covers, 0, 1e-3, kNothing);
    return light.triangles.size();
  };
  CHECK(left(both) <= 2 * left(b) + 10);
}

TEST_CASE("of UVs that tile, few texels are looked at, and none turns over") {
  constexpr std::uint32_t n = 12;
  const auto sheet = [](float periods) {
    Builder b;
    b.grid(
        n, 0,
        [](float s, float t) {
          return Vec3f{s, t, 0.05F * std::sin(9 * s) * std::cos(7 * t)};
        },
        [=](float s, float t) {
          return Vec2f{periods * s, periods * t};
        });
    return b.made();
  };
  CHECK(covers_of(sheet(1), 1024).front().edge() == 1024);
  CHECK(covers_of(sheet(2), 1024).front().edge() == 1024);
  // Nearly two periods for each square: all of them together fill some 570.
  WedgeSurface light = sheet(1.99F * n);
  auto covers = covers_of(light, 1024);
  const double filled = 1.99 * 1.99 * n * n, edge = covers.front().edge();
  CHECK(edge * edge * filled < 4.1 * 1024 * 1024);
  CHECK(edge * edge * filled > 3.5 * 1024 * 1024);
  collapse(light, covers, 100, kAnyDistance, kNothing);
  CHECK(light.triangles.size() <= 100);
  for (const Triangle& t : light.triangles) CHECK(turn_of(uvs_of(light, t)) > 0);
  CHECK(uv_area(light, 0) == Approx(filled));
}

/// A cone of n triangles around its tip.
WedgeSurface cone(std::uint32_t n) {
  Builder b;
  b.positions.push_back({0, 0, 1});
  for (std::uint32_t k = 0; k < n; ++k) {
    const double angle = 2 * 3.14159265358979 * k / n;
    b.positions.push_back(Vec3f(Vec3d{std::cos(angle), std::sin(angle), 0}));
  }
  const auto uv = [&](std::uint32_t v) {
    return Vec2f{0.5F + 0.4F * b.positions[v].x, 0.5F + 0.4F * b.positions[v].y};
  };
  for (std::uint32_t k = 0; k < n; ++k) {
    const Triangle t{0, 1 + k, 1 + (k + 1) % n};
    b.triangles.push_back(t);
    b.uvs.push_back({uv(t[0]), uv(t[1]), uv(t[2])});
    b.materials.push_back(0);
  }
  return b.made();
}

TEST_CASE("a tip with very many triangles is simplified in time that grows with their number") {
  // Polls come with the work that is done: of 16 times as many triangles, 16 times as many.
  const auto polls = [](std::uint32_t n) {
    std::size_t count = 0;
    WedgeSurface light = cone(n);
    auto covers = covers_of(light, 64);
    collapse(light, covers, 40, kAnyDistance, [&] { ++count; });
    CHECK(light.triangles.size() <= 40);
    CHECK(light.triangles.size() >= 38);
    CHECK(light.places.size() == light.triangles.size() + 1);  // still a cone
    CHECK(open_edges(light) == light.triangles.size());
    for (const Triangle& t : light.triangles) CHECK(turn_of(uvs_of(light, t)) > 0);
    return count;
  };
  const std::size_t some = polls(2500), many = polls(40000);
  CHECK(some > 0);
  CHECK(many < 24 * some);
}

TEST_CASE("what collapsing holds is said by places, wedges and triangles") {
  Builder b;  // triangles that have nothing in common
  for (std::uint32_t k = 0; k < 100; ++k) {
    const auto x = static_cast<float>(k);
    for (const Vec2f p : {Vec2f{0, 0}, Vec2f{0.5F, 0}, Vec2f{0, 1}})
      b.positions.push_back({x + p.x, p.y, 0});
    b.triangles.push_back({3 * k, 3 * k + 1, 3 * k + 2});
    b.uvs.push_back({Vec2f{x, 0}, Vec2f{x + 0.5F, 0}, Vec2f{x, 1}});
    b.materials.push_back(0);
  }
  CHECK(collapsing_bytes_of(b.made()) / 100 > 1600);
  const WedgeSurface sheet = wavy_sheet(24);
  CHECK(collapsing_bytes_of(sheet) / sheet.triangles.size() < 700);
}

}  // namespace
}  // namespace pounce::meshing
