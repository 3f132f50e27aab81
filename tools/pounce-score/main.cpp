// SPDX-License-Identifier: Apache-2.0
//
// How well do textures show a scene? Called by tools/score-splats.sh.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "pounce/error.h"
#include "score.h"

namespace {

using namespace pounce;

void row(const std::string& name, const score::Truth& truth, const std::vector<Vec3d>& colours) {
  fmt::print("{:<28} {:6.2f} {:6.2f} {:6.2f}   {:5.1f} %\n", name, score::psnr(truth.four, colours),
             score::psnr(truth.sides, colours), score::psnr(truth.many, colours),
             100 * score::share_off(truth.four, colours));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Scores textures against front-to-back renders of the scene that they were made of");
  std::string scene_path, maps;
  std::vector<std::string> images;
  std::size_t most = 20000;
  bool harmonics = false;
  app.add_option("SCENE", scene_path, "The splat scene")->required();
  app.add_option("--maps", maps, "What `pounce maps` wrote of the target: a path with <CHANNEL>")
      ->required();
  app.add_option("IMAGE", images, "Textures of the target, of the maps' size");
  app.add_option("--points", most, "Most texels to look at")->capture_default_str();
  app.add_flag("--sh", harmonics, "The truth shows spherical harmonics; else degree 0 alone");
  CLI11_PARSE(app, argc, argv);
  try {
    const score::Scene scene = score::read_scene(scene_path);
    const score::Points points = score::read_points(maps, most);
    const score::Truth truth = score::make_truth(scene, points, harmonics);
    fmt::print(
        "{} Gaussians, {} texels; seen {} times from 4 sides, {} from 14, {} by >= 3 of 24\n",
        scene.gaussians.size(), points.points.size(), truth.four.size(), truth.sides.size(),
        truth.many.size());
    fmt::print("{:<28} {:>6} {:>6} {:>6}   off by > 0.15\n", "PSNR in dB", "4", "14", "many");
    for (const double percent : {1.0, 2.0})
      row(fmt::format("compositing from +{} %", percent), truth,
          score::composited(scene, points, percent / 100));
    for (const std::string& image : images) row(image, truth, score::read_colours(image, points));
  } catch (const Error& error) {
    fmt::print(stderr, "pounce-score: {}\n", error.what());
    return 1;
  }
  return 0;
}
