// SPDX-License-Identifier: Apache-2.0
//
// Scenes that are cut off, changed at random or lie: each is read, or refused as input.
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <functional>
#include <random>

#include "splat_reading.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

bool has(const std::string& text, const std::string& part) {
  INFO(text);
  const bool found = text.find(part) != std::string::npos;
  CHECK(found);
  return found;
}

struct Encoded {
  std::string name, bytes;
  bool is_whole_or_nothing = true;  ///< cut off, it is refused wherever the cut is
};

std::vector<Encoded> encoded(std::size_t count) {
  const test::Scene scene = test::random_scene(count, 5);
  return {{"a.ply", test::ply_bytes(scene, false)},
          {"b.ply", test::compressed_ply_bytes(scene)},
          {"c.splat", test::dot_splat_bytes(scene), false},
          {"d1.spz", test::gzipped(test::spz_bytes(scene, 1))},
          {"d2.spz", test::spz_bytes(scene, 2)},
          {"d3.spz", test::gzipped(test::spz_bytes(scene, 3))},
          {"d4.spz", test::spz_bytes(scene, 4)},
          {"e0.ksplat", test::ksplat_bytes(scene, 0)},
          {"e2.ksplat", test::ksplat_bytes(scene, 2)},
          {"f.glb", test::gltf_scene(scene).bytes()}};
}

TEST_CASE("a scene that was cut off is refused", "[io]") {
  const test::TempFolder folder;
  for (const Encoded& file : encoded(40)) {
    CAPTURE(file.name);
    CHECK(splat_problem(write_bytes(folder, file.name, file.bytes)).empty());
    for (std::size_t k = 0; k < 60; ++k) {
      const std::size_t size = k < 40 ? file.bytes.size() * k / 40 : file.bytes.size() - (k - 39);
      CAPTURE(size);
      if (file.name == "f.glb" && size < 4) continue;  // not to be known as a scene
      const std::string problem =
          splat_problem(write_bytes(folder, file.name, file.bytes.substr(0, size)));
      if (file.is_whole_or_nothing || size % 32 != 0) CHECK_FALSE(problem.empty());
    }
  }
}

TEST_CASE("a scene changed at random is read or refused", "[io]") {
  const test::TempFolder folder;
  std::mt19937 random(17);
  for (const Encoded& file : encoded(12)) {
    CAPTURE(file.name);
    int refused = 0, read = 0;
    for (int round = 0; round < 120; ++round) {
      CAPTURE(round);
      std::string bytes = file.bytes;
      const std::size_t within =
          round % 2 == 0 ? bytes.size() : std::min<std::size_t>(bytes.size(), 64);
      for (int k = 0; k <= round % 3; ++k) bytes[random() % within] = static_cast<char>(random());
      ++(splat_problem(write_bytes(folder, file.name, bytes)).empty() ? read : refused);
    }
    std::printf("FIGURE mutants of %s: %d read, %d refused\n", file.name.c_str(), read, refused);
    if (file.name != "c.splat") CHECK(refused > 10);
    // A checksum lets next to nothing through; without one other values are as good as these.
    const bool is_checked = file.bytes.starts_with("\x1f\x8b");
    if (!is_checked) CHECK(read > 5);
    CHECK(splat_problem(write_bytes(folder, file.name, file.bytes)).empty());
  }
}

TEST_CASE("a SOG changed at random is read or refused", "[io]") {
  const test::TempFolder folder;
  const test::Scene scene = test::random_scene(50, 5);
  test::write_sog(scene, folder.path() / "sog");
  const std::string path = folder.file("sog");
  CHECK(splat_problem(path).empty());
  std::mt19937 random(3);
  int refused = 0, read = 0;
  for (const auto& entry : fs::directory_iterator(path)) {
    const std::string name = "sog/" + entry.path().filename().string();
    std::string whole;
    {
      std::ifstream in(entry.path(), std::ios::binary);
      whole.assign(std::istreambuf_iterator<char>(in), {});
    }
    CAPTURE(name);
    for (int round = 0; round < 40; ++round) {
      std::string bytes = whole;
      if (round % 4 == 0) bytes.resize(random() % bytes.size());
      const std::size_t within =
          round % 2 == 0 ? bytes.size() : std::min<std::size_t>(bytes.size(), 80);
      for (int k = 0; k <= round % 3 && within > 0; ++k)
        bytes[random() % within] = static_cast<char>(random());
      write_bytes(folder, name, bytes);
      try {
        read_scene(path, 8);
        ++read;
      } catch (const Error& e) {
        INFO(e.what());
        CHECK(e.kind() == ErrorKind::input);
        ++refused;
      }
    }
    write_bytes(folder, name, whole);
  }
  std::printf("FIGURE mutants of a SOG: %d read, %d refused\n", read, refused);
  CHECK(refused > 80);
  CHECK(read > 40);
}

