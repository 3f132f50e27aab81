// SPDX-License-Identifier: Apache-2.0
//
// A mesh onto itself must give its own texture back: whole, and in the 2 px band along the borders
// of charts, where neighbours, seams and gutters would show first.
#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>
#include <random>

#include "golden.h"
#include "io/read_mesh.h"
#include "pounce/gaussians.h"
#include "support/mesh_files.h"
#include "support/target_raster.h"

namespace pounce::test {
namespace {

constexpr std::uint32_t kSize = 1024;

constexpr double kExact = std::numeric_limits<double>::infinity();  // dB: not a sample differs

/// The floors are what docs/measured.md says, 0.2 dB below where it is a figure.
struct Model {
  const char* path;
  double whole_db, band_db;
};
constexpr Model kModels[] = {
    {"heads/head_src.glb", kExact, kExact},
    {"meshes/lee_perry_smith/LeePerrySmith_plain_textured.glb", 86.6, kExact},
    {"meshes/spot/spot.obj", kExact, kExact},
    {"meshes/cesium_man/CesiumMan.glb", kExact, kExact},
};

/// The mesh's own texture at the texel centres of a kSize image: bilinear, repeating.
WholeImage own_texture(const mesh::Mesh& mesh) {
  const auto material =
      std::find_if(mesh.materials.begin(), mesh.materials.end(),
                   [](const mesh::Material& m) { return m.textures[0].has_value(); });
  REQUIRE(material != mesh.materials.end());
  const WholeImage image = read_whole_image(mesh.images[material->textures[0]->image]);
  WholeImage out{kSize, kSize, 3, image.linear, {}};
  const auto fetch = [&](std::int64_t x, std::int64_t y, std::size_t c) {
    const std::int64_t w = image.width, h = image.height;
    return image.colour(static_cast<std::size_t>((y + h) % h * w + (x + w) % w), c);
  };
  for (std::uint32_t y = 0; y < kSize; ++y) {
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const double tx = (x + 0.5) / kSize * image.width - 0.5;
      const double ty = (y + 0.5) / kSize * image.height - 0.5;
      const auto left = static_cast<std::int64_t>(std::floor(tx));
      const auto top = static_cast<std::int64_t>(std::floor(ty));
      const double u = tx - static_cast<double>(left), v = ty - static_cast<double>(top);
      for (std::size_t c = 0; c < 3; ++c) {
        out.samples.push_back(
            (1 - v) * ((1 - u) * fetch(left, top, c) + u * fetch(left + 1, top, c)) +
            v * ((1 - u) * fetch(left, top + 1, c) + u * fetch(left + 1, top + 1, c)));
      }
    }
  }
  return out;
}

/// u, v -> 1 - v, u: the picture turns by 90 degrees.
void turn(mesh::Mesh& mesh) {
  for (Vec2f& uv : mesh.uv_sets[0]) uv = {1 - uv.y, uv.x};
}
WholeImage turned_back(const WholeImage& image) {
  WholeImage out = image;
  for (std::size_t y = 0; y < kSize; ++y) {
    for (std::size_t x = 0; x < kSize; ++x) {
      for (std::size_t c = 0; c < image.channels; ++c)
        out.samples[(y * kSize + x) * image.channels + c] = image.at(x * kSize + kSize - 1 - y, c);
    }
  }
  return out;
}

}  // namespace

