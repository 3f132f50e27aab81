// SPDX-License-Identifier: Apache-2.0
//
// Real meshes onto themselves, texel by texel: where the output is not what the mesh has there, a
// brute force with the same rule (tests/support/reference_transfer.h) must not do better.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "golden.h"
#include "support/reference_transfer.h"

namespace pounce::test {
namespace {

constexpr double kWrong = 8.0 / 255;
constexpr std::size_t kProbes = 300;  // texels that the brute force looks at anyway

struct Model {
  const char* path;
  const char* texture = nullptr;  ///< for meshes without one
  std::uint32_t size = 1024;
};
constexpr const char* kFace = "meshes/mediapipe_face/canonical_face_model_uv_visualization.png";
constexpr Model kModels[] = {
    {"meshes/cesium_man/CesiumMan.glb"},
    {"meshes/lee_perry_smith/LeePerrySmith_plain_textured.glb"},
    {"meshes/spot/spot.obj"},
    {"heads/head_src.glb"},
    {"meshes/duck/gltf/Duck.gltf"},
    {"meshes/spot_glb/cow.glb"},
    {"meshes/water_bottle/SpecGlossVsMetalRough.gltf"},
    {"meshes/multi_uv/MultiUVTest.gltf"},
    {"meshes/TextureTransformTest/TextureTransformTest.gltf"},
    {"meshes/mediapipe_face/canonical_face_model.obj", kFace},
    {"meshes/makehuman/base.obj", kFace},
};

/// The largest difference of a texel's samples from these.
double error_of(const WholeImage& image, std::size_t texel, const std::array<double, 3>& samples) {
  double error = 0;
  for (std::size_t c = 0; c < 3; ++c)
    error = std::max(error, std::abs(image.at(texel, c) - samples[c]));
  return error;
}

/// Every so-manieth texel of an image, for one of `size` x `size`. Where a target is coarser than
/// its source it shows means, which the brute force knows nothing of.
WholeImage thinned(const WholeImage& image, std::uint32_t size) {
  WholeImage out{size, size, image.channels, image.linear, {}};
  for (std::size_t y = 0; y < size; ++y) {
    for (std::size_t x = 0; x < size; ++x) {
      const std::size_t at = (y * image.height / size) * image.width + x * image.width / size;
      for (std::size_t c = 0; c < image.channels; ++c) out.samples.push_back(image.at(at, c));
    }
  }
  return out;
}

}  // namespace

TEST_CASE("no texel of a mesh onto itself is wrong that a brute force gets right",
          "[golden][external]") {
  const auto data = test_data();
  if (!data) return;
  const Model model = GENERATE(from_range(std::begin(kModels), std::end(kModels)));
  const std::string path = (*data / model.path).string();
  const TempFolder folder;
  auto options = golden_options(path, path, folder.file("out.png"));
  options.image.size = ImageSize{model.size, model.size};
  options.image.depth = Depth::u8;
  options.channels.transferred = {Channel::base_color};
  options.mesh.filter = Filter::tent;  // what the reference looks up
  if (model.texture != nullptr) {
    const WholeImage skin = read_whole_image((*data / model.texture).string());
    write_whole_image(folder.file("skin.png"), thinned(skin, model.size / 2));
    options.material.textures = {{Channel::base_color, folder.file("skin.png")}};
  }
  transfer(options);
  const WholeImage out = read_whole_image(options.output);
  const WholeImage coverage = read_whole_image(options.image.coverage_output);
  REQUIRE(out.channels >= 3);
  const Reference reference(options, Channel::base_color, out.channels, false);
  const TargetRaster& raster = reference.raster();

  std::size_t covered = 0, wrong = 0, avoidable = 0, unsure = 0, probed = 0, differ = 0;
  double squared = 0;
  std::vector<double> samples(out.channels);
  const auto first_three = [&] { return std::array{samples[0], samples[1], samples[2]}; };
  const std::size_t stride = raster.owner.size() / kProbes | 1;
  for (std::size_t i = 0; i < raster.owner.size(); ++i) {
    if (!raster.covered(i)) continue;
    ++covered;
    reference.own(i, samples.data());
    const std::array<double, 3> own = first_three();
    for (std::size_t c = 0; c < 3; ++c) squared += std::pow(out.at(i, c) - own[c], 2);
    const bool is_wrong = coverage.at(i, 0) < 0.5 || error_of(out, i, own) > kWrong;
    wrong += is_wrong ? 1 : 0;
    if (!is_wrong && i % stride != 0) continue;
    if (raster.on_edge[i] != 0) {
      unsure += is_wrong ? 1 : 0;
      continue;
    }
    const Verdict verdict = reference.texel(i, samples.data());
    double from_own = 0;
    for (std::size_t c = 0; c < 3; ++c)
      from_own = std::max(from_own, std::abs(first_three()[c] - own[c]));
    avoidable +=
        is_wrong && verdict != Verdict::empty && verdict != Verdict::coarse && from_own <= kWrong
            ? 1
            : 0;
    if (verdict == Verdict::ambiguous || verdict == Verdict::coarse) continue;
    const bool found = verdict == Verdict::found;
    ++probed;
    differ +=
        found != (coverage.at(i, 0) > 0.5) || (found && error_of(out, i, first_three()) > 1.0 / 255)
            ? 1
            : 0;
  }
  const std::string name = std::filesystem::path(path).stem().string() + " own texture ";
  figure(name + "dB",
         squared > 0 ? -10 * std::log10(squared / (3.0 * static_cast<double>(covered))) : 999);
  figure(name + "texels", static_cast<double>(covered));
  figure(name + "wrong", static_cast<double>(wrong));
  figure(name + "wrong that the brute force gets right", static_cast<double>(avoidable));
  figure(name + "wrong and on an edge within rounding", static_cast<double>(unsure));
  figure(name + "probed", static_cast<double>(probed));
  figure(name + "unlike the brute force", static_cast<double>(differ));
  CAPTURE(name);
  CHECK(covered > 10000);
  CHECK(avoidable == 0);
  CHECK(unsure == 0);
  CHECK(differ == 0);
}

}  // namespace pounce::test
