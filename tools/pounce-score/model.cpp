// SPDX-License-Identifier: Apache-2.0
#include "model.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "io/read_mesh.h"
#include "mesh/tangent_space.h"

namespace pounce::score {
namespace {

constexpr double kAmbient = 0.25;

std::optional<Image> read_texture(const mesh::Mesh& mesh, const mesh::Material& material,
                                  Channel channel) {
  const auto& binding = material.textures[static_cast<std::size_t>(channel)];
  if (!binding) return std::nullopt;
  return read_image(mesh.images[binding->image]);
}

Vec2d uv_of(const mesh::Mesh& mesh, const mesh::TextureBinding& binding, std::uint32_t vertex) {
  const Vec2f uv = mesh.uv_sets[binding.uv_set][vertex];
  const mesh::UvTransform& m = binding.transform;
  return {m.a * uv.x + m.b * uv.y + m.c, m.d * uv.x + m.e * uv.y + m.f};
}

Vec3d unit(Vec3d v) { return length(v) > 0 ? v * (1 / length(v)) : v; }

/// What one triangle shows at a point of it, given by the corners' shares.
class Shader {
 public:
  Shader(const Model& model, std::size_t triangle, const View& view, bool lit)
      : mesh_(model.mesh),
        corners_(mesh_.triangles[triangle]),
        textures_(model.materials[mesh_.triangle_material[triangle]]),
        material_(mesh_.materials[mesh_.triangle_material[triangle]]),
        view_(view),
        lit_(lit) {}

  Vec3d operator()(const std::array<double, 3>& shares) const {
    Vec3d colour{0.5, 0.5, 0.5};
    if (textures_.colour) colour = at(*textures_.colour, Channel::base_color, shares);
    if (!lit_) return colour;
    const Vec3d lamp = unit(view_.forward * -1.0 + view_.right * 0.5 - view_.down * 0.7);
    const double light = std::max(0.0, dot(normal(shares), lamp));
    return colour * (kAmbient + (1 - kAmbient) * light);
  }

 private:
  Vec3d at(const Image& image, Channel channel, const std::array<double, 3>& shares) const {
    const auto& binding = *material_.textures[static_cast<std::size_t>(channel)];
    Vec2d uv{};
    for (std::size_t k = 0; k < 3; ++k) uv = uv + uv_of(mesh_, binding, corners_[k]) * shares[k];
    return lookup(image, uv.x, uv.y);
  }
  Vec3d normal(const std::array<double, 3>& shares) const {
    Vec3d n{}, t{};
    double hand = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      n = n + Vec3d(mesh_.normals[corners_[k]]) * shares[k];
      if (!textures_.normal) continue;
      const Vec4f& own = mesh_.tangents[corners_[k]];
      t = t + Vec3d{own.x, own.y, own.z} * shares[k];
      hand = own.w;
    }
    if (!textures_.normal) return unit(n);
    const Vec3d m = at(*textures_.normal, Channel::normal, shares) * 2.0 - Vec3d{1, 1, 1};
    const double scale = material_.factors[static_cast<std::size_t>(Channel::normal)][0];
    return unit(t * (m.x * scale) + cross(n, t) * (hand * m.y * scale) + n * m.z);
  }

  const mesh::Mesh& mesh_;
  const std::array<std::uint32_t, 3>& corners_;
  const Model::Textures& textures_;
  const mesh::Material& material_;
  const View& view_;
  const bool lit_;
};

}  // namespace

Model read_model(const std::string& path) {
  Model model;
  model.mesh = io::read_mesh(path);
  std::vector<std::uint32_t> uv_sets;
  for (const mesh::Material& material : model.mesh.materials) {
    model.materials.push_back({read_texture(model.mesh, material, Channel::base_color),
                               read_texture(model.mesh, material, Channel::normal)});
    const auto& normal = material.textures[static_cast<std::size_t>(Channel::normal)];
    uv_sets.push_back(normal ? normal->uv_set : 0);
  }
  const bool any = std::any_of(model.materials.begin(), model.materials.end(),
                               [](const auto& textures) { return textures.normal.has_value(); });
  if (any)
    mesh::set_tangents(model.mesh, uv_sets, std::vector<bool>(model.mesh.materials.size(), true));
  return model;
}

Seen see_model(const Model& model, const View& view, std::uint32_t finer, bool lit) {
  return see_triangles(model.mesh, view, finer,
                       [&](std::size_t triangle) { return Shader(model, triangle, view, lit); });
}

}  // namespace pounce::score
