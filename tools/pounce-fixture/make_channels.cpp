// SPDX-License-Identifier: Apache-2.0
//
// Four curved patches whose UV sets are all affine in the patch's own coordinates, on the same
// vertices and triangles in source and target. So the source UV of a target texel is known exactly:
// target UV -> patch coordinates -> source UV set -> texture transform. The truth is the bilinear
// lookup there, in double precision, of the source image as stored (8 bit).
#include <algorithm>
#include <array>
#include <cmath>

#include "grid_chart.h"
#include "output_file.h"
#include "recipes.h"
#include "render_image.h"
#include "texture_pattern.h"
#include "write_glb.h"

namespace pounce::fixture {
namespace {

constexpr std::uint32_t kCells = 14;
constexpr double kPi = 3.14159265358979323846;
constexpr std::size_t kTargetSet =
    2;  // UV sets of a patch here: 0 and 1 of the source, 2 = the target's

/// KHR_texture_transform of the occlusion texture: scale, then turn, then move.
constexpr double kOffset[] = {0.31, 0.17}, kRotation = 0.4, kScale[] = {0.80, 0.70};

Vec2d occlusion_transform(Vec2d uv) {
  const double x = kScale[0] * uv.x, y = kScale[1] * uv.y;
  const double c = std::cos(kRotation), s = std::sin(kRotation);
  return {c * x + s * y + kOffset[0],
          -s * x + c * y + kOffset[1]};  // v down: positive = counter-clockwise
}

/// What is painted, as one image in UV space, tiling; value of channel c at (u, v).
using Paint = Rgb (*)(double u, double v);

Rgb paint_colour(double u, double v) {  // the head's picture as a map of the world
  const double longitude = (u - 0.5) * 2 * kPi, latitude = (0.5 - v) * kPi,
               ring = std::cos(latitude);
  return pattern_colour(
      {std::sin(longitude) * ring, std::sin(latitude), std::cos(longitude) * ring});
}

Rgb paint_metallic_roughness(double u, double v) {
  const auto roughness = static_cast<float>(0.5 + 0.3 * cosine_turns(3 * u + 2 * v));
  const bool metal = cosine_turns(6 * u) * cosine_turns(5 * v) > 0.2;
  return {0, roughness, metal ? 1.0F : 0.0F};
}

Rgb paint_occlusion(double u, double v) {
  const double waves = cosine_turns(4 * u - 3 * v) + cosine_turns(11 * u + 7 * v) * 0.5;
  return {static_cast<float>(0.6 + 0.2 * waves), 0, 0};
}

struct ChannelImage {
  const char* name;
  std::uint32_t size, channels;
  std::size_t uv_set;
  bool transformed;
  bool is_data;
  Paint paint;
};

constexpr ChannelImage kImages[] = {
    {"baseColor", 1024, 3, 0, false, false, paint_colour},
    {"metallicRoughness", 256, 3, 0, false, true, paint_metallic_roughness},
    {"occlusion", 512, 1, 1, true, true, paint_occlusion},
};

/// The source image's texel as stored, coordinates wrapped (repeat).
Rgb stored_texel(const ChannelImage& image, long x, long y) {
  const long size = image.size;
  x = (x % size + size) % size;
  y = (y % size + size) % size;
  Rgb value = image.paint((static_cast<double>(x) + 0.5) / image.size,
                          (static_cast<double>(y) + 0.5) / image.size);
  for (float& v : value) v = std::floor(std::clamp(v, 0.0F, 1.0F) * 255.0F + 0.5F) / 255.0F;
  return value;
}

Rgb bilinear(const ChannelImage& image, Vec2d uv) {
  const double x = uv.x * image.size - 0.5, y = uv.y * image.size - 0.5;
  const double left = std::floor(x), top = std::floor(y), fx = x - left, fy = y - top;
  std::array<double, 3> sum{};
  for (const int dy : {0, 1}) {
    for (const int dx : {0, 1}) {
      const double weight = (dx != 0 ? fx : 1 - fx) * (dy != 0 ? fy : 1 - fy);
      const Rgb texel =
          stored_texel(image, static_cast<long>(left) + dx, static_cast<long>(top) + dy);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * static_cast<double>(texel[c]);
    }
  }
  return {static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2])};
}

