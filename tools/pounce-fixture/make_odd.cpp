// SPDX-License-Identifier: Apache-2.0
//
// Small meshes and images that are unusual, awkward or broken in one way each; fixtures/README.md
// has the table of what a reader should do with each.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "output_file.h"
#include "recipes.h"
#include "render_image.h"
#include "texture_pattern.h"
#include "write_glb.h"

namespace pounce::fixture {
namespace {

/// Unit square in z = 0, UVs the same square (v down).
SmallMesh quad() {
  return {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}},
          {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}},
          {{{0, 1}, {1, 1}, {1, 0}, {0, 0}}},
          {0, 1, 2, 0, 2, 3}};
}

/// Two squares side by side, each with its own four vertices; UVs in the left and right half.
SmallMesh two_quads() {
  SmallMesh mesh = quad();
  for (std::size_t i = 0; i < 4; ++i) {
    mesh.positions.push_back(mesh.positions[i] + Vec3f{1.5F, 0, 0});
    mesh.normals.push_back(mesh.normals[i]);
    const Vec2f uv = mesh.uv_sets[0][i];
    mesh.uv_sets[0][i] = {uv.x * 0.45F + 0.02F, uv.y};
    mesh.uv_sets[0].push_back({uv.x * 0.45F + 0.52F, uv.y});
  }
  mesh.indices.insert(mesh.indices.end(), {4, 5, 6, 4, 6, 7});
  return mesh;
}

SmallMesh scaled(SmallMesh mesh, float scale, Vec3f offset) {
  for (Vec3f& p : mesh.positions) p = p * scale + offset;
  return mesh;
}

SmallMesh with_uvs(SmallMesh mesh, Vec2f (*change)(Vec2f)) {
  for (Vec2f& uv : mesh.uv_sets[0]) uv = change(uv);
  return mesh;
}

/// A square of 16 x 16 cells, bent a little, whose every triangle is a chart of its own in the
/// image.
SmallMesh per_triangle_charts() {
  constexpr std::uint32_t kCells = 16, kPerRow = 32;  // 512 triangles in 32 columns and 16 rows
  SmallMesh mesh;
  mesh.uv_sets.resize(1);
  const auto add = [&](std::uint32_t column, std::uint32_t row, Vec2f uv) {
    const float x = static_cast<float>(column) / kCells, y = static_cast<float>(row) / kCells;
    mesh.indices.push_back(static_cast<std::uint32_t>(mesh.positions.size()));
    mesh.positions.push_back({x, y, 0.1F * x * x});
    mesh.normals.push_back(Vec3f(normalized({-0.2 * static_cast<double>(x), 0, 1})));
    mesh.uv_sets[0].push_back(uv);
  };
  for (std::uint32_t k = 0; k < kCells * kCells * 2; ++k) {
    const std::uint32_t column = k / 2 % kCells, row = k / 2 / kCells;
    const float u = static_cast<float>(k % kPerRow) / kPerRow;
    const float v = static_cast<float>(k / kPerRow) / 16;
    const Vec2f a{u + 0.004F, v + 0.056F}, b{u + 0.026F, v + 0.056F}, c{u + 0.026F, v + 0.006F};
    add(column, row, a);
    add(k % 2 == 0 ? column + 1 : column + 1, k % 2 == 0 ? row : row + 1, b);
    add(k % 2 == 0 ? column + 1 : column, row + 1, c);
  }
  return mesh;
}

/// 64 strips, each 1/64 wide in space and 1/100,000 of the image in UV: none covers a texel centre.
SmallMesh slivers() {
  SmallMesh mesh;
  mesh.uv_sets.resize(1);
  for (std::uint32_t i = 0; i < 64; ++i) {
    const float x = static_cast<float>(i) / 64, u = x + 1e-5F;
    const auto base = static_cast<std::uint32_t>(mesh.positions.size());
    for (const auto& [dx, y] : {std::pair{0.0F, 0.0F}, {1.0F, 0.0F}, {1.0F, 1.0F}, {0.0F, 1.0F}}) {
      mesh.positions.push_back({x + dx / 64, y, 0});
      mesh.normals.push_back({0, 0, 1});
      mesh.uv_sets[0].push_back({u + dx * 1e-5F, 1 - y});
    }
    mesh.indices.insert(mesh.indices.end(), {base, base + 1, base + 2, base, base + 2, base + 3});
  }
  return mesh;
}

