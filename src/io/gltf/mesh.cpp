// SPDX-License-Identifier: Apache-2.0
//
// From a glTF file to one flat triangle mesh. tinygltf gives the document its types, but it trusts
// what it reads and keeps every buffer in memory twice. So the file is opened, parsed and checked
// here first (gltf_file, gltf_validate); tinygltf only sees a checked document without buffers and
// images, and accessors are read straight from the file in small pieces. What is in memory at the
// peak is the mesh, one primitive as the file has it, and the JSON.
#include "io/gltf/mesh.h"

#include <fmt/format.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "io/gltf/accessor.h"
#include "io/gltf/file.h"
#include "io/gltf/material.h"
#include "io/gltf/model.h"
#include "io/gltf/plan.h"
#include "io/gltf/primitive.h"
#include "io/gltf/scene.h"
#include "io/gltf/validate.h"
#include "io/material_names.h"
#include "io/problems.h"
#include "mesh/vertex_frames.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kBytesPerExtensionValue = 640;
/// JSON that takes no more is looked into whatever the limit, to say exactly what is needed.
constexpr std::uint64_t kUnderstoodAnyway = 64U << 20;
constexpr std::uint64_t kTypedBytesPerMaterial = 5000;  // 4 kB measured of an empty one
// Two names, the part that has them, its run, and the tables that find them again while reading.
constexpr std::uint64_t kBytesPerInstance = 600;
constexpr std::uint64_t kBytesPerPath = 300;
/// Its matrix, and the inverse bind matrix it is made with.
constexpr std::uint64_t kBytesPerJoint = sizeof(Affine) + 2 * 64;

void reserve(const ScenePlan& plan, mesh::Mesh& mesh) {
  mesh.positions.reserve(plan.vertices);
  mesh.normals.reserve(plan.vertices);
  mesh.tangents.reserve(plan.vertices);
  mesh.triangles.reserve(plan.triangles);
  mesh.triangle_material.reserve(plan.triangles);
  mesh.uv_sets.resize(plan.uv_sets);
  mesh.uv_present.resize(plan.uv_sets);
  for (auto& set : mesh.uv_sets) set.reserve(plan.vertices);
}

/// Joint matrices of a skin: where each joint is now, after taking the vertex to its bind pose.
std::vector<Affine> joint_matrices(const tinygltf::Model& model, const AccessorReader& accessors,
                                   const ScenePlan& plan, int skin_index) {
  std::vector<Affine> matrices;
  if (skin_index < 0) return matrices;
  const tinygltf::Skin& skin = model.skins[static_cast<std::size_t>(skin_index)];
  std::vector<float> inverse_bind;
  if (skin.inverseBindMatrices >= 0) {
    const std::string place = fmt::format("skin {} inverseBindMatrices", skin_index);
    accessors.check_unbacked(skin.inverseBindMatrices, skin.joints.size(), place);
    inverse_bind.resize(accessors.count(skin.inverseBindMatrices) * 16);
    accessors.read_floats(skin.inverseBindMatrices, inverse_bind.data(), place);
  }
  for (std::size_t j = 0; j < skin.joints.size(); ++j) {
    Affine matrix = plan.worlds[static_cast<std::size_t>(skin.joints[j])];
    if (!inverse_bind.empty()) {
      std::array<double, 16> m{};
      std::copy_n(inverse_bind.begin() + static_cast<std::ptrdiff_t>(16 * j), 16, m.begin());
      matrix = matrix * affine_from_columns(m.data());
    }
    matrices.push_back(matrix);
  }
  return matrices;
}

void add_default_material(mesh::Mesh& mesh) {
  std::vector<std::string> names;
  for (const auto& material : mesh.materials) names.push_back(material.name);
  names.emplace_back("default");
  mesh.materials.emplace_back().name = unique_material_names(std::move(names)).back();
}

/// What an instance can be selected by: its node and its mesh; where both have no name, its number.
std::vector<std::string> instance_names(const tinygltf::Model& model,
                                        const MeshInstance& instance) {
  const std::string& mesh = model.meshes[static_cast<std::size_t>(instance.mesh)].name;
  const std::string node =
      instance.node < 0 ? "" : model.nodes[static_cast<std::size_t>(instance.node)].name;
  if (mesh.empty() && node.empty()) return {fmt::format("mesh_{}", instance.mesh)};
  return {node, mesh};
}

