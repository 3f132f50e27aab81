// SPDX-License-Identifier: Apache-2.0
//
// Normal maps and what is baked from shape, against fields of directions that are known.
//
// A dome, part of the unit sphere, has its own normals, so that each of its points says which
// direction a field gives it. A map of the field is made for one set of UVs by this test, then
// transferred onto others, and read back as a renderer of the target would.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>

#include "io/read_mesh.h"
#include "mesh/tangent_space.h"
#include "pounce/error.h"
#include "pounce/transfer.h"
#include "support/gltf_builder.h"
#include "support/target_raster.h"
#include "support/test_data.h"
#include "support/transfer_job.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Vec3d unit(Vec3d v) { return v * (1 / length(v)); }
double degrees(Vec3d a, Vec3d b) { return std::atan2(length(cross(a, b)), dot(a, b)) / kDegree; }

/// Bumps on the dome: up to 25 degrees off its normal.
Vec3d field(Vec3d p) {
  return unit(unit(p) + Vec3d{std::sin(5 * p.y), std::cos(4 * p.z), std::sin(6 * p.x)} * 0.25);
}

enum class Uvs { plain, turned, mirrored };

/// A vertex of the dome at a, b in 0..1.
Vec3d dome_point(double a, double b) {
  const double lon = 2 * a - 1, lat = 2 * b - 1;
  return {std::sin(lon) * std::cos(lat), std::sin(lat), std::cos(lon) * std::cos(lat)};
}

/// Where it lies in the image (v down), in a chart of its own for each half where it is mirrored.
Vec2d dome_uv(double a, double b, bool right, Uvs uvs) {
  switch (uvs) {
    case Uvs::plain:
      return {0.05 + 0.9 * a, 0.95 - 0.9 * b};
    case Uvs::turned:  // and sheared
      return {0.05 + 0.75 * b + 0.15 * a, 0.05 + 0.9 * a};
    case Uvs::mirrored:
      break;
  }
  return {right ? 0.97 - 0.9 * (a - 0.5) : 0.03 + 0.9 * a, 0.95 - 0.9 * b};
}

