// SPDX-License-Identifier: Apache-2.0
//
// How well do textures show a scene? In figures, for tools/score-splats.sh and
// tools/score-capture.sh, and in pictures.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <functional>

#include "around.h"
#include "core/bounds.h"
#include "io/read_mesh.h"
#include "model.h"
#include "picture.h"
#include "pounce/error.h"
#include "score.h"
#include "views.h"

namespace {

using namespace pounce;

constexpr const char* kAbout =
    "Scores textures of a target against front-to-back renders of the splat scene that they were "
    "made of,\nand draws both from the same side.";
constexpr std::uint32_t kGap = 4;  // pixels between two pictures
constexpr Vec3d kBackground{1, 1, 1};

struct TableOptions {
  std::string scene, maps;
  std::vector<std::string> images;
  std::size_t most = 20000;
  double behind = 0;
  bool harmonics = false;
};

/// So far behind (of the diagonal) lies what is looked at where only that counts, at most.
constexpr double kFarBehind = 0.06;

void print_row(const std::string& name, const score::Truth& truth,
               const std::vector<Vec3d>& colours) {
  fmt::print("{:<28} {:6.2f} {:6.2f} {:6.2f}   {:5.1f} %\n", name, score::psnr(truth.four, colours),
             score::psnr(truth.sides, colours), score::psnr(truth.many, colours),
             100 * score::share_off(truth.four, colours));
}

void print_table(const TableOptions& o) {
  const score::Scene scene = score::read_scene(o.scene);
  const score::Points points = score::read_points(o.maps, o.most);
  const score::Truth truth =
      o.behind > 0
          ? score::beyond(score::make_truth(scene, points, o.harmonics, kFarBehind), o.behind / 100)
          : score::make_truth(scene, points, o.harmonics);
  fmt::print("{} Gaussians, {} texels; seen {} times from 4 sides, {} from 14, {} by >= 3 of 24\n",
             scene.gaussians.size(), points.points.size(), truth.four.size(), truth.sides.size(),
             truth.many.size());
  fmt::print("{:<28} {:>6} {:>6} {:>6}   off by > 0.15\n", "PSNR in dB", "4", "14", "many");
  for (const double percent : {1.0, 2.0})
    print_row(fmt::format("compositing from +{} %", percent), truth,
              score::composited(scene, points, percent / 100));
  for (const std::string& image : o.images)
    print_row(image, truth, score::read_colours(image, points));
}

struct RankingOptions {
  std::string scene, maps, image;
  std::vector<std::string> numbers;
  std::size_t most = 20000;
  bool harmonics = false;
};

void print_rankings(const RankingOptions& o) {
  const score::Scene scene = score::read_scene(o.scene);
  const score::Points points = score::read_points(o.maps, o.most);
  const score::Truth truth = score::make_truth(scene, points, o.harmonics, kFarBehind);
  const std::vector<Vec3d> colours = score::read_colours(o.image, points);
  fmt::print("{:<28} {:>7} {:>9} {:>10} {:>12} {:>6}\n", "", "texels", "off > 0.1", "mean error",
             "least tenth", "area");
  for (const std::string& numbers : o.numbers) {
    const score::Ranking r = score::rank(truth, colours, score::read_colours(numbers, points));
    fmt::print("{:<28} {:>7} {:>7.1f} % {:>10.4f} {:>12.4f} {:>6.3f}\n", numbers, r.texels,
               100 * r.wrong, r.error, r.least_error, r.area);
  }
}

constexpr const char* kOneSided =
    "Leave out triangles that face away, so that a room is open like a doll's house";

struct PictureOptions {
  std::string scene, target, output;
  std::vector<std::string> images;
  score::Framing framing;
  bool harmonics = false, wireframe = false, one_sided = false;
};

void draw_pictures(const PictureOptions& o) {
  const mesh::Mesh target = io::read_mesh(o.target);
  score::View view = score::view_of(target, o.framing);
  view.one_sided = o.one_sided;
  const std::size_t size = view.size;
  std::vector<std::vector<Vec3d>> pictures{
      score::draw_scene(score::read_scene(o.scene), view, o.harmonics, kBackground)};
  if (o.wireframe) pictures.push_back(score::draw_wireframe(target, view, kBackground));
  for (const std::string& image : o.images)
    pictures.push_back(score::draw_mesh(target, score::read_image(image), view, kBackground));
  std::vector<Vec3d> row_by_row;
  for (std::size_t y = 0; y < size; ++y) {
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      if (i > 0) row_by_row.insert(row_by_row.end(), kGap, kBackground);
      const auto begin = pictures[i].begin() + static_cast<std::ptrdiff_t>(y * size);
      row_by_row.insert(row_by_row.end(), begin, begin + static_cast<std::ptrdiff_t>(size));
    }
  }
  const auto width = row_by_row.size() / size;
  score::write_image(o.output, static_cast<std::uint32_t>(width), view.size, row_by_row);
}

