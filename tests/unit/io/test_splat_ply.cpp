// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "io/splats/ply_scene.h"
#include "pounce/error.h"
#include "support/splat_ply_builder.h"
#include "support/test_data.h"

namespace pounce::io {
namespace {

using store::Splat;
using store::SplatCounts;
using store::SplatFilter;
using test::SplatPlyBuilder;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Read {
  PageVector<Splat> splats;
  SplatCounts filtered{};
  std::uint64_t count(SplatFilter filter) const {
    return filtered[static_cast<std::size_t>(filter)];
  }
};

Read read_all(const std::string& path, const Axes& axes = {}) {
  const SplatPly ply(path, axes);
  store::SplatRows rows;
  Read result;
  ply.read(0, ply.header().splats, rows, result.filtered);
  result.splats = std::move(rows.splats);
  return result;
}

std::string problem(const std::string& path) {
  try {
    read_all(path);
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    CHECK(std::string(e.what()).find(path) == 0);
    return e.what();
  }
  return "";
}

std::string problem_of(const std::string& bytes) {
  const test::TempFolder folder;
  std::ofstream(folder.file("s.ply"), std::ios::binary) << bytes;
  return problem(folder.file("s.ply"));
}

SplatPlyBuilder usual(int rows) {
  SplatPlyBuilder ply;
  for (int i = 0; i < rows; ++i) ply.rows.push_back(SplatPlyBuilder::usual_row(i));
  return ply;
}

bool has(const std::string& text, const std::string& part) {
  INFO(text);
  const bool found = text.find(part) != std::string::npos;
  CHECK(found);
  return found;
}

SplatPlyBuilder::Row golden_row() {
  return {{"x", 1.25},     {"y", -2.5},    {"z", 0.0625},   {"f_dc_0", 0.5},   {"f_dc_1", -1},
          {"f_dc_2", 1.5}, {"opacity", 1}, {"scale_0", -4}, {"scale_1", -5.5}, {"scale_2", -7.25},
          {"rot_0", 0.5},  {"rot_1", 0.5}, {"rot_2", -0.5}, {"rot_3", 0.5}};
}

void check_golden(const Splat& s) {
  CHECK(s.mean == Vec3f{1.25F, -2.5F, 0.0625F});
  CHECK(s.colour.x == Approx(0.6410474).epsilon(1e-6));  // 0.5 + 0.28209479 * 0.5
  CHECK(s.colour.y == Approx(0.2179052).epsilon(1e-6));
  CHECK(s.colour.z == Approx(0.9231422).epsilon(1e-6));
  CHECK(s.alpha == Approx(0.7310586).epsilon(1e-6));     // 1 / (1 + 1/e)
  CHECK(s.sigma.x == Approx(0.01831564).epsilon(1e-6));  // e^-4
  CHECK(s.sigma.y == Approx(0.004086771).epsilon(1e-6));
  CHECK(s.sigma.z == Approx(7.101744e-4).epsilon(1e-6));
  CHECK(s.rotation == std::array<float, 4>{0.5F, 0.5F, -0.5F, 0.5F});
  CHECK(s.normal == Vec3f{});
}

TEST_CASE("the golden row of another program's PLY decodes to its values", "[io]") {
  const std::string hex =
      "0000a03f000020c00000803d0000000000000000000000000000003f000080bf0000c03fcdccccbe9a9999be"
      "cdcc4cbecdccccbd00000000cdcccc3dcdcc4c3e9a99993ecdcccc3e0000803f000080c00000b0c00000e8c0"
      "0000003f0000003f000000bf0000003f";
  SplatPlyBuilder ply;
  ply.columns = SplatPlyBuilder::usual_columns(9);
  std::string bytes = ply.header();
  bytes.replace(bytes.find("vertex 0"), 8, "vertex 1");
  for (std::size_t i = 0; i < hex.size(); i += 2)
    bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  const test::TempFolder folder;
  std::ofstream(folder.file("a.ply"), std::ios::binary) << bytes;
  const Read read = read_all(folder.file("a.ply"));
  REQUIRE(read.splats.size() == 1);
  check_golden(read.splats[0]);
  CHECK(SplatPly(folder.file("a.ply")).header().sh_degree == 1);
}

TEST_CASE("columns may come in any order, type and company", "[io]") {
  const test::TempFolder folder;
  SplatPlyBuilder ply;
  ply.rows = {golden_row()};
  SECTION("reversed") { std::reverse(ply.columns.begin(), ply.columns.end()); }
  SECTION("no normals") { ply.columns = SplatPlyBuilder::usual_columns(0, false); }
  SECTION("degree 2, 3 and 4") {
    ply.columns = SplatPlyBuilder::usual_columns(GENERATE(24, 45, 72));
  }
  SECTION("doubles, and columns that nobody asked for") {
    for (std::string& column : ply.columns) column.replace(0, 5, "double");
    ply.columns.insert(ply.columns.begin(), "uchar flag");
    ply.columns.insert(ply.columns.begin() + 5, "int16 group");
    ply.rows[0]["flag"] = 200;
  }
  SECTION("lines that end in CR LF") { ply.line_end = "\r\n"; }
  SECTION("elements before and after") {
    ply.before = "element camera 2\nproperty float fov\nproperty uchar kind\n";
    ply.bytes_before = std::string(10, 'c');
    ply.after = "element extrinsic 16\nproperty float extrinsic\n";
    ply.bytes_after = std::string(64, 'e');
  }
  SECTION("an element of lists after") {
    ply.after = "element image_size 1\nproperty list uchar uint size\n";
    ply.bytes_after = std::string("\x02") + std::string(8, 's');
  }
  ply.write(folder.file("s.ply"));
  const Read read = read_all(folder.file("s.ply"));
  REQUIRE(read.splats.size() == 1);
  check_golden(read.splats[0]);
}

TEST_CASE("every scalar type is read as its value", "[io]") {
  const auto type =
      GENERATE(as<std::string>{}, "char", "int8", "uchar", "uint8", "ushort", "uint16", "int",
               "int32", "uint", "uint32", "float", "float32", "double", "float64");
  CAPTURE(type);
  SplatPlyBuilder ply = usual(1);
  ply.columns[1] = type + " y";
  ply.rows[0]["y"] = type.front() == 'u' ? 200 : -100;
  const test::TempFolder folder;
  ply.write(folder.file("s.ply"));
  const Read read = read_all(folder.file("s.ply"));
  REQUIRE(read.splats.size() == 1);
  CHECK(read.splats[0].mean.y == (type.front() == 'u' ? 200.0F : -100.0F));
}

TEST_CASE("columns of ushort hold half floats", "[io]") {
  const auto name_of = [](const std::string& column) {
    return column.substr(column.find(' ') + 1);
  };
  SplatPlyBuilder ply;
  ply.rows = {golden_row(), golden_row(), golden_row()};
  ply.rows[1]["opacity"] = kInfinity;
  ply.rows[2]["x"] = kNan;
  SECTION("all of them") {
    for (std::string& column : ply.columns) column = "ushort " + name_of(column);
  }
  SECTION("beside floats and doubles") {
    for (std::size_t c = 0; c < ply.columns.size(); ++c) {
      const std::array types{"uint16 ", "double ", "float "};
      ply.columns[c] = types[c % 3] + name_of(ply.columns[c]);
    }
  }
  const test::TempFolder folder;
  ply.write(folder.file("s.ply"));
  const Read read = read_all(folder.file("s.ply"));
  REQUIRE(read.splats.size() == 2);
  check_golden(read.splats[0]);
  CHECK(read.splats[1].alpha == 1);
  CHECK(read.count(SplatFilter::not_finite) == 1);
}

TEST_CASE("splat columns of short are refused by name", "[io]") {
  for (const std::string name : {"x", "f_dc_2", "f_rest_0", "opacity", "scale_1", "rot_3", "nx"}) {
    SplatPlyBuilder ply = usual(1);
    if (name == "f_rest_0") ply.columns = SplatPlyBuilder::usual_columns(9);
    *std::find(ply.columns.begin(), ply.columns.end(), "float " + name) =
        (name == "x" ? "short " : "int16 ") + name;
    has(problem_of(ply.bytes()), "its column \"" + name + "\" has type short (int16)");
  }
}

TEST_CASE("discs without a third scale have a third sigma of 0", "[io]") {
  SplatPlyBuilder ply = usual(2);
  SECTION("absent") {
    ply.columns.erase(std::find(ply.columns.begin(), ply.columns.end(), "float scale_2"));
  }
  SECTION("minus infinity") {
    for (auto& row : ply.rows) row["scale_2"] = -kInfinity;
  }
  const test::TempFolder folder;
  ply.write(folder.file("s.ply"));
  const Read read = read_all(folder.file("s.ply"));
  REQUIRE(read.splats.size() == 2);
  CHECK(read.splats[1].sigma.z == 0);
  CHECK(read.splats[1].sigma.x == Approx(std::exp(-2.3)));
}

TEST_CASE("what cannot be used is left out and counted by its reason", "[io]") {
  SplatPlyBuilder ply;
  const auto add = [&](const std::string& column, double value) {
    auto row = golden_row();
    row[column] = value;
    ply.rows.push_back(row);
  };
  for (const char* column : {"x", "f_dc_1", "opacity", "scale_2", "rot_3"}) add(column, kNan);
  for (const char* column : {"z", "f_dc_0", "rot_0"}) add(column, -kInfinity);
  add("opacity", -kInfinity);
  add("opacity", -5.6);  // alpha 0.00368 < 1/255
  add("opacity", -5.5);  // alpha 0.00407: stays
  add("opacity", kInfinity);
  add("scale_1", 88.8);  // e^88.8 is no float any more
  add("scale_0", kInfinity);
  add("nx", kNan);  // a normal is nothing we need
  ply.rows.push_back(golden_row());
  for (int k = 0; k < 4; ++k) ply.rows.back()["rot_" + std::to_string(k)] = 0;
  ply.rows.push_back(golden_row());
  for (int k = 0; k < 3; ++k) ply.rows.back()["scale_" + std::to_string(k)] = -200;
  const test::TempFolder folder;
  ply.write(folder.file("s.ply"));
  const Read read = read_all(folder.file("s.ply"));
  CHECK(read.count(SplatFilter::not_finite) == 8);
  CHECK(read.count(SplatFilter::transparent) == 2);
  CHECK(read.count(SplatFilter::exploded) == 2);
  CHECK(read.count(SplatFilter::zero_quaternion) == 1);
  CHECK(read.count(SplatFilter::sizeless) == 1);
  REQUIRE(read.splats.size() == 3);
  CHECK(read.splats[0].alpha == Approx(0.00407014).epsilon(1e-5));
  CHECK(read.splats[1].alpha == 1);
  CHECK(read.splats[2].normal == Vec3f{});
}

TEST_CASE("rotations and normals come out as unit vectors", "[io]") {
  SplatPlyBuilder ply = usual(1);
  ply.rows[0]["rot_0"] = 3e-20;
  ply.rows[0]["rot_2"] = -4e-20;
  ply.rows[0]["ny"] = 5;
  const test::TempFolder folder;
  ply.write(folder.file("s.ply"));
  const Read read = read_all(folder.file("s.ply"));
  REQUIRE(read.splats.size() == 1);
  CHECK(read.splats[0].rotation == std::array<float, 4>{0.6F, 0, -0.8F, 0});
  CHECK(read.splats[0].normal == Vec3f{0, 1, 0});
}

TEST_CASE("the header's comments say how a scene was trained, the last one counts", "[io]") {
  SplatPlyBuilder ply = usual(1);
  const auto model = [&](const std::string& comments) {
    const test::TempFolder folder;
    ply.comments = comments;
    ply.write(folder.file("s.ply"));
    return SplatPly(folder.file("s.ply")).header().model;
  };
  using store::SplatModel;
  CHECK(model("comment by hand\nobj_info nothing\n") == SplatModel::standard);
  CHECK(model("comment SplatRenderMode: mip\n") == SplatModel::antialiased);
  CHECK(model("comment splatrendermode: 2DGS\n") == SplatModel::flat);
  CHECK(model("comment antialiased 1\n") == SplatModel::antialiased);
  CHECK(model("comment antialiased 1\ncomment SplatRenderMode: default\n") == SplatModel::standard);
}

TEST_CASE("what is no splat PLY is refused by what it is", "[io]") {
  SplatPlyBuilder ply = usual(3);
  const std::string whole = ply.bytes();
  CHECK(problem_of(whole).empty());
  has(problem_of(""), "empty");
  has(problem_of("glTF stuff"), "does not begin like a PLY");
  has(problem_of("ply\n"), "end_header");
  has(problem_of(whole.substr(0, whole.size() - 1)), "after 2 of them");
  has(problem_of(whole + "x"), "do not match");
  has(problem_of(ply.header()), "truncated");
  ply.format = "ascii 1.0";
  has(problem_of(ply.bytes()), "ASCII");
  ply.format = "binary_big_endian 1.0";
  has(problem_of(ply.bytes()), "big-endian");
  ply.format = "binary_little_endian 2.0";
  has(problem_of(ply.bytes()), "version");
  ply = usual(0);
  has(problem_of(ply.bytes()), "no Gaussians");
  ply.columns = {"float x", "float y", "float z", "float intensity"};
  ply.rows.resize(4);
  has(problem_of(ply.bytes()), "a point cloud without colours (4 points)");
  ply.after = "element face 2\nproperty list uchar int vertex_indices\n";
  has(problem_of(ply.bytes()), "a mesh (4 vertices, 2 face rows)");
  ply.after.clear();
  ply = usual(1);
  ply.columns.erase(ply.columns.begin() + 9);
  has(problem_of(ply.bytes()), "no column \"opacity\"");
  ply = usual(1);
  ply.columns = SplatPlyBuilder::usual_columns(10);
  has(problem_of(ply.bytes()), "10 f_rest columns");
}

TEST_CASE("a malicious header costs no memory and no time", "[io]") {
  const std::string start = "ply\nformat binary_little_endian 1.0\n";
  std::string columns;
  for (const std::string& column : SplatPlyBuilder::usual_columns())
    columns += "property " + column + "\n";
  has(problem_of(start + "element vertex 18446744073709551615\n" + columns + "end_header\n"),
      "truncated");
  has(problem_of(start + "element vertex 300000000000000000\n" + columns + "end_header\n"),
      "truncated");
  has(problem_of(start + "element vertex 99999999999999999999999\n"), "count");
  has(problem_of(start + "element vertex -1\n"), "count");
  has(problem_of(start + "element a 18446744073709551615\nproperty float b\nelement vertex 1\n" +
                 columns + "end_header\n"),
      "truncated");
  has(problem_of(start + "element a 1\nproperty list uchar int b\nelement vertex 1\n" + columns +
                 "end_header\n"),
      "rows of variable size");
  has(problem_of(start + "property float x\n"), "before any element");
  has(problem_of(start + "element vertex 1\nproperty quad x\n"), "unknown type");
  has(problem_of(start + "element vertex 1\nproperty float\n"), "without a name");
  has(problem_of(start + "element vertex 1\nproperty float x\nproperty float x\n"), "twice");
  has(problem_of(start + "element vertex 1\nelement vertex 1\n"), "twice");
  has(problem_of(start + "nonsense\n"), "not PLY");
  std::string many = start + "element vertex 1\n";
  for (int i = 0; i < 5000; ++i) many += "property float c" + std::to_string(i) + "\n";
  has(problem_of(many), "too many columns");
  has(problem_of(start + "comment " + std::string(3 << 20, 'x')), "first 1048576 bytes");
}

TEST_CASE("axes turn Gaussians as they turn their covariance", "[io]") {
  SplatPlyBuilder ply;
  ply.rows = {golden_row()};
  ply.rows[0]["rot_0"] = 0.9;
  ply.rows[0]["nz"] = 1;
  const test::TempFolder folder;
  ply.write(folder.file("s.ply"));
  const auto text =
      GENERATE(as<std::string>{}, "x,-y,-z", "-x,-y,z", "z,x,y", "y,x,z", "-x,y,z", "x,z,-y");
  CAPTURE(text);
  const Axes axes = parse_axes(text);
  const Splat from = read_all(folder.file("s.ply")).splats[0];
  const Splat to = read_all(folder.file("s.ply"), axes).splats[0];
  CHECK(to.mean == axes.apply(from.mean));
  CHECK(to.normal == axes.apply(from.normal));
  // x^T Sigma' x = (P^T x)^T Sigma (P^T x) for directions x: compare the boxes' half widths.
  const auto half = [](const Splat& s) {
    const Box3f box = store::splat_box(s);
    return Vec3f{box.hi.x - s.mean.x, box.hi.y - s.mean.y, box.hi.z - s.mean.z};
  };
  const Vec3f turned = axes.apply(half(from)), found = half(to);
  CHECK(found.x == Approx(std::abs(turned.x)).epsilon(1e-4));
  CHECK(found.y == Approx(std::abs(turned.y)).epsilon(1e-4));
  CHECK(found.z == Approx(std::abs(turned.z)).epsilon(1e-4));
}

void check_facts(const std::string& name) {
  const auto data = test::test_data();
  if (!data) return;
  const auto path = *data / "splats" / name;
  nlohmann::json facts;
  std::ifstream(path.string() + ".facts.json") >> facts;
  const SplatPly ply(path.string());
  CHECK(ply.header().splats == facts["count"].get<std::uint64_t>());
  CHECK(ply.header().sh_degree == facts["sh_degree"].get<unsigned>());
  const Read read = read_all(path.string());
  std::uint64_t out = 0;
  for (const std::uint64_t count : read.filtered) out += count;
  CHECK(read.splats.size() + out == ply.header().splats);
  CHECK(out == read.count(SplatFilter::transparent));
  if (out > 0) return;  // the facts speak of all Gaussians
  double colour[3]{}, alpha = 0;
  Box3f box;
  for (const Splat& s : read.splats) {
    box.extend(s.mean);
    colour[0] += s.colour.x, colour[1] += s.colour.y, colour[2] += s.colour.z;
    alpha += s.alpha;
  }
  const auto n = static_cast<double>(read.splats.size());
  CHECK(alpha / n == Approx(facts["mean_opacity"].get<double>()).epsilon(1e-6));
  for (std::size_t c = 0; c < 3; ++c)
    CHECK(colour[c] / n == Approx(facts["mean_colour_sh0"][c].get<double>()).epsilon(1e-6));
  CHECK(box.lo.x == facts["mean_bbox"]["min"][0].get<float>());
  CHECK(box.hi.z == facts["mean_bbox"]["max"][2].get<float>());
  const Splat& last = read.splats.back();
  CHECK(last.mean.y == facts["last"]["mean"][1].get<float>());
  CHECK(last.alpha == Approx(facts["last"]["opacity"].get<double>()).epsilon(1e-6));
  CHECK(last.sigma.y ==
        Approx(std::exp(facts["last"]["log_scale"][1].get<double>())).epsilon(1e-6));
  CHECK(last.rotation[3] == Approx(facts["last"]["rot_wxyz_unit"][3].get<double>()).margin(1e-6));
}

TEST_CASE("real scenes hold what another program found in them", "[io][external]") {
  check_facts("train-1000.ply");
  check_facts("playbot_lod3_converted/playbot_lod3.ply");
  check_facts("three_points/test-splat.3-points-from-train.ply");
}

TEST_CASE("every bad PLY of the test data is refused", "[io][external]") {
  const auto data = test::test_data();
  if (!data) return;
  int seen = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(*data / "bad")) {
    if (entry.path().extension() != ".ply") continue;
    CAPTURE(entry.path().filename().string());
    CHECK_FALSE(problem(entry.path().string()).empty());
    ++seen;
  }
  CHECK(seen >= 10);
}

TEST_CASE("a mutated file is read or refused, never anything else", "[io]") {
  SplatPlyBuilder ply = usual(20);
  ply.columns = SplatPlyBuilder::usual_columns(9);
  const std::string whole = ply.bytes();
  const std::size_t header = ply.header().size();
  CHECK(problem_of(whole).empty());
  std::mt19937 random(7);
  int read = 0, refused = 0;
  for (int round = 0; round < 2000; ++round) {
    std::string bytes = whole;
    const std::size_t within = round % 4 == 0 ? bytes.size() : header;
    for (unsigned k = 0; k < 1 + static_cast<unsigned>(round) % 3; ++k) {
      const std::size_t at = random() % std::min(within, bytes.size());
      switch (random() % 3) {
        case 0:
          bytes[at] = static_cast<char>(random());
          break;
        case 1:
          bytes.erase(at, 1 + random() % 8);
          break;
        default:
          bytes.insert(at, bytes.substr(random() % std::min(within, bytes.size()), random() % 40));
      }
    }
    ++(problem_of(bytes).empty() ? read : refused);  // Error(input) or nothing; checked inside
  }
  std::printf("FIGURE PLY mutants: %d read, %d refused\n", read, refused);
  // A reader that refuses all, or none, is no reader. What is hit in the rows is only other values.
  CHECK(read > 50);  // 73 when written
  CHECK(refused > 1000);
}

}  // namespace
}  // namespace pounce::io