/// The squares of `base` in three layers 0.01 apart, one above the other, each with a third of the
/// image.
SmallMesh stacked_layers() {
  SmallMesh stack;
  stack.uv_sets.resize(1);
  for (std::uint32_t layer = 0; layer < 3; ++layer) {
    const SmallMesh one = quad();
    for (std::size_t i = 0; i < 4; ++i) {
      stack.positions.push_back(one.positions[i] + Vec3f{0, 0, 0.01F * static_cast<float>(layer)});
      stack.normals.push_back(one.normals[i]);
      const Vec2f uv = one.uv_sets[0][i];
      stack.uv_sets[0].push_back({(uv.x * 0.9F + static_cast<float>(layer)) / 3 + 0.01F, uv.y});
    }
    for (const std::uint32_t index : one.indices) stack.indices.push_back(index + 4 * layer);
  }
  return stack;
}

/// Renders a small picture: gradients in every channel and a grid of thin lines.
void write_picture(const std::string& path, RenderSpec spec) {
  render_image(path, spec, [spec](std::uint32_t y, std::span<float> row) {
    for (std::uint32_t x = 0; x < spec.width; ++x) {
      const double u = (x + 0.5) / spec.width, v = (y + 0.5) / spec.height;
      const double values[] = {0.2 + 0.6 * u, 0.2 + 0.6 * v, 0.5 + 0.3 * cosine_turns(2 * u + v),
                               0.5 + 0.4 * cosine_turns(u - v)};
      for (std::uint32_t c = 0; c < spec.channels; ++c) {
        const bool is_alpha = c + 1 == spec.channels && spec.channels % 2 == 0;
        const bool on_line = !is_alpha && (x % 16 == 0 || y % 16 == 0);
        row[std::size_t{x} * spec.channels + c] =
            on_line ? 0.1F : static_cast<float>(values[is_alpha ? 3 : c]);
      }
    }
  });
}

/// The folder of odd things: knows where files go and what was written.
class OddFolder {
 public:
  explicit OddFolder(std::string folder) : folder_(std::move(folder)) {
    make_folder(folder_);
    picture_ = image("picture.png", {.width = 64, .height = 64});
  }