void add_table(CLI::App& app, std::function<void()>& run, TableOptions& o) {
  CLI::App* c = app.add_subcommand(
      "table", "PSNR of textures, beside that of plain compositing along the texels' normals");
  c->add_option("SCENE", o.scene, "The splat scene")->required();
  c->add_option("--maps", o.maps, "What `pounce maps` wrote of the target: a path with <CHANNEL>")
      ->required();
  c->add_option("IMAGE", o.images, "Textures of the target, of the maps' size");
  c->add_option("--points", o.most, "Most texels to look at")
      ->check(CLI::Range(1, 100000000))
      ->capture_default_str();
  c->add_option("--behind", o.behind,
                "Only where the scene lies more than so many per cent of the diagonal behind, up "
                "to 6 %. 0: wherever it lies within 2 %")
      ->check(CLI::Range(0.0, 6.0));
  c->add_flag("--sh", o.harmonics, "The truth shows spherical harmonics; else degree 0 alone");
  c->callback([&run, &o] { run = [&o] { print_table(o); }; });
}

void add_ranking(CLI::App& app, std::function<void()>& run, RankingOptions& o) {
  CLI::App* c = app.add_subcommand(
      "confidence", "How well the numbers of an image tell which texels of a texture are wrong");
  c->add_option("SCENE", o.scene, "The splat scene")->required();
  c->add_option("IMAGE", o.image, "A texture of the target, of the maps' size")->required();
  c->add_option("NUMBERS", o.numbers, "Images of one number per texel, 0 where there is none")
      ->required();
  c->add_option("--maps", o.maps, "What `pounce maps` wrote of the target: a path with <CHANNEL>")
      ->required();
  c->add_option("--points", o.most, "Most texels to look at")
      ->check(CLI::Range(1, 100000000))
      ->capture_default_str();
  c->add_flag("--sh", o.harmonics, "The truth shows spherical harmonics; else degree 0 alone");
  c->callback([&run, &o] { run = [&o] { print_rankings(o); }; });
}

struct ViewsOptions {
  std::string scene, target, confidence;
  std::vector<std::string> images;
  std::size_t count = 26;
  std::uint32_t size = 448, finer = 3;
  bool harmonics = false;
};

/// Between the directions of the method, whatever their number.
constexpr double kTurn = 0.31;

