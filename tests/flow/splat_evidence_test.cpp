// SPDX-License-Identifier: Apache-2.0
//
// How sure a splat scene is of a target's texels: confidence and distance on planes of Gaussians,
// worked by hand, and scenes that do not lie at their target.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/file.h"
#include "flow/transfer.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/memory_file_system.h"
#include "support/splat_ply_builder.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr double kSpacing = 0.05, kLong = 0.08, kShort = 0.03, kEdge = 1.0 / 16;
constexpr std::size_t kMiddle = 8 * 16 + 8;  // its texel's centre is at 0.53125

/// Sheets of Gaussians across z, twice as wide as a square target of 16x16 texels from (0 0 0) to
/// (1 1 0) that faces +z. They are long, so they are no discs: a scene as captures are.
class Sheets {
 public:
  explicit Sheets(double max_distance = 0.4) {
    ply.columns = SplatPlyBuilder::usual_columns(0, false);
    square("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n", "0 0 1");
    options.source = folder.file("scene.ply");
    options.targets = {folder.file("target.obj")};
    options.output = folder.file("<CHANNEL>.exr");
    options.channels.transferred = {Channel::base_color, Channel::confidence, Channel::distance};
    options.image.size = ImageSize{16, 16};
    options.splats.look = Look::normal;
    options.image.depth = Depth::float32;
    options.search.max_distance = Length{max_distance, false};
    options.resources.threads = 2;
    options.resources.memory_bytes = 128ULL << 20;
    options.resources.use_cache = false;
  }

  /// `part`: of the image's width and height, from its lower left corner.
  void square(const std::string& corners, const std::string& normal, double part = 1) {
    std::ofstream(folder.file("target.obj"))
        << corners << "vt 0 0\nvt " << part << " 0\nvt " << part << ' ' << part << "\nvt 0 " << part
        << "\nvn " << normal << "\nf 1/1/1 2/2/1 3/3/1 4/4/1\n";
  }

  /// A sheet at z of this opacity.
  void add(double z, double alpha) {
    for (int i = 0; i < 40 * 40; ++i) {
      auto row = SplatPlyBuilder::usual_row(kSpacing * (i % 40) - 0.475);
      row["y"] = kSpacing * (i / 40) - 0.475;
      row["z"] = z;
      row["scale_0"] = std::log(kLong);
      row["scale_1"] = std::log(kShort);
      row["scale_2"] = -9;
      row["opacity"] = std::log(alpha / (1 - alpha));
      ply.rows.push_back(row);
    }
  }

  Report run(const job::TestKnobs& knobs = {.keeps_isolated = true}) {
    ply.write(options.source);
    return flow::transfer(options, knobs);
  }
  std::string path(Channel channel) const {
    return folder.file(std::string(channel_name(channel)) + ".exr");
  }
  double at(Channel channel) const { return read_whole_image(path(channel)).at(kMiddle, 0); }

  TempFolder folder;
  SplatPlyBuilder ply;
  TransferOptions options;
};

/// Blurred optical depth of a sheet before the middle texel: 0.4 peak (1 - q / 9) over its
/// Gaussians, each grown by the texel's footprint, with the fourth root of what that takes.
double mass_of(double alpha, double edge = kEdge) {
  const double footprint = 0.3 * edge * edge;
  const double across = kLong * kLong + footprint, along = kShort * kShort + footprint;
  const double peak = alpha * std::pow(kLong * kLong * kShort * kShort / (across * along), 0.25);
  double mass = 0;
  for (int i = 0; i < 40; ++i) {
    for (int j = 0; j < 40; ++j) {
      const double x = kSpacing * i - 0.475 - 0.53125, y = kSpacing * j - 0.475 - 0.53125;
      const double q = x * x / across + y * y / along;
      mass += q <= 9 ? 0.4 * peak * (1 - q / 9) : 0;
    }
  }
  return mass;
}

/// Of one colour, so far away where texels look 0.4.
double sureness_at(double distance) { return std::exp(-0.5 * std::abs(distance) / 0.4); }

}  // namespace

TEST_CASE("a sheet's distance and confidence are those worked by hand", "[flow]") {
  // Half the reach of 0.4 is the middle of a bin: nothing of the sheet lies before its anchor.
  const double z = GENERATE(0.2, -0.2), alpha = GENERATE(0.9, 0.5, 0.05);
  CAPTURE(z, alpha);
  Sheets sheets;
  sheets.add(z, alpha);
  const Report report = sheets.run();
  CHECK(report.targets[0].fit == 1.0);
  CHECK(report.targets[0].scene_offset == Approx(z).margin(1e-4));
  CHECK(report.targets[0].scene_spread == Approx(0).margin(1e-4));
  CHECK(report.target_empty == 0);
  const double confidence = (1 - std::exp(-mass_of(alpha))) * sureness_at(z);
  CHECK(sheets.at(Channel::confidence) == Approx(confidence).margin(1e-4));
  CHECK(sheets.at(Channel::distance) == Approx(z).margin(1e-4));
  CHECK(read_whole_image(sheets.path(Channel::confidence)).channels == 1);
  CHECK(read_whole_image(sheets.path(Channel::distance)).channels == 1);
  REQUIRE(report.channels.size() == 3);
  for (const ChannelReport& channel : report.channels) CHECK(channel.counts.covered == 256);
}