/// Writes the dome as `cells` x `cells` quads; `image`: its normal map, or none.
std::string write_dome(const std::string& path, int cells, Uvs uvs, const std::string& image = "",
                       double scale = 1) {
  std::vector<float> positions, normals, texcoords;
  std::vector<std::uint32_t> indices;
  const auto put = [](std::vector<float>& to, std::initializer_list<double> values) {
    for (const double v : values) to.push_back(static_cast<float>(v));
  };
  for (const bool right : {false, true}) {
    const int half = cells / 2, from = right ? half : 0;
    const auto first = static_cast<std::uint32_t>(positions.size() / 3);
    for (int j = 0; j <= cells; ++j) {
      for (int i = from; i <= from + half; ++i) {
        const double a = 1.0 * i / cells, b = 1.0 * j / cells;
        const Vec3d p = dome_point(a, b);
        const Vec2d uv = dome_uv(a, b, right, uvs);
        put(positions, {p.x, p.y, p.z});
        put(normals, {p.x, p.y, p.z});
        put(texcoords, {uv.x, uv.y});
      }
    }
    const auto row = static_cast<std::uint32_t>(half + 1);
    for (int j = 0; j < cells; ++j) {
      for (int i = 0; i < half; ++i) {
        const std::uint32_t a =
            first + static_cast<std::uint32_t>(j) * row + static_cast<std::uint32_t>(i);
        for (const std::uint32_t v : {a, a + 1, a + row + 1, a, a + row + 1, a + row})
          indices.push_back(v);
      }
    }
  }
  GltfBuilder file;
  const int p = file.add(positions, "VEC3"), n = file.add(normals, "VEC3"),
            t = file.add(texcoords, "VEC2");
  nlohmann::json& primitive = file.primitive({{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", t}},
                                             file.add(indices, "SCALAR"));
  if (!image.empty()) {
    const int texture = file.push("textures", {{"source", file.push("images", {{"uri", image}})}});
    primitive["material"] =
        file.push("materials", {{"normalTexture", {{"index", texture}, {"scale", scale}}}});
  }
  return file.write_glb(path);
}

/// What a renderer knows of each covered texel of a mesh's image.
class Surface {
 public:
  Surface(const std::string& path, std::uint32_t size) : mesh_(io::read_mesh(path)) {
    mesh::set_tangents(mesh_, std::vector<std::uint32_t>(mesh_.materials.size(), 0),
                       std::vector<bool>(mesh_.materials.size(), true));
    raster_ = raster_target(mesh_, size, size);
  }

  bool covered(std::size_t texel) const { return raster_.covered(texel); }
  std::size_t texels() const { return raster_.owner.size(); }
  Vec3d position(std::size_t texel) const { return between(texel, mesh_.positions); }
  Vec3d normal(std::size_t texel) const { return between(texel, mesh_.normals); }

  /// The three axes, as MikkTSpace says.
  std::array<Vec3d, 3> axes(std::size_t texel) const {
    const auto& t = mesh_.triangles[static_cast<std::size_t>(raster_.owner[texel])];
    std::array<Vec3d, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec4f& v = mesh_.tangents[t[k]];
      corners[k] = {v.x, v.y, v.z};
    }
    const Vec3d n = normal(texel), tangent = mixed(texel, corners);
    return {tangent, cross(n, tangent) * double{mesh_.tangents[t[0]].w}, n};
  }
  Vec3d shown(std::size_t texel, const WholeImage& map) const {
    const auto [t, b, n] = axes(texel);
    return unit(t * (2 * map.at(texel, 0) - 1) + b * (2 * map.at(texel, 1) - 1) +
                n * (2 * map.at(texel, 2) - 1));
  }
  /// The map that shows a direction: the axes' system of equations, solved.
  Vec3d coded(std::size_t texel, Vec3d direction) const {
    const auto [t, b, n] = axes(texel);
    const double det = dot(t, cross(b, n));
    const Vec3d v = unit(Vec3d{dot(direction, cross(b, n)), dot(direction, cross(n, t)),
                               dot(direction, cross(t, b))} *
                         (1 / det));
    return (v + Vec3d{1, 1, 1}) * 0.5;
  }

 private:
  Vec3d mixed(std::size_t texel, const std::array<Vec3d, 3>& v) const {
    const auto& t = mesh_.triangles[static_cast<std::size_t>(raster_.owner[texel])];
    std::array<Vec2d, 3> c;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f uv = mesh_.uv_sets[0][t[k]];
      c[k] = {uv.x * 1.0 * raster_.width - 0.5, uv.y * 1.0 * raster_.height - 0.5};
    }
    const Vec2d e1 = c[1] - c[0], e2 = c[2] - c[0],
                d = Vec2d{raster_.x[texel], raster_.y[texel]} - c[0];
    const double area = e1.x * e2.y - e1.y * e2.x;
    const double w1 = (d.x * e2.y - d.y * e2.x) / area, w2 = (e1.x * d.y - e1.y * d.x) / area;
    return v[0] * (1 - w1 - w2) + v[1] * w1 + v[2] * w2;
  }
  Vec3d between(std::size_t texel, const std::vector<Vec3f>& of) const {
    const auto& t = mesh_.triangles[static_cast<std::size_t>(raster_.owner[texel])];
    return mixed(texel, {Vec3d(of[t[0]]), Vec3d(of[t[1]]), Vec3d(of[t[2]])});
  }

  mesh::Mesh mesh_;
  TargetRaster raster_;
};

