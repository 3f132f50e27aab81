// SPDX-License-Identifier: Apache-2.0
#include <zlib.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "core/directions.h"
#include "core/portable_math.h"
#include "io/splats/batch.h"
#include "io/splats/scene.h"
#include "io/splats/splat_writer.h"
#include "pounce/error.h"
#include "support/test_data.h"

using namespace pounce;
using namespace pounce::io;
using pounce::test::TempFolder;

namespace {

constexpr double kC0 = 0.28209479177387814;

std::string read_all(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string hex(const std::string& bytes) {
  std::string text;
  for (const char c : bytes) {
    constexpr const char* kDigits = "0123456789abcdef";
    text += kDigits[static_cast<unsigned char>(c) >> 4];
    text += kDigits[static_cast<unsigned char>(c) & 15];
  }
  return text;
}

std::string unzipped(const std::string& bytes) {
  z_stream stream{};
  REQUIRE(inflateInit2(&stream, MAX_WBITS + 16) == Z_OK);
  std::string out(1 << 20, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  CHECK(inflate(&stream, Z_FINISH) == Z_STREAM_END);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

float colour_of(double dc) { return static_cast<float>(0.5 + kC0 * dc); }

/// Gaussian A of the formats' golden vectors, but not turned: harmonics -0.4, -0.3, ... 0.4 channel
/// by channel.
store::SplatRows one_row() {
  store::SplatRows rows;
  rows.lobes = 3;
  store::Splat s;
  s.mean = {1.25F, -2.5F, 0.0625F};
  s.sigma = {std::exp(-4.0F), std::exp(-5.5F), std::exp(-7.25F)};
  s.alpha = 0.5F;
  s.colour = {colour_of(0.5), colour_of(-1), colour_of(1.5)};
  rows.splats.push_back(s);
  for (int k = 0; k < 3; ++k)
    for (int c = 0; c < 3; ++c)
      rows.sh.push_back(float_to_half(static_cast<float>(3 * c + k - 4) * 0.1F));
  return rows;
}

void write(const TempFolder& folder, const std::string& path, const store::SplatRows& rows,
           const SplatFileFacts& facts) {
  const auto writer =
      open_splat_writer(path, facts, {&posix_file_system(), folder.path().string()});
  writer->append(writer->encode(rows));
  CHECK_FALSE(std::filesystem::exists(path));
  writer->commit([] {});
}

store::SplatRows random_rows(std::size_t count, std::uint32_t lobes) {
  std::mt19937 random(11);
  const auto between = [&](double low, double high) {
    return static_cast<float>(low + (high - low) * static_cast<double>(random()) / 4294967295.0);
  };
  store::SplatRows rows;
  rows.lobes = lobes;
  for (std::size_t i = 0; i < count; ++i) {
    store::Splat s;
    s.mean = {between(-3, 3), between(-3, 3), between(-3, 3)};
    s.sigma = {std::exp(between(-6, -2)), std::exp(between(-6, -2)), std::exp(between(-6, -2))};
    s.rotation = {between(-1, 1), between(-1, 1), between(-1, 1), between(-1, 1)};
    float square = 0;
    for (const float v : s.rotation) square += v * v;
    for (float& v : s.rotation) v /= std::sqrt(square);
    s.alpha = between(0.01, 0.99);
    s.colour = {between(0, 1), between(0, 1), between(0, 1)};
    rows.splats.push_back(s);
    for (std::uint32_t k = 0; k < 3 * lobes; ++k)
      rows.sh.push_back(float_to_half(between(-0.9, 0.9)));
  }
  return rows;
}

std::array<double, 9> covariance(const store::Splat& s) {
  const auto [w, x, y, z] = s.rotation;
  const std::array<Vec3d, 3> axes = rotation_columns<double>(w, x, y, z);
  const std::array<double, 3> sigma{s.sigma.x, s.sigma.y, s.sigma.z};
  std::array<double, 9> out{};
  for (std::size_t k = 0; k < 3; ++k) {
    const std::array<double, 3> a{axes[k].x, axes[k].y, axes[k].z};
    for (std::size_t i = 0; i < 9; ++i) out[i] += sigma[k] * sigma[k] * a[i / 3] * a[i % 3];
  }
  return out;
}

/// The largest difference of two ellipsoids' matrices, over the square of the larger size.
double difference(const store::Splat& a, const store::Splat& b) {
  const auto one = covariance(a), other = covariance(b);
  double most = 0;
  for (std::size_t i = 0; i < 9; ++i) most = std::max(most, std::abs(one[i] - other[i]));
  return most / std::pow(static_cast<double>(store::size_of(a)), 2);
}

store::SplatRows read_back(const TempFolder& folder, const std::string& path, std::uint32_t lobes) {
  const auto scene = open_splat_scene(path, {});
  scene->prepare({&posix_file_system(), folder.path().string()}, [] {});
  store::SplatRows rows;
  rows.lobes = lobes;
  store::SplatCounts filtered{};
  scene->read(0, scene->info().splats, rows, filtered);
  CHECK(store::filtered_text(filtered).empty());
  return rows;
}

std::string message_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a splat PLY is its header and its rows, byte for byte", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("two.ply");
  store::SplatRows rows;
  store::Splat s;
  s.mean = {1, 2, 3};
  s.normal = {0, 0, 1};
  s.colour = {colour_of(0.5), colour_of(-1), colour_of(1.5)};
  s.sigma = {0.5F, 1, 0.25F};
  rows.splats = {s, s};
  write(folder, path, rows, {});
  const std::string bytes = read_all(path);
  // The count is known at the end only: the comment before it leaves it room.
  const std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment pounce gaussians" + std::string(19, ' ') +
      "\nelement vertex 2\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
      "property float opacity\n"
      "property float scale_0\nproperty float scale_1\nproperty float scale_2\n"
      "property float rot_0\nproperty float rot_1\nproperty float rot_2\nproperty float rot_3\n"
      "end_header\n";
  REQUIRE(bytes.size() == header.size() + 2 * 68);
  CHECK(bytes.substr(0, header.size()) == header);
  const float expected[17] = {1, 2, 3, 0, 0, 1, 0.5F, -1, 1.5F, 10, -0.69314718F, 0, -1.38629436F,
                              1, 0, 0, 0};
  std::array<float, 34> row;
  std::memcpy(row.data(), bytes.data() + header.size(), sizeof row);
  for (std::size_t k = 0; k < row.size(); ++k)
    CHECK(row[k] == Approx(expected[k % 17]).margin(1e-6));
}

TEST_CASE("a PLY has harmonics channel by channel and says how it was trained", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("one.ply");
  write(folder, path, one_row(), {3, store::SplatModel::antialiased, false});
  const std::string bytes = read_all(path);
  CHECK(bytes.find("\ncomment SplatRenderMode: mip\nelement vertex 1\n") != std::string::npos);
  REQUIRE(bytes.size() > 26 * 4);
  std::array<float, 26> row;
  std::memcpy(row.data(), bytes.data() + bytes.size() - sizeof row, sizeof row);
  for (int k = 0; k < 9; ++k)
    CHECK(row[static_cast<std::size_t>(9 + k)] == Approx((k - 4) * 0.1).margin(1e-4));
  CHECK(row[18] == 0);  // the logit of a half
  CHECK(open_splat_scene(path, {})->info().model == store::SplatModel::antialiased);
}

TEST_CASE("an SPZ is its header and its attributes, byte for byte", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("one.spz");
  write(folder, path, one_row(), {3, store::SplatModel::antialiased, false});
  const std::string packed = read_all(path);
  CHECK(hex(packed.substr(0, 10)) == "1f8b0800000000000003");  // gzip without a time
  // Of the 24 bits 20 are behind the point: 1.25, -2.5 and 0.0625 times 2^20; opacity 0.5 x 255;
  // (dc x 0.15 + 0.5) x 255; (log + 10) x 16; x, y, z of no turn; harmonics x 128 + 128.
  CHECK(hex(unzipped(packed)) ==
        "4e475350020000000100000001140100"
        "000014"
        "0000d8"
        "000001"
        "80"
        "9359b9"
        "60482c"
        "808080"
        "4d739a"
        "5a80a6"
        "668db3");
}

TEST_CASE("a glb of Gaussians is valid and every value lies where its accessor says", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("two.glb");
  store::SplatRows rows = one_row();
  rows.splats.push_back(rows.splats[0]);
  rows.splats[1].mean = {-3, 0.1F, 2};
  rows.splats[1].rotation = {0.5F, 0.5F, -0.5F, 0.5F};
  for (std::size_t k = 0; k < 9; ++k) rows.sh.push_back(float_to_half(0.25F));
  write(folder, path, rows, {3, {}, false});
  const std::string bytes = read_all(path);
  const auto number = [&](std::size_t at) {
    std::uint32_t value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  };
  REQUIRE(bytes.substr(0, 4) == "glTF");
  CHECK(number(4) == 2);
  CHECK(number(8) == bytes.size());
  const std::uint32_t json_bytes = number(12);
  CHECK(json_bytes % 4 == 0);
  CHECK(bytes.substr(16, 4) == "JSON");
  const auto json = nlohmann::json::parse(bytes.substr(20, json_bytes));
  const std::size_t bin = 20 + json_bytes + 8;
  CHECK(number(bin - 8) == 2 * (56 + 36));
  CHECK(bytes.substr(bin - 4, 4) == std::string("BIN\0", 4));
  CHECK(bytes.size() == bin + 2 * (56 + 36));
  CHECK(json["buffers"][0]["byteLength"] == 2 * (56 + 36));
  const auto& primitive = json["meshes"][0]["primitives"][0];
  CHECK(primitive["mode"] == 0);
  const auto& extension = primitive["extensions"]["KHR_gaussian_splatting"];
  CHECK(extension["kernel"] == "ellipse");
  CHECK(extension["colorSpace"] == "srgb_rec709_display");
  CHECK(json["extensionsUsed"] == nlohmann::json{"KHR_gaussian_splatting"});
  CHECK(primitive["attributes"].size() == 8);
  const auto values = [&](const std::string& name, const char* type, std::size_t components) {
    const auto& accessor = json["accessors"][primitive["attributes"].at(name).get<std::size_t>()];
    CHECK(accessor["componentType"] == 5126);
    CHECK(accessor["count"] == 2);
    CHECK(accessor["type"] == type);
    const auto& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    CHECK(view["byteLength"] == 8 * components);
    CHECK(view["byteOffset"].get<std::size_t>() % 4 == 0);
    std::vector<float> out(2 * components);
    std::memcpy(out.data(), bytes.data() + bin + view["byteOffset"].get<std::size_t>(),
                8 * components);
    return out;
  };
  CHECK(values("POSITION", "VEC3", 3) == std::vector<float>{1.25F, -2.5F, 0.0625F, -3, 0.1F, 2});
  const auto& place = json["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
  CHECK(place["min"].get<std::vector<float>>() == std::vector<float>{-3, -2.5F, 0.0625F});
  CHECK(place["max"].get<std::vector<float>>() == std::vector<float>{1.25F, 0.1F, 2});
  const std::string k = "KHR_gaussian_splatting:";
  CHECK(values(k + "ROTATION", "VEC4", 4) ==
        std::vector<float>{0, 0, 0, 1, 0.5F, -0.5F, 0.5F, 0.5F});
  CHECK(values(k + "OPACITY", "SCALAR", 1) == std::vector<float>{0.5F, 0.5F});
  CHECK(values(k + "SCALE", "VEC3", 3)[1] == std::exp(-5.5F));
  CHECK(values(k + "SH_DEGREE_0_COEF_0", "VEC3", 3)[2] == Approx(1.5));
  const auto last = values(k + "SH_DEGREE_1_COEF_2", "VEC3", 3);
  CHECK(last[0] == Approx(-0.2).margin(1e-4));
  CHECK(last[1] == Approx(0.1).margin(1e-4));
  CHECK(last[2] == Approx(0.4).margin(1e-3));
  CHECK(last[3] == 0.25F);
}

TEST_CASE("what is written reads back as it was, within the format's steps", "[io]") {
  const std::uint32_t lobes = GENERATE(0U, 15U);
  const std::string ending = GENERATE("ply", "spz", "glb");
  CAPTURE(lobes, ending);
  const TempFolder folder;
  const store::SplatRows rows = random_rows(3000, lobes);
  const std::string path = folder.file("scene." + ending);
  write(folder, path, rows, {lobes, {}, false});
  const store::SplatRows back = read_back(folder, path, lobes);
  REQUIRE(back.splats.size() == rows.splats.size());
  const bool bytes = ending == "spz";
  double place = 0, alpha = 0, colour = 0, shape = 0, harmonics = 0;
  const auto far = [](float a, float b) { return static_cast<double>(std::abs(a - b)); };
  for (std::size_t i = 0; i < rows.splats.size(); ++i) {
    const store::Splat &a = rows.splats[i], &b = back.splats[i];
    place = std::max(
        {place, far(a.mean.x, b.mean.x), far(a.mean.y, b.mean.y), far(a.mean.z, b.mean.z)});
    alpha = std::max(alpha, far(a.alpha, b.alpha));
    colour = std::max({colour, far(a.colour.x, b.colour.x), far(a.colour.z, b.colour.z)});
    shape = std::max(shape, difference(a, b));
  }
  for (std::size_t k = 0; k < rows.sh.size(); ++k)
    harmonics = std::max(harmonics, far(half_to_float(rows.sh[k]), half_to_float(back.sh[k])));
  CHECK(place <= (bytes ? 0.5 / (1 << 20) + 1e-9 : 0));
  CHECK(alpha <= (bytes ? 0.5 / 255 + 1e-6 : 1e-6));
  CHECK(colour <= (bytes ? 0.5 * kC0 / (0.15 * 255) + 1e-6 : 1e-6));
  CHECK(harmonics <= (bytes ? 0.5 / 128 + 1e-3 : 0));
  // exp(2 / 32) - 1 by its sizes, and below a degree by its turn.
  CHECK(shape <= (bytes ? 0.085 : 1e-5));
}

TEST_CASE("of an ellipsoid's 24 names the one that turns least is the same ellipsoid", "[io]") {
  const store::SplatRows rows = random_rows(2000, 0);
  float least = 1;
  double most = 0;
  for (const store::Splat& s : rows.splats) {
    store::Splat turned = s;
    turn_least(turned);
    least = std::min(least, turned.rotation[0]);
    most = std::max(most, difference(s, turned));
  }
  CHECK(least >= 0.85);
  CHECK(most <= 2e-6);
}

TEST_CASE("an SPZ that cannot hold its scene is refused, else what was cut is said", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("scene.spz");
  std::ofstream(path) << "old";
  store::SplatRows rows = random_rows(10, 0);
  std::string message, warnings;
  const auto try_it = [&](const SplatFileFacts& facts = {}) {
    warnings.clear();
    message = message_of([&] {
      const auto writer =
          open_splat_writer(path, facts, {&posix_file_system(), folder.path().string()});
      writer->append(writer->encode(rows));
      writer->commit([] {});
      for (const std::string& warning : writer->warnings()) warnings += warning;
    });
  };
  for (std::size_t i = 0; i < 6; ++i) rows.splats[i].sigma = {1e-5F, 2e-5F, 1e-9F};
  try_it();
  CHECK(message.find("6 of 10 Gaussians are outside of the range of SPZ") != std::string::npos);
  CHECK(message.find("write a .ply or .glb") != std::string::npos);
  CHECK(read_all(path) == "old");
  for (std::size_t i = 0; i < 4; ++i) rows.splats[i].sigma = {0.01F, 0.01F, 1e-9F};
  try_it();
  CHECK(message.empty());
  CHECK(warnings.find("2 of 10 Gaussians are outside of the range") != std::string::npos);
  CHECK(read_all(path) != "old");
  // One far away makes the step of all places coarse: 2^22 leaves no bit behind the point.
  rows = random_rows(10, 0);
  rows.splats[3].mean.y = 0x1p22F;
  try_it();
  CHECK(message.find("step of 1 units") != std::string::npos);
  CHECK(message.find("--box") != std::string::npos);
  rows.splats[3].mean.y = 0x1p23F;
  try_it();
  CHECK(message.find("1 of 10 Gaussians are farther than 8388607 units from the origin, up to "
                     "8.39e+06") != std::string::npos);
  CHECK(message.find("--box (\"box 98 %\" in pounce inspect") != std::string::npos);
  rows = random_rows(10, 0);
  rows.splats[0].colour.x = 2;
  try_it();
  CHECK(warnings.find("1 of 10 Gaussians have colours") != std::string::npos);
  try_it({0, {}, true});
  CHECK(message.find("colours are linear") != std::string::npos);
}

TEST_CASE("Gaussians that were not finished leave nothing", "[io]") {
  const TempFolder folder;
  for (const char* name : {"half.ply", "half.spz", "half.glb"}) {
    const auto writer =
        open_splat_writer(folder.file(name), {}, {&posix_file_system(), folder.path().string()});
    writer->append(writer->encode(random_rows(3000, 0)));
  }
  CHECK(std::filesystem::is_empty(folder.path()));
}

TEST_CASE("our logarithm is the logarithm", "[io]") {
  for (double x = 1e-300; x < 1e300; x *= 1.37) {
    CHECK(log_same(x) == Approx(std::log(x)).epsilon(2e-15));
  }
  for (double x = 0.5; x < 2; x += 0.001) CHECK(std::abs(log_same(x) - std::log(x)) <= 1e-15);
  CHECK(log_same(1) == 0);
}
