// SPDX-License-Identifier: Apache-2.0
//
// One scene in every encoding gives one picture, within what each encoding's steps can move.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>

#include "io/splats/scene.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/splat_encodings.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

/// How far pictures are apart, in 255ths.
struct Apart {
  double largest = 0, mean = 0;
};

Apart apart(const WholeImage& a, const WholeImage& b) {
  REQUIRE(a.samples.size() == b.samples.size());
  Apart out;
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    const double d = 255 * std::abs(a.samples[i] - b.samples[i]);
    out.largest = std::max(out.largest, d);
    out.mean += d / static_cast<double>(a.samples.size());
  }
  return out;
}

/// Needles, a little tilted, on the square (-1..1)^2 of the plane z = 0, in colours that go over
/// into each other as those of a surface do; within the range of every format. There is one layer:
/// with two, a texel between them may take the other for a step of any size.
Scene capture() {
  Scene scene = random_scene(2000, 11);
  for (SceneSplat& s : scene) {
    s.mean = {s.mean[0] * 1.3F / 3, s.mean[1] * 1.3F / 3, s.mean[2] * 0.003F / 3};
    const float size = -2.3F + 0.15F * (s.log_sigma[0] + 4);
    s.log_sigma = {size, size - 1.2F, size - 2};
    const float length = std::sqrt(s.q[0] * s.q[0] + s.q[3] * s.q[3] +
                                   0.0009F * (s.q[1] * s.q[1] + s.q[2] * s.q[2]));
    s.q = {s.q[0] / length, 0.03F * s.q[1] / length, 0.03F * s.q[2] / length, s.q[3] / length};
    for (std::size_t c = 0; c < 3; ++c)
      s.dc[c] = std::sin(3 * s.mean[0] + static_cast<float>(c)) * std::cos(2 * s.mean[1]) +
                0.2F * s.dc[c];
    for (float& v : s.rest) v *= 0.5F;
  }
  return scene;
}

TransferOptions picture_of(const TempFolder& folder, const std::string& source) {
  TransferOptions options;
  options.source = source;
  options.targets = {folder.file("target.obj")};
  options.output = folder.file("out.png");
  options.image.depth = Depth::u16;
  options.image.size = ImageSize{128, 128};
  options.splats.look = Look::normal;  // where each format's steps were measured
  options.resources.use_cache = false;
  options.resources.threads = 2;
  return options;
}

WholeImage picture(const TransferOptions& options) {
  const Report report = transfer(options);
  CHECK(report.target_empty == 0);
  CHECK(report.source_filtered.empty());
  return read_whole_image(options.output);
}

}  // namespace

