// SPDX-License-Identifier: Apache-2.0
//
// From a glTF file to one flat triangle mesh, in three steps: the file is opened and checked
// (gltf_file), the scene is planned, its primitives are appended one after the other
// (placed_primitive). What is in memory at the peak is the mesh, one primitive as the file has it,
// and the JSON; gltf_cost() adds these up before, from a scan of the JSON and the same plan.
//
// The plan needs no geometry: accessors say how many vertices and triangles each primitive has, and
// a mesh that many nodes show is judged once. It is also what stands between a small file and a
// huge mesh. A few kB of JSON may show one mesh a million times, claim accessors without bytes, or
// list morph targets that take hours to read. So the sums are compared at every step with what a
// file of this size could sensibly mean, and nothing is reserved before they were.
#include <fmt/format.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "io/gltf/accessor.h"
#include "io/gltf/gltf_file.h"
#include "io/gltf/material_reader.h"
#include "io/gltf/placed_primitive.h"
#include "io/gltf/validate.h"
#include "io/problems.h"
#include "io/read_mesh.h"
#include "mesh/vertex_frames.h"

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

/// One mesh of the file, as the nodes see it that show it with a skin, or without.
struct MeshShape {
  std::vector<PrimitiveShape> primitives;
  std::vector<std::size_t> surfaces;  ///< those that become triangles
  std::uint64_t vertices = 0, triangles = 0;
  std::uint64_t skipped = 0, splats = 0;  ///< as Plan counts them
  std::uint64_t largest_primitive_bytes = 0;
  std::uint64_t reading_bytes = 0;   ///< what is read each time it is shown
  std::uint64_t morphing_bytes = 0;  ///< and what comes to that if it is morphed
  std::size_t uv_sets = 0;
  bool has_colours = false;  ///< has one of the primitives?
};

/// What the scene becomes, found without reading geometry.
struct ScenePlan {
  std::vector<Affine> worlds;
  std::vector<MeshInstance> instances;
  std::map<std::pair<int, bool>, MeshShape> meshes;  ///< by mesh and whether it has a skin
  std::vector<const MeshShape*> shapes;              ///< by instance
  std::set<int> skins;                               ///< that instances have
  std::uint64_t vertices = 0, triangles = 0, reading_bytes = 0;
  std::uint64_t skipped = 0;  ///< primitives without a surface
  std::uint64_t splats = 0;   ///< primitives of Gaussians
  std::uint64_t largest_primitive_bytes = 0;
  std::size_t uv_sets = 0;
  bool has_colours = false;

  /// What Mesh::colours takes, where they are asked for.
  std::uint64_t colour_bytes() const { return has_colours ? vertices * sizeof(Vec4f) : 0; }
  std::uint64_t mesh_bytes() const {
    const std::uint64_t per_vertex =
        sizeof(Vec3f) * 2 + sizeof(Vec4f) + uv_sets * sizeof(Vec2f) + (uv_sets + 7) / 8;
    return vertices * per_vertex + triangles * (sizeof(std::uint32_t) * 4);
  }
};

// A scene may repeat its meshes; what it becomes must stay in some proportion to the file.
constexpr std::uint64_t kReadingPerFlattened = 8;  // and what is read to make it
constexpr std::uint64_t kClaimedVertices = std::uint64_t{1} << 40;

/// 0: no skin, so joints and weights are not looked at.
std::size_t joints_of(const tinygltf::Model& model, const MeshInstance& instance) {
  const int skin = skin_of(model, instance);
  return skin < 0 ? 0 : model.skins[static_cast<std::size_t>(skin)].joints.size();
}

/// What PrimitiveReader holds of one primitive at its peak; 2 MiB for pieces of accessors.
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

