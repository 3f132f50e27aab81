// SPDX-License-Identifier: Apache-2.0
//
// A scene that is seen from all around, files in and out: against the plain form of the rule, and
// what the look decides.
#include "around.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "flow/transfer.h"
#include "io/read_mesh.h"
#include "points.h"
#include "pounce/transfer.h"
#include "scene.h"
#include "support/bytes.h"
#include "support/reference_splats.h"
#include "support/splat_scenes.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

Vec3d colour_at(Vec3d p) {
  const auto wave = [](double v) { return 0.5 + 0.4 * std::sin(v); };
  return {wave(3 * p.x + p.y), wave(4 * p.y), wave(3 * p.z - 2 * p.x)};
}

/// Needles on a sphere of radius 1, a little off it, as captures have them; `lift` from it.
std::vector<ReferenceSplat> needles(Random& random, std::size_t count, double lift = 0) {
  std::vector<ReferenceSplat> scene;
  while (scene.size() < count) {
    Vec3d way{random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0)};
    if (length(way) > 1 || length(way) < 0.1) continue;
    way = way * (1 / length(way));
    ReferenceSplat s;
    s.mean = way * (1 + lift + random.between(-0.01, 0.01));
    s.sigma = {random.between(0.03, 0.06), random.between(0.005, 0.012), 0.004};
    s.rotation = random_rotation(random);
    s.alpha = random.between(0.5, 0.98);
    s.colour = colour_at(way);
    scene.push_back(as_floats(s));
  }
  return scene;
}

/// A sphere of radius 1 as a grid of longitude and latitude, the poles left out. A room is seen
/// from inside. Where it is `strewn`, each face is a small chart far from its neighbours'.
void write_sphere(const std::string& path, bool is_room = false, bool strewn = false) {
  constexpr int kAround = 48, kUp = 24;
  std::ofstream file(path);
  for (int i = 0; strewn && i < kAround * kUp; ++i) {
    const int at = i * 341 % (kAround * kUp);  // no common factor: each once
    for (const auto& [x, y] : {std::pair{0.0, 0.0}, {0.0, 0.4}, {0.4, 0.4}, {0.4, 0.0}})
      file << "vt " << (at % kAround + x) / kAround << ' ' << 1 - (at / kAround + y) / kUp << '\n';
  }
  for (int y = 0; y <= kUp; ++y) {
    for (int x = 0; x <= kAround; ++x) {
      const double u = static_cast<double>(x) / kAround, v = static_cast<double>(y) / kUp;
      const double angle = 2 * std::numbers::pi * u, height = std::numbers::pi * (0.04 + 0.92 * v);
      file << "v " << std::sin(height) * std::cos(angle) << ' ' << std::cos(height) << ' '
           << -std::sin(height) * std::sin(angle) << '\n';
      if (!strewn) file << "vt " << u << ' ' << 1 - v << '\n';
    }
  }
  int corners = 0;
  const auto corner = [&](int x, int y) {
    const int at = y * (kAround + 1) + x + 1;
    return " " + std::to_string(at) + "/" + std::to_string(strewn ? ++corners : at);
  };
  for (int y = 0; y < kUp; ++y) {
    for (int x = 0; x < kAround; ++x) {
      const std::string a = corner(x, y), b = corner(x, y + 1), c = corner(x + 1, y + 1),
                        d = corner(x + 1, y);
      file << 'f' << (is_room ? d + c + b + a : a + b + c + d) << '\n';
    }
  }
}

TransferOptions sphere(const TempFolder& folder, const std::vector<ReferenceSplat>& scene) {
  TransferOptions options;
  options.source = folder.file("scene.ply");
  write_reference_splats(options.source, scene);
  options.targets = {folder.file("target.obj")};
  write_sphere(options.targets[0]);
  options.output = folder.file("out.png");
  options.image.size = ImageSize{1024, 512};
  options.image.depth = Depth::u16;
  options.resources.use_cache = false;
  options.resources.memory_bytes = 256ULL << 20;
  return options;
}

/// Mean squared errors of an image's texels from what is expected of them.
double error_of(const std::string& path, const score::Points& points,
                const std::vector<Vec3d>& expected) {
  const std::vector<Vec3d> found = score::read_colours(path, points);
  double sum = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Vec3d off = found[i] - expected[i];
    sum += dot(off, off) / 3;
  }
  return sum / static_cast<double>(found.size());
}

score::Points points_of(const TempFolder& folder, const TransferOptions& options) {
  MapsOptions maps;
  maps.target = options.targets[0];
  maps.output = folder.file("maps.<CHANNEL>.exr");
  maps.size = *options.image.size;
  maps.resources.use_cache = false;
  pounce::maps(maps);
  return score::read_points(maps.output, SIZE_MAX);
}

}  // namespace