TEST_CASE("a mesh onto itself gives its own texture back", "[golden][external]") {
  const auto data = test_data();
  if (!data) return;
  const Model model = GENERATE(from_range(std::begin(kModels), std::end(kModels)));
  const std::string path = (*data / model.path).string();
  const std::string name = std::filesystem::path(path).stem().string();
  const mesh::Mesh mesh = io::read_mesh(path);
  const WholeImage expected = own_texture(mesh);
  const TargetRaster raster = raster_target(mesh, kSize, kSize);
  const auto band = border_band(mesh, raster);
  std::vector<std::uint8_t> whole(raster.owner.size());
  for (std::size_t i = 0; i < whole.size(); ++i) whole[i] = raster.covered(i) ? 1 : 0;

  const TempFolder folder;
  auto options = golden_options(path, path, folder.file("out.png"));
  options.image.size = ImageSize{kSize, kSize};
  const auto check = [&](const std::string& how, bool is_turned) {
    const Report report = transfer(options);
    WholeImage out = read_whole_image(options.output);
    if (is_turned) out = turned_back(out);
    const Score all = score(out, expected, whole), edge = score(out, expected, band);
    figure(name + " " + how + " whole dB", all.psnr_db);
    figure(name + " " + how + " band dB", edge.psnr_db);
    CAPTURE(name, how);
    CHECK(report.target_empty == 0);
    CHECK(edge.texels > 1000);
    CHECK(all.psnr_db >= model.whole_db);
    CHECK(edge.psnr_db >= model.band_db);
  };
  check("as it is", false);
  keep_picture(options.output, name + ".png");
  options.search.max_distance = Length{8, true};
  check("at 8 %", false);
  options.search.max_distance = Length{5, true};

  mesh::Mesh shuffled = mesh;
  std::mt19937 random(5);
  for (std::size_t i = shuffled.triangles.size() - 1; i > 0; --i)
    std::swap(shuffled.triangles[i], shuffled.triangles[random() % (i + 1)]);
  turn(shuffled);
  options.targets = {folder.file("shuffled.glb")};
  write_glb(options.targets.front(), shuffled);
  check("shuffled and turned", true);
}

TEST_CASE("a head's texels as Gaussians give it back as the paper says", "[golden][external]") {
  const auto data = test_data();
  if (!data) return;
  const std::string heads = (*data / "heads").string(), head = heads + "/head_src.glb";
  const TempFolder folder;
  const WholeImage texture = read_whole_image(heads + "/head_src_1k.png");
  auto options = golden_options(head, head, folder.file("out.png"));
  options.mesh.method = Method::gaussian;
  options.image.size = ImageSize{texture.width, texture.height};
  transfer(options);
  const WholeImage coverage = read_whole_image(options.image.coverage_output);
  std::vector<std::uint8_t> mask(coverage.samples.size());
  for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = coverage.samples[i] > 0.5 ? 1 : 0;
  const Score s = score(read_whole_image(options.output), texture, mask);
  keep_picture(options.output, "head_as_gaussians.png");
  figure("head as Gaussians, similarity %", 100 * s.similarity);
  figure("head as Gaussians dB", s.psnr_db);
  CHECK(s.texels == 1008000);
  CHECK(s.similarity >= 0.991);  // 99.16 % was measured; the paper: about 98 %
  CHECK(s.psnr_db >= 34.5);      // 34.75 was measured
}

TEST_CASE("a head written as Gaussians for a transfer gives its texture back",
          "[golden][external]") {
  const auto data = test_data();
  if (!data) return;
  const std::string heads = (*data / "heads").string(), head = heads + "/head_src.glb";
  const TempFolder folder;
  GaussiansOptions written;
  written.source = head;
  written.output = folder.file("head.ply");
  written.sigma_texels = 0.25;
  written.sharpen = 1;
  written.resources.use_cache = false;
  written.resources.memory_bytes = 512 << 20;
  gaussians(written);
  const WholeImage texture = read_whole_image(heads + "/head_src_1k.png");
  auto options = golden_options(written.output, head, folder.file("out.png"));
  options.image.size = ImageSize{texture.width, texture.height};
  CHECK(transfer(options).target_empty == 0);
  const WholeImage coverage = read_whole_image(options.image.coverage_output);
  std::vector<std::uint8_t> mask(coverage.samples.size());
  for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = coverage.samples[i] > 0.5 ? 1 : 0;
  const Score s = score(read_whole_image(options.output), texture, mask);
  figure("head through a file of Gaussians dB", s.psnr_db);
  CHECK(s.texels == 1008000);
  CHECK(s.psnr_db >= 38.6);  // 38.81 was measured; 29.08 with the defaults, which are for viewers
}

}  // namespace pounce::test
