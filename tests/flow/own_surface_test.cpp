// SPDX-License-Identifier: Apache-2.0
//
// A mesh onto itself: each texel must find the triangle that it lies on, whatever its normals say
// and however close the next triangle is.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "pounce/transfer.h"
#include "support/gltf_builder.h"
#include "support/reference_transfer.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr std::array<double, 3> kWhite{1, 1, 1};

/// An image whose texels have one of two colours.
template <class Choose>
void write_picture(const std::string& path, std::uint32_t size, Choose colour_at) {
  WholeImage image{size, size, 3, false, {}};
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x) {
      for (const double v : colour_at(x, y)) image.samples.push_back(v);
    }
  }
  write_whole_image(path, image);
}

nlohmann::json textured_material(GltfBuilder& file, const std::string& image) {
  const int texture = file.push("textures", {{"source", file.push("images", {{"uri", image}})}});
  return file.push("materials",
                   {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
}

TransferOptions onto_itself(const std::string& mesh, const TempFolder& folder, std::uint32_t size) {
  TransferOptions options;
  options.source = mesh;
  options.targets = {mesh};
  options.output = folder.file("out.png");
  options.image.coverage_output = folder.file("coverage.png");
  options.image.size = ImageSize{size, size};
  options.resources.use_cache = false;
  options.resources.memory_bytes = 256 << 20;
  return options;
}

/// Covered texels that differ from what the mesh has there by more than `least` 255ths.
std::size_t wrong_texels(const TransferOptions& options, double least) {
  const WholeImage out = read_whole_image(options.output);
  const Reference reference(options, Channel::base_color, 3, false);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < reference.raster().owner.size(); ++i) {
    if (!reference.raster().covered(i)) continue;
    std::array<double, 3> own{};
    reference.own(i, own.data());
    double error = 0;
    for (std::size_t c = 0; c < 3; ++c) error = std::max(error, std::abs(out.at(i, c) - own[c]));
    wrong += error > least / 255 ? 1 : 0;
  }
  return wrong;
}

}  // namespace

TEST_CASE("texels on the edge of two materials take the one that they belong to", "[flow]") {
  // Two triangles make the unit square. Each material's image is white where the other triangle is,
  // and on the diagonal, which passes through texel centres, where its own triangle has them not.
  const bool turned = GENERATE(false, true), swapped = GENERATE(false, true);
  const std::uint32_t size = GENERATE(64U, 1000U);
  CAPTURE(turned, swapped, size);
  const TempFolder folder;
  GltfBuilder file;
  const int positions = file.add<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  const int normals = file.add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int uvs = file.add<float>(turned ? std::vector<float>{1, 1, 0, 1, 0, 0, 1, 0}
                                         : std::vector<float>{0, 0, 1, 0, 1, 1, 0, 1},
                                  "VEC2");
  std::array<std::vector<std::uint32_t>, 2> triangles{
      {{0, 1, 2}, {0, 2, 3}}};  // above and below the diagonal, or turned around
  if (swapped) std::swap(triangles[0], triangles[1]);
  std::array<int, 2> materials{};
  for (std::size_t m = 0; m < 2; ++m) {
    const std::string name = "m" + std::to_string(m) + ".png";
    materials[m] = textured_material(file, name);
    file.primitive({{"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", uvs}},
                   file.add(triangles[m], "SCALAR"))["material"] = materials[m];
  }
  const std::string path = file.write_glb(folder.file("square.glb"));
  const auto options = onto_itself(path, folder, size);
  // Which triangle has the diagonal is the raster's to say.
  for (const char* name : {"m0.png", "m1.png"})
    write_picture(folder.file(name), size, [](auto, auto) { return kWhite; });
  const TargetRaster raster = Reference(options, Channel::base_color, 3, false).raster();
  for (std::uint32_t m = 0; m < 2; ++m) {
    write_picture(
        folder.file("m" + std::to_string(m) + ".png"), size, [&](std::uint32_t x, std::uint32_t y) {
          const bool own = raster.owner[std::size_t{y} * size + x] == static_cast<std::int32_t>(m);
          return own ? std::array{1.0 - m, 0.2, 1.0 * m} : kWhite;
        });
  }
  const Report report = transfer(options);
  CHECK(report.target_empty == 0);
  const WholeImage out = read_whole_image(options.output);
  std::size_t white = 0;
  for (std::size_t i = 0; i < raster.owner.size(); ++i) white += out.at(i, 1) > 0.5 ? 1 : 0;
  CHECK(white == 0);
}

