// SPDX-License-Identifier: Apache-2.0
//
// Texture sets of other programs, and the heads over 20 and 4 UDIMs.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "golden.h"
#include "pounce/compare.h"

namespace pounce::test {
namespace {

struct Set {
  std::string folder;
  TransferOptions options;
  Report report;

  std::string out(int udim) const { return folder + "/out." + std::to_string(udim) + ".png"; }
  std::string mask(int udim) const { return folder + "/mask." + std::to_string(udim) + ".png"; }
};

/// A model with its texture set onto itself.
Set onto_itself(const TempFolder& folder, const std::string& model, const std::string& textures,
                std::optional<ImageSize> size) {
  Set set;
  set.folder = folder.path().string();
  set.options = golden_options(model, model, set.folder + "/out.<UDIM>.png");
  set.options.image.coverage_output = set.folder + "/mask.<UDIM>.png";
  set.options.material.textures = {{Channel::base_color, textures}};
  set.options.image.size = size;
  set.report = transfer(set.options);
  return set;
}

bool warns(const Report& report, const std::string& text) {
  return std::any_of(report.warnings.begin(), report.warnings.end(),
                     [&](const std::string& w) { return w.find(text) != std::string::npos; });
}

}  // namespace

TEST_CASE("a cube over seven UDIM tiles gives its texture set back", "[golden][external]") {
  const auto data = test_data();
  if (!data) return;
  const TempFolder folder;
  const std::string cube = (*data / "udim/materialx_cube").string();
  const Set set =
      onto_itself(folder, cube + "/cube.obj", cube + "/grid.<UDIM>.png", ImageSize{512, 512});
  CHECK(set.report.udims == std::vector<int>{1001, 1002, 1003, 1011, 1012, 1013});
  CHECK(warns(set.report, "no image for UDIM 1023,"));
  CHECK(set.report.target_empty == 2510);
  for (const int udim : set.report.udims) {
    const Comparison c =
        compare(set.out(udim), cube + "/grid." + std::to_string(udim) + ".png", set.mask(udim));
    figure("materialx_cube " + std::to_string(udim) + " dB", c.psnr_db);
    CHECK(c.texels >= 252004);
    CHECK(c.largest_error == 0);
  }
}

TEST_CASE("a plane over twenty tiles names those without an image", "[golden][external]") {
  const auto data = test_data();
  if (!data) return;
  const TempFolder folder;
  const std::string plane = (*data / "udim/openusd_plane").string();
  const Set set =
      onto_itself(folder, plane + "/usdUdims.obj", plane + "/texture_<UDIM>.jpg", std::nullopt);
  CHECK(set.report.udims ==
        std::vector<int>{1001, 1002, 1003, 1004, 1005, 1006, 1008, 1009, 1010, 1011, 1012, 1013});
  CHECK(warns(set.report, "no image for UDIM 1007, 1014-1020,"));
  for (const int udim : set.report.udims) {
    const Comparison c =
        compare(set.out(udim), plane + "/texture_" + std::to_string(udim) + ".jpg", set.mask(udim));
    figure("openusd_plane " + std::to_string(udim) + " dB", c.psnr_db);
    CHECK(c.texels > 0);
    CHECK(c.largest_error == 0);
  }
}

TEST_CASE("a head over many UDIMs is covered everywhere, whatever the search limit",
          "[golden][external]") {
  const auto data = test_data();
  if (!data) return;
  const TempFolder folder;
  const int tiles = GENERATE(20, 4);
  TransferOptions options =
      golden_options((*data / "heads/head_src.glb").string(),
                     (*data / ("heads/head_dst_udim" + std::to_string(tiles) + ".obj")).string(),
                     folder.file("near.<UDIM>.png"));
  options.image.coverage_output = folder.file("near_mask.<UDIM>.png");
  options.image.size = ImageSize{256, 256};
  const Report near = transfer(options);
  options.output = folder.file("far.<UDIM>.png");
  options.image.coverage_output = folder.file("far_mask.<UDIM>.png");
  options.search.max_distance = Length{8, true};
  const Report far = transfer(options);
  REQUIRE(near.udims.size() == static_cast<std::size_t>(tiles));
  CHECK(near.udims.front() == 1001);
  CHECK(near.udims.back() == 1000 + tiles);
  CHECK(near.target_overlapping == 0);
  for (const int udim : near.udims) {
    const std::string number = std::to_string(udim);
    const auto path = [&](const std::string& name) {
      return folder.file(name + "." + number + ".png");
    };
    CAPTURE(udim);
    const Comparison c = compare(path("near"), path("far"), path("near_mask"));
    CHECK(c.largest_error <= 1.0 / 255);
    // Of the tile's own raster: all that 8 % reaches and 5 % does not is empty.
    const Comparison all = compare(path("near"), path("far"), path("far_mask"));
    CHECK(static_cast<double>(c.texels) >= 0.99 * static_cast<double>(all.texels));
  }
  figure(
      "head_dst_udim" + std::to_string(tiles) + " covered %",
      100.0 * static_cast<double>(near.target_covered) / static_cast<double>(near.target_texels));
  CHECK(far.target_covered == far.target_texels);
}

}  // namespace pounce::test