TEST_CASE("what shows through a sheet draws its distance inwards", "[flow]") {
  // Both sheets are alike, so the far one weighs what the near one lets through.
  Sheets sheets;
  sheets.add(0.2, 0.1);
  sheets.add(-0.2, 0.1);
  CHECK(sheets.run().targets[0].fit == 1.0);
  const double mass = mass_of(0.1), through = std::exp(-mass);
  REQUIRE(through > 0.3);
  const double away = 0.2 * (1 - through) / (1 + through);
  CHECK(sheets.at(Channel::confidence) ==
        Approx((1 - std::exp(-2 * mass)) * sureness_at(sheets.at(Channel::distance))).margin(1e-4));
  CHECK(sheets.at(Channel::distance) == Approx(away).margin(1e-3));
}

TEST_CASE("colours that differ along a normal make a texel less sure", "[flow]") {
  Sheets sheets;
  sheets.add(0.2, 0.1);
  sheets.add(-0.2, 0.1);
  const double c0 = 0.28209479177387814, near = 0.8, far = 0.3;
  for (std::size_t i = 0; i < sheets.ply.rows.size(); ++i) {
    for (const char* channel : {"f_dc_0", "f_dc_1", "f_dc_2"})
      sheets.ply.rows[i][channel] = ((i < 1600 ? near : far) - 0.5) / c0;
  }
  sheets.run();
  const double mass = mass_of(0.1), through = std::exp(-mass);
  const double share = through / (1 + through), away = 0.2 * (1 - through) / (1 + through);
  const double spread = std::sqrt(3 * share * (1 - share)) * (near - far);
  REQUIRE(spread > 0.3);
  CHECK(sheets.at(Channel::confidence) ==
        Approx((1 - std::exp(-2 * mass)) * sureness_at(away) * std::exp(-spread)).margin(1e-3));
}

TEST_CASE("confidence is opacity times fit, less far away", "[flow]") {
  // The sheet lies before some 2.5 % of the target: half as many places as would be sure of it.
  Sheets sheets;
  sheets.add(0.2, 0.5);
  sheets.square("v -5.8 -5.8 0\nv 6.8 -5.8 0\nv 6.8 6.8 0\nv -5.8 6.8 0\n", "0 0 1");
  sheets.options.image.size = ImageSize{200, 200};
  const Report report = sheets.run();
  REQUIRE(report.targets[0].fit);
  const double fit = *report.targets[0].fit;
  CHECK(fit > 0.4);
  CHECK(fit < 0.6);
  CHECK(report.target_covered > 0);
  const double opacity = 1 - std::exp(-mass_of(0.5, 12.6 / 200));
  const double found = read_whole_image(sheets.path(Channel::confidence)).at(100 * 200 + 100, 0);
  CHECK(found / fit ==
        Approx(opacity * sureness_at(0.2)).margin(0.02));  // texels lie otherwise in the lattice
}

TEST_CASE("a fit that is neither good nor bad is told", "[flow]") {
  // The sheet lies before less of the target than would be sure of it, but more than half as much.
  Sheets sheets;
  sheets.add(0.2, 0.5);
  const auto warned = [&] {
    const Report report = sheets.run();
    CAPTURE(*report.targets[0].fit);
    return std::count_if(report.warnings.begin(), report.warnings.end(), [](const auto& warning) {
      return warning.find("the scene may not match this target (fit 0.") != std::string::npos;
    });
  };
  CHECK(warned() == 0);
  sheets.square("v -5.2 -5.2 0\nv 6.2 -5.2 0\nv 6.2 6.2 0\nv -5.2 6.2 0\n", "0 0 1");
  sheets.options.image.size = ImageSize{64, 64};
  const double fit = *sheets.run().targets[0].fit;
  CHECK(fit > 0.5);
  CHECK(fit < 0.9);
  CHECK(warned() == 1);
}

TEST_CASE("padding makes no texel sure", "[flow]") {
  // A square over a quarter of the image: colours and distances go on around it, confidence ends.
  Sheets sheets;
  sheets.add(0.2, 0.5);
  sheets.options.image.padding_px = 4;
  sheets.square("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n", "0 0 1", 0.5);
  sheets.run();
  const auto beside = [&](Channel channel) {
    return read_whole_image(sheets.path(channel))
        .at(12 * 16 + 9, 0);  // a texel and a half beside the square
  };
  CHECK(beside(Channel::base_color) > 0.1);
  CHECK(beside(Channel::distance) == Approx(0.2).margin(1e-4));
  CHECK(beside(Channel::confidence) == 0);
}