TEST_CASE("a surface of a triangle per texel and more takes its own materials", "[flow]") {
  // A bent sheet of squares of two triangles whose corners are texel centres, so that every centre
  // lies on six edges; every other square has another material. Each image is white where the other
  // material is.
  const std::uint32_t size = 200;
  const auto cells = static_cast<std::uint32_t>(GENERATE(199, 398));
  const TempFolder folder;
  GltfBuilder file;
  std::vector<float> positions, normals, uvs;
  for (std::uint32_t y = 0; y <= cells; ++y) {
    for (std::uint32_t x = 0; x <= cells; ++x) {
      const double u = (0.5 + x * 199.0 / cells) / size, v = (0.5 + y * 199.0 / cells) / size;
      const double z = 0.01 * std::sin(40 * u) * std::cos(31 * v);
      for (const double p : {u, 1 - v, z}) positions.push_back(static_cast<float>(p));
      for (const float n : {0.0F, 0.0F, 1.0F}) normals.push_back(n);
      for (const double w : {u, v}) uvs.push_back(static_cast<float>(w));
    }
  }
  std::array<std::vector<std::uint32_t>, 2> triangles;
  for (std::uint32_t y = 0; y < cells; ++y) {
    for (std::uint32_t x = 0; x < cells; ++x) {
      const std::uint32_t a = y * (cells + 1) + x, b = a + cells + 1;
      auto& list = triangles[(x + y) % 2];
      list.insert(list.end(), {a, b, b + 1, a, b + 1, a + 1});
    }
  }
  const int p = file.add<float>(positions, "VEC3"), n = file.add<float>(normals, "VEC3"),
            t = file.add<float>(uvs, "VEC2");
  for (std::size_t m = 0; m < 2; ++m) {
    file.primitive({{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", t}},
                   file.add(triangles[m], "SCALAR"))["material"] =
        textured_material(file, "m" + std::to_string(m) + ".png");
  }
  const std::string path = file.write_glb(folder.file("sheet.glb"));
  auto options = onto_itself(path, folder, size);
  options.resources.use_cache = true;  // scratch files need not be small
  options.resources.cache_dir = folder.file("cache");
  for (const char* name : {"m0.png", "m1.png"})
    write_picture(folder.file(name), size, [](auto, auto) { return kWhite; });
  const TargetRaster raster = Reference(options, Channel::base_color, 3, false).raster();
  const auto first_of_second = static_cast<std::int32_t>(triangles[0].size() / 3);
  for (std::int32_t m = 0; m < 2; ++m) {
    write_picture(folder.file("m" + std::to_string(m) + ".png"), size,
                  [&](std::uint32_t x, std::uint32_t y) {
                    const std::int32_t owner = raster.owner[std::size_t{y} * size + x];
                    const bool own = (owner >= first_of_second ? 1 : 0) == m;
                    return own ? std::array{1.0 - m, 0.2, 1.0 * m} : kWhite;
                  });
  }
  const Report report = transfer(options);
  CHECK(report.target_empty == 0);
  CHECK(report.target_store_bytes < 6 * report.target_texels);  // not as triangles
  const WholeImage out = read_whole_image(options.output);
  std::size_t white = 0;
  for (std::size_t i = 0; i < raster.owner.size(); ++i)
    white += raster.covered(i) && out.at(i, 1) > 0.5 ? 1 : 0;
  CHECK(white == 0);
}

namespace {

/// Thirteen planks whose normals lean from 60 to 120 degrees away from their plane, one way at one
/// end and another at the other. Half a texel below each lies one that faces the texels squarely.
std::string write_leaning_planks(const TempFolder& folder) {
  constexpr int kPlanks = 13;
  std::vector<float> positions, normals, uvs;
  std::vector<std::uint32_t> indices;
  const auto add_plank = [&](double y, double z, double row, double lean, double turn) {
    const auto first = static_cast<std::uint32_t>(positions.size() / 3);
    for (int corner = 0; corner < 4; ++corner) {
      const int along = corner % 2, across = corner / 2;
      const double direction = turn + (along != 0 ? 0.4 : -0.4);
      const double x = std::sin(lean) * std::cos(direction);
      for (const double v : {1.0 * along, y + 0.06 * across, z}) {
        positions.push_back(static_cast<float>(v));
      }
      for (const double v : {x, std::sin(lean) * std::sin(direction), std::cos(lean)})
        normals.push_back(static_cast<float>(v));
      uvs.push_back(static_cast<float>(0.02 + 0.96 * along));
      uvs.push_back(static_cast<float>((row + 0.1 + 0.8 * across) / (2 * kPlanks)));
    }
    for (const std::uint32_t k : {0U, 1U, 3U, 0U, 3U, 2U}) indices.push_back(first + k);
  };
  for (int k = 0; k < kPlanks; ++k) {
    const double lean = (60 + 5 * k) * std::numbers::pi / 180, turn = 0.9 * k;
    add_plank(0.08 * k, 0, 2 * k, lean, turn);
    add_plank(0.08 * k, -0.002, 2 * k + 1, 0, 0);
  }
  GltfBuilder file;
  const int p = file.add(positions, "VEC3"), n = file.add(normals, "VEC3");
  const int uv = file.add(uvs, "VEC2");
  auto& primitive = file.primitive({{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", uv}},
                                   file.add(indices, "SCALAR"));
  primitive["material"] = textured_material(file, "planks.png");
  write_picture(folder.file("planks.png"), 416, [](std::uint32_t x, std::uint32_t y) {
    const double row = y / 16;
    return std::array{row / 26, static_cast<int>(row) % 2 * 0.9, 0.3 + 0.3 * std::sin(x * 0.05)};
  });
  return file.write_glb(folder.file("planks.glb"));
}

}  // namespace

TEST_CASE("sheets that lie close are told apart, however far away something else is", "[flow]") {
  // Two sheets of 10 cm, a tenth of a millimetre apart, and one triangle that makes the mesh large.
  const float away = GENERATE(1.0F, 1e3F, 1e4F);
  CAPTURE(away);
  constexpr float kGap = 1e-4F, kSize = 0.1F;
  constexpr std::uint32_t kTexels = 128;
  const TempFolder folder;
  GltfBuilder file;
  std::vector<float> positions, normals, uvs;
  std::vector<std::uint32_t> triangles;
  const auto corner = [&](float x, float y, float z, float u, float v) {
    positions.insert(positions.end(), {x, y, z});
    normals.insert(normals.end(), {0, 0, 1});
    uvs.insert(uvs.end(), {u, v});
  };
  for (const float sheet : {0.0F, 1.0F}) {
    const float z = kGap * sheet, u = sheet / 2;
    const auto first = static_cast<std::uint32_t>(uvs.size() / 2);
    corner(0, 0, z, u, 0.9F), corner(kSize, 0, z, u + 0.45F, 0.9F);
    corner(kSize, kSize, z, u + 0.45F, 0), corner(0, kSize, z, u, 0);
    for (const std::uint32_t k : {0U, 1U, 2U, 0U, 2U, 3U}) triangles.push_back(first + k);
  }
  const auto first = static_cast<std::uint32_t>(uvs.size() / 2);
  corner(away, 0, 0, 0, 1), corner(away + 1, 0, 0, 0.9F, 1), corner(away, 1, 0, 0, 0.93F);
  for (const std::uint32_t k : {0U, 1U, 2U}) triangles.push_back(first + k);
  const int material = textured_material(file, "sheets.png");
  file.primitive({{"POSITION", file.add<float>(positions, "VEC3")},
                  {"NORMAL", file.add<float>(normals, "VEC3")},
                  {"TEXCOORD_0", file.add<float>(uvs, "VEC2")}},
                 file.add(triangles, "SCALAR"))["material"] = material;
  const std::string path = file.write_glb(folder.file("sheets.glb"));
  write_picture(folder.file("sheets.png"), kTexels, [](std::uint32_t x, std::uint32_t y) {
    if (y > kTexels * 11 / 12) return kWhite;  // far away, where coordinates are coarse
    return std::array{x < kTexels / 2 ? 1.0 : 0.0, y % 16 / 16.0, x % 16 / 16.0};
  });
  const auto options = onto_itself(path, folder, kTexels);
  CHECK(transfer(options).target_empty == 0);
  CHECK(wrong_texels(options, 8) == 0);
}

TEST_CASE("texels whose normals lean 60 to 120 degrees from their triangle find it", "[flow]") {
  const double max_angle = GENERATE(20.0, 80.0, 89.5);
  CAPTURE(max_angle);
  const TempFolder folder;
  auto options = onto_itself(write_leaning_planks(folder), folder, 416);
  options.search.max_angle_deg = max_angle;
  const Report report = transfer(options);
  CHECK(report.target_covered > 100000);
  CHECK(report.target_empty == 0);
  CHECK(wrong_texels(options, 1) == 0);
}

TEST_CASE("leaning normals agree with the brute force on another triangulation", "[flow]") {
  const TempFolder folder;
  auto options = onto_itself(write_leaning_planks(folder), folder, 420);
  GltfBuilder file;  // one sheet over all planks, leaning 35 degrees
  const int p = file.add<float>({0, 0, 0.003F, 1, 0, 0.001F, 1, 1, 0.003F, 0, 1, 0}, "VEC3");
  const int n =
      file.add<float>({0, .57F, .82F, 0, .57F, .82F, 0, .57F, .82F, 0, .57F, .82F}, "VEC3");
  const int uv = file.add<float>({0, 0, 1, 0, 1, 1, 0, 1}, "VEC2");
  file.primitive({{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", uv}},
                 file.add<std::uint32_t>({0, 1, 2, 0, 2, 3}, "SCALAR"));
  options.targets = {file.write_glb(folder.file("sheet.glb"))};
  options.search.max_angle_deg = 70;
  options.mesh.filter = Filter::tent;  // what the reference looks up
  transfer(options);
  const WholeImage out = read_whole_image(options.output);
  const WholeImage coverage = read_whole_image(options.image.coverage_output);
  const ReferenceResult expected = reference_transfer(options, Channel::base_color, 3, false);
  std::size_t found = 0, empty = 0, wrong = 0;
  for (std::size_t i = 0; i < expected.verdicts.size(); ++i) {
    if (expected.verdicts[i] == Verdict::ambiguous || expected.verdicts[i] == Verdict::coarse)
      continue;
    const bool is_found = expected.verdicts[i] == Verdict::found;
    (is_found ? found : empty) += 1;
    double error = (coverage.at(i, 0) > 0.5) == is_found ? 0 : 1;
    for (std::size_t c = 0; c < 3 && is_found; ++c)
      error = std::max(error, std::abs(out.at(i, c) - expected.samples[3 * i + c]));
    wrong += error > 0.502 / 255 ? 1 : 0;
  }
  CHECK(found > 5000);
  CHECK(empty > 500);
  CHECK(wrong == 0);
}

TEST_CASE("texels near an edge are averaged over their own triangle", "[flow]") {
  // Columns of squares as wide as each other in the image, and by turns 1 and 4 wide in space. They
  // stand 1500 from the origin, where single precision knows a texel to .02 of its edge. Who takes
  // a texel of a wide column for a narrow one's takes four texels' mean.
  const std::uint32_t size = 256;
  constexpr std::uint32_t kColumns = 44, kRows = 40;
  const TempFolder folder;
  GltfBuilder file;
  std::vector<float> positions, normals, uvs;
  std::vector<std::uint32_t> narrow, wide;
  for (std::uint32_t column = 0; column < kColumns; ++column) {
    const bool is_narrow = column % 2 == 0;
    const double left = column / 2 * 1.25 + (is_narrow ? 0 : 0.25), width = is_narrow ? 0.25 : 1;
    const double middle = column < kColumns / 2 ? -1500 : 1500;
    const auto first = static_cast<std::uint32_t>(positions.size() / 3);
    for (std::uint32_t y = 0; y <= kRows; ++y) {
      for (const double side : {0.0, 1.0}) {
        const double x = middle + 5.37 / size * (left + side * width);
        for (const double v : {x, 5.91 / size * y, 0.0}) positions.push_back(static_cast<float>(v));
        for (const float n : {0.0F, 0.0F, 1.0F}) normals.push_back(n);
        uvs.push_back(static_cast<float>((3 + 5.37 * (column + side)) / size));
        uvs.push_back(static_cast<float>((3 + 5.91 * (kRows - y)) / size));
      }
    }
    std::vector<std::uint32_t>& triangles = is_narrow ? narrow : wide;
    for (std::uint32_t a = first; a < first + 2 * kRows; a += 2)
      triangles.insert(triangles.end(), {a, a + 1, a + 3, a, a + 3, a + 2});
  }
  const auto first_wide = static_cast<std::int32_t>(narrow.size() / 3);
  narrow.insert(narrow.end(), wide.begin(), wide.end());
  const int p = file.add<float>(positions, "VEC3"), n = file.add<float>(normals, "VEC3"),
            t = file.add<float>(uvs, "VEC2");
  file.primitive({{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", t}},
                 file.add(narrow, "SCALAR"))["material"] = textured_material(file, "waves.png");
  write_picture(folder.file("waves.png"), size, [](std::uint32_t x, std::uint32_t y) {
    return std::array{0.5 + 0.4 * std::sin(x * 0.9), 0.5 + 0.4 * std::sin(y * 0.9), 0.5};
  });
  const std::string path = file.write_glb(folder.file("columns.glb"));
  const auto options = onto_itself(path, folder, size);
  transfer(options);
  const WholeImage out = read_whole_image(options.output);
  const Reference reference(options, Channel::base_color, 3, false);
  std::size_t wrong = 0, seen = 0;
  double worst = 0;
  for (std::size_t i = 0; i < reference.raster().owner.size(); ++i) {
    if (!reference.raster().covered(i) || reference.raster().owner[i] < first_wide) continue;
    ++seen;
    std::array<double, 3> own{};
    reference.own(i, own.data());
    double error = 0;
    for (std::size_t c = 0; c < 3; ++c) error = std::max(error, std::abs(out.at(i, c) - own[c]));
    wrong += error > 8.0 / 255 ? 1 : 0;
    worst = std::max(worst, error);
  }
  CAPTURE(worst * 255, seen);
  CHECK(seen > 20000);
  CHECK(wrong == 0);
}

}  // namespace pounce::test
