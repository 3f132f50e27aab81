// SPDX-License-Identifier: Apache-2.0
//
// What is averaged where a target texel covers several of the source's: whatever an image holds.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>

#include "core/colour_space.h"
#include "shading/result_block.h"
#include "store/blocks/colour_store.h"
#include "support/flat_scene.h"

namespace pounce::test {
namespace {

/// Two values that alternate from texel to texel.
WholeImage checker(std::uint32_t size, const std::vector<double>& even,
                   const std::vector<double>& odd) {
  WholeImage image{size, size, static_cast<std::uint32_t>(even.size()), false, {}};
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x) {
      const auto& texel = (x + y) % 2 == 0 ? even : odd;
      image.samples.insert(image.samples.end(), texel.begin(), texel.end());
    }
  }
  return image;
}

/// The largest difference of a channel from what it is everywhere.
double off(const WholeImage& image, std::size_t channel, double value) {
  double most = 0;
  for (std::size_t t = 0; t < std::size_t{image.width} * image.height; ++t)
    most = std::max(most, std::abs(image.at(t, channel) - value));
  return most;
}

double worst(const WholeImage& a, const WholeImage& b) {
  REQUIRE(a.samples.size() == b.samples.size());
  double most = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i)
    most = std::max(most, std::abs(a.samples[i] - b.samples[i]));
  return most;
}

constexpr ImageSize kSizes[] = {{200, 170}, {64, 64}, {37, 29}, {256, 11}};

}  // namespace

TEST_CASE("floats are averaged as floats: bright, negative, and exact where all are one",
          "[flow]") {
  const Depth depth = GENERATE(Depth::float32, Depth::half);
  FlatScene scene("skin.exr");
  scene.options.output = scene.folder.file("out.exr");
  WholeImage skin = waves(256, 256);
  for (double& v : skin.samples) v = 50 * v - 10;
  write_floats(scene.texture(), skin, depth);
  for (const ImageSize size : {ImageSize{128, 128}, ImageSize{64, 64}, ImageSize{43, 50}}) {
    scene.options.image.size = size;
    transfer(scene.options);
    const double error =
        worst(read_whole_image(scene.options.output), box_means(skin, size.width, size.height));
    CAPTURE(depth_name(depth), size.width, size.height, error);
    CHECK(error <= 0.4);  // of 50
  }
  for (const double one : {40.0, -0.3, 6e-8}) {
    const double value = depth == Depth::half
                             ? double{half_to_float(float_to_half(static_cast<float>(one)))}
                             : double{static_cast<float>(one)};
    write_floats(scene.texture(), checker(256, {value, value, value}, {value, value, value}),
                 depth);
    for (const ImageSize size : kSizes) {
      scene.options.image.size = size;
      transfer(scene.options);
      CAPTURE(depth_name(depth), size.width, size.height, value);
      CHECK(off(read_whole_image(scene.options.output), 1, value) == 0);
    }
  }
}

TEST_CASE("16 bits keep 16 bits in the mean", "[flow]") {
  FlatScene scene("skin.tif");
  scene.options.output = scene.folder.file("out.tif");
  std::mt19937 random(3);
  WholeImage skin{256, 256, 3, false, {}};
  std::vector<std::uint16_t> samples;
  for (std::size_t i = 0; i < std::size_t{256} * 256 * 3; ++i) {
    samples.push_back(static_cast<std::uint16_t>(20000 + random() % 30));
    skin.samples.push_back(samples.back() / 65535.0);
  }
  io::ImageWriter writer(scene.texture(), {256, 256, 3, Depth::u16, false, false});
  writer.write_rows(256, reinterpret_cast<const std::byte*>(samples.data()));
  writer.commit();
  scene.options.image.size = ImageSize{64, 64};
  transfer(scene.options);
  const double error = worst(read_whole_image(scene.options.output), box_means(skin, 64, 64));
  CHECK(error <= 12.0 / 65535);  // an 8-bit step is 257
}

TEST_CASE("colours that are held times alpha are averaged so", "[flow]") {
  FlatScene scene("skin.exr");
  // Colour 1 where it is opaque, 0.25 where it is not: times alpha, 1 and 0.0625.
  write_floats(scene.texture(), checker(256, {1, 0.5, 0, 1}, {0.0625, 0.125, 0, 0.25}),
               Depth::float32);
  scene.options.output = scene.folder.file("out.exr");
  for (const ImageSize size : {ImageSize{128, 128}, ImageSize{64, 64}}) {
    scene.options.image.size = size;
    transfer(scene.options);
    mesh::ImageRef file;
    file.path = file.label = scene.options.output;
    io::ImageReader reader(file);
    reader.keep_premultiplied();
    REQUIRE(reader.info().channels == 4);
    std::vector<std::byte> rows(reader.row_bytes() * reader.info().height);
    reader.read_rows(reader.info().height, rows.data());
    double most = 0;
    const std::array<double, 4> mean = {0.53125, 0.3125, 0, 0.625};
    const std::size_t step = store::depth_bytes(reader.info().depth);
    for (std::size_t i = 0; i < rows.size() / step; ++i)
      most = std::max(
          most, std::abs(sample_value(reader.info().depth, rows.data() + i * step) - mean[i % 4]));
    CHECK(most <= 1e-6);
  }
  // Out of alpha again where the output holds colours without it.
  write_floats(scene.texture(), checker(256, {0.5, 0.25, 0, 1}, {0.125, 0.0625, 0, 0.25}),
               Depth::float32);
  scene.options.output = scene.folder.file("out.png");
  for (const ImageSize size : kSizes) {
    scene.options.image.size = size;
    transfer(scene.options);
    const WholeImage out = read_whole_image(scene.options.output);
    REQUIRE(out.channels == 4);
    CAPTURE(size.width, size.height);
    CHECK(off(out, 0, linear_to_srgb(0.5)) <= 0.51 / 255);
    CHECK(off(out, 1, linear_to_srgb(0.25)) <= 0.51 / 255);
  }
}