TEST_CASE("texels that are less sure than asked stay empty", "[flow]") {
  Sheets sheets;
  sheets.add(0.2, 0.1);
  const double confidence = (1 - std::exp(-mass_of(0.1))) * sureness_at(0.2);
  sheets.options.channels.transferred = {Channel::base_color};
  sheets.options.splats.min_confidence = confidence - 0.01;
  CHECK(sheets.run().target_empty == 0);
  sheets.options.splats.min_confidence =
      confidence + 0.06;  // texels see the lattice a little differently
  const Report report = sheets.run();
  CHECK(report.target_covered == 0);
  CHECK(std::all_of(report.targets[0].distances.begin(), report.targets[0].distances.end(),
                    [](std::uint64_t count) { return count == 0; }));
}

TEST_CASE("a scene that crosses its target does not fit", "[flow]") {
  // At 45 degrees along the square's middle line, and 0.5 to 0.85 away along the normals of most.
  Sheets sheets(0.05);
  sheets.add(0, 0.9);
  sheets.square("v 0 0 -0.5\nv 1 0 0.5\nv 1 1 0.5\nv 0 1 -0.5\n", "-1 0 1");
  const Report report = sheets.run();
  REQUIRE(report.targets[0].fit);
  CHECK(*report.targets[0].fit < 0.5);
  CHECK(report.target_covered * 20 < report.target_texels);
  REQUIRE(!report.warnings.empty());
  const std::string& warning = report.warnings.back();
  for (const char* part :
       {"does not match this target", "--source-axes", "--max-distance", "--min-confidence 0"}) {
    CAPTURE(warning, part);
    CHECK(warning.find(part) != std::string::npos);
  }
  CHECK(to_json(report).find("\"fit\": ") != std::string::npos);

  sheets.options.splats.min_confidence = 0;  // what is there all the same
  CHECK(sheets.run().target_covered > 0);
}

TEST_CASE("the fit is looked for farther than colours are", "[flow]") {
  // 6 % of the diagonal are 0.085: the sheet is there, but no texel may look so far.
  Sheets sheets(0.03);
  sheets.add(0.045, 0.9);
  for (auto& row : sheets.ply.rows) row["scale_2"] = std::log(0.005);
  const Report report = sheets.run();
  CHECK(report.targets[0].fit == 1.0);
  CHECK(report.target_covered * 20 < report.target_texels);
  CHECK(report.source_filtered.empty());
  REQUIRE(!report.warnings.empty());
  CHECK(report.warnings.back().find("or use --max-distance 0.06") != std::string::npos);
  // The sheet is so thick that it comes near enough to be sorted, but others would not be.
  sheets.options.splats.near_target = Length{0.03, false};
  const Report near = sheets.run();
  CHECK(near.source_gaussians > 400);  // all but those beside the target
  CHECK(near.targets[0].fit == 0.0);
}

TEST_CASE("evidence has the same bytes however it is made", "[flow]") {
  Sheets sheets;
  sheets.options.image.size = ImageSize{150, 130};
  for (const double z : {0.3, 0.1, 0.0, -0.1, -0.15}) sheets.add(z, 0.1 - z * 0.2);
  const auto bytes = [&] {
    std::vector<std::vector<std::byte>> all;
    for (const Channel channel : sheets.options.channels.transferred)
      all.push_back(read_whole(posix_file_system(), sheets.path(channel)));
    return all;
  };
  const auto in_memory = test::make_memory_file_system();
  const double fit = sheets.run({.files = in_memory.get()}).targets[0].fit.value();
  const auto expected = bytes();
  for (const unsigned threads : {1U, 5U}) {
    for (const std::uint64_t tile_cap : {std::uint64_t{1}, std::uint64_t{0}}) {
      sheets.options.resources.threads = threads;
      sheets.options.resources.memory_bytes = 128ULL << 20;
      const job::TestKnobs knobs{.tile_cap_bytes = tile_cap};
      const std::uint64_t least = flow::plan(sheets.options, knobs).least_memory_bytes;
      for (const std::uint64_t memory : {least, std::uint64_t{512} << 20}) {
        CAPTURE(threads, tile_cap, memory);
        sheets.options.resources.memory_bytes = memory;
        CHECK(sheets.run(knobs).targets[0].fit == fit);
        CHECK((bytes() == expected));
      }
    }
  }
}

