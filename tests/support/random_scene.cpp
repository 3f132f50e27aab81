// SPDX-License-Identifier: Apache-2.0
#include "support/random_scene.h"

#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "core/vec.h"
#include "io/read_mesh.h"
#include "support/gltf_builder.h"
#include "support/mesh_files.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

/// The same numbers everywhere: the standard's distributions differ between libraries.
class Dice {
 public:
  explicit Dice(std::uint32_t seed) : random_(seed) {}
  double real(double low, double high) {
    return low + (high - low) * (static_cast<double>(random_()) / 4294967296.0);
  }
  int whole(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<std::uint32_t>(high - low + 1));
  }

 private:
  std::mt19937 random_;
};

struct Grid {
  int columns = 0, rows = 0;
  std::vector<float> positions, normals, uvs;
  /// Triangles of the columns [from, to).
  std::vector<std::uint32_t> triangles(int from, int to, bool flipped) const {
    std::vector<std::uint32_t> out;
    for (int r = 0; r < rows; ++r) {
      for (int c = from; c < to; ++c) {
        const auto a = static_cast<std::uint32_t>(r * (columns + 1) + c);
        const auto below = static_cast<std::uint32_t>(columns + 1);
        std::array<std::uint32_t, 6> quad{a, a + 1, a + below + 1, a, a + below + 1, a + below};
        if (flipped) quad = {a, a + below + 1, a + 1, a, a + below, a + below + 1};
        out.insert(out.end(), quad.begin(), quad.end());
      }
    }
    return out;
  }
};

/// A sheet over the unit square. `displace` moves points along their normals at random; `uv_of`
/// maps the grid's own parameters to UVs.
Grid make_sheet(Dice& dice, int columns, int rows, double level, bool flipped, double displace,
                const std::function<Vec2d(double, double)>& uv_of) {
  Grid grid;
  grid.columns = columns;
  grid.rows = rows;
  for (int r = 0; r <= rows; ++r) {
    for (int c = 0; c <= columns; ++c) {
      const bool inner = c > 0 && c < columns && r > 0 && r < rows;
      const double s = (c + (inner ? dice.real(-0.2, 0.2) : 0)) / columns;
      const double t = (r + (inner ? dice.real(-0.2, 0.2) : 0)) / rows;
      const double z = level + 0.15 * std::sin(2.3 * s + 0.4) * std::cos(1.9 * t - 0.3);
      const double zs = 0.15 * 2.3 * std::cos(2.3 * s + 0.4) * std::cos(1.9 * t - 0.3);
      const double zt = -0.15 * 1.9 * std::sin(2.3 * s + 0.4) * std::sin(1.9 * t - 0.3);
      Vec3d n{-zs, -zt, 1};
      n = n * ((flipped ? -1 : 1) / length(n));
      const Vec3d p = Vec3d{s, t, z} + n * dice.real(-displace, displace);
      for (const double v : {p.x, p.y, p.z}) grid.positions.push_back(static_cast<float>(v));
      for (const double v : {n.x, n.y, n.z}) grid.normals.push_back(static_cast<float>(v));
      const Vec2d uv = uv_of(s, t);
      grid.uvs.push_back(static_cast<float>(uv.x));
      grid.uvs.push_back(static_cast<float>(uv.y));
    }
  }
  return grid;
}

void add_grid(GltfBuilder& file, const Grid& grid, const std::vector<int>& materials,
              bool flipped) {
  const int positions = file.add(grid.positions, "VEC3");
  const int normals = file.add(grid.normals, "VEC3");
  const int uvs = file.add(grid.uvs, "VEC2");
  const int parts = static_cast<int>(materials.size());
  for (int part = 0; part < parts; ++part) {
    const int indices = file.add(
        grid.triangles(grid.columns * part / parts, grid.columns * (part + 1) / parts, flipped),
        "SCALAR");
    auto& primitive = file.primitive(
        {{"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", uvs}}, indices);
    if (materials[static_cast<std::size_t>(part)] >= 0)
      primitive["material"] = materials[static_cast<std::size_t>(part)];
  }
}

/// Smooth waves and a little noise: a wrong texel, row or wrap mode shows.
void make_picture(Dice& dice, const std::string& path, std::uint32_t width, std::uint32_t height,
                  std::uint32_t channels) {
  WholeImage image{width, height, channels, false, {}};
  const double a = dice.real(3, 9), b = dice.real(3, 9), c = dice.real(0, 6);
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      for (std::uint32_t k = 0; k < channels; ++k) {
        const double wave = std::sin(a * x / width + c + k) * std::cos(b * y / height - c + 2 * k);
        image.samples.push_back(0.5 + 0.35 * wave + dice.real(-0.1, 0.1));
      }
    }
  }
  write_whole_image(path, image);
}