TEST_CASE("a capture's texels are what the plain form of the rule sees", "[flow]") {
  const TempFolder folder;
  Random random(1);
  TransferOptions options = sphere(folder, needles(random, 20000));
  const Report report = flow::transfer(options, {});
  CHECK(report.discness < 0.5);
  CHECK(report.views == 36);  // by itself: these are no discs
  CHECK(report.target_empty == 0);

  const score::Points points = points_of(folder, options);
  const score::Scene scene = score::read_scene(options.source);
  score::AroundOptions plain;
  plain.views = 36;
  plain.size = 720;  // pixels of about the same edge
  plain.sharpened = 0.44;
  plain.ring = 0.005 * std::sqrt(12.0) / points.diagonal;  // of the region, a cube of edge 2
  const auto seen = score::around(scene, io::read_mesh(options.targets[0]), points, plain);
  std::vector<Vec3d> expected;
  std::size_t unseen = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    unseen += seen[i].weight > 0 ? 0 : 1;
    expected.push_back(seen[i].colour);
  }
  CHECK(unseen == 0);
  // Each draws with pixels of its own lattice and looks up between them: a few thousandths.
  CHECK(std::sqrt(error_of(options.output, points, expected)) < 0.006);
}

TEST_CASE("a room is seen as a doll's house, haze and all", "[flow]") {
  const TempFolder folder;
  Random random(6);
  std::vector<ReferenceSplat> scene = needles(random, 20000);
  const std::size_t walls = scene.size();
  while (scene.size() < walls + 600) {
    const auto at = [&] { return random.between(-0.7, 0.7); };
    ReferenceSplat s;
    s.mean = {at(), at(), at()};
    if (length(s.mean) > 0.7) continue;
    s.sigma = {0.2, 0.18, 0.16};
    s.rotation = random_rotation(random);
    s.alpha = 0.3;
    s.colour = {0.9, 0.9, 0.9};
    scene.push_back(as_floats(s));
  }
  TransferOptions options = sphere(folder, scene);
  write_sphere(options.targets[0], true);
  const Report report = flow::transfer(options, {});
  CHECK(report.views == 36);
  CHECK(report.target_empty == 0);
  const score::Points points = points_of(folder, options);
  std::vector<Vec3d> expected;
  for (const score::Point& point : points.points) expected.push_back(colour_at(point.position));
  const double around = error_of(options.output, points, expected);
  const std::vector<double> shown = read_whole_image(options.output).samples;

  SECTION("it is nearer than along normals, through the haze") {
    options.splats.look = Look::normal;
    flow::transfer(options, {});
    const double ray = error_of(options.output, points, expected);
    CAPTURE(std::sqrt(around), std::sqrt(ray));
    CHECK(around < ray);
    CHECK(std::sqrt(around) < 0.01);  // no hole through which the back of another wall shows
  }
  SECTION("the same bytes from little memory, on another number of threads") {
    options.resources.memory_bytes = 24ULL << 20;
    options.resources.threads = 2;
    flow::transfer(options, {});
    CHECK(read_whole_image(options.output).samples == shown);
  }
  SECTION("the same bytes in slabs") {
    job::TestKnobs knobs;
    knobs.most_ellipses = 500;
    flow::transfer(options, knobs);
    CHECK(read_whole_image(options.output).samples == shown);
  }
}

TEST_CASE("where tiles do not stay decoded, small charts are looked up in few pieces", "[flow]") {
  // No view sees the half of the target where the scene is not: rays have their turns, too.
  const TempFolder folder;
  Random random(7);
  std::vector<ReferenceSplat> scene;
  for (const ReferenceSplat& s : needles(random, 40000)) {
    if (s.mean.x > 0) scene.push_back(s);
  }
  TransferOptions options = sphere(folder, scene);
  write_sphere(options.targets[0], false, true);
  options.splats.look = Look::around;
  options.splats.views = 24;  // all tiles of so many stay decoded in what is ample below
  const auto pieces = [](const Report& report) {
    return std::find_if(report.nodes.begin(), report.nodes.end(),
                        [](const NodeReport& node) { return node.name == "store"; })
        ->runs;
  };
  const std::uint64_t ample = pieces(flow::transfer(options, {}));
  const std::vector<double> shown = read_whole_image(options.output).samples;
  for (const std::uint64_t more : {0, 4 << 20}) {
    for (const unsigned threads : {1U, 2U}) {
      options.resources.threads = threads;
      options.resources.memory_bytes = 0;
      options.resources.memory_bytes = flow::plan(options, {}).least_memory_bytes + more;
      const Report small = flow::transfer(options, {});
      CAPTURE(threads, options.resources.memory_bytes, pieces(small), ample);
      CHECK(read_whole_image(options.output).samples == shown);
      if (more > 0) CHECK(pieces(small) < ample);
    }
  }
}