TEST_CASE("evidence goes only where it can be held", "[flow]") {
  Sheets sheets;
  sheets.add(0, 0.9);
  sheets.ply.write(sheets.options.source);
  const auto refusal = [&](const TransferOptions& asked, const std::string& part) {
    std::string message;
    CHECK(error_kind([&] { transfer(asked); }, &message) == exit_status(ErrorKind::usage));
    CAPTURE(message);
    CHECK(message.find(part) != std::string::npos);
  };
  for (const char* ending : {"png", "jpg"}) {
    TransferOptions other = sheets.options;
    other.output = sheets.folder.file(std::string("<CHANNEL>.") + ending);
    other.image.depth.reset();
    refusal(other, "distance: signed values");
    refusal(other, ".exr or .tif");
  }
  TransferOptions other = sheets.options;
  other.output = sheets.folder.file("<CHANNEL>.tif");
  other.image.depth = Depth::u16;
  refusal(other, "remove --depth");
  other.image.depth.reset();  // colours in integers, lengths in floats
  transfer(other);
  CHECK(std::filesystem::exists(sheets.folder.file("distance.tif")));
  other = sheets.options;
  other.output = sheets.folder.file("out.glb");
  other.image.depth.reset();
  refusal(other, "confidence");
  other = sheets.options;
  other.output = sheets.folder.file("confidence.exr");
  other.composite.onto = sheets.folder.file("baseColor.tif");
  other.channels.transferred = {Channel::confidence};
  refusal(other, "--onto");
  other = sheets.options;
  other.source = sheets.options.targets[0];
  other.splats.look = Look::automatic;
  refusal(other, "is a mesh");
  other.channels.transferred = {Channel::base_color};
  other.splats.min_confidence = 0.5;
  refusal(other, "--min-confidence");
  other = sheets.options;
  other.splats.min_confidence = 1.5;
  refusal(other, "from 0 to 1");
  other = sheets.options;
  other.material.textures = {{Channel::distance, "a.png"}};
  refusal(other, "--source-texture");
}

TEST_CASE("confidence in integers is rounded", "[flow]") {
  Sheets sheets;
  sheets.add(0.2, 0.5);
  sheets.options.channels.transferred = {Channel::confidence};
  sheets.options.image.depth.reset();
  sheets.options.output = sheets.folder.file("out.png");
  sheets.run();
  const WholeImage out = read_whole_image(sheets.options.output);
  CHECK(out.channels == 1);
  CHECK(out.at(kMiddle, 0) ==
        std::round((1 - std::exp(-mass_of(0.5))) * sureness_at(0.2) * 255) / 255);
}

TEST_CASE("real scenes fit their own targets and no others", "[flow][external]") {
  const auto found = test_data();
  if (!found) return;
  const std::string data = found->string();
  const TempFolder folder;
  const std::string bot = data + "/splats/playbot_lod3_converted/playbot_lod3.ply",
                    bot_proxy = data + "/meshes/playbot_proxy/playbot_proxy.glb",
                    angel = data + "/captures/angel.ply",
                    angel_proxy = data + "/captures/angel_proxy.glb",
                    narcissus = data + "/captures/narcissus.ply",
                    narcissus_proxy = data + "/captures/narcissus_proxy.glb",
                    sphere = data + "/splats/noisy_sphere/scene.ply",
                    sphere_target = data + "/splats/noisy_sphere/sphere.obj";
  const auto covered = [&](const std::string& scene, const std::string& target,
                           const std::string& axes) {
    TransferOptions options;
    options.source = scene;
    options.targets = {target};
    options.source_use.axes = axes;
    options.output = folder.file("out.png");
    options.image.size = ImageSize{128, 128};
    options.resources.cache_dir = folder.file("cache");
    options.resources.memory_bytes = 256ULL << 20;
    const Report report = transfer(options);
    CAPTURE(scene, target, axes);
    CHECK((*report.targets[0].fit < 0.5) == (report.target_covered == 0));
    return static_cast<double>(report.target_covered) / static_cast<double>(report.target_texels);
  };
  CHECK(covered(bot, bot_proxy, "") > 0.99);
  CHECK(covered(angel, angel_proxy, "") > 0.99);
  CHECK(covered(narcissus, narcissus_proxy, "") > 0.99);
  CHECK(covered(bot, angel_proxy, "") < 0.05);
  CHECK(covered(angel, narcissus_proxy, "") < 0.05);
  CHECK(covered(narcissus, bot_proxy, "") < 0.05);
  CHECK(covered(angel, angel_proxy, "x,-y,-z") < 0.05);
  CHECK(covered(sphere, sphere_target, "") > 0.99);
  CHECK(covered(narcissus, data + "/meshes/lee_perry_smith/LeePerrySmith_plain_textured.glb", "") <
        0.05);  // a tenth of the places, at distances that nearly agree: a fit of 0.16 before
}

}  // namespace pounce::test
