// SPDX-License-Identifier: Apache-2.0
#include "gaussian/texel_gaussians.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "mesh/block_bins.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::gaussian;
using pounce::test::Random;

namespace {

/// A block of triangles with corners at texel coordinates of an image (its centres are integers).
struct BlockMaker {
  mesh::Lattice lattice;
  store::GeometryBlock block;

  void add(std::array<Vec3f, 3> positions, std::array<Vec2d, 3> texels,
           std::array<Vec3f, 3> normals = {Vec3f{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}) {
    const auto first = static_cast<std::uint16_t>(block.positions.size());
    for (std::size_t k = 0; k < 3; ++k) {
      block.positions.push_back(positions[k]);
      block.normals.push_back(normals[k]);
      block.uvs.push_back({static_cast<float>((texels[k].x + 0.5) / lattice.width),
                           static_cast<float>((texels[k].y + 0.5) / lattice.height)});
      block.tangents.push_back({});
    }
    block.triangles.push_back(
        {first, static_cast<std::uint16_t>(first + 1), static_cast<std::uint16_t>(first + 2)});
    block.ids.push_back(static_cast<std::uint32_t>(block.ids.size()));
  }
  std::vector<MeshGaussian> all() const {
    const MeshGaussians gaussians(block, lattice);
    std::vector<MeshGaussian> out;
    gaussians.visit(0, gaussians.count(), [&](const MeshGaussian& g) { out.push_back(g); });
    CHECK(out.size() == gaussians.count());
    return out;
  }
};

constexpr mesh::Lattice kImage{8, 8, 0, {}};

/// The covariance that a footprint means.
std::array<std::array<double, 3>, 3> covariance(const Footprint& f) {
  const auto [w, x, y, z] = f.rotation;
  CHECK(w * w + x * x + y * y + z * z == Approx(1).epsilon(1e-12));
  CHECK(w >= 0);
  const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                          {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                          {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
  std::array<std::array<double, 3>, 3> c{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k) c[i][j] += r[i][k] * r[j][k] * f.sigma[k] * f.sigma[k];
    }
  }
  return c;
}

}  // namespace

TEST_CASE("a quad of 4 x 4 texels gives sixteen Gaussians, worked by hand") {
  // 8 wide and 2 high at z = 5: a texel is 2 x 0.5. Texel centres at 0..3, so corners at -0.5, 3.5.
  BlockMaker maker{{4, 4, 0, {}}, {}};
  const Vec3f a{0, 2, 5}, b{8, 2, 5}, c{8, 0, 5}, d{0, 0, 5};  // image rows run down in y
  const Vec2d ta{-0.5, -0.5}, tb{3.5, -0.5}, tc{3.5, 3.5}, td{-0.5, 3.5};
  maker.add({d, c, b}, {td, tc, tb});
  maker.add({d, b, a}, {td, tb, ta});
  const auto found = maker.all();
  REQUIRE(found.size() == 16);
  std::array<int, 16> seen{};
  for (const MeshGaussian& g : found) {
    REQUIRE((g.x >= 0 && g.x < 4 && g.y >= 0 && g.y < 4));
    ++seen[static_cast<std::size_t>(g.y * 4 + g.x)];
    CHECK(g.frac_x == 0);
    CHECK(g.frac_y == 0);
    CHECK(g.mean.x == Approx(1 + 2 * g.x));
    CHECK(g.mean.y == Approx(1.75 - 0.5 * g.y));
    CHECK(g.mean.z == 5);
    CHECK(g.normal == Vec3f{0, 0, 1});
  }
  for (const int n : seen) CHECK(n == 1);
  for (const std::uint32_t t : {0U, 1U}) {
    const Footprint f = MeshGaussians(maker.block, maker.lattice).footprint(t);
    CHECK(f.sigma[0] == Approx(kSigmaTexels * 2));
    CHECK(f.sigma[1] == Approx(kSigmaTexels * 0.5));
    CHECK(f.sigma[2] == Approx(kSigmaTexels * 0.5 * kFlatness));
    // Long axis along x, thin axis along z: no turn at all, or a half turn about z.
    CHECK(std::abs(f.rotation[0]) + std::abs(f.rotation[3]) == Approx(1));
    CHECK(f.rotation[1] == Approx(0).margin(1e-15));
    CHECK(f.rotation[2] == Approx(0).margin(1e-15));
    const auto cov = covariance(f);
    CHECK(cov[0][0] == Approx(1.0));
    CHECK(cov[1][1] == Approx(0.0625));
    CHECK(cov[0][1] == Approx(0).margin(1e-15));
  }
}

TEST_CASE("a sheared texel's covariance is that of its parallelogram") {
  // jx = (1, 0, 1), jy = (0.5, 2, 0.5): positions of the texels (0,0), (4,0), (0,4).
  BlockMaker maker{kImage, {}};
  maker.add({Vec3f{0, 0, 0}, {4, 0, 4}, {2, 8, 2}}, {Vec2d{0, 0}, {4, 0}, {0, 4}},
            {Vec3f{1, 0, -1}, {1, 0, -1}, {1, 0, -1}});
  const Footprint f = MeshGaussians(maker.block, maker.lattice).footprint(0);
  const auto cov = covariance(f);
  const double s2 = kSigmaTexels * kSigmaTexels;
  const double thin = f.sigma[2] * f.sigma[2];  // adds n n' thin, n = (1, 0, -1) / sqrt 2
  CHECK(cov[0][0] == Approx(s2 * (1 + 0.25) + thin / 2));
  CHECK(cov[1][1] == Approx(s2 * 4));
  CHECK(cov[2][2] == Approx(s2 * (1 + 0.25) + thin / 2));
  CHECK(cov[0][1] == Approx(s2 * 1));
  CHECK(cov[0][2] == Approx(s2 * (1 + 0.25) - thin / 2));
  CHECK(cov[1][2] == Approx(s2 * 1));
  // The third column is the normal on the side that the vertex normals say.
  const auto [w, x, y, z] = f.rotation;
  CHECK(2 * (x * z + w * y) == Approx(std::sqrt(0.5)));
  CHECK(2 * (y * z - w * x) == Approx(0).margin(1e-12));
  CHECK(1 - 2 * (x * x + y * y) == Approx(-std::sqrt(0.5)));
}

TEST_CASE("a triangle that holds no texel's centre is one Gaussian of its own size") {
  BlockMaker maker{kImage, {}};
  // Between the centres 2 and 3 both ways; in space an equilateral triangle of side 2.
  const auto h = static_cast<float>(std::sqrt(3.0));
  maker.add({Vec3f{-1, 0, 0}, {1, 0, 0}, {0, h, 0}}, {Vec2d{2.2, 2.2}, {2.8, 2.2}, {2.2, 2.8}});
  const auto found = maker.all();
  REQUIRE(found.size() == 1);
  CHECK(found[0].mean.x == Approx(0).margin(1e-7));
  CHECK(found[0].mean.y == Approx(h / 3));
  CHECK(found[0].x == 2);
  CHECK(found[0].frac_x == Approx(0.4));
  CHECK(found[0].frac_y == Approx(0.4));
  // v v' over corners at distance 2 / sqrt 3 from the centroid: (4 / 3) * 3 / 2 = 2 both ways.
  const Footprint f = MeshGaussians(maker.block, maker.lattice).footprint(0);
  CHECK(f.sigma[0] == Approx(kSigmaTexels * std::sqrt(2.0)).epsilon(1e-6));
  CHECK(f.sigma[1] == Approx(kSigmaTexels * std::sqrt(2.0)).epsilon(1e-6));
}

TEST_CASE("a triangle without an image is one Gaussian, without area it is none") {
  BlockMaker maker{{0, 0, 0, {}}, {}};
  maker.lattice.width = 8;  // for add(), which divides
  maker.lattice.height = 8;
  maker.add({Vec3f{0, 0, 0}, {3, 0, 0}, {0, 3, 0}}, {});
  maker.add({Vec3f{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {});
  maker.add({Vec3f{0, 0, 1}, {3, 0, 1}, {0, 3, 1}}, {});
  maker.lattice = {};
  const auto found = maker.all();
  REQUIRE(found.size() == 2);
  CHECK(found[0].mean == Vec3f{1, 1, 0});
  CHECK(found[1].triangle == 2);
  CHECK(found[1].mean == Vec3f{1, 1, 1});
}

TEST_CASE("a triangle smaller than a texel does not overhang") {
  BlockMaker maker{kImage, {}};
  // 0.2 texels wide in the image over a centre, 1 in space: a texel's footprint would be 5 wide.
  maker.add({Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {Vec2d{2.9, 2.9}, {3.2, 2.9}, {2.9, 3.2}});
  const auto found = maker.all();
  REQUIRE(found.size() == 1);
  CHECK(found[0].x == 3);
  CHECK(found[0].frac_x == 0);
  CHECK(found[0].mean.x == Approx(1.0 / 3).epsilon(1e-5));
  const Footprint f = MeshGaussians(maker.block, maker.lattice).footprint(0);
  // v v' over (-1/3, -1/3), (2/3, -1/3), (-1/3, 2/3): 2/3 on the diagonal, -1/3 beside it.
  CHECK(f.sigma[0] == Approx(kSigmaTexels * 1));
  CHECK(f.sigma[1] == Approx(kSigmaTexels * std::sqrt(1.0 / 3)));
}

TEST_CASE("a block's Gaussians can be visited in parts") {
  Random random(5);
  BlockMaker maker{kImage, {}};
  for (int i = 0; i < 40; ++i) {
    const auto v = [&] {
      return Vec3f{random.between(-1.F, 1.F), random.between(-1.F, 1.F), 0.3F};
    };
    const auto t = [&] { return Vec2d{random.between(-3.0, 20.0), random.between(-3.0, 20.0)}; };
    maker.add({v(), v(), v()}, {t(), t(), t()});
  }
  const auto whole = maker.all();
  const MeshGaussians gaussians(maker.block, maker.lattice);
  REQUIRE(whole.size() > 500);
  for (const std::uint64_t step : {1U, 7U, 97U, 1000000U}) {
    std::size_t next = 0;
    for (std::uint64_t begin = 0; begin < whole.size(); begin += step) {
      gaussians.visit(begin, std::min<std::uint64_t>(begin + step, whole.size()),
                      [&](const MeshGaussian& g) {
                        REQUIRE(next < whole.size());
                        CHECK(g.mean == whole[next].mean);
                        CHECK(g.x == whole[next].x);
                        CHECK(g.y == whole[next].y);
                        CHECK(g.triangle == whole[next].triangle);
                        ++next;
                      });
    }
    CHECK(next == whole.size());
  }
}

TEST_CASE("footprints of any triangle are finite, ordered and turn to its normal") {
  Random random(6);
  for (int i = 0; i < 3000; ++i) {
    BlockMaker maker{kImage, {}};
    const double size = std::pow(10.0, random.between(-6.0, 6.0));
    const double thin = random.one_in(3) ? 1e-6 : 1.0;
    const auto v = [&](double squeeze) {
      return Vec3f{static_cast<float>(size * random.between(-1.0, 1.0)),
                   static_cast<float>(size * random.between(-1.0, 1.0) * squeeze),
                   static_cast<float>(size * random.between(-1.0, 1.0))};
    };
    const auto t = [&] { return Vec2d{random.between(0.0, 20.0), random.between(0.0, 20.0)}; };
    maker.add({v(thin), v(thin), v(thin)}, {t(), t(), t()});
    const MeshGaussians gaussians(maker.block, maker.lattice);
    if (gaussians.count() == 0) continue;
    const Footprint f = gaussians.footprint(0);
    CHECK(std::isfinite(std::log(f.sigma[2])));
    CHECK(f.sigma[0] >= f.sigma[1] * (1 - 1e-9));
    CHECK(f.sigma[1] > f.sigma[2]);
    covariance(f);
    const auto& p = maker.block.positions;
    const Vec3d n = cross(Vec3d(p[1]) - Vec3d(p[0]), Vec3d(p[2]) - Vec3d(p[0]));
    const auto [w, x, y, z] = f.rotation;
    const Vec3d axis{2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
    CHECK(std::abs(dot(n, axis)) / length(n) == Approx(1).epsilon(1e-9));
    CHECK(axis.z >= 0);  // the vertex normals' side
  }
}
