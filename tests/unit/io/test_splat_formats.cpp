// SPDX-License-Identifier: Apache-2.0
//
// One scene in every format, what each of them loses bounded by its steps; vectors and scenes that
// other programs wrote.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "io/splats/scene.h"
#include "splat_reading.h"

namespace pounce::io {
namespace {

using store::Splat;
using test::Scene;
using test::SceneSplat;

/// Largest differences: lengths, logarithms of sigma, degrees, opacity, colour, harmonics.
struct Loss {
  double mean = 0, log_sigma = 0, degrees = 0, alpha = 0, colour = 0, sh = 0;
};

/// By the chord: the arc cosine of nearly 1 has no digits left.
double degrees_between(const std::array<float, 4>& a, const std::array<float, 4>& b) {
  double same = 0, opposite = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto x = static_cast<double>(a[k]), y = static_cast<double>(b[k]);
    same += (x - y) * (x - y);
    opposite += (x + y) * (x + y);
  }
  const double chord = std::sqrt(std::min(same, opposite));
  return 4 * std::asin(chord / 2) * 180 / 3.14159265358979;
}

Loss loss(const Scene& scene, const ReadScene& read) {
  REQUIRE(read.rows.splats.size() == scene.size());
  Loss worst;
  const auto raise = [](double& most, double found) { most = std::max(most, std::abs(found)); };
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const SceneSplat& s = scene[i];
    const Splat& found = read.rows.splats[i];
    const std::array<float, 3> mean{found.mean.x, found.mean.y, found.mean.z},
        sigma{found.sigma.x, found.sigma.y, found.sigma.z},
        colour{found.colour.x, found.colour.y, found.colour.z};
    for (std::size_t k = 0; k < 3; ++k) {
      raise(worst.mean, mean[k] - s.mean[k]);
      raise(worst.log_sigma, std::log(sigma[k]) - s.log_sigma[k]);
      raise(worst.colour, colour[k] - (0.5 + test::kC0 * s.dc[k]));
    }
    raise(worst.alpha, found.alpha - s.alpha);
    raise(worst.degrees, degrees_between(found.rotation, s.q));
    for (std::size_t k = 0; k < 9 && read.rows.lobes == 3; ++k)
      raise(worst.sh, read.sh(i, k) - s.rest[k]);
  }
  return worst;
}

void check_loss(const Scene& scene, const ReadScene& read, const Loss& most) {
  const Loss found = loss(scene, read);
  CAPTURE(read.info.format);
  CHECK(found.mean <= most.mean);
  CHECK(found.log_sigma <= most.log_sigma);
  CHECK(found.degrees <= most.degrees);
  CHECK(found.alpha <= most.alpha);
  CHECK(found.colour <= most.colour);
  if (read.info.sh_degree > 0) CHECK(found.sh <= most.sh);
}