  std::string image(const std::string& name, const RenderSpec& spec) {
    written_.push_back(folder_ + "/" + name);
    write_picture(written_.back(), spec);
    return name;
  }
  /// One mesh with one material; its texture is the embedded plain picture.
  void mesh(const std::string& name, SmallMesh small) {
    GlbWriter glb;
    const auto texture = static_cast<int>(glb.add_embedded_texture(folder_ + "/" + picture_));
    const auto material = static_cast<int>(glb.add_material("skin", texture));
    glb.add_mesh(name);
    glb.add_primitive(std::move(small), material);
    write(name, glb);
  }
  /// A plain square with a texture in the file `image_name` beside it, which need not exist.
  void textured(const std::string& name, const std::string& image_name) {
    GlbWriter glb;
    const auto texture = static_cast<int>(glb.add_external_texture(image_name));
    const auto material = static_cast<int>(glb.add_material("skin", texture));
    glb.add_mesh(name);
    glb.add_primitive(quad(), material);
    write(name, glb);
  }
  void write(const std::string& name, GlbWriter& glb) {
    written_.push_back(folder_ + "/" + name + ".glb");
    glb.write(written_.back());
  }
  /// The first `size_bytes` of the plain picture.
  std::string truncated_picture(const std::string& name, std::size_t size_bytes) {
    written_.push_back(folder_ + "/" + name);
    std::filesystem::copy_file(folder_ + "/" + picture_, written_.back(),
                               std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(written_.back(), size_bytes);
    return name;
  }
  std::string picture_path() const { return folder_ + "/" + picture_; }
  Paths written() const { return written_; }

 private:
  std::string folder_, picture_;
  Paths written_;
};

void add_uv_oddities(OddFolder& odd) {
  SmallMesh mesh = quad();
  mesh.uv_sets.clear();
  odd.mesh("no_uvs", mesh);
  odd.mesh("zero_area_uvs", with_uvs(quad(), [](Vec2f) { return Vec2f{0.5F, 0.5F}; }));
  odd.mesh("line_uvs", with_uvs(quad(), [](Vec2f uv) { return Vec2f{uv.x, uv.x}; }));
  odd.mesh("negative_uvs", with_uvs(quad(), [](Vec2f uv) { return uv - Vec2f{1.25F, 0.75F}; }));
  odd.mesh("uvs_above_one", with_uvs(quad(), [](Vec2f uv) {
             return Vec2f{uv.x * 3, uv.y * 2.5F};
           }));
  odd.mesh("huge_uvs", with_uvs(quad(), [](Vec2f uv) { return Vec2f{uv.x * 5000, uv.y * 3000}; }));
  odd.mesh("overlapping_uvs", with_uvs(two_quads(), [](Vec2f uv) {
             return uv.x > 0.5F ? Vec2f{uv.x - 0.4F, uv.y} : uv;
           }));
  odd.mesh("mirrored_uvs", with_uvs(two_quads(), [](Vec2f uv) {
             return uv.x > 0.5F ? Vec2f{1.48F - uv.x, uv.y} : uv;
           }));
  odd.mesh("mirrored_on_itself_uvs", with_uvs(two_quads(), [](Vec2f uv) {
             return uv.x > 0.5F ? Vec2f{0.99F - uv.x, uv.y} : uv;
           }));
  odd.mesh("per_triangle_charts", per_triangle_charts());
  odd.mesh("slivers_without_texel", slivers());
}

void add_geometry_oddities(OddFolder& odd) {
  odd.mesh("plain", quad());
  odd.mesh("stacked_layers", stacked_layers());
  SmallMesh mesh = two_quads();
  for (std::size_t i = 4; i < 8; ++i) mesh.positions[i] = mesh.positions[4];
  odd.mesh("zero_area_triangles", mesh);
  mesh = quad();
  mesh.indices.insert(mesh.indices.end(), {0, 0, 1, 2, 2, 2});
  odd.mesh("repeated_indices", mesh);
  mesh = quad();
  mesh.normals.clear();
  odd.mesh("no_normals", mesh);
  mesh = quad();
  for (Vec3f& normal : mesh.normals) normal = {};
  odd.mesh("zero_normals", mesh);
  odd.mesh("huge_coordinates", scaled(quad(), 1e6F, {3e6F, -2e6F, 1e6F}));
  odd.mesh("tiny_coordinates", scaled(quad(), 1e-6F, {}));
  GlbWriter glb;
  const auto texture = static_cast<int>(glb.add_embedded_texture(odd.picture_path()));
  const auto material = static_cast<int>(glb.add_material("skin", texture));
  const std::size_t node = glb.add_mesh("negative_scale");
  glb.json()["nodes"][node]["scale"] = {-2, 1, 1};
  glb.add_primitive(two_quads(), material);
  odd.write("negative_scale", glb);
}

void add_image_oddities(OddFolder& odd) {
  odd.textured("texture_rgba", odd.image("rgba.png", {.width = 64, .height = 64, .channels = 4}));
  odd.textured("texture_gray", odd.image("gray.png", {.width = 64, .height = 64, .channels = 1}));
  odd.textured("texture_gray_alpha",
               odd.image("gray_alpha.png", {.width = 64, .height = 64, .channels = 2}));
  odd.textured("texture_16_bit",
               odd.image("rgb16.png", {.width = 64, .height = 64, .depth = Depth::u16}));
  odd.textured("texture_1x1", odd.image("one.png", {.width = 1, .height = 1}));
  odd.textured("texture_100x37", odd.image("odd_size.png", {.width = 100, .height = 37}));
  odd.textured("texture_missing", "not_there.png");
  odd.textured("texture_truncated", odd.truncated_picture("truncated.png", 700));
  odd.textured("texture_header_only", odd.truncated_picture("header_only.png", 20));
  odd.textured("texture_empty_file", odd.truncated_picture("empty.png", 0));
}

void add_material_oddities(OddFolder& odd) {
  const std::string small = odd.image("small.png", {.width = 32, .height = 32});
  const SmallMesh left = quad();
  const SmallMesh right = scaled(quad(), 1, {1.5F, 0, 0});
  for (const bool both : {false, true}) {
    GlbWriter glb;
    const auto first = static_cast<int>(glb.add_embedded_texture(odd.picture_path()));
    const int second = both ? static_cast<int>(glb.add_external_texture(small)) : -1;
    const auto skin = static_cast<int>(glb.add_material("skin", first));
    const auto cloth = static_cast<int>(glb.add_material("cloth", second));
    if (!both) {
      glb.json()["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] = {0.2, 0.5, 0.1, 1};
    }
    glb.add_mesh("two");
    glb.add_primitive(left, skin);
    glb.add_primitive(right, cloth);
    odd.write(both ? "two_image_sizes" : "one_material_without_texture", glb);
  }
}

}  // namespace

Paths make_odd(const std::string& folder) {
  OddFolder odd(folder);
  add_geometry_oddities(odd);
  add_uv_oddities(odd);
  add_image_oddities(odd);
  add_material_oddities(odd);
  return odd.written();
}

}  // namespace pounce::fixture