void print_views(const ViewsOptions& o) {
  const score::Scene scene = score::read_scene(o.scene);
  const mesh::Mesh target = io::read_mesh(o.target);
  std::vector<score::Image> images;
  for (const std::string& image : o.images) images.push_back(score::read_image(image));
  std::optional<score::Image> confidence;
  if (!o.confidence.empty()) confidence = score::read_image(o.confidence);
  const std::vector<Vec3d> ways = score::directions(o.count, kTurn);
  Box3f box;
  for (const Vec3f& p : target.positions) box.extend(p);
  const double diagonal = length(Vec3d(box.hi) - Vec3d(box.lo));
  std::vector<std::vector<score::Likeness>> scores(ways.size());
  tbb::parallel_for(std::size_t{0}, ways.size(), [&](std::size_t i) {
    const score::View view = score::view_along(target, ways[i], o.size);
    const score::Seen seen = score::see_scene(scene, view, o.harmonics, o.finer);
    std::optional<score::Seen> trust;
    if (confidence) trust = score::see_mesh(target, &*confidence, view, o.finer);
    for (const score::Image& image : images) {
      const score::Seen mesh = score::see_mesh(target, &image, view, o.finer);
      scores[i].push_back(score::likeness(seen, mesh, trust ? &*trust : nullptr, o.size, diagonal));
    }
  });
  fmt::print("{:<28} {:>6} {:>6} {:>6} {:>6} {:>6}  {:>12}  {}\n", fmt::format("{} views", o.count),
             "either", "both", "IoU", "SSIM", "sharp", "depth 50, 90", "nearer than the first");
  for (std::size_t k = 0; k < images.size(); ++k) {
    score::Likeness all;
    std::size_t nearer = 0;
    for (const auto& of_view : scores) {
      all.add(of_view[k]);
      nearer += of_view[k].either_squares < of_view[0].either_squares ? 1 : 0;
    }
    fmt::print("{:<28} {:>6.2f} {:>6.2f} {:>6.3f} {:>6.3f} {:>6.2f}  {:>5.2f} {:>5.2f}%  {}\n",
               o.images[k], all.either_db(), all.both_db(), all.iou(), all.mean_ssim(),
               all.sharpness(), 100 * all.depth(0.5), 100 * all.depth(0.9), nearer);
    if (confidence)
      fmt::print("  mean errors by quarters of confidence: {:.3f}\n",
                 fmt::join(score::errors_by_trust(std::move(all.trusted)), " / "));
  }
}

struct ModelsOptions {
  std::string truth;
  std::vector<std::string> models;
  std::size_t count = 26;
  std::uint32_t size = 448, finer = 3;
  bool one_sided = false;
};

void print_models(const ModelsOptions& o) {
  const score::Model truth = score::read_model(o.truth);
  std::vector<score::Model> models;
  for (const std::string& path : o.models) models.push_back(score::read_model(path));
  const std::vector<Vec3d> ways = score::directions(o.count, kTurn);
  Box3f box;
  for (const Vec3f& p : truth.mesh.positions) box.extend(p);
  const double diagonal = length(Vec3d(box.hi) - Vec3d(box.lo));
  fmt::print("{:<28} {:>6} {:>6} {:>6} {:>6} {:>6}  {:>12}\n", fmt::format("{} views", o.count),
             "either", "both", "IoU", "SSIM", "sharp", "depth 50, 90");
  for (const bool lit : {false, true}) {
    std::vector<score::Likeness> all(models.size());
    for (const Vec3d way : ways) {
      score::View view = score::view_along(truth.mesh, way, o.size);
      view.one_sided = o.one_sided;
      const score::Seen seen = score::see_model(truth, view, o.finer, lit);
      tbb::parallel_for(std::size_t{0}, models.size(), [&](std::size_t k) {
        all[k].add(score::likeness(seen, score::see_model(models[k], view, o.finer, lit), nullptr,
                                   o.size, diagonal));
      });
    }
    for (std::size_t k = 0; k < models.size(); ++k) {
      fmt::print("{:<28} {:>6.2f} {:>6.2f} {:>6.3f} {:>6.3f} {:>6.2f}  {:>5.2f} {:>5.2f}%\n",
                 o.models[k] + (lit ? ", lit" : ""), all[k].either_db(), all[k].both_db(),
                 all[k].iou(), all[k].mean_ssim(), all[k].sharpness(), 100 * all[k].depth(0.5),
                 100 * all[k].depth(0.9));
    }
  }
}

struct BakeOptions {
  std::string scene, target, maps, rest, output, rule = "around";
  score::AroundOptions around;
};

