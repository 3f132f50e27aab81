// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "core/file.h"
#include "io/splats/scene.h"
#include "pounce/error.h"
#include "support/test_data.h"

namespace pounce::io {
namespace {

struct Cloud {
  SplatSceneInfo info;
  PageVector<store::Splat> points;
  store::SplatCounts filtered{};
};

Cloud read(const std::string& path) {
  const test::TempFolder scratch;
  const auto scene = open_splat_scene(path, {});
  CHECK(scene->unpacked_bytes() % 40 == 0);
  scene->prepare({&posix_file_system(), scratch.path()}, [] {});
  Cloud cloud{scene->info(), {}, {}};
  store::SplatRows rows;
  scene->read(0, cloud.info.splats, rows, cloud.filtered);
  cloud.points = std::move(rows.splats);
  return cloud;
}

std::string written(const test::TempFolder& folder, const std::string& header,
                    const std::string& rows) {
  const std::string path = folder.file("cloud.ply");
  std::ofstream(path, std::ios::binary) << "ply\n" << header << "end_header\n" << rows;
  return path;
}

template <class T>
void put(std::string& to, T value, bool is_swapped = false) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof value);
  if (is_swapped) std::reverse(raw.begin(), raw.end());
  to.append(raw.data(), raw.size());
}

constexpr const char* kUsual =
    "element vertex 3\n"
    "property float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n";

/// (1, 2, 3) black to white, (4, 5, 6), (-1, 0, 0.5).
std::string usual_rows(bool is_swapped) {
  std::string rows;
  const float places[3][3] = {{1, 2, 3}, {4, 5, 6}, {-1, 0, 0.5F}};
  const std::uint8_t colours[3][3] = {{0, 51, 255}, {102, 153, 204}, {255, 255, 255}};
  for (int i = 0; i < 3; ++i) {
    for (const float v : places[i]) put(rows, v, is_swapped);
    for (const std::uint8_t v : colours[i]) put(rows, v);
  }
  return rows;
}

void check_usual(const Cloud& cloud) {
  REQUIRE(cloud.points.size() == 3);
  CHECK(cloud.info.are_points);
  CHECK(cloud.info.format == "point cloud PLY");
  CHECK(cloud.points[0].mean == Vec3f{1, 2, 3});
  CHECK(cloud.points[2].mean == Vec3f{-1, 0, 0.5F});
  CHECK(cloud.points[0].colour.y == Approx(0.2));
  CHECK(cloud.points[0].colour.z == 1);
  CHECK(cloud.points[1].colour.x == Approx(0.4));
  for (const store::Splat& s : cloud.points) {
    CHECK(s.alpha == 1);
    CHECK(s.sigma.x > 0);
    CHECK(s.normal == Vec3f{});
  }
}

TEST_CASE("a coloured point cloud is one scene in whatever encoding its PLY has") {
  const test::TempFolder folder;
  const std::string usual(kUsual);
  check_usual(read(written(folder, "format binary_little_endian 1.0\n" + usual,
                           usual_rows(false))));
  check_usual(read(written(folder, "format binary_big_endian 1.0\n" + usual, usual_rows(true))));
  const std::string text =
      "1 2 3 0 51 255\n4 5 6 102 153 204\n-1 0 .5 255 255 255\n";
  check_usual(read(written(folder, "format ascii 1.0\n" + usual, text)));
  // Behind other elements, with others behind it.
  check_usual(read(written(folder,
                           "format ascii 1.0\nelement camera 2\nproperty float f\n" + usual +
                               "element note 1\nproperty list uchar int words\n",
                           "7\n8\n" + text + "2 1 1\n")));
  // Faces of which there are none.
  check_usual(read(written(folder,
                           "format binary_little_endian 1.0\n" + usual +
                               "element face 0\nproperty list uchar int vertex_indices\n",
                           usual_rows(false))));
}