/// Writes a map of the field for a surface, gutters included as the nearest covered texel of a row.
void write_map(const std::string& path, std::uint32_t size, const Surface& surface, Depth depth,
               bool down = false, double scale = 1) {
  std::vector<double> samples(std::size_t{size} * size * 3, 0.5);
  for (std::size_t i = 0; i < surface.texels(); ++i) {
    if (!surface.covered(i)) continue;
    Vec3d c = surface.coded(i, field(surface.position(i)));
    // As a map that is to be scaled again.
    Vec3d v = c * 2.0 - Vec3d{1, 1, 1};
    v = {v.x / scale, v.y / scale * (down ? -1 : 1), v.z};
    v = scale == 1 ? v : unit(v);
    c = (v + Vec3d{1, 1, 1}) * 0.5;
    samples[3 * i] = c.x;
    samples[3 * i + 1] = c.y;
    samples[3 * i + 2] = c.z;
  }
  const auto covered = [&](std::size_t i) { return surface.covered(i); };
  for (std::size_t pass = 0; pass < 4; ++pass) {  // gutters of a few texels
    std::vector<double> next = samples;
    for (std::size_t y = 0; y < size; ++y) {
      for (std::size_t x = 0; x < size; ++x) {
        const std::size_t i = y * size + x;
        if (covered(i) || samples[3 * i + 2] != 0.5) continue;
        for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
          const std::size_t at = i + static_cast<std::size_t>(dy * static_cast<int>(size) + dx);
          const bool inside =
              x + static_cast<std::size_t>(dx) < size && y + static_cast<std::size_t>(dy) < size;
          if (!inside || samples[3 * at + 2] == 0.5) continue;
          std::copy_n(&samples[3 * at], 3, &next[3 * i]);
        }
      }
    }
    samples = next;
  }
  io::ImageWriter writer(path, {size, size, 3, depth, false, false});
  const std::size_t bytes_per = depth == Depth::u8 ? 1 : 2;
  std::vector<std::byte> bytes(samples.size() * bytes_per);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto value = static_cast<std::uint16_t>(
        std::lround(samples[i] * (depth == Depth::u8 ? 255.0 : 65535.0)));
    std::memcpy(&bytes[i * bytes_per], &value, bytes_per);
  }
  writer.write_rows(size, bytes.data());
  writer.commit();
}

TransferOptions job(const std::string& source, const std::string& target,
                    const std::string& output) {
  TransferOptions options = transfer_job(source, target, output, 256);
  options.image.coverage_output = output + ".mask.png";
  return options;
}

struct Deviation {
  double mean = 0, worst = 0, lit = 0;
  std::size_t texels = 0;
};

/// Of what a target shows to what it should, and of its light to that.
Deviation error_of(const std::string& target, const WholeImage& map,
                   const std::function<Vec3d(Vec3d)>& truth) {
  const Surface surface(target, map.width);
  const Vec3d light = unit({0.4, 0.5, 0.8});
  Deviation out;
  for (std::size_t i = 0; i < surface.texels(); ++i) {
    if (!surface.covered(i)) continue;
    const Vec3d is = surface.shown(i, map), should = truth(surface.position(i));
    const double off = degrees(is, should);
    out.mean += off;
    out.worst = std::max(out.worst, off);
    out.lit += std::abs(std::max(0.0, dot(is, light)) - std::max(0.0, dot(should, light)));
    ++out.texels;
  }
  out.mean /= static_cast<double>(out.texels);
  out.lit /= static_cast<double>(out.texels);
  return out;
}

}  // namespace

TEST_CASE("a normal map lights a target as it lit its source, whatever their UVs", "[flow]") {
  const Uvs from = GENERATE(Uvs::plain, Uvs::mirrored),
            to = GENERATE(Uvs::plain, Uvs::turned, Uvs::mirrored);
  const Depth depth = GENERATE(Depth::u8, Depth::u16);
  CAPTURE(static_cast<int>(from), static_cast<int>(to), depth_name(depth));
  constexpr std::uint32_t kSize = 256;
  const TempFolder folder;
  const std::string source = write_dome(folder.file("source.glb"), 16, from, "map.png");
  write_map(folder.file("map.png"), kSize, Surface(source, kSize), depth);
  const std::string target = write_dome(folder.file("target.glb"), 16, to);
  TransferOptions options = job(source, target, folder.file("out.png"));
  options.channels.transferred = {Channel::normal};
  const Report report = transfer(options);
  CHECK(report.target_empty == 0);
  const WholeImage out = read_whole_image(options.output);
  CHECK(out.channels == 3);
  const Deviation error = error_of(target, out, field);
  UNSCOPED_INFO("off by " << error.mean << " degrees, at most " << error.worst << ", light by "
                          << 255 * error.lit << " of 255");
  CHECK(error.mean <= (depth == Depth::u8 ? 0.3 : 0.1));
  CHECK(error.lit <= 1.0 / 255);
  const bool same = from == to;  // texels meet texels
  if (same) {
    const WholeImage in = read_whole_image(folder.file("map.png"));
    const Surface surface(source, kSize);
    std::size_t differ = 0;
    const double step = depth == Depth::u8 ? 1.0 / 255 : 1.0 / 65535;
    for (std::size_t i = 0; i < surface.texels(); ++i) {
      if (!surface.covered(i)) continue;
      for (std::size_t c = 0; c < 3; ++c)
        differ += std::abs(in.at(i, c) - out.at(i, c)) > 1.5 * step ? 1 : 0;
    }
    CHECK(differ == 0);
  }
}