TEST_CASE("headers that lie are refused before anything is made of them", "[io]") {
  const test::TempFolder folder;
  const test::Scene scene = test::random_scene(10, 5);
  const auto problem = [&](const std::string& name, std::string bytes, std::size_t at, auto value) {
    std::memcpy(&bytes[at], &value, sizeof value);
    const std::string path = write_bytes(folder, name, bytes);
    try {
      open_splat_scene(path, {});
    } catch (const Error& e) {
      CHECK(e.kind() == ErrorKind::input);
      return std::string(e.what());
    }
    return std::string();
  };
  const std::string v2 = test::spz_bytes(scene, 2), v4 = test::spz_bytes(scene, 4);
  const auto gzip = [&](std::size_t at, std::uint32_t value) {
    std::string bytes = v2;
    std::memcpy(&bytes[at], &value, sizeof value);
    return problem("a.spz", test::gzipped(bytes), 0, std::uint8_t{0x1F});
  };
  has(problem("a.spz", v2, 8, std::uint32_t{0x7FFFFFFF}), "more than the file's");
  has(problem("a.spz", v4, 8, std::uint32_t{0x7FFFFFFF}), "more than the file's");
  has(problem("a.spz", v2, 8, std::uint32_t{0x80000000}), "more than 2^31 - 1");
  has(problem("a.spz", v2, 8, std::uint32_t{0}), "no Gaussians");
  has(problem("a.spz", v2, 8, std::uint32_t{9}), "the file has");
  has(problem("a.spz", v2, 4, std::uint32_t{5}), "SPZ version 5");
  has(problem("a.spz", v2, 12, std::uint8_t{5}), "degree 5");
  has(problem("a.spz", v2, 13, std::uint8_t{31}), "31 fractional bits");
  has(gzip(8, 0x7FFFFFFF), "more than the file's");
  has(gzip(4, 4), "SPZ version 4 in gzip");
  has(problem("a.spz", v4, 15, std::uint8_t{5}), "5 streams, but there must be 6");
  has(problem("a.spz", v4, 16, std::uint32_t{31}), "list of streams");
  has(problem("a.spz", v4, 16, std::uint32_t{0xFFFFFFFF}), "list of streams");
  has(problem("a.spz", v4, 32, std::uint64_t{1} << 60), "extends beyond the end");
  has(problem("a.spz", v4, 40, std::uint64_t{1} << 60), "10 Gaussians need 90");
  const std::string k1 = test::ksplat_bytes(scene, 1);
  has(problem("a.ksplat", k1, 0, std::uint8_t{1}), "version 1.1");
  has(problem("a.ksplat", k1, 4, std::uint32_t{5000}), "5000 sections");
  has(problem("a.ksplat", k1, 4, std::uint32_t{4000}), "section headers are truncated");
  has(problem("a.ksplat", k1, 20, std::uint16_t{3}), "level 3");
  has(problem("a.ksplat", k1, 4096, std::uint32_t{0xFFFFFFFF}), "more Gaussians than its capacity");
  has(problem("a.ksplat", k1, 4100, std::uint32_t{0xFFFFFFFF}), "beyond the end of the file");
  has(problem("a.ksplat", k1, 4108, std::uint32_t{0}), "fewer buckets than it fills");
  has(problem("a.ksplat", k1, 4132, std::uint32_t{0xFFFFFFFF}), "beyond the end of the file");
  has(problem("a.ksplat", k1, 4136, std::uint16_t{3}), "degree 3");
  has(problem("a.ksplat", k1, 5120, std::uint32_t{0}), "empty bucket");
  has(problem("a.ksplat", k1, 5120, std::uint32_t{9}), "do not contain all Gaussians");
  has(problem("a.splat", test::dot_splat_bytes(scene) + "x", 0, 1.0F), "321 bytes");
  const std::string ply = test::compressed_ply_bytes(scene);
  const auto edited = [&](const std::string& from, const std::string& to) {
    std::string bytes = ply;
    bytes.replace(bytes.find(from), from.size(), to);
    return problem("a.ply", bytes, 0, 'p');
  };
  has(edited("vertex 10", "vertex 4000000000000"), "truncated");
  has(edited("chunk 1", "chunk 0"), "do not match");
  std::string fewer = ply;
  fewer.replace(fewer.find("element sh 10"), 13, "element sh 9");
  fewer.resize(fewer.size() - 9);
  has(problem("a.ply", fewer, 0, 'p'), "9 rows of spherical harmonics");
  fewer = test::compressed_ply_bytes(test::random_scene(300, 5));
  fewer.replace(fewer.find("chunk 2"), 7, "chunk 1");
  fewer.erase(fewer.find("end_header") + 11, 18 * 4);
  has(problem("a.ply", fewer, 0, 'p'), "has 1 chunks of 256");
  has(edited("float max_scale_z", "float max_scale_w"), "no column \"max_scale_z\"");
  has(edited("float min_x", "int min_x"), "of an unknown type");
  has(edited("uint packed_scale", "uint packed_size"), "no column \"packed_scale\"");
  has(edited("element chunk", "element clump"), "no element \"chunk\"");
}