TEST_CASE("one scene in twelve encodings is one scene within each format's steps", "[io]") {
  const Scene scene = test::random_scene(700, 3);
  const test::TempFolder folder;
  int number = 0;
  const auto check = [&](const std::string& bytes, const char* ending, const std::string& format,
                         const Loss& most) {
    const std::string path = write_bytes(folder, std::to_string(number++) + ending, bytes);
    const ReadScene read = read_scene(path, 3);
    CHECK(read.info.format == format);
    check_loss(scene, read, most);
  };
  // Half a step of each value; of halves 2^-11 of it. Harmonics come as halves: 2^-12 at 1.
  constexpr double kByte = 0.5 / 255 + 1e-6, kHalf = 0.5e-3;
  check(test::ply_bytes(scene, false), "", "3DGS PLY", {0, 1e-5, 0.05, 1e-6, 1e-6, kHalf / 2});
  check(test::ply_bytes(scene, true), "", "3DGS PLY", {1e-3, 2e-3, 0.05, kHalf, kHalf, kHalf});
  // A chunk is 6 wide: half a step of 10 bits, of 4 in logarithms, 0.85 in colours, 8 in harmonics.
  check(test::compressed_ply_bytes(scene), "", "SuperSplat compressed PLY",
        {3 / 1023.0, 2 / 1023.0 + 1e-5, 0.25, kByte, 0.85 * kByte, 4 / 256.0 + kHalf});
  check(test::dot_splat_bytes(scene), ".splat", ".splat", {0, 1e-5, 0.8, kByte, kByte, 0});
  const Loss spz{0.5 / 4096 + 1e-6,        1 / 32.0 + 1e-5,  0.25, kByte,
                 test::kC0 / 0.15 * kByte, 0.5 / 128 + kHalf};
  Loss coarse = spz;  // 8 bits for x, y, z: what is left for w is coarse where it is small
  coarse.degrees = 3.5;
  check(test::spz_bytes(scene, 2), "", "SPZ v2", coarse);
  check(test::gzipped(test::spz_bytes(scene, 2)), "", "SPZ v2", coarse);
  check(test::gzipped(test::spz_bytes(scene, 3)), "", "SPZ v3", spz);
  check(test::spz_bytes(scene, 4), "", "SPZ v4", spz);
  coarse.mean = 1e-3;
  check(test::gzipped(test::spz_bytes(scene, 1)), "", "SPZ v1", coarse);
  check(test::gltf_scene(scene).bytes(), "", "glTF (KHR_gaussian_splatting)",
        {0, 1e-5, 0.05, 1e-6, 1e-6, kHalf / 2});
  check(test::ksplat_bytes(scene, 0), ".ksplat", ".ksplat (level 0)",
        {0, 1e-5, 0.05, kByte, kByte, kHalf / 2});
  check(test::ksplat_bytes(scene, 1), ".ksplat", ".ksplat (level 1)",
        {4 / 65534.0 + 1e-6, 1e-3, 0.06, kByte, kByte, kHalf});
  check(test::ksplat_bytes(scene, 2), ".ksplat", ".ksplat (level 2)",
        {4 / 65534.0 + 1e-6, 1e-3, 0.06, kByte, kByte, 3 * kByte + kHalf});
  test::write_sog(scene, folder.path() / "sog");
  for (const char* name : {"sog", "sog/meta.json"}) {
    const ReadScene read = read_scene(folder.file(name), 3);
    CHECK(read.info.format == "SOG v2 (a folder)");
    check_loss(scene, read,
               {4 * std::log(4.0) / 65535 + 1e-6, 2 / 255.0 + 1e-5, 1.1, kByte,
                3 * test::kC0 * kByte, 2 * kByte + kHalf});
    CHECK(read.info.files.size() == 8);
  }
}

TEST_CASE("what a reader takes does not depend on the number of Gaussians", "[io]") {
  const test::TempFolder folder;
  const auto bytes_of = [&](std::size_t count) {
    const Scene scene = test::random_scene(count, 3);
    test::write_sog(scene, folder.path() / "sog");
    std::vector<std::uint64_t> bytes;
    for (const std::string& path :
         {write_bytes(folder, "a.ply", test::ply_bytes(scene, false)),
          write_bytes(folder, "b.ply", test::compressed_ply_bytes(scene)),
          write_bytes(folder, "c.splat", test::dot_splat_bytes(scene)),
          write_bytes(folder, "d.spz", test::gzipped(test::spz_bytes(scene, 3))),
          write_bytes(folder, "e.ksplat", test::ksplat_bytes(scene, 1))}) {
      const auto opened = open_splat_scene(path, {});
      bytes.push_back(opened->prepare_bytes());
      bytes.push_back(opened->read_bytes());
    }
    const auto sog = open_splat_scene(folder.file("sog"), {});
    CHECK(sog->prepare_bytes() < 48 << 20);
    return bytes;
  };
  CHECK(bytes_of(500) == bytes_of(20000));
}

// Two Gaussians as other programs encoded them: A, then B.
constexpr const char* kSpz3 =
    "4e4753500300000002000000010c000000140000d8ff00010000d0ff000800002000ba1e9359b976809c60482c7070"
    "10"
    "69a595360000a0cc5070985880a86890b08090a88898b090a0b0";
constexpr const char* kDotSplat =
    "0000a03f000020c00000803dae0a963c53ea853bff2a3a3aa337ebbac0c040c0"
    "000040c00000003f0000004086ed4b3d86ed4b3d916701396d7fb51efaa38080";

std::string unhex(const std::string& hex) {
  std::string out;
  for (std::size_t i = 0; i < hex.size(); i += 2)
    out += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  return out;
}