TEST_CASE("a normal map that is held times alpha is read without it", "[flow]") {
  FlatScene scene("skin.exr");
  // (0.6, 0, 0.8) everywhere, whatever the alpha beside it.
  write_floats(scene.texture(), checker(256, {0.8, 0.5, 0.9, 1}, {0.2, 0.125, 0.225, 0.25}),
               Depth::half);
  scene.options.material.textures = {{Channel::normal, scene.texture()}};
  scene.options.channels.transferred = {Channel::normal};
  scene.options.output = scene.folder.file("out.exr");
  for (const ImageSize size : {ImageSize{256, 256}, ImageSize{100, 100}, ImageSize{400, 400}}) {
    scene.options.image.size = size;
    transfer(scene.options);
    const WholeImage out = read_whole_image(scene.options.output);
    CAPTURE(size.width);
    CHECK(off(out, 0, 0.8) <= 2e-3);
    CHECK(off(out, 1, 0.5) <= 2e-3);
    CHECK(off(out, 2, 0.9) <= 2e-3);
  }
}

TEST_CASE("a mean is taken of what the file holds, and converted once", "[flow]") {
  FlatScene scene("skin.png");
  write_whole_image(scene.texture(), checker(256, {1, 1, 1}, {0, 0, 0}));
  scene.options.output = scene.folder.file("out.exr");
  scene.options.image.colour_space = GENERATE("", "acescg");
  for (const ImageSize size : {ImageSize{128, 128}, ImageSize{64, 64}}) {
    scene.options.image.size = size;
    transfer(scene.options);
    const WholeImage out = read_whole_image(scene.options.output);
    // Grey is grey in any primaries: linear 0.5 is what sRGB-coded 0.5 means.
    CAPTURE(scene.options.image.colour_space, size.width);
    CHECK(off(out, 1, srgb_to_linear(0.5)) <= 0.004);
  }
}

TEST_CASE("a coarse normal map holds the mean of the normals under its texels", "[flow]") {
  FlatScene scene("map.png", Channel::normal);
  WholeImage map{256, 256, 3, false, {}};
  const auto unit = [](Vec3d v) { return v * (1 / length(v)); };
  std::vector<Vec3d> normals;
  for (std::uint32_t y = 0; y < map.height; ++y) {
    for (std::uint32_t x = 0; x < map.width; ++x) {
      const double turn = 2 * std::numbers::pi / 256;
      const double grain = 0.4 * ((7 * x + 13 * y) % 5) - 0.8;  // what a point lookup would see
      const Vec3d n = unit({0.5 * std::sin(3 * turn * x) + grain, 0.5 * std::cos(2 * turn * y), 1});
      normals.push_back(n);
      for (const double v : {n.x, n.y, n.z}) map.samples.push_back(0.5 + 0.5 * v);
    }
  }
  write_whole_image(scene.texture(), map);
  for (const std::uint32_t size : {128U, 64U, 32U}) {
    scene.options.image.size = ImageSize{size, size};
    transfer(scene.options);
    const WholeImage out = read_whole_image(scene.options.output);
    const std::uint32_t n = 256 / size;
    double mean = 0;
    for (std::uint32_t y = 0; y < size; ++y) {
      for (std::uint32_t x = 0; x < size; ++x) {
        Vec3d sum{};
        for (std::uint32_t j = 0; j < n; ++j) {
          for (std::uint32_t i = 0; i < n; ++i) sum = sum + normals[(y * n + j) * 256 + x * n + i];
        }
        const std::size_t at = std::size_t{y} * size + x;
        const Vec3d shown = {2 * out.at(at, 0) - 1, 2 * out.at(at, 1) - 1, 2 * out.at(at, 2) - 1};
        CHECK(std::abs(length(shown) - 1) <= 0.02);
        mean += std::acos(std::min(1.0, dot(unit(shown), unit(sum)))) * 180 / std::numbers::pi;
      }
    }
    mean /= size * size;
    std::printf("FIGURE normal footprint %u %.3f\n", size, mean);
    CAPTURE(size, mean);
    CHECK(mean <= 0.5);
  }
}

TEST_CASE("tiles of a source are averaged at their own sizes, each clamped at its border",
          "[flow]") {
  FlatScene scene("skin.<UDIM>.png", Channel::base_color, flat_sheet(2, 1));
  const std::array<WholeImage, 2> tiles = {waves(256, 128), waves(96, 512)};
  for (std::size_t i = 0; i < tiles.size(); ++i)
    write_whole_image(scene.folder.file("skin." + std::to_string(1001 + i) + ".png"), tiles[i]);
  scene.options.image.size = ImageSize{96, 64};
  transfer(scene.options);
  const WholeImage out = read_whole_image(scene.options.output);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const WholeImage truth = box_means(tiles[i], 48, 64);
    WholeImage part{48, 64, 3, false, {}};
    for (std::size_t y = 0; y < 64; ++y) {
      for (std::size_t x = 0; x < std::size_t{48} * 3; ++x)
        part.samples.push_back(out.samples[(y * 96 + 48 * i) * 3 + x]);
    }
    const Score s = score(part, truth, std::vector<std::uint8_t>(std::size_t{48} * 64, 1));
    CAPTURE(i, s.psnr_db);
    CHECK(s.psnr_db >= 35);
  }
}

}  // namespace pounce::test