TEST_CASE("SPZ that inflates to more or less than its header says is refused", "[io]") {
  const test::TempFolder folder;
  const std::string bytes = test::spz_bytes(test::random_scene(10, 5), 3);
  has(splat_problem(write_bytes(folder, "a.spz", test::gzipped(bytes + "x"))), "more bytes follow");
  has(splat_problem(write_bytes(folder, "a.spz", test::gzipped(bytes.substr(0, 99)))),
      "but only 99 exist");
  std::string damaged = test::gzipped(bytes);
  damaged[damaged.size() - 6] = static_cast<char>(damaged[damaged.size() - 6] ^ 1);  // the checksum
  has(splat_problem(write_bytes(folder, "a.spz", damaged)), "damaged");
  // A bomb behind the Gaussians costs nothing but the reading of its first 64 KiB.
  std::string flagged = test::spz_bytes(test::random_scene(10, 5), 3, std::string(8, '\0'));
  has(splat_problem(
          write_bytes(folder, "a.spz", test::gzipped(flagged + std::string(1 << 20, '\0')))),
      "more bytes follow");
}

TEST_CASE("a scene of more Gaussians than its file can hold is refused", "[io]") {
  const test::TempFolder folder;
  // One Gaussian, 300,000 times: nearly nothing once compressed.
  const test::Scene one = test::random_scene(1, 5);
  test::Scene many = one;
  many.assign(300'000, one.front());
  const std::string spz = write_bytes(folder, "a.spz", test::gzipped(test::spz_bytes(many, 3)));
  REQUIRE(fs::file_size(spz) < 300'000);
  has(splat_problem(spz), "a.spz: states 300000 Gaussians in ");
  has(splat_problem(spz), "convert it to PLY");
  // Few are no harm, and a scene that is one is read.
  many.resize(200'000);
  CHECK(open_splat_scene(write_bytes(folder, "b.spz", test::gzipped(test::spz_bytes(many, 3))), {})
            ->info()
            .splats == 200'000);
  CHECK(open_splat_scene(
            write_bytes(folder, "c.spz",
                        test::gzipped(test::spz_bytes(test::random_scene(300'000, 5), 3))),
            {})
            ->info()
            .splats == 300'000);
}

TEST_CASE("a SOG does not lead out of its folder", "[io]") {
  const test::TempFolder folder;
  test::write_sog(test::random_scene(20, 5), folder.path() / "sog");
  fs::rename(folder.file("sog/low.webp"), folder.file("low.webp"));
  nlohmann::json meta;
  std::ifstream(folder.file("sog/meta.json")) >> meta;
  const auto problem = [&](const std::string& name) {
    meta["means"]["files"][0] = name;
    std::ofstream(folder.file("sog/meta.json")) << meta;
    return splat_problem(folder.file("sog"));
  };
  has(problem("../low.webp"), "in another folder");
  has(problem(folder.file("low.webp")), "in another folder");
  has(problem("low.webp"), "missing");
  fs::create_symlink(folder.file("low.webp"), folder.file("sog/low.webp"));
  has(problem("low.webp"), "missing");
  fs::remove(folder.file("sog/low.webp"));
  fs::rename(folder.file("low.webp"), folder.file("sog/low.webp"));
  CHECK(problem("low.webp").empty());
  meta["count"] = 25;
  has(problem("low.webp"), "states 25 Gaussians");
  meta["count"] = 20;
  meta["shN"]["bands"] = 2;
  has(problem("low.webp"), "a palette of degree 2, 512 pixels wide");
  meta["shN"]["bands"] = 1;
  meta["scales"]["codebook"].erase(0);
  has(problem("low.webp"), "no codebook of 256 numbers in \"scales\"");
  meta["version"] = 3;
  has(problem("low.webp"), "SOG version 3");
}

TEST_CASE("null in a codebook is what JSON has for infinity", "[io]") {
  const test::TempFolder folder;
  test::write_sog(test::random_scene(20, 5), folder.path() / "sog");
  nlohmann::json meta;
  std::ifstream(folder.file("sog/meta.json")) >> meta;
  meta["scales"]["codebook"] = std::vector<nlohmann::json>(256);
  std::ofstream(folder.file("sog/meta.json")) << meta;
  const ReadScene read = read_scene(folder.file("sog"));
  CHECK(read.count(store::SplatFilter::sizeless) == 20);
}

}  // namespace
}  // namespace pounce::io