/// A 2 x 2 arrangement of curved square patches, apart from each other, with their three UV sets.
GridMesh patches() {
  struct Layout {
    Vec2d corner, size;
    int turns;
  };
  // Patch 2 lies in another tile of UV set 0, patch 3 across its right border: both wrap.
  static constexpr Layout kSets[3][4] = {{{{0.0303, 0.0303}, {0.42, 0.60}, 0},
                                          {{0.5203, 0.0303}, {0.36, 0.28}, 1},
                                          {{1.5203, -0.6497}, {0.36, 0.28}, 2},
                                          {{0.5203, 0.7003}, {0.60, 0.26}, 0}},
                                         {{{0.0503, 0.0403}, {0.40, 0.43}, 3},
                                          {{0.5203, 0.0403}, {0.43, 0.43}, 0},
                                          {{0.0503, 0.5203}, {0.43, 0.43}, 1},
                                          {{0.5203, 0.5203}, {0.43, 0.40}, 2}},
                                         {{{0.0203, 0.0203}, {0.46, 0.46}, 1},
                                          {{0.6003, 0.1003}, {0.30, 0.30}, 0},
                                          {{0.0203, 0.5203}, {0.46, 0.44}, 0},
                                          {{0.5203, 0.5203}, {0.46, 0.46}, 3}}};
  GridMesh mesh;
  for (std::size_t k = 0; k < 4; ++k) {
    GridChart chart;
    chart.name = "patch";
    chart.columns = chart.rows = kCells;
    for (const auto& set : kSets) {
      chart.uv_sets.push_back(fit_frame(kCells, kCells, set[k].corner, set[k].size, set[k].turns));
    }
    const double x0 = 1.3 * static_cast<double>(k % 2), y0 = 1.3 * static_cast<double>(k / 2);
    chart.point = [=](std::uint32_t column, std::uint32_t row) {
      const double x = column / (1.0 * kCells), y = 1 - row / (1.0 * kCells);
      const double dx = 0.5 * (0.5 - x), dy = 0.3 * (0.5 - y);  // slopes of the paraboloid below
      return SurfacePoint{{x0 + x, y0 + y, 0.25 * x * (1 - x) + 0.15 * y * (1 - y)},
                          normalized({-dx, -dy, 1})};
    };
    mesh.push_back(std::move(chart));
  }
  // One chart is turned by an angle that is no quarter turn.
  mesh[1].uv_sets[kTargetSet] = turned(mesh[1].uv_sets[kTargetSet], kCells, kCells, 13, 1);
  return mesh;
}

GridMesh with_uv_sets(GridMesh mesh, std::size_t first, std::size_t count) {
  for (GridChart& chart : mesh) {
    const auto begin = chart.uv_sets.begin() + static_cast<std::ptrdiff_t>(first);
    chart.uv_sets = std::vector<UvFrame>(begin, begin + static_cast<std::ptrdiff_t>(count));
  }
  return mesh;
}

std::string write_source(const std::string& folder, const GridMesh& mesh) {
  GlbWriter glb;
  std::vector<std::unique_ptr<RemoveAtEnd>> images;
  for (const ChannelImage& image : kImages) {
    images.push_back(std::make_unique<RemoveAtEnd>(folder + "/embedding." + image.name + ".png"));
    render_image(images.back()->path(),
                 {.width = image.size,
                  .height = image.size,
                  .channels = image.channels,
                  .is_data = image.is_data},
                 [&](std::uint32_t y, std::span<float> row) {
                   for (std::uint32_t x = 0; x < image.size; ++x) {
                     const Rgb texel = stored_texel(image, x, y);
                     std::copy_n(texel.begin(), image.channels,
                                 row.begin() + std::ptrdiff_t{x} * image.channels);
                   }
                 });
    glb.add_embedded_texture(images.back()->path());
  }
  const auto material = static_cast<int>(glb.add_material("patches", 0));
  glb.json()["extensionsUsed"] = {"KHR_texture_transform"};
  GlbWriter::Json& m = glb.json()["materials"][0];
  m["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", 1}};
  m["pbrMetallicRoughness"]["metallicFactor"] = 1;
  m["occlusionTexture"] = {{"index", 2}, {"texCoord", 1}};
  m["occlusionTexture"]["extensions"]["KHR_texture_transform"] = {
      {"offset", {kOffset[0], kOffset[1]}},
      {"rotation", kRotation},
      {"scale", {kScale[0], kScale[1]}}};
  glb.add_mesh("channels_src");
  const GridMesh with_source_uvs = with_uv_sets(mesh, 0, 2);
  glb.add_primitive(with_source_uvs, material);
  glb.write(folder + "/channels_src.glb");
  return folder + "/channels_src.glb";
}

std::string write_target(const std::string& folder, const GridMesh& mesh) {
  GlbWriter glb;
  glb.add_mesh("channels_target");
  const GridMesh with_target_uvs = with_uv_sets(mesh, kTargetSet, 1);
  glb.add_primitive(with_target_uvs, -1);
  glb.write(folder + "/channels_target.glb");
  return folder + "/channels_target.glb";
}

std::string write_truth(const std::string& folder, const GridMesh& mesh,
                        const ChannelImage& image) {
  const std::string path = folder + "/channels_target.truth." + image.name + ".png";
  const std::uint32_t channels = image.channels + 1;
  const auto truth_row = [&](std::uint32_t y, std::span<float> row) {
    ChartFinder finder(mesh, kTargetSet);
    std::fill(row.begin(), row.end(), 0.0F);
    for (std::uint32_t x = 0; x < image.size; ++x) {
      const auto found = finder.find({(x + 0.5) / image.size, (y + 0.5) / image.size});
      if (!found.inside) continue;
      const Vec2d uv = mesh[found.chart].uv_sets[image.uv_set].to_uv(found.grid);
      const Rgb value = bilinear(image, image.transformed ? occlusion_transform(uv) : uv);
      const auto texel = row.begin() + std::ptrdiff_t{x} * channels;
      std::copy_n(value.begin(), image.channels, texel);
      texel[image.channels] = 1.0F;
    }
  };
  render_image(path,
               {.width = image.size,
                .height = image.size,
                .channels = channels,
                .depth = Depth::u16,
                .is_data = image.is_data},
               truth_row);
  return path;
}

}  // namespace

Paths make_channels(const std::string& folder) {
  make_folder(folder);
  const GridMesh mesh = patches();
  Paths written{write_source(folder, mesh), write_target(folder, mesh)};
  for (const ChannelImage& image : kImages) written.push_back(write_truth(folder, mesh, image));
  return written;
}

}  // namespace pounce::fixture