TEST_CASE("green may point down on either side, and a scale is part of the vectors", "[flow]") {
  const bool source_down = GENERATE(false, true), output_down = GENERATE(false, true);
  constexpr std::uint32_t kSize = 128;
  const TempFolder folder;
  const std::string source = write_dome(folder.file("source.glb"), 16, Uvs::plain, "map.png", 0.5);
  write_map(folder.file("map.png"), kSize, Surface(source, kSize), Depth::u16, source_down, 0.5);
  const std::string target = write_dome(folder.file("target.glb"), 16, Uvs::turned);
  TransferOptions options = job(source, target, folder.file("out.png"));
  options.channels.transferred = {Channel::normal};
  options.material.normal_y = source_down ? NormalY::down : NormalY::up;
  options.image.normal_y = output_down ? NormalY::down : NormalY::up;
  transfer(options);
  WholeImage out = read_whole_image(options.output);
  if (output_down) {
    for (std::size_t i = 1; i < out.samples.size(); i += 3) out.samples[i] = 1 - out.samples[i];
  }
  CHECK(error_of(target, out, field).mean <= 0.3);
}

TEST_CASE("a model gets a normal map that its own tangents read", "[flow]") {
  constexpr std::uint32_t kSize = 128;
  const TempFolder folder;
  const std::string source = write_dome(folder.file("source.glb"), 16, Uvs::plain, "map.png", 0.5);
  write_map(folder.file("map.png"), kSize, Surface(source, kSize), Depth::u8, false, 0.5);
  const std::string target = write_dome(folder.file("target.glb"), 16, Uvs::turned, "map.png", 7);
  TransferOptions options = job(source, target, folder.file("out.glb"));
  options.image.coverage_output.clear();
  transfer(options);
  const mesh::Mesh made = io::read_mesh(options.output);
  REQUIRE(made.materials.size() == 1);
  const auto& binding = made.materials[0].textures[static_cast<std::size_t>(Channel::normal)];
  REQUIRE(binding);
  CHECK(made.materials[0].factors[static_cast<std::size_t>(Channel::normal)][0] == 1);
  const WholeImage map = read_whole_image(made.images[binding->image]);
  CHECK(error_of(options.output, map, field).mean <= 0.4);
}