TEST_CASE("colours are fractions of what their type holds, and floats are as they are") {
  const test::TempFolder folder;
  const std::string places = "property double x\nproperty double y\nproperty double z\n";
  std::string rows;
  for (const double v : {0.5, 0.25, 8.0}) put(rows, v);
  for (const int v : {0, 32768, 65535}) put(rows, static_cast<std::uint16_t>(v));
  Cloud cloud = read(written(folder,
                             "format binary_little_endian 1.0\nelement vertex 1\n" + places +
                                 "property ushort r\nproperty ushort g\nproperty ushort b\n",
                             rows));
  REQUIRE(cloud.points.size() == 1);
  CHECK(cloud.points[0].mean == Vec3f{0.5F, 0.25F, 8});
  CHECK(cloud.points[0].colour.y == Approx(32768.0 / 65535));
  CHECK(cloud.points[0].colour.z == 1);

  cloud = read(written(folder,
                       "format ascii 1.0\nelement vertex 1\n" + places +
                           "property float diffuse_red\nproperty float diffuse_green\nproperty "
                           "float diffuse_blue\nproperty uchar alpha\nproperty float nx\nproperty "
                           "float ny\nproperty float nz\nproperty int label\n",
                       "0 0 0 .125 .5 1 51 0 0 -2 17\n"));
  REQUIRE(cloud.points.size() == 1);
  CHECK(cloud.points[0].colour.x == 0.125F);
  CHECK(cloud.points[0].alpha == Approx(0.2));
  CHECK(cloud.points[0].normal == Vec3f{0, 0, -1});
}

TEST_CASE("a cloud far from the origin says how its places are rounded") {
  const test::TempFolder folder;
  const std::string header =
      "format binary_little_endian 1.0\nelement vertex 1\nproperty double x\nproperty double y\n"
      "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";
  const auto notes = [&](double x) {
    std::string rows;
    for (const double v : {x, 2.0, 3.0}) put(rows, v);
    rows += "abc";
    return read(written(folder, header, rows)).info.assumptions;
  };
  CHECK(notes(1000).empty());
  const auto far = notes(-500000);
  REQUIRE(far.size() == 1);
  CHECK(far[0].find("500000 units from the origin, where places are rounded to 0.06 units") !=
        std::string::npos);
}

TEST_CASE("points without a place are left out and counted, in text too") {
  const test::TempFolder folder;
  std::string rows = usual_rows(false);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(rows.data() + 15, &nan, sizeof nan);
  const auto not_finite = static_cast<std::size_t>(store::SplatFilter::not_finite);
  for (const Cloud& cloud :
       {read(written(folder, std::string("format binary_little_endian 1.0\n") + kUsual, rows)),
        read(written(folder, std::string("format ascii 1.0\n") + kUsual,
                     "1 2 3 0 51 255\nnan 5 6 102 153 204\n-1 0 .5 255 255 255\n"))}) {
    CHECK(cloud.points.size() == 2);
    CHECK(cloud.filtered[not_finite] == 1);
  }
}

std::string problem(const std::string& path) {
  try {
    read(path);
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    CHECK(std::string(e.what()).find(path) == 0);
    return e.what();
  }
  return "";
}

TEST_CASE("what is no coloured cloud says what it lacks") {
  const test::TempFolder folder;
  const auto has = [](const std::string& text, const char* part) {
    CAPTURE(text, part);
    CHECK(text.find(part) != std::string::npos);
  };
  const std::string format = "format binary_little_endian 1.0\n", usual(kUsual);
  has(problem(written(folder, format + usual, usual_rows(false).substr(1))), "truncated");
  has(problem(written(folder, "format ascii 1.0\n" + usual, "1 2 3 0 51 255\n4 5 6 102 red 0\n1 2 3 4 5 6\n")),
      "line");
  has(problem(written(folder, format + "element vertex 0\nproperty float x\nproperty float y\n"
                                       "property float z\nproperty uchar red\nproperty uchar "
                                       "green\nproperty uchar blue\n",
                      "")),
      "no points");
  std::string grey = usual;
  grey.replace(grey.find("property uchar red"), std::string::npos, "property float intensity\n");
  has(problem(written(folder, format + grey, std::string(48, '\0'))), "without colours (3 points)");
}

}  // namespace
}  // namespace pounce::io