/// All hits of a part of the points are in memory at once.
std::vector<Vec3d> composited_in_parts(const score::Scene& scene, const score::Points& points) {
  constexpr std::size_t kPart = 100000;
  constexpr double kOutside = 0.01;  // of the diagonal
  std::vector<Vec3d> colours(points.points.size());
  const std::size_t parts = (colours.size() + kPart - 1) / kPart;
  tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t i) {
    score::Points some{{}, points.diagonal, points.width, points.height};
    const std::size_t first = i * kPart, last = std::min(first + kPart, colours.size());
    for (std::size_t p = first; p < last; ++p) some.points.push_back(points.points[p]);
    const std::vector<Vec3d> found = score::composited(scene, some, kOutside);
    std::copy(found.begin(), found.end(), colours.begin() + static_cast<std::ptrdiff_t>(first));
  });
  return colours;
}

void bake(const BakeOptions& o) {
  const score::Scene scene = score::read_scene(o.scene);
  const score::Points points = score::read_points(o.maps, SIZE_MAX);
  std::vector<Vec3d> colours;
  if (o.rule == "nearest") {
    colours = score::nearest_colours(scene, points);
  } else if (o.rule == "composite") {
    colours = composited_in_parts(scene, points);
  } else {
    if (o.rest.empty()) throw Error(ErrorKind::usage, "--rule around needs --rest IMAGE");
    colours = score::read_colours(o.rest, points);
    const auto seen = score::around(scene, io::read_mesh(o.target), points, o.around);
    std::size_t unseen = 0;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      unseen += seen[i].weight > 0 ? 0 : 1;
      if (seen[i].weight > 0) colours[i] = seen[i].colour;
    }
    fmt::print("{}: {:.1f} % of {} texels are seen by no view\n", o.output,
               100 * static_cast<double>(unseen) / static_cast<double>(seen.size()), seen.size());
  }
  score::write_texture(o.output, points, colours);
}

void add_views(CLI::App& app, std::function<void()>& run, ViewsOptions& o) {
  CLI::App* c = app.add_subcommand(
      "views", "How alike the scene and the target with each texture look from all around");
  c->add_option("SCENE", o.scene, "The splat scene")->required();
  c->add_option("TARGET", o.target, "The mesh whose UV set 0 the textures lie on")->required();
  c->add_option("IMAGE", o.images, "Textures of the target")->required();
  c->add_option("--confidence", o.confidence,
                "An image of confidence: prints the mean error of its four quarters of pixels");
  c->add_option("--views", o.count, "So many directions")->capture_default_str();
  c->add_option("--size", o.size, "Pixels along a picture's edge")
      ->check(CLI::Range(1, 8192))
      ->capture_default_str();
  c->add_option("--samples", o.finer, "Samples along a pixel's edge")
      ->check(CLI::Range(1, 8))
      ->capture_default_str();
  c->add_flag("--sh", o.harmonics, "The scene shows spherical harmonics; else degree 0 alone");
  c->callback([&run, &o] { run = [&o] { print_views(o); }; });
}

void add_models(CLI::App& app, std::function<void()>& run, ModelsOptions& o) {
  CLI::App* c = app.add_subcommand(
      "models",
      "How alike models look from all around, by their base colours, and lit with their "
      "normal maps");
  c->add_option("TRUTH", o.truth, "The model that the others are held against")->required();
  c->add_option("MODEL", o.models, "Models in the same place")->required();
  c->add_option("--views", o.count, "So many directions")->capture_default_str();
  c->add_option("--size", o.size, "Pixels along a picture's edge")
      ->check(CLI::Range(1, 8192))
      ->capture_default_str();
  c->add_option("--samples", o.finer, "Samples along a pixel's edge")
      ->check(CLI::Range(1, 8))
      ->capture_default_str();
  c->add_flag("--one-sided", o.one_sided, kOneSided);
  c->callback([&run, &o] { run = [&o] { print_models(o); }; });
}