TEST_CASE("one scene in nineteen encodings gives one picture", "[flow]") {
  // What half a step of a value moves a texel by, in 255ths: colour by itself, a coefficient of
  // degree 1 by 2/3 (--sh mean) of 0.489 * 255 = 83 times itself, sizes and places by the change of
  // weights, for which a texel has some ten Gaussians. Bounds are about 1.4 times what was
  // measured.
  const Apart spz_early{6, 0.62}, spz{6, 0.42}, sog{3.2, 0.4};
  const std::map<std::string, Apart> bounds{
      {"3DGS PLY of doubles", {0, 0}},
      // 11 bits: colour 0.05, sizes 0.1 %, means 0.0005 where a needle's sigma is 0.03.
      {"3DGS PLY of halves", {1.3, 0.03}},
      // Colour 0.43, a coefficient 1/64 or 1.3; means 0.0013; opacity 0.2 %.
      {"SuperSplat compressed PLY", {3.2, 0.36}},
      // Colour 0.94, a coefficient 1/256 or 0.32; sizes 3 %; rotations 0.25 degrees, up to 3.5 in
      // versions 1 and 2.
      {"SPZ v1", spz_early},
      {"SPZ v2", spz_early},
      {"SPZ v3", spz},
      {"SPZ v4", spz},
      {"glTF (KHR_gaussian_splatting_compression_spz_2)", spz_early},
      // Colour 0.42, a coefficient 1/255 or 0.33; sizes 0.8 %; rotations 1.1 degrees.
      {"SOG v1 (a folder)", sog},
      {"SOG v1 (bundled)", sog},
      {"SOG v2 (a folder)", sog},
      {"SOG v2 (bundled)", sog},
      // Nothing but the last places of sigma, whose logarithm the PLY has.
      {"glTF (KHR_gaussian_splatting)", {0.1, 0.001}},
      // Means 0.00006, sizes up to 0.1 %, opacity 0.2 %.
      {"glTF (KHR_gaussian_splatting), quantised", {1.3, 0.06}},
      // Colour 0.5, opacity 0.2 %, rotations 0.8 degrees.
      {".splat", {2.7, 0.35}},
      // Colour 0.5, opacity 0.2 %; from level 1 on means 0.00006 and halves; at level 2 a
      // coefficient 0.006 or 0.49.
      {".ksplat (level 0)", {1, 0.12}},
      {".ksplat (level 1)", {2.4, 0.14}},
      {".ksplat (level 2)", {2.4, 0.17}},
  };
  const TempFolder folder;
  std::ofstream(folder.file("target.obj"))
      << "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
         "f 1/1 2/2 3/3 4/4\n";
  const Scene scene = capture();
  TransferOptions options = picture_of(folder, folder.file("floats.ply"));
  std::ofstream(options.source, std::ios::binary) << ply_bytes(scene, false);
  const WholeImage with = picture(options);
  options.splats.harmonics = SphericalHarmonics::dc;
  const WholeImage without = picture(options);
  CHECK(apart(with, without).mean > 3);  // harmonics are seen
  std::size_t compared = 0;
  for_each_encoding(scene, [&](const SplatEncoding& encoding) {
    CAPTURE(encoding.format);
    const std::string named = io::open_splat_scene(encoding.path, {})->info().format;
    CAPTURE(named);
    CHECK(encoding.format.starts_with(named));
    const Apart found =
        apart(picture(picture_of(folder, encoding.path)), encoding.has_harmonics ? with : without);
    std::printf("FIGURE %s: largest difference %.2f/255, mean %.3f\n", encoding.format.c_str(),
                found.largest, found.mean);
    const Apart most = bounds.at(encoding.format);
    CHECK(found.largest <= most.largest);
    CHECK(found.mean <= most.mean);
    ++compared;
  });
  CHECK(compared == bounds.size());
}

TEST_CASE("the least memory that a plan names works for every encoding", "[flow]") {
  const TempFolder folder;
  std::ofstream(folder.file("target.obj"))
      << "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
         "f 1/1 2/2 3/3 4/4\n";
  for_each_encoding(capture(), [&](const SplatEncoding& encoding) {
    CAPTURE(encoding.format);
    TransferOptions options = picture_of(folder, encoding.path);
    options.resources.memory_bytes = plan(options).least_memory_bytes;
    CHECK(transfer(options).target_empty == 0);
    --options.resources.memory_bytes;
    CHECK(error_kind([&] { transfer(options); }) == static_cast<int>(ErrorKind::budget));
  });
}

TEST_CASE("a real scene in six formats gives one picture", "[flow][data][external]") {
  const auto data = test_data();
  if (!data) return;
  const std::string scene = (*data / "splats/playbot_lod3_converted/playbot_lod3.").string();
  const TempFolder folder;
  const auto picture_from = [&](const std::string& ending, const std::string& axes) {
    TransferOptions options = picture_of(folder, scene + ending);
    options.source_use.axes = axes;
    options.targets = {(*data / "meshes/playbot_proxy/playbot_proxy.glb").string()};
    options.image.size = ImageSize{512, 512};
    transfer(options);
    return read_whole_image(options.output);
  };
  const WholeImage floats = picture_from("ply", "");
  // Of a capture a texel in a hundred thousand lies between two layers and may take the other one,
  // so means alone are bounded. SPZ and glTF lie otherwise, so their harmonics are turned.
  const auto check = [&](const char* ending, const char* axes, double most) {
    const Apart found = apart(picture_from(ending, axes), floats);
    std::printf("FIGURE playbot %s: mean difference %.3f/255\n", ending, found.mean);
    CAPTURE(ending);
    CHECK(found.mean <= most);
  };
  check("compressed.ply", "", 0.9);
  check("v3.spz", "x,-y,-z", 0.9);
  check("v4.spz", "x,-y,-z", 0.9);
  check("sog", "", 0.8);
  check("glb", "-x,-y,z", 0.003);
}

}  // namespace pounce::test