/// Sums over the primitives of a mesh, from their accessors. What reading it costs is counted apart
/// from what it becomes: morph targets and accessors without bytes can make the first far larger.
MeshShape shape_of(const GltfFile& file, const tinygltf::Model& model,
                   const AccessorReader& accessors, const MeshInstance& instance) {
  MeshShape out;
  const auto& primitives = model.meshes[static_cast<std::size_t>(instance.mesh)].primitives;
  for (std::size_t p = 0; p < primitives.size(); ++p) {
    if (!splat_extension(primitives[p]).empty()) {
      ++out.splats;
      out.primitives.emplace_back();
      continue;
    }
    PrimitiveShape shape =
        check_primitive(accessors, primitives[p], primitive_place(model, instance.mesh, p),
                        joints_of(model, instance));
    shape.is_packed = shape.is_surface && is_draco(file, model, primitives[p]);
    if (shape.is_packed) {
      shape.vertices = most_draco_vertices(shape.vertices);
      if (shape.has_normals) shape.flattened = shape.vertices;
    }
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
    std::uint64_t reading = reading_bytes(shape);
    if (shape.is_packed) {
      const std::uint64_t unpacking = draco_bytes(file, model, primitives[p]);
      add_claimed(out.reading_bytes, unpacking);
      reading += unpacking;
    }
    out.largest_primitive_bytes = std::max(out.largest_primitive_bytes, reading);
  }
  return out;
}

/// Checked at every step: whatever the file says, the sums stay far from overflow.
void check_proportion(const GltfFile& file, const ScenePlan& plan) {
  // In proportion to what the file has, not an absolute number: a large scan is no attack.
  const std::uint64_t limit =
      kExpandedBase + kExpandedPerByte * (file.total_buffer_bytes() + file.json_bytes());
  if (plan.vertices > std::numeric_limits<std::uint32_t>::max() ||
      plan.triangles > std::numeric_limits<std::uint32_t>::max() || plan.mesh_bytes() > limit ||
      plan.reading_bytes / kReadingPerFlattened > limit) {
    refuse(file.path(),
           "its scene has {} vertices and {} triangles or more, too many for a file of this size; "
           "export fewer instances or morph targets, and no accessors without bytes",
           plan.vertices, plan.triangles);
  }
}

/// What makes Gaussians of points in this model, for messages.
std::string splat_extensions(const tinygltf::Model& model) {
  std::set<std::string> names;
  for (const tinygltf::Mesh& mesh : model.meshes) {
    for (const tinygltf::Primitive& primitive : mesh.primitives)
      names.insert(splat_extension(primitive));
  }
  names.erase("");
  return fmt::format("{}", fmt::join(names, "; "));
}

/// Throws Error(input) where the scene is empty, or too large for its file.
ScenePlan plan_scene(const GltfFile& file, const tinygltf::Model& model,
                     const AccessorReader& accessors) {
  ScenePlan plan;
  plan.worlds = world_transforms(model);
  plan.instances = mesh_instances(model, plan.worlds);
  for (const MeshInstance& instance : plan.instances) {
    const int skin = skin_of(model, instance);
    // A mesh is judged once, however many nodes show it; a skin changes what its joints may name.
    const auto [at, is_new] = plan.meshes.try_emplace({instance.mesh, skin >= 0});
    if (is_new) at->second = shape_of(file, model, accessors, instance);
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
    refuse(file.path(),
           "a Gaussian splat scene in glTF ({}) without triangles, but a mesh is required; a scene "
           "comes first, as the source of a transfer (of KHR_gaussian_splatting, as .glb): pounce "
           "transfer SCENE TARGET.glb -o OUTPUT",
           splat_extensions(model));
  }
  if (plan.triangles == 0) {
    refuse(file.path(),
           "no triangles in its scene ({} primitives are points or lines or have no positions); "
           "export a model with a surface",
           plan.skipped);
  }
  return plan;
}

/// To the final size at once: growing would hold the mesh twice for a moment.
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
  // Without matrices all of them are the identity: the mesh is in the joints' own space.
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

/// Made when the first primitive without a material is met, since most files have none.
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