void append_instance(const tinygltf::Model& model, const AccessorReader& accessors,
                     const ScenePlan& plan, std::size_t index, const std::vector<Affine>& joints,
                     bool with_colours, Vec3d origin, mesh::Mesh& mesh, MeshWarnings& warnings) {
  const MeshInstance& instance = plan.instances[index];
  const tinygltf::Mesh& source = model.meshes[static_cast<std::size_t>(instance.mesh)];
  const std::vector<double>& weights = weights_of(model, instance);
  for (const std::size_t p : plan.shapes[index]->surfaces) {
    const PrimitiveShape& shape = plan.shapes[index]->primitives[p];
    const tinygltf::Primitive& primitive = source.primitives[p];
    const std::string place = primitive_place(model, instance.mesh, p);
    // The last material is the one for primitives without any.
    const auto material = primitive.material < 0
                              ? static_cast<std::uint32_t>(model.materials.size())
                              : static_cast<std::uint32_t>(primitive.material);
    if (material == mesh.materials.size()) add_default_material(mesh);
    mesh.has_vertex_colours |= shape.has_colours;
    if (!joints.empty() && shape.joint_sets == 0) {
      warnings.add("{} has a skin but no joints and weights; placed by its node instead", place);
    }
    if (!shape.has_colours && primitive.attributes.contains("COLOR_0"))
      warnings.add("{} COLOR_0 is of a type that colours do not have; left out", place);
    const PrimitiveContext context{accessors,         primitive, place,        weights,
                                   instance.to_world, joints,    with_colours, origin};
    const AppendCounts counts = append_primitive(context, shape, material, mesh);
    if (counts.incomplete_triangles > 0) {
      warnings.add("{} ends with an incomplete triangle, left out", place);
    }
    if (counts.bad_colours > 0) {
      warnings.add("{} COLOR_0 has {} colours that are not finite; taken as white", place,
                   counts.bad_colours);
    }
    if (counts.bad_normals > 0) {
      warnings.add(
          "{} has {} normals that are zero or not finite; replaced by those of the triangles",
          place, counts.bad_normals);
    }
  }
}

void warn_of_extensions(const GltfFile& file, MeshWarnings& warnings) {
  const auto used = file.document().find("extensionsUsed");
  if (used == file.document().end()) return;
  for (const auto& name : *used) {
    if (name == "EXT_mesh_gpu_instancing") {
      warnings.add("EXT_mesh_gpu_instancing is not read; each mesh appears once");
    }
  }
}

void bind_all(mesh::Mesh& mesh, std::uint32_t uv_set) {
  for (auto& material : mesh.materials) {
    for (auto& binding : material.textures) {
      if (binding) binding->uv_set = uv_set;
    }
  }
}

/// Bindings to UV sets that no primitive has would look beyond uv_sets.
void check_bindings(mesh::Mesh& mesh, MeshWarnings& warnings) {
  for (auto& material : mesh.materials) {
    for (std::size_t c = 0; c < material.textures.size(); ++c) {
      auto& binding = material.textures[c];
      if (!binding || binding->uv_set < mesh.uv_sets.size()) continue;
      warnings.add(
          "material \"{}\" wants TEXCOORD_{} for {}, which no primitive has; texture left out",
          material.name, binding->uv_set, channel_name(static_cast<Channel>(c)));
      binding.reset();
    }
  }
}

/// What it takes to understand the JSON: its text, its trees and tinygltf's model.
std::uint64_t json_cost(std::uint64_t text_bytes, std::uint64_t long_bytes, std::uint64_t entries,
                        std::uint64_t materials, std::uint64_t extension_values) {
  const std::uint64_t rest = text_bytes - std::min(long_bytes, text_bytes);
  return kTypedBytesPerJsonByte * rest + kCopiesOfLongStrings * (text_bytes - rest) +
         kBytesPerEntry * entries + kTypedBytesPerMaterial * materials +
         kBytesPerExtensionValue * extension_values;
}

/// What the mesh keeps of where its images are: paths, labels and problems, which name the file.
std::uint64_t image_ref_bytes(const GltfFile& file) {
  const auto images = file.document().find("images");
  if (images == file.document().end()) return 0;
  std::uint64_t longest = 0;  // of what is said of a buffer that an image lies in
  for (const GltfBuffer& buffer : file.buffers())
    longest = std::max<std::uint64_t>(longest, buffer.path.size() + buffer.problem.size());
  return images->size() *
         (sizeof(mesh::ImageRef) + kBytesPerPath + 3 * file.path().size() + longest);
}

}  // namespace