void check_two(const ReadScene& read, const std::array<float, 4>& a, float degrees_margin = 0.01F) {
  REQUIRE(read.rows.splats.size() == 2);
  CHECK(degrees_between(read.rows.splats[0].rotation, a) < degrees_margin);
}

TEST_CASE("the golden vectors decode to their values", "[io]") {
  const test::TempFolder folder;
  SECTION("SPZ v3, in gzip and not, and v4") {
    const std::string v3 = unhex(kSpz3);
    std::string path;
    SECTION("as it is") { path = write_bytes(folder, "s", v3); }
    SECTION("gzip") { path = write_bytes(folder, "s", test::gzipped(v3)); }
    SECTION("v4") {
      std::string out = unhex("4e4753500400000002000000010c000620000000") + std::string(12, '\0');
      std::string frames;
      std::size_t at = 16;
      for (const std::size_t size : {18, 2, 6, 6, 8, 18}) {
        std::string frame(ZSTD_compressBound(size), '\0');
        frame.resize(ZSTD_compress(frame.data(), frame.size(), &v3[at], size, 1));
        test::put(out, std::uint64_t{frame.size()});
        test::put(out, std::uint64_t{size});
        frames += frame;
        at += size;
      }
      path = write_bytes(folder, "s", out + frames);
    }
    const ReadScene read = read_scene(path, 3);
    check_two(read, {0.499541F, 0.501374F, -0.499541F, 0.499541F});
    const Splat &a = read.rows.splats[0], &b = read.rows.splats[1];
    CHECK(a.mean == Vec3f{1.25F, -2.5F, 0.0625F});
    CHECK(b.mean == Vec3f{-3, 0.5F, 2});
    CHECK(a.alpha == Approx(0.729412).epsilon(1e-5));
    CHECK(b.alpha == Approx(0.117647).epsilon(1e-5));
    CHECK(a.colour.x == Approx(0.5 + test::kC0 * 0.509804).epsilon(1e-5));
    CHECK(a.colour.y == Approx(0.5 - test::kC0 * 1.006536).epsilon(1e-5));
    CHECK(b.colour.z == Approx(0.5 + test::kC0 * 0.745098).epsilon(1e-5));
    CHECK(a.sigma.z == Approx(std::exp(-7.25)).epsilon(1e-6));
    CHECK(b.sigma.x == Approx(std::exp(-3.0)).epsilon(1e-6));
    CHECK(degrees_between(b.rotation, {0.960139F, 0.279522F, 0, 0}) < 0.01);
    // Channel by channel in the reference, coefficient by coefficient here.
    constexpr std::array<double, 9> kA{-.375, -.3125, -.1875, -.125, 0, .125, .1875, .3125, .375};
    constexpr std::array<double, 9> kB{0, .0625, .125, .125, .1875, .25, .3125, .375, .375};
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t c = 0; c < 3; ++c) {
        CHECK(read.sh(0, 3 * k + c) == kA[3 * c + k]);
        CHECK(read.sh(1, 3 * k + c) == kB[3 * c + k]);
      }
    }
  }
  SECTION(".splat") {
    const ReadScene read = read_scene(write_bytes(folder, "s.splat", unhex(kDotSplat)));
    check_two(read, {0.5F, 0.5F, -0.5F, 0.5F});
    const Splat &a = read.rows.splats[0], &b = read.rows.splats[1];
    CHECK(a.mean == Vec3f{1.25F, -2.5F, 0.0625F});
    CHECK(a.sigma.x == Approx(std::exp(-4.0)).epsilon(1e-6));
    CHECK(a.colour.x == Approx(0xA3 / 255.0).epsilon(1e-6));
    CHECK(b.alpha == Approx(0x1E / 255.0).epsilon(1e-6));
    CHECK(b.mean.z == 2);
  }
  SECTION("compressed PLY") {
    std::string bytes = test::compressed_ply_bytes(test::random_scene(2, 1));
    bytes.resize(bytes.size() - 2 * 9 - 2 * 16 - 18 * 4);
    for (const float v :
         {-3.0F, -2.5F, 0.0625F, 1.25F, 0.5F, 2.0F, -4.0F, -5.5F, -9.0F, -3.0F, -3.0F, -7.25F,
          .42947629F, .21790521F, .71157110F, .64104742F, .5F, .92314219F}) {
      test::put(bytes, v);
    }
    for (const std::uint32_t v : {0xFFE00000U, 0x36925B69U, 0x000007FFU, 0xFF00FFBAU, 0x001FFFFFU,
                                  0x2CA80200U, 0xFFFFF800U, 0x00FF001EU}) {
      test::put(bytes, v);
    }
    for (const int v : {115, 118, 121, 124, 128, 131, 134, 137, 140, 128, 129, 131, 132, 134, 136,
                        137, 139, 140}) {
      bytes += static_cast<char>(v);
    }
    const ReadScene read = read_scene(write_bytes(folder, "s", bytes), 3);
    check_two(read, {.500767F, .499744F, -.499744F, .499744F});
    const Splat& a = read.rows.splats[0];
    CHECK(a.mean == Vec3f{1.25F, -2.5F, 0.0625F});
    CHECK(a.sigma.x == Approx(std::exp(-4.0)).epsilon(1e-6));
    CHECK(a.colour.x == Approx(.64104742).epsilon(1e-6));
    CHECK(a.alpha == Approx(0xBA / 255.0).epsilon(1e-6));
    constexpr std::array<double, 9> kA{-.390625, -.296875, -.203125, -.109375, .015625,
                                       .109375,  .203125,  .296875,  .390625};
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t c = 0; c < 3; ++c) CHECK(read.sh(0, 3 * k + c) == kA[3 * c + k]);
  }
}