/// All surfaces of a mesh as one node shows it, with a warning for each thing that was wrong but
/// not enough to refuse the file.
void append_instance(const GltfFile& file, const tinygltf::Model& model, const ScenePlan& plan,
                     std::size_t index, const std::vector<Affine>& joints, bool with_colours,
                     Vec3d origin, mesh::Mesh& mesh, MeshWarnings& warnings) {
  const MeshInstance& instance = plan.instances[index];
  const tinygltf::Mesh& source = model.meshes[static_cast<std::size_t>(instance.mesh)];
  const std::vector<double>& weights = weights_of(model, instance);
  for (const std::size_t p : plan.shapes[index]->surfaces) {
    PrimitiveShape shape = plan.shapes[index]->primitives[p];
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
      warnings.add("{} COLOR_0 has a type that is not valid for colours; ignored", place);
    std::optional<DracoPrimitive> unpacked;
    if (shape.is_packed) {
      unpacked.emplace(file, model, primitive, place);
      shape.vertices = unpacked->vertices();
      shape.triangles = unpacked->triangles();
    }
    const AccessorReader reader(file, model, unpacked ? &*unpacked : nullptr);
    const PrimitiveContext context{reader, primitive,    place, weights, instance.to_world,
                                   joints, with_colours, origin};
    const AppendCounts counts = append_primitive(context, shape, material, mesh);
    if (counts.incomplete_triangles > 0) {
      warnings.add("{} ends with an incomplete triangle; ignored", place);
    }
    if (counts.bad_colours > 0) {
      warnings.add("{} COLOR_0 has {} non-finite colours; replaced by white", place,
                   counts.bad_colours);
    }
    if (counts.bad_normals > 0) {
      warnings.add("{} has {} zero or non-finite normals; replaced by the normals of the triangles",
                   place, counts.bad_normals);
    }
  }
}

void warn_of_extensions(const GltfFile& file, MeshWarnings& warnings) {
  const auto used = file.document().find("extensionsUsed");
  if (used == file.document().end()) return;
  for (const auto& name : *used) {
    if (name == "EXT_mesh_gpu_instancing") {
      warnings.add("EXT_mesh_gpu_instancing is not supported; each mesh appears once");
    }
  }
}

/// The user says on which UV set textures lie (--source-uv-set), whatever the materials say.
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
          "material \"{}\" needs TEXCOORD_{} for {}, which no primitive has; texture ignored",
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
    warnings.add("{} primitives that are points or lines, or have no positions, ignored",
                 plan.skipped);
  }
  if (plan.splats > 0) {
    warnings.add("{} primitives of Gaussian splats ({}) ignored", plan.splats,
                 splat_extensions(model));
  }
  const bool with_colours = reading.vertex_colours && plan.has_colours;
  reserve(plan, mesh);
  if (with_colours) mesh.colours.reserve(plan.vertices);
  // One run of triangles for each node that shows a mesh: what a user can select is what a node or
  // a mesh is called.
  mesh::PartsBuilder parts;
  // Once per skin and not per instance: a crowd of one character shares its matrices.
  std::map<int, std::vector<Affine>> joints;  // by skin; many nodes may share one
  // No skin, so no joints: instances without one find an empty list.
  joints[-1];
  for (const int skin : plan.skins) joints[skin] = joint_matrices(model, accessors, plan, skin);
  for (std::size_t i = 0; i < plan.instances.size(); ++i) {
    parts.start(static_cast<std::uint32_t>(mesh.triangles.size()),
                instance_names(model, plan.instances[i]));
    append_instance(file, model, plan, i, joints.at(skin_of(model, plan.instances[i])),
                    with_colours, reading.origin, mesh, warnings);
  }
  mesh.parts = parts.finish(static_cast<std::uint32_t>(mesh.triangles.size()));
  if (reading.texture_uv_set) bind_all(mesh, *reading.texture_uv_set);
  check_bindings(mesh, warnings);
  // From here on every vertex has a normal of unit length, and a tangent where the file had one.
  mesh::repair_normals(mesh);
  mesh::complete_tangents(mesh);
  warnings.finish();
  return mesh;
}

MeshCost gltf_cost(const std::string& path, const MeshReading& reading, std::uint64_t most_bytes) {
  // In two steps: the scan of the text says whether the budget allows to understand the JSON at
  // all; only then is it parsed, for the exact plan. A job that is refused has taken next to
  // nothing.
  const JsonSize size = gltf_json_size(path);
  const std::uint64_t understanding = json_cost(size.text_bytes, size.long_bytes, size.entries,
                                                size.materials, size.extension_values) +
                                      3 * size.data_bytes;
  // A bound is all that is known then: for the exact number the JSON would have to be parsed, which
  // needs the memory that is not there.
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
                    3 * file.inline_bytes() + joints * kBytesPerJoint + file.unpacking_bytes() +
                    2 * file.image_text_bytes() +
                    json_cost(file.json_bytes(), file.long_string_bytes(),
                              gltf_entry_count(file.document()), materials, size.extension_values);
  return cost;
}

}  // namespace pounce::io
