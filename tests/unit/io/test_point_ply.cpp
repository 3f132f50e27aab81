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
#include "core/job_space.h"
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
  check_usual(
      read(written(folder, "format binary_little_endian 1.0\n" + usual, usual_rows(false))));
  check_usual(read(written(folder, "format binary_big_endian 1.0\n" + usual, usual_rows(true))));
  const std::string text = "1 2 3 0 51 255\n4 5 6 102 153 204\n-1 0 .5 255 255 255\n";
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
  CHECK(Vec3d(cloud.points[0].mean) + cloud.info.origin == Vec3d{0.5, 0.25, 8});
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

/// `count` points about (x, 2, 3), .001 apart; in doubles.
std::string doubles(double x, int count) {
  std::string rows;
  for (int i = 0; i < count; ++i) {
    for (const double v : {x + i * 0.001, 2.0, 3.0}) put(rows, v);
    rows += "abc";
  }
  return rows;
}

TEST_CASE("a cloud far from 0 has an origin, in text too, and loses no digit") {
  const test::TempFolder folder;
  const std::string columns =
      "element vertex 1000\nproperty double x\nproperty double y\nproperty double z\nproperty "
      "uchar "
      "red\nproperty uchar green\nproperty uchar blue\n";
  const auto path = [&](double x) {
    return written(folder, "format binary_little_endian 1.0\n" + columns, doubles(x, 1000));
  };
  CHECK(read(path(2)).info.origin == Vec3d{});
  const auto check = [](const Cloud& cloud, double x) {
    REQUIRE(cloud.points.size() == 1000);
    CHECK(std::abs(cloud.info.origin.x - x) < 20);
    for (std::size_t i = 0; i < 1000; ++i) {
      CHECK(std::abs(static_cast<double>(cloud.points[i].mean.x) + cloud.info.origin.x -
                     (x + static_cast<double>(i) * 0.001)) < 1e-6);
      CHECK(static_cast<double>(cloud.points[i].mean.y) + cloud.info.origin.y == Approx(2));
    }
  };
  check(read(path(-448250.25)), -448250.25);
  std::string text;
  for (int i = 0; i < 1000; ++i) text += std::to_string(-448250.25 + i * 0.001) + " 2 3 97 98 99\n";
  check(read(written(folder, "format ascii 1.0\n" + columns, text)), -448250.25);
  // What a scanner puts at 0 for nothing is not where the cloud is.
  {
    std::string rows = doubles(-448250.25, 1000);
    const double nothing[3] = {0, 0, 0};
    std::memcpy(rows.data() + 27 * 500, nothing, sizeof nothing);
    const Cloud cloud = read(written(folder, "format binary_little_endian 1.0\n" + columns, rows));
    CHECK(std::abs(cloud.info.origin.x + 448250.25) < 20);
  }
  // Axes are turned before.
  const test::TempFolder scratch;
  const auto scene = open_splat_scene(path(500000), parse_axes("z,x,-y"));
  CHECK(std::abs(scene->info().origin.y - 500000) < 2);
  scene->prepare({&posix_file_system(), scratch.path()}, [] {});
  store::SplatRows rows;
  store::SplatCounts filtered{};
  scene->read(0, 1, rows, filtered);
  CHECK(static_cast<double>(rows.splats[0].mean.x) + scene->info().origin.x == Approx(3));
  CHECK(static_cast<double>(rows.splats[0].mean.z) + scene->info().origin.z == Approx(-2));
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
  has(problem(written(folder, "format ascii 1.0\n" + usual,
                      "1 2 3 0 51 255\n4 5 6 102 red 0\n1 2 3 4 5 6\n")),
      "line");
  has(problem(written(folder,
                      format + "element vertex 0\nproperty float x\nproperty float y\n"
                               "property float z\nproperty uchar red\nproperty uchar "
                               "green\nproperty uchar blue\n",
                      "")),
      "no points");
  std::string grey = usual;
  grey.replace(grey.find("property uchar red"), std::string::npos, "property float intensity\n");
  has(problem(written(folder, format + grey, std::string(48, '\0'))), "without colours (3 points)");
}

struct LasPoint {
  std::int32_t x, y, z;
  std::uint16_t red, green, blue;
  bool is_withheld = false;
  unsigned kind = 0;
};