void add_bake(CLI::App& app, std::function<void()>& run, BakeOptions& o) {
  CLI::App* c = app.add_subcommand("bake", "A texture by a plain rule, to be held against");
  c->add_option("SCENE", o.scene, "The splat scene")->required();
  c->add_option("TARGET", o.target, "The mesh whose UV set 0 the texture lies on")->required();
  c->add_option("--maps", o.maps, "What `pounce maps` wrote of the target: a path with <CHANNEL>")
      ->required();
  c->add_option("--rule", o.rule, "nearest Gaussian; composite along the normal; seen from around")
      ->check(CLI::IsMember({"nearest", "composite", "around"}))
      ->capture_default_str();
  c->add_option("--rest", o.rest, "A texture for what no view sees");
  c->add_option("-o,--output", o.output, "An image")->required();
  score::AroundOptions& around = o.around;
  c->add_option("--views", around.views, "So many directions")->capture_default_str();
  c->add_option("--pixels", around.size, "Pixels along a view's edge")->capture_default_str();
  c->add_option("--exponent", around.exponent, "Of the cosine, as a weight")->capture_default_str();
  c->add_option("--on-target", around.on_target,
                "How far from the target's surface, of the diagonal")
      ->capture_default_str();
  c->add_option("--hidden", around.hidden, "How far before a texel the scene hides it")
      ->capture_default_str();
  c->add_flag("--sh", around.harmonics, "The scene shows spherical harmonics; else degree 0 alone");
  c->callback([&run, &o] { run = [&o] { bake(o); }; });
}

void add_picture(CLI::App& app, std::function<void()>& run, PictureOptions& o) {
  CLI::App* c = app.add_subcommand(
      "render", "The scene and the target with each texture side by side, orthographic, unlit");
  c->add_option("SCENE", o.scene, "The splat scene")->required();
  c->add_option("TARGET", o.target, "The mesh whose UV set 0 the textures lie on")->required();
  c->add_option("IMAGE", o.images, "Textures of the target")->required();
  c->add_option("-o,--output", o.output, "An image")->required();
  const auto vector = [c](const char* name, const char* about, auto set) {
    c->add_option_function<std::vector<double>>(
         name,
         [set](const std::vector<double>& v) {
           set(Vec3d{v[0], v[1], v[2]});
         },
         about)
        ->delimiter(',')
        ->expected(3);
  };
  score::Framing& framing = o.framing;
  vector("--from", "X,Y,Z: where the camera stands, seen from the middle. Default: 1,0,1",
         [&framing](Vec3d v) { framing.from = v; });
  vector("--up", "X,Y,Z: what is up in the picture. Default: 0,1,0",
         [&framing](Vec3d v) { framing.up = v; });
  vector("--middle", "X,Y,Z: what is in the picture's middle. Default: the target's",
         [&framing](Vec3d v) { framing.middle = v; });
  c->add_option("--edge", framing.edge, "What a picture's edge shows, in units. Default: all")
      ->check(CLI::PositiveNumber);
  c->add_option("--size", framing.size, "Pixels along a picture's edge")
      ->check(CLI::Range(1, 8192))
      ->capture_default_str();
  c->add_flag("--wireframe", o.wireframe, "The target's triangles between the two, too");
  c->add_flag("--sh", o.harmonics, "The scene shows spherical harmonics; else degree 0 alone");
  c->add_flag("--one-sided", o.one_sided, kOneSided);
  c->callback([&run, &o] { run = [&o] { draw_pictures(o); }; });
}

}  // namespace

int main(int argc, char** argv) try {
  CLI::App app(kAbout, "pounce-score");
  app.require_subcommand(1);
  TableOptions table;
  RankingOptions ranking;
  PictureOptions picture;
  ViewsOptions views;
  ModelsOptions models;
  BakeOptions baking;
  std::function<void()> run;
  add_table(app, run, table);
  add_ranking(app, run, ranking);
  add_picture(app, run, picture);
  add_views(app, run, views);
  add_models(app, run, models);
  add_bake(app, run, baking);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : exit_status(ErrorKind::usage);
  }
  run();
  return 0;
} catch (const pounce::Error& e) {
  std::fprintf(stderr, "pounce-score: error: %s\n", e.what());
  return pounce::exit_status(e.kind());
} catch (const std::exception& e) {
  std::fprintf(stderr, "pounce-score: internal error: %s\n", e.what());
  return 70;
}