TEST_CASE("discs are looked at along normals, unless one asks otherwise", "[flow]") {
  const TempFolder folder;
  Random random(2);
  std::vector<ReferenceSplat> scene = needles(random, 4000);
  for (ReferenceSplat& s : scene) {
    // Turned so that the thin axis is the normal.
    s.sigma = {0.04, 0.038, 0.001};
    const Vec3d n = s.mean * (1 / length(s.mean));
    s.rotation = {1 + n.z, -n.y, n.x, 0};
    if (n.z < -0.99) s.rotation = {0, 1, 0, 0};
  }
  TransferOptions options = sphere(folder, scene);
  const Report by_itself = flow::transfer(options, {});
  CHECK(by_itself.discness > 0.5);
  CHECK(by_itself.views == 0);
  const std::vector<double> automatic = read_whole_image(options.output).samples;
  options.splats.look = Look::normal;
  flow::transfer(options, {});
  CHECK(read_whole_image(options.output).samples == automatic);
  options.splats.look = Look::around;
  options.splats.views = 6;
  CHECK(flow::transfer(options, {}).views == 6);
  CHECK(read_whole_image(options.output).samples != automatic);
}

TEST_CASE("views are found again for another size and another target", "[flow]") {
  const TempFolder folder;
  Random random(3);
  TransferOptions options = sphere(folder, needles(random, 3000));
  options.resources.use_cache = true;
  options.resources.cache_dir = folder.file("cache");
  options.splats.everywhere = true;
  const auto drawn = [&] {
    const Report report = flow::transfer(options, {});
    for (const StageTime& stage : report.stages) {
      if (stage.name == "views") return !stage.cached;
    }
    return true;
  };
  CHECK(drawn());
  CHECK_FALSE(drawn());
  const auto warm = read_whole(posix_file_system(), options.output);
  options.image.size = ImageSize{2048, 1024};
  CHECK_FALSE(drawn());
  // A little smaller: its box is cut along the same round numbers.
  const std::string other = folder.file("other.obj");
  std::ifstream in(options.targets[0]);
  std::ofstream out(other);
  for (std::string kind, rest; in >> kind && std::getline(in, rest);) {
    if (kind != "v") {
      out << kind << rest << '\n';
      continue;
    }
    double x, y, z;
    std::sscanf(rest.c_str(), "%lf %lf %lf", &x, &y, &z);
    out << "v " << x * 0.98 << ' ' << y * 0.98 << ' ' << z * 0.98 << '\n';
  }
  out.close();
  options.targets = {other};
  CHECK_FALSE(drawn());
  options.splats.views = 12;
  CHECK(drawn());
  options.splats.views = kDefaultViews;
  options.targets = {folder.file("target.obj")};
  options.image.size = ImageSize{1024, 512};
  CHECK_FALSE(drawn());
  const bool is_same = read_whole(posix_file_system(), options.output) == warm;
  CHECK(is_same);  // not by a list of all bytes
}

TEST_CASE("evidence tells what views agree about", "[flow]") {
  // Half of the sphere lies where the target is, half of it 3 % of the diagonal above.
  const TempFolder folder;
  Random random(4);
  std::vector<ReferenceSplat> scene;
  for (const ReferenceSplat& s : needles(random, 40000)) {
    if (s.mean.x > 0) scene.push_back(s);
  }
  for (const ReferenceSplat& s : needles(random, 40000, 0.1)) {
    if (s.mean.x <= 0) scene.push_back(s);
  }
  TransferOptions options = sphere(folder, scene);
  options.output = folder.file("<CHANNEL>.exr");
  options.image.depth = Depth::float32;
  options.channels.transferred = {Channel::confidence, Channel::distance};
  options.splats.look = Look::around;
  options.search.max_distance = Length{10, true};
  flow::transfer(options, {});
  const score::Points points = points_of(folder, options);
  const WholeImage confidence = read_whole_image(folder.file("confidence.exr")),
                   distance = read_whole_image(folder.file("distance.exr"));
  double sure[2] = {}, away[2] = {}, counts[2] = {};
  for (const score::Point& point : points.points) {
    if (std::abs(point.position.x) < 0.3) continue;
    const std::size_t side = point.position.x > 0 ? 0 : 1,
                      at = std::size_t{point.y} * confidence.width + point.x;
    sure[side] += confidence.at(at, 0);
    away[side] += distance.at(at, 0);
    ++counts[side];
  }
  CHECK(sure[0] / counts[0] > 2 * sure[1] / counts[1]);
  // The outermost of needles that lie within 0.01 is what is seen first.
  const double first = away[0] / counts[0], second = away[1] / counts[1];
  CHECK(first == Approx(0.015).margin(0.015));
  CHECK(second - first == Approx(0.1).margin(0.02));
  // Whether the confidence is an output decides nothing else, nor which texels are sure enough.
  std::vector<std::vector<std::byte>> distances;
  for (const double least : {kDefaultMinConfidence, 0.5}) {
    options.splats.min_confidence = least;
    std::vector<std::byte> found[2];
    for (const bool beside : {true, false}) {
      options.channels.transferred = {Channel::distance};
      if (beside) options.channels.transferred.push_back(Channel::confidence);
      flow::transfer(options, {});
      found[beside ? 1 : 0] = read_whole(posix_file_system(), folder.file("distance.exr"));
    }
    CHECK(found[0] == found[1]);
    distances.push_back(found[0]);
  }
  CHECK(distances[0] != distances[1]);
}

}  // namespace pounce::test