int add_texture(GltfBuilder& file, Dice& dice, const std::string& image) {
  constexpr std::array kModes{10497, 33648, 33071};
  const int sampler =
      file.push("samplers", {{"wrapS", kModes[static_cast<std::size_t>(dice.whole(0, 2))]},
                             {"wrapT", kModes[static_cast<std::size_t>(dice.whole(0, 2))]}});
  const int source = file.push("images", {{"uri", image}});
  return file.push("textures", {{"sampler", sampler}, {"source", source}});
}

void add_materials(GltfBuilder& file, Dice& dice, const std::string& folder,
                   std::uint32_t channels) {
  for (const int m : {0, 1}) {
    const std::string name = "colour" + std::to_string(m) + ".png";
    make_picture(dice, folder + "/" + name, static_cast<std::uint32_t>(dice.whole(40, 150)),
                 static_cast<std::uint32_t>(dice.whole(40, 150)), m == 0 ? channels : 3);
    nlohmann::json colour = {{"index", add_texture(file, dice, name)}};
    if (m == 1) {
      colour["extensions"]["KHR_texture_transform"] = {
          {"offset", {dice.real(-0.5, 0.5), 0.1}}, {"rotation", 0.3}, {"scale", {0.9, 1.2}}};
    }
    const std::string rough = "rough" + std::to_string(m) + ".png";
    make_picture(dice, folder + "/" + rough, static_cast<std::uint32_t>(dice.whole(20, 90)),
                 static_cast<std::uint32_t>(dice.whole(20, 90)), 3);
    file.push("materials",
              {{"name", "painted " + std::to_string(m)},
               {"pbrMetallicRoughness",
                {{"baseColorTexture", colour},
                 {"metallicRoughnessTexture", {{"index", add_texture(file, dice, rough)}}}}}});
  }
  file.doc["extensionsUsed"] = {"KHR_texture_transform"};
  file.push("materials", {{"name", "plain"},
                          {"pbrMetallicRoughness",
                           {{"baseColorFactor", {0.2, 0.5, 0.7, 0.8}}, {"roughnessFactor", 0.3}}}});
}

}  // namespace

TransferOptions make_random_scene(const std::string& folder, std::uint32_t seed) {
  Dice dice(seed);
  const bool facing_away = seed % 2 == 1;
  const double gap = 0.07;
  {
    GltfBuilder file;
    add_materials(file, dice, folder, seed % 3 == 0 ? 4 : 3);
    for (const int layer : {0, 1}) {
      const bool flipped = layer == 1 && facing_away;
      const double scale = dice.real(0.6, 1.6), shift = dice.real(-0.6, 0.4);
      const Grid grid = make_sheet(dice, dice.whole(9, 14), dice.whole(7, 12), -gap * layer,
                                   flipped, 0.0, [&](double s, double t) {
                                     return Vec2d{shift + scale * (s + 0.05 * t), scale * t - 0.2};
                                   });
      add_grid(file, grid, layer == 0 ? std::vector{0, 1, 2} : std::vector{1, 0}, flipped);
    }
    file.write_glb(folder + "/source.glb");
  }
  GltfBuilder file;
  for (const int layer : {0, 1}) {
    const bool flipped = layer == 1 && facing_away;
    const double leaves = seed % 4 == 2 ? 0.3 : 0;  // the target's UVs leave the image
    const Grid grid =
        make_sheet(dice, dice.whole(6, 11), dice.whole(8, 13), -gap * layer, flipped, 0.01,
                   [&](double s, double t) {
                     return Vec2d{0.03 + 0.93 * s + 0.02 * std::sin(3 * t) + leaves,
                                  0.02 + 0.45 * (t * t * 0.3 + t * 0.7) + 0.5 * layer};
                   });
    add_grid(file, grid, {-1}, flipped);
  }
  TransferOptions options;
  options.source = folder + "/source.glb";
  options.targets = {file.write_glb(folder + "/target.glb")};
  if (seed % 2 == 0) {
    options.targets = {folder + "/target.obj"};
    write_obj(options.targets.front(), io::read_mesh(folder + "/target.glb"));
  }
  options.image.size = ImageSize{static_cast<std::uint32_t>(dice.whole(48, 200)),
                                 static_cast<std::uint32_t>(dice.whole(48, 200))};
  options.search.max_distance = Length{seed % 5 == 0 ? 0.4 : seed % 3 == 1 ? 20.0 : 5.0, true};
  return options;
}

}  // namespace pounce::test