TEST_CASE("an SPZ that names its axes is turned to those of a PLY, others are not", "[io]") {
  const Scene scene = test::random_scene(1, 9);
  const auto extension = [](std::uint32_t system) {
    std::string out;
    test::put(out, std::uint32_t{0xADBE0002});  // another one first
    test::put(out, std::uint32_t{2});
    out += "xy";
    test::put(out, std::uint32_t{0xADBE0003});
    test::put(out, std::uint32_t{4});
    test::put(out, system);
    return out;
  };
  const test::TempFolder folder;
  const auto read = [&](std::uint32_t version, std::uint32_t system, const Axes& axes = {}) {
    std::string bytes = test::spz_bytes(scene, version, extension(system));
    if (version == 3 && system != 4) bytes = test::gzipped(bytes);
    return read_scene(write_bytes(folder, "s.spz", bytes), 3, axes);
  };
  for (const std::uint32_t version : {3U, 4U}) {
    const ReadScene rdf = read(version, 6), rub = read(version, 4), luf = read(version, 7),
                    rfu = read(version, 12), unknown = read(version, 99);
    const Vec3f p = rdf.rows.splats[0].mean;
    CHECK(unknown.rows.splats[0].mean == p);
    CHECK(rub.rows.splats[0].mean == Vec3f{p.x, -p.y, -p.z});
    CHECK(luf.rows.splats[0].mean == Vec3f{-p.x, -p.y, p.z});
    CHECK(rfu.rows.splats[0].mean == Vec3f{p.x, -p.z, p.y});  // y is forward, z is up
    CHECK(rub.sh(0, 0) == -rdf.sh(0, 0));                     // goes with y
    CHECK(rub.sh(0, 3) == -rdf.sh(0, 3));                     // with z
    CHECK(rub.sh(0, 6) == rdf.sh(0, 6));                      // with x
    REQUIRE(rub.info.assumptions.size() == 1);
    CHECK(rub.info.assumptions[0].find("stated as RUB") != std::string::npos);
    CHECK(unknown.info.assumptions[0].find("read as stored") != std::string::npos);
    CHECK(read(version, 4, parse_axes("z,x,y")).rows.splats[0].mean == Vec3f{-p.z, p.x, -p.y});
    CHECK(read(version, 99, parse_axes("z,x,y")).info.assumptions.empty());  // the user said it
  }
  // Of a gzip file too before it is unpacked.
  const std::string path =
      write_bytes(folder, "s.spz",
                  test::gzipped(test::spz_bytes(test::random_scene(9000, 9), 3, extension(4))));
  REQUIRE(open_splat_scene(path, {})->info().assumptions.size() == 1);
  CHECK(open_splat_scene(path, {})->info().assumptions[0].find("RUB") != std::string::npos);
  // All of it is inflated for that: whoever waits is asked whether to go on.
  int asked = 0;
  open_splat_scene(path, {}, [&] { ++asked; });
  CHECK(asked > 3);
  CHECK_THROWS_AS(open_splat_scene(path, {}, [] { throw std::runtime_error("stop"); }),
                  std::runtime_error);
}