TEST_CASE("detail turns with the surface, and baked shape does not", "[flow]") {
  // A flat plate below a dome of the same UVs' reach: the dome has a flat normal map.
  constexpr std::uint32_t kSize = 64;
  const TempFolder folder;
  const std::string source = write_dome(folder.file("source.glb"), 16, Uvs::plain, "map.png");
  write_whole_image(folder.file("map.png"), [&] {
    WholeImage flat{kSize, kSize, 3, false, {}};
    for (std::size_t i = 0; i < std::size_t{kSize} * kSize; ++i)
      flat.samples.insert(flat.samples.end(), {128 / 255.0, 128 / 255.0, 1});
    return flat;
  }());
  GltfBuilder file;
  const int p = file.add<float>(
      {-0.4F, -0.4F, 0.8F, 0.4F, -0.4F, 0.8F, 0.4F, 0.4F, 0.8F, -0.4F, 0.4F, 0.8F}, "VEC3");
  const int n = file.add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int t = file.add<float>({0, 1, 1, 1, 1, 0, 0, 0}, "VEC2");
  file.primitive({{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", t}},
                 file.add<std::uint32_t>({0, 1, 2, 0, 2, 3}, "SCALAR"));
  const std::string plate = file.write_glb(folder.file("plate.glb"));
  TransferOptions options = job(source, plate, folder.file("out.png"));
  options.search.max_distance = Length{0.5, false};
  options.channels.transferred = {Channel::normal};
  transfer(options);
  const WholeImage detail = read_whole_image(options.output);
  const Deviation flat = error_of(plate, detail, [](Vec3d) { return Vec3d{0, 0, 1}; });
  CHECK(flat.worst <= 0.5);

  options.channels.transferred = {};
  options.channels.baked = {Channel::normal};
  transfer(options);
  const WholeImage shape = read_whole_image(options.output);
  const auto above = [](Vec3d q) { return Vec3d{q.x, q.y, std::sqrt(1 - q.x * q.x - q.y * q.y)}; };
  const Deviation round = error_of(plate, shape, above);
  CHECK(round.mean <= 0.4);
}

TEST_CASE("a fine sphere becomes the normals, heights and places of a coarse one", "[flow]") {
  constexpr std::uint32_t kSize = 256;
  const TempFolder folder;
  const std::string fine = write_dome(folder.file("fine.glb"), 128, Uvs::plain);
  const std::string coarse = write_dome(folder.file("coarse.glb"), 8, Uvs::turned);
  TransferOptions options = job(fine, coarse, folder.file("<CHANNEL>.tif"));
  options.image.coverage_output = folder.file("mask.png");
  options.image.depth = Depth::float32;
  options.image.size = ImageSize{kSize, kSize};
  options.channels.baked = {Channel::normal, Channel::height, Channel::position};
  const Report report = transfer(options);
  CHECK(report.outputs.size() == 4);
  const Surface surface(coarse, kSize);
  const WholeImage mask = read_whole_image(options.image.coverage_output),
                   normal = read_whole_image(folder.file("normal.tif")),
                   height = read_whole_image(folder.file("height.tif")),
                   position = read_whole_image(folder.file("position.tif"));
  REQUIRE(height.channels == 1);
  REQUIRE(position.channels == 3);
  double mean = 0, worst = 0, most_height = 0, most_place = 0;
  std::size_t texels = 0;
  for (std::size_t i = 0; i < surface.texels(); ++i) {
    if (!surface.covered(i) || mask.at(i, 0) < 0.5) continue;
    // Where the texel's normal meets the sphere.
    const Vec3d at = surface.position(i), along = unit(surface.normal(i));
    const double b = dot(at, along), t = -b + std::sqrt(b * b + 1 - dot(at, at));
    const Vec3d met = at + along * t;
    // Beyond the dome's border the nearest point of it counts.
    if (std::abs(std::atan2(met.x, met.z)) > 0.99 || std::abs(std::asin(met.y)) > 0.99) continue;
    const double off = degrees(surface.shown(i, normal), met);
    mean += off;
    worst = std::max(worst, off);
    most_height = std::max(most_height, std::abs(height.at(i, 0) - t));
    const Vec3d place{position.at(i, 0), position.at(i, 1), position.at(i, 2)};
    most_place = std::max(most_place, length(place - met));
    ++texels;
  }
  UNSCOPED_INFO("normals off by " << mean / static_cast<double>(texels) << " degrees, at most "
                                  << worst);
  REQUIRE(texels > 40000);
  CHECK(mean / static_cast<double>(texels) <= 0.05);
  CHECK(worst <= 1);
  CHECK(most_height <= 1e-4);
  CHECK(most_place <= 1e-4);
}

TEST_CASE("a pyramid over a plane has the heights that it was built with", "[flow]") {
  constexpr std::uint32_t kSize = 100;
  const TempFolder folder;
  GltfBuilder high;
  const int p = high.add<float>(
      {-1, -1, 0.25F, 1, -1, 0.25F, 1, 1, 0.25F, -1, 1, 0.25F, 0, 0, -0.5F}, "VEC3");
  const int n = high.add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  high.primitive({{"POSITION", p}, {"NORMAL", n}},
                 high.add<std::uint32_t>({0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4}, "SCALAR"));
  GltfBuilder low;
  const int q = low.add<float>({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, "VEC3");
  const int m = low.add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int t = low.add<float>({0, 1, 1, 1, 1, 0, 0, 0}, "VEC2");
  low.primitive({{"POSITION", q}, {"NORMAL", m}, {"TEXCOORD_0", t}},
                low.add<std::uint32_t>({0, 1, 2, 0, 2, 3}, "SCALAR"));
  TransferOptions options = job(high.write_glb(folder.file("high.glb")),
                                low.write_glb(folder.file("low.glb")), folder.file("height.exr"));
  options.channels.baked = {Channel::height};
  options.image.size = ImageSize{kSize, kSize};
  options.search.max_distance = Length{1, false};
  transfer(options);
  const WholeImage out = read_whole_image(options.output);
  double most = 0;
  for (std::size_t y = 0; y < kSize; ++y) {
    for (std::size_t x = 0; x < kSize; ++x) {
      const double px = (2.0 * static_cast<double>(x) + 1) / kSize - 1,
                   py = 1 - (2.0 * static_cast<double>(y) + 1) / kSize;
      const double known = -0.5 + 0.75 * std::max(std::abs(px), std::abs(py));
      most = std::max(most, std::abs(out.at(y * kSize + x, 0) - known));
    }
  }
  CHECK(most <= 1e-6);
}

TEST_CASE("normals and bakes are the same bytes, however the job is cut", "[flow]") {
  constexpr std::uint32_t kSize = 300;
  const TempFolder folder;
  const std::string source = write_dome(folder.file("source.glb"), 40, Uvs::mirrored, "map.png");
  write_map(folder.file("map.png"), kSize, Surface(source, kSize), Depth::u8);
  const std::string target = write_dome(folder.file("target.glb"), 24, Uvs::turned);
  const auto bytes = [&](unsigned threads, std::uint64_t memory) {
    TransferOptions options = job(source, target, folder.file("<CHANNEL>.exr"));
    options.image.coverage_output.clear();
    options.channels.baked = {Channel::height, Channel::position};
    options.resources.threads = threads;
    options.resources.memory_bytes = memory;
    transfer(options);
    std::string all;
    for (const char* name : {"normal", "height", "position"}) {
      std::ifstream file(folder.file(std::string(name) + ".exr"), std::ios::binary);
      all += std::string(std::istreambuf_iterator<char>(file), {});
    }
    return all;
  };
  const std::string one = bytes(1, 512 << 20);
  CHECK(bytes(2, 512 << 20) == one);
  CHECK(bytes(2, 24 << 20) == one);
}

TEST_CASE("what cannot be a normal map or a bake is said", "[flow]") {
  const TempFolder folder;
  const std::string source = write_dome(folder.file("source.glb"), 8, Uvs::plain);
  const auto fails = [&](const std::function<void(TransferOptions&)>& change) {
    TransferOptions options = job(source, source, folder.file("out.png"));
    change(options);
    try {
      plan(options);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  using Catch::Contains;
  CHECK_THAT(fails([](auto& o) { o.channels.transferred = {Channel::normal}; }),
             Contains("no material has a normal texture"));
  CHECK_THAT(fails([](auto& o) { o.channels.baked = {Channel::normal}; }),
             Contains("specify --size"));
  CHECK_THAT(fails([](auto& o) {
               o.channels.baked = {Channel::height};
               o.image.size = ImageSize{64, 64};
             }),
             Contains("signed values need half or float samples"));
  CHECK_THAT(fails([](auto& o) { o.channels.transferred = {Channel::height}; }),
             Contains("--bake height"));
  CHECK_THAT(fails([](auto& o) { o.channels.baked = {Channel::emissive}; }),
             Contains("choose normal, height, position or vertexColor"));
  CHECK_THAT(fails([&](auto& o) {
               o.channels.baked = {Channel::position};
               o.output = folder.file("out.glb");
               o.image.coverage_output.clear();
             }),
             Contains("is a model"));
  CHECK_THAT(fails([&](auto& o) {
               o.image.normal_y = NormalY::down;
               o.output = folder.file("out.glb");
               o.image.coverage_output.clear();
             }),
             Contains("always up (+Y)"));
  CHECK_THAT(fails([](auto& o) {
               o.mesh.method = Method::gaussian;
               o.channels.baked = {Channel::normal};
             }),
             Contains("--method surface"));
  write_whole_image(folder.file("grey.png"), {8, 8, 1, false, std::vector<double>(64, 0.5)});
  CHECK_THAT(fails([&](auto& o) {
               o.channels.transferred = {Channel::normal};
               o.material.textures = {{Channel::normal, folder.file("grey.png")}};
             }),
             Contains("a normal map has three"));
}

}  // namespace pounce::test