mesh::Mesh read_gltf(const std::string& path, const MeshReading& reading) {
  GltfFile file(path, reading.allow_external);
  const tinygltf::Model model = load_model(file);
  const AccessorReader accessors(file, model);
  const ScenePlan plan = plan_scene(file, model, accessors);

  mesh::Mesh mesh;
  mesh.path = path;
  MeshWarnings warnings(mesh);
  mesh.files = {path};
  for (const GltfBuffer& buffer : file.buffers()) {
    if (!buffer.path.empty() && buffer.path != path) mesh.files.push_back(buffer.path);
  }
  for (const std::string& warning : file.warnings()) {
    warnings.add("{}", warning);
  }
  read_gltf_materials(file, model, mesh, warnings);
  warn_of_extensions(file, warnings);
  if (plan.skipped > 0) {
    warnings.add("{} primitives of points or lines, or without positions, left out", plan.skipped);
  }
  if (plan.splats > 0) {
    warnings.add("{} primitives of Gaussian splats ({}) left out", plan.splats,
                 splat_extensions(model));
  }
  const bool with_colours = reading.vertex_colours && plan.has_colours;
  reserve(plan, mesh);
  if (with_colours) mesh.colours.reserve(plan.vertices);
  mesh::PartsBuilder parts;
  std::map<int, std::vector<Affine>> joints;  // by skin; many nodes may share one
  joints[-1];
  for (const int skin : plan.skins) joints[skin] = joint_matrices(model, accessors, plan, skin);
  for (std::size_t i = 0; i < plan.instances.size(); ++i) {
    parts.start(static_cast<std::uint32_t>(mesh.triangles.size()),
                instance_names(model, plan.instances[i]));
    append_instance(model, accessors, plan, i, joints.at(skin_of(model, plan.instances[i])),
                    with_colours, reading.origin, mesh, warnings);
  }
  mesh.parts = parts.finish(static_cast<std::uint32_t>(mesh.triangles.size()));
  if (reading.texture_uv_set) bind_all(mesh, *reading.texture_uv_set);
  check_bindings(mesh, warnings);
  mesh::repair_normals(mesh);
  mesh::complete_tangents(mesh);
  warnings.finish();
  return mesh;
}

MeshCost gltf_cost(const std::string& path, const MeshReading& reading, std::uint64_t most_bytes) {
  const JsonSize size = gltf_json_size(path);
  const std::uint64_t understanding = json_cost(size.text_bytes, size.long_bytes, size.entries,
                                                size.materials, size.extension_values) +
                                      3 * size.data_bytes;
  if (understanding > std::max(most_bytes, kUnderstoodAnyway))
    return {understanding, size.text_bytes};
  GltfFile file(path, reading.allow_external);
  const tinygltf::Model model = load_model(file);
  const ScenePlan plan = plan_scene(file, model, AccessorReader(file, model));
  MeshCost cost;
  // Embedded data URIs may all be images, which the mesh keeps.
  const auto materials = model.materials.size() + 1;
  std::uint64_t joints = 0;
  for (const int skin : plan.skins)
    joints += model.skins[static_cast<std::size_t>(skin)].joints.size();
  const std::uint64_t names = plan.instances.size() * kBytesPerInstance +
                              file.buffers().size() * (kBytesPerPath + 3 * path.size()) +
                              image_ref_bytes(file);
  const std::uint64_t colours = reading.vertex_colours ? plan.colour_bytes() : 0;
  cost.kept_bytes = plan.mesh_bytes() + colours + file.inline_bytes() + file.image_text_bytes() +
                    file.json_bytes() + materials * sizeof(mesh::Material) + names + (1U << 20);
  cost.peak_bytes = cost.kept_bytes + plan.largest_primitive_bytes + 2 * colours +
                    3 * file.inline_bytes() + joints * kBytesPerJoint +
                    2 * file.image_text_bytes() +
                    json_cost(file.json_bytes(), file.long_string_bytes(),
                              gltf_entry_count(file.document()), materials, size.extension_values);
  return cost;
}

}  // namespace pounce::io
