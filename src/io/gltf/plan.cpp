// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string_view>

#include "io/gltf/validate.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

// A scene may repeat its meshes; what it becomes must stay in some proportion to the file.
constexpr std::uint64_t kFlattenedBase = 256U << 20;
constexpr std::uint64_t kFlattenedPerByte = 256;
constexpr std::uint64_t kReadingPerFlattened = 8;  // and what is read to make it
/// Messages are made for every primitive of every instance, needed or not.
constexpr std::size_t kShownNameBytes = 100;
constexpr std::uint64_t kClaimedVertices = std::uint64_t{1} << 40;

std::size_t joints_of(const tinygltf::Model& model, const MeshInstance& instance) {
  const int skin = skin_of(model, instance);
  return skin < 0 ? 0 : model.skins[static_cast<std::size_t>(skin)].joints.size();
}

std::uint64_t reading_bytes(const PrimitiveShape& shape) {
  // Positions, normals, tangents twice over (morphing), UVs, joints and weights, indices and
  // triangles.
  return shape.vertices * (12 + 12 + 16 + 12 + 12 + 8 * shape.uv_sets + 32 * shape.joint_sets) +
         shape.triangles * (12 + 12) + (2U << 20);
}

/// What makes Gaussians of a primitive's points; "" if nothing does.
std::string splat_extension(const tinygltf::Primitive& primitive) {
  for (const auto& [name, value] : primitive.extensions) {
    if (!is_splat_extension(name)) continue;
    if (!value.Has("extensions")) return name;
    const std::vector<std::string> inner = value.Get("extensions").Keys();
    return inner.empty() ? name : fmt::format("{} with {}", name, fmt::join(inner, ", "));
  }
  return "";
}

/// Sums of what a file claims: far from overflow, and far beyond what is accepted.
void add_claimed(std::uint64_t& sum, std::uint64_t more) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 53;
  sum = std::min(kMost, sum + std::min(kMost, more));
}

MeshShape shape_of(const tinygltf::Model& model, const AccessorReader& accessors,
                   const MeshInstance& instance) {
  MeshShape out;
  const auto& primitives = model.meshes[static_cast<std::size_t>(instance.mesh)].primitives;
  for (std::size_t p = 0; p < primitives.size(); ++p) {
    if (!splat_extension(primitives[p]).empty()) {
      ++out.splats;
      out.primitives.emplace_back();
      continue;
    }
    const PrimitiveShape shape =
        check_primitive(accessors, primitives[p], primitive_place(model, instance.mesh, p),
                        joints_of(model, instance));
    out.primitives.push_back(shape);
    if (!shape.is_surface) {
      ++out.skipped;
      continue;
    }
    out.surfaces.push_back(p);
    add_claimed(out.vertices, shape.flattened);
    add_claimed(out.triangles, shape.triangles);
    // Besides its numbers, each attribute is a few calls.
    constexpr std::uint64_t kBytesPerRead = 256;
    add_claimed(out.reading_bytes, 32 * shape.vertices + 8 * kBytesPerRead);
    add_claimed(out.morphing_bytes,
                primitives[p].targets.size() *
                    (12 * std::min(shape.vertices, kClaimedVertices) + kBytesPerRead));
    out.uv_sets = std::max(out.uv_sets, shape.uv_sets);
    out.has_colours = out.has_colours || shape.has_colours;
    out.largest_primitive_bytes = std::max(out.largest_primitive_bytes, reading_bytes(shape));
  }
  return out;
}

/// Checked at every step: whatever the file says, the sums stay far from overflow.
void check_proportion(const GltfFile& file, const ScenePlan& plan) {
  const std::uint64_t limit =
      kFlattenedBase + kFlattenedPerByte * (file.total_buffer_bytes() + file.json_bytes());
  if (plan.vertices > std::numeric_limits<std::uint32_t>::max() ||
      plan.triangles > std::numeric_limits<std::uint32_t>::max() || plan.mesh_bytes() > limit ||
      plan.reading_bytes / kReadingPerFlattened > limit) {
    throw Error(ErrorKind::input,
                fmt::format("{}: its scene has {} vertices and {} triangles or more, too many "
                            "for a file of this size; export fewer instances or morph targets, and "
                            "no accessors without bytes",
                            file.path(), plan.vertices, plan.triangles));
  }
}

}  // namespace