std::string las(unsigned minor, unsigned format, const std::vector<LasPoint>& points,
                double offset = 0) {
  std::string head(minor == 4 ? 375 : minor == 3 ? 235 : 227, '\0');
  const auto set = [&](std::size_t at, auto value) {
    std::memcpy(head.data() + at, &value, sizeof value);
  };
  const bool is_extended = format >= 6;
  const std::uint16_t bytes = format == 2 ? 26 : format == 3 ? 34 : format == 7 ? 36 : 67;
  const std::size_t colours = format == 2 ? 20 : format == 3 ? 28 : 30;
  head.replace(0, 4, "LASF");
  set(24, std::uint8_t{1});
  set(25, static_cast<std::uint8_t>(minor));
  set(94, static_cast<std::uint16_t>(head.size()));
  set(96, static_cast<std::uint32_t>(head.size()));
  set(104, static_cast<std::uint8_t>(format));
  set(105, static_cast<std::uint16_t>(bytes + 4));  // with bytes of the writer's own
  if (minor < 4) set(107, static_cast<std::uint32_t>(points.size()));
  if (minor == 4) set(247, std::uint64_t{points.size()});
  for (std::size_t k = 0; k < 3; ++k) {
    set(131 + 8 * k, 0.001);
    set(155 + 8 * k, offset);
  }
  for (const LasPoint& p : points) {
    std::string row(bytes + 4U, '\x7e');
    const auto put_at = [&](std::size_t at, auto value) {
      std::memcpy(row.data() + at, &value, sizeof value);
    };
    put_at(0, p.x);
    put_at(4, p.y);
    put_at(8, p.z);
    put_at(colours, p.red);
    put_at(colours + 2, p.green);
    put_at(colours + 4, p.blue);
    const unsigned own = p.is_withheld ? (is_extended ? 4U : 0x80U) : 0U;
    put_at(15, static_cast<std::uint8_t>(is_extended ? own : own | p.kind));
    if (is_extended) put_at(16, static_cast<std::uint8_t>(p.kind));
    head += row;
  }
  return head;
}

std::string las_file(const test::TempFolder& folder, const std::string& bytes) {
  std::ofstream(folder.file("cloud.las"), std::ios::binary) << bytes;
  return folder.file("cloud.las");
}

TEST_CASE("LAS of every version and of point formats with colours is a cloud") {
  const test::TempFolder folder;
  const std::vector<LasPoint> points{{1000, -2000, 500, 0, 32768, 65535},
                                     {0, 0, 0, 1, 2, 3},
                                     {5, 5, 5, 9, 9, 9, true},
                                     {5, 5, 5, 9, 9, 9, false, 7}};
  for (const auto& [minor, format] :
       std::vector<std::pair<unsigned, unsigned>>{{2, 2}, {2, 3}, {3, 3}, {4, 7}, {4, 10}}) {
    const Cloud cloud = read(las_file(folder, las(minor, format, points)));
    CAPTURE(minor, format);
    CHECK(cloud.info.are_points);
    REQUIRE(cloud.points.size() == 2);  // neither what is withheld nor noise
    CHECK(cloud.filtered[static_cast<std::size_t>(store::SplatFilter::transparent)] == 2);
    CHECK(cloud.points[0].mean == Vec3f{1, -2, 0.5F});
    CHECK(cloud.points[0].colour.x == 0);
    CHECK(cloud.points[0].colour.y == Approx(32768.0 / 65535));
    CHECK(cloud.points[0].colour.z == 1);
    CHECK(cloud.info.assumptions.empty());
  }
}

TEST_CASE("LAS with colours of 8 bits and coordinates of a country") {
  const test::TempFolder folder;
  const Cloud cloud = read(
      las_file(folder, las(4, 7, {{0, 0, 0, 255, 51, 0}, {1000, 1000, 1000, 0, 0, 0}}, 5400000)));
  REQUIRE(cloud.points.size() == 2);
  CHECK(cloud.points[0].colour.x == 1);
  CHECK(cloud.points[0].colour.y == Approx(0.2));
  REQUIRE(cloud.info.assumptions.size() == 1);
  CHECK(cloud.info.assumptions[0].find("no colour is above 255") != std::string::npos);
  CHECK(std::abs(cloud.info.origin.x - 5400000) < 2);
  CHECK(static_cast<double>(cloud.points[1].mean.z) + cloud.info.origin.z == 5400001);
}

TEST_CASE("LAS that is not read says why") {
  const test::TempFolder folder;
  const std::string whole = las(2, 3, {{1, 2, 3, 4, 5, 6}, {7, 8, 9, 4, 5, 6}});
  const auto has = [&](const std::string& bytes, const char* part) {
    const std::string text = problem(las_file(folder, bytes));
    CAPTURE(text, part);
    CHECK(text.find(part) != std::string::npos);
  };
  const auto with = [&](std::size_t at, auto value) {
    std::string changed = whole;
    std::memcpy(changed.data() + at, &value, sizeof value);
    return changed;
  };
  has("LAS", "does not begin like a LAS");
  has(whole.substr(0, 100), "header ends at byte 100");
  has(with(25, std::uint8_t{1}), "LAS version 1.1");
  has(with(104, std::uint8_t{131}), "LAZ");
  has(with(104, std::uint8_t{1}), "no colours (point format 1)");
  has(with(105, std::uint16_t{30}), "its points have 30 bytes, format 3 needs 34");
  has(with(107, std::uint32_t{3}), "truncated: its header states 3 points of 38 bytes");
  has(with(107, std::uint32_t{0}), "no points");
  has(with(96, std::uint32_t{0xFFFFFFFF}), "truncated");
  has(with(131, std::numeric_limits<double>::quiet_NaN()), "scale or offset");
}

}  // namespace
}  // namespace pounce::io