TEST_CASE("tags of training and coefficients beyond a file's are understood", "[io]") {
  const Scene scene = test::random_scene(3, 2);
  const test::TempFolder folder;
  const ReadScene tagged =
      read_scene(write_bytes(folder, "a", test::spz_bytes(scene, 3, {}, 1)), 15);
  CHECK(tagged.info.model == store::SplatModel::antialiased);
  for (std::size_t k = 9; k < 45; ++k) CHECK(tagged.sh(2, k) == 0);
  CHECK(read_scene(write_bytes(folder, "b", test::spz_bytes(scene, 3))).info.model ==
        store::SplatModel::standard);
}

TEST_CASE("coefficients that are no numbers or no halves", "[io]") {
  Scene scene = test::random_scene(3, 2);
  scene[0].rest[4] = std::nanf("");
  scene[1].rest[4] = -1e9F;
  const test::TempFolder folder;
  const std::string path = write_bytes(folder, "a.ply", test::ply_bytes(scene, false));
  const ReadScene read = read_scene(path, 3);
  CHECK(read.count(store::SplatFilter::not_finite) == 1);
  CHECK(read.sh(0, 4) == -65504);
  CHECK(read_scene(path, 0).rows.splats.size() == 3);  // nobody looks at them
}

/// Against what another program decoded. `turned`: into PLY's axes as it has them.
void check_facts(const std::string& name, const std::string& facts_name, const Axes& axes,
                 double mean_margin) {
  const auto data = test::test_data();
  if (!data) return;
  CAPTURE(name);
  nlohmann::json facts;
  std::ifstream((*data / "splats" / facts_name).string() + ".facts.json") >> facts;
  const ReadScene read = read_scene((*data / "splats" / name).string(), 0, axes);
  CHECK(read.info.splats == facts["count"].get<std::uint64_t>());
  double alpha = 0;
  std::array<double, 3> colour{};
  Box3f box;
  for (const Splat& s : read.rows.splats) {
    box.extend(s.mean);
    alpha += s.alpha;
    colour[0] += s.colour.x, colour[1] += s.colour.y, colour[2] += s.colour.z;
  }
  const auto n = static_cast<double>(read.rows.splats.size());
  const bool all = read.rows.splats.size() == read.info.splats;
  CHECK(alpha / n == Approx(facts["mean_opacity"].get<double>()).epsilon(all ? 1e-6 : 1e-3));
  for (std::size_t c = 0; c < 3; ++c) {
    CHECK(colour[c] / n ==
          Approx(facts["mean_colour_sh0"][c].get<double>()).epsilon(all ? 1e-5 : 1e-3));
  }
  CHECK(box.lo.x == Approx(facts["mean_bbox"]["min"][0].get<double>()).margin(mean_margin));
  CHECK(box.lo.y == Approx(facts["mean_bbox"]["min"][1].get<double>()).margin(mean_margin));
  CHECK(box.hi.z == Approx(facts["mean_bbox"]["max"][2].get<double>()).margin(mean_margin));
}

TEST_CASE("real scenes of every format hold what another program found in them",
          "[io][data][external]") {
  const std::string converted = "playbot_lod3_converted/playbot_lod3.";
  const Axes none{}, flip = parse_axes("x,-y,-z");
  for (const char* ending : {"ply", "compressed.ply", "sog", "glb"})
    check_facts(converted + ending, converted + ending, none, 1e-6);
  for (const char* ending : {"v3.spz", "v4.spz"})
    check_facts(converted + ending, converted + ending, flip, 1e-6);
  check_facts("playbot_lod3_sog", "playbot_lod3_sog", none, 1e-6);
  check_facts("playcanvas_logo_sog_v1", "playcanvas_logo_sog_v1", none, 1e-5);
  check_facts("minimal/minimal.splat", "minimal/minimal.splat", none, 0);
  check_facts("minimal/minimal.ksplat", "minimal/minimal.ksplat", none, 0);
  for (const char* version : {"v2", "v3", "v4"}) {
    const std::string name = std::string("minimal/minimal-") + version + ".spz";
    check_facts(name, name, flip, 1e-6);
  }
}

}  // namespace
}  // namespace pounce::io