int skin_of(const tinygltf::Model& model, const MeshInstance& instance) {
  return instance.node < 0 ? -1 : model.nodes[static_cast<std::size_t>(instance.node)].skin;
}

const std::vector<double>& weights_of(const tinygltf::Model& model, const MeshInstance& instance) {
  if (instance.node >= 0) {
    const auto& own = model.nodes[static_cast<std::size_t>(instance.node)].weights;
    if (!own.empty()) return own;
  }
  return model.meshes[static_cast<std::size_t>(instance.mesh)].weights;
}

std::string primitive_place(const tinygltf::Model& model, int mesh, std::size_t primitive) {
  const std::string& name = model.meshes[static_cast<std::size_t>(mesh)].name;
  if (name.empty()) return fmt::format("mesh {} primitive {}", mesh, primitive);
  std::size_t shown = std::min(name.size(), kShownNameBytes);
  while (shown < name.size() && (name[shown] & 0xC0) == 0x80) --shown;  // whole characters
  return fmt::format("mesh {} \"{}{}\" primitive {}", mesh, std::string_view(name).substr(0, shown),
                     shown < name.size() ? "..." : "", primitive);
}

std::string splat_extensions(const tinygltf::Model& model) {
  std::set<std::string> names;
  for (const tinygltf::Mesh& mesh : model.meshes) {
    for (const tinygltf::Primitive& primitive : mesh.primitives)
      names.insert(splat_extension(primitive));
  }
  names.erase("");
  return fmt::format("{}", fmt::join(names, "; "));
}

ScenePlan plan_scene(const GltfFile& file, const tinygltf::Model& model,
                     const AccessorReader& accessors) {
  ScenePlan plan;
  plan.worlds = world_transforms(model);
  plan.instances = mesh_instances(model, plan.worlds);
  for (const MeshInstance& instance : plan.instances) {
    const int skin = skin_of(model, instance);
    const auto [at, is_new] = plan.meshes.try_emplace({instance.mesh, skin >= 0});
    if (is_new) at->second = shape_of(model, accessors, instance);
    const MeshShape& shape = at->second;
    plan.shapes.push_back(&shape);
    if (skin >= 0) plan.skins.insert(skin);
    plan.skipped += shape.skipped;
    plan.splats += shape.splats;
    plan.vertices += shape.vertices;
    plan.triangles += shape.triangles;
    plan.reading_bytes += shape.reading_bytes;
    plan.has_colours = plan.has_colours || shape.has_colours;
    if (!weights_of(model, instance).empty()) plan.reading_bytes += shape.morphing_bytes;
    plan.uv_sets = std::max(plan.uv_sets, shape.uv_sets);
    plan.largest_primitive_bytes =
        std::max(plan.largest_primitive_bytes, shape.largest_primitive_bytes);
    check_proportion(file, plan);
  }
  if (plan.triangles == 0 && plan.splats > 0) {
    throw Error(ErrorKind::input,
                fmt::format("{}: a Gaussian splat scene in glTF ({}), without a triangle, where a "
                            "mesh is wanted; a scene comes first, as the source of a transfer (of "
                            "KHR_gaussian_splatting, as .glb): pounce transfer SCENE TARGET.glb "
                            "-o OUTPUT",
                            file.path(), splat_extensions(model)));
  }
  if (plan.triangles == 0) {
    throw Error(ErrorKind::input,
                fmt::format("{}: no triangles in its scene ({} primitives of points or lines or "
                            "without positions); export a model with a surface",
                            file.path(), plan.skipped));
  }
  return plan;
}

}  // namespace pounce::io
