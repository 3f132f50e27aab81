// SPDX-License-Identifier: Apache-2.0
//
// The wall between a file and everything that reads it: behind check_gltf() every index leads to an
// entry, every number is finite and of its type, every view lies in its buffer and every element of
// an accessor in its view, nodes are a forest. tinygltf and our readers then ask nothing again, and
// each check stands in one place, with the place in the document in its message.
//
// Order matters: buffers before views before accessors, since each is measured by the one before;
// nodes one by one before the forest they make. All arithmetic is on whole numbers below 2^53, so
// no sum overflows, and products are compared by dividing.
//
// Files of real programs break the letter of the standard in harmless ways; what pounce does not
// read is not looked at, and a rotation that is not of unit length is a warning.
#include "io/gltf/validate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "io/gltf/draco.h"
#include "io/gltf/meshopt.h"
#include "io/json/untrusted.h"
#include "io/problems.h"
#include "io/read_mesh.h"

namespace pounce::io {
namespace {

using Json = nlohmann::json;

// Whole numbers of JSON are exact up to here in every reader; sums of two of these cannot overflow.
constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 53;
// An empty object of 3 bytes becomes 1.2 kB in tinygltf, an empty material 4 kB. No real file comes
// near.
constexpr std::size_t kMaxEntries = 1 << 19;
constexpr std::uint64_t kMaxInt = 0x7FFFFFFF;  // tinygltf keeps some offsets in an int
/// Every node that shows a mesh says its name anew.
constexpr std::size_t kMaxNameBytes = 4096;

// Besides every KHR_materials_*: these change neither geometry nor UVs nor how images are decoded,
// or pounce implements them.
constexpr std::array<std::string_view, 10> kSupported = {"KHR_mesh_quantization",
                                                         "KHR_texture_transform",
                                                         "KHR_lights_punctual",
                                                         "KHR_animation_pointer",
                                                         "KHR_xmp",
                                                         "KHR_xmp_json_ld",
                                                         "EXT_lights_image_based",
                                                         "EXT_lights_ies",
                                                         kMeshopt,
                                                         kDraco};

constexpr std::array<std::string_view, 6> kImageExtensions = {
    "KHR_texture_basisu", "EXT_texture_webp",  "EXT_texture_avif",
    "MSFT_texture_dds",   "EXT_texture_video", "GOOGLE_texture_basis"};

/// Version 1 has other names for everything; 2.1 may mean something new by what 2.0 has, so a file
/// that asks for more than 2.0 (minVersion) is refused, one that only says 2.x is read.
void check_asset(const JsonCheck& check, const std::string& path, const Json& root) {
  const Json* asset = check.object(root, "asset", {});
  if (asset == nullptr) check.fail("asset", "is missing");
  const std::string* version = check.string(*asset, "version", "asset");
  if (version == nullptr) check.fail("asset.version", "is missing");
  const auto refuse = [&](const std::string& found) {
    io::refuse(path, "glTF version \"{}\", but only 2.x is supported; export the model as glTF 2.0",
               found);
  };
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  if (version->size() < 3 || !version->starts_with("2.") ||
      !std::all_of(version->begin() + 2, version->end(), is_digit)) {
    refuse(*version);
  }
  const std::string* least = check.string(*asset, "minVersion", "asset");
  if (least != nullptr && *least != "2.0") refuse(*least);
}

/// What is required and changes what a file means has to be known, or the result would be wrong
/// without a word: compressed geometry above all. Extensions that are only used are optional.
void check_extensions(const JsonCheck& check, const std::string& path, const Json& root) {
  const auto strings = [&](const char* key) -> const Json* {
    const Json* list = check.array(root, key, {});
    if (list == nullptr) return nullptr;
    for (const Json& name : *list) {
      if (!name.is_string()) check.fail(key, "contains something that is not a string");
    }
    return list;
  };
  strings("extensionsUsed");
  const Json* required = strings("extensionsRequired");
  if (required == nullptr) return;
  for (const Json& item : *required) {
    const auto& name = item.get_ref<const std::string&>();
    if (name.starts_with("KHR_materials_") ||
        std::find(kSupported.begin(), kSupported.end(), name) != kSupported.end()) {
      continue;
    }
    // Their images and points are left out, by name, where something would need them.
    if (is_image_extension(name) || is_splat_extension(name)) continue;
    const bool packed = name.find("compression") != std::string::npos;
    refuse(
        path, "requires the extension {}, which pounce does not support; {}", name,
        packed ? "export the model without geometry compression" : "export the model without it");
  }
}

/// Bytes of an accessor, or of a sparse part, within its view.
struct AccessorLayout {
  std::uint64_t offset, stride, element, count;
};

void check_range(const JsonCheck& check, const std::string& place, const AccessorLayout& layout,
                 const Json& view, std::size_t view_index) {
  // Every factor is below 2^53, so divide instead of multiplying.
  const auto view_bytes = view.at("byteLength").get<std::uint64_t>();
  // All strides but the last, and then one element: a view may end with it, without the rest of a
  // stride.
  const std::uint64_t head = layout.offset + layout.element;
  if (head > view_bytes || (layout.count - 1) > (view_bytes - head) / layout.stride) {
    check.fail(place, fmt::format("reads beyond the end of bufferViews[{}] ({} elements from byte "
                                  "{}, but it has only {} bytes)",
                                  view_index, layout.count, layout.offset, view_bytes));
  }
}

/// By what the document says alone: whether a buffer's file really has so many bytes is found when
/// it is opened. byteStride is checked as glTF has it; without one elements follow each other.
void check_buffers(const JsonCheck& check, const Json& root) {
  check.for_each("buffers", [&](const Json& buffer, const std::string& place) {
    check.required_whole(buffer, "byteLength", place, 0, kMaxBytes);
    check.string(buffer, "uri", place);
  });
  check.for_each("bufferViews", [&](const Json& view, const std::string& place) {
    check.required_index(view, "buffer", place, "buffers");
    const std::uint64_t offset = check.whole(view, "byteOffset", place, 0, kMaxBytes, 0);
    const std::uint64_t length = check.required_whole(view, "byteLength", place, 0, kMaxBytes);
    const std::uint64_t stride = check.whole(view, "byteStride", place, 4, 252, 4);
    if (stride % 4 != 0) check.fail(place + ".byteStride", "is not a multiple of 4");
    const auto buffer = view.at("buffer").get<std::size_t>();
    const auto size = root.at("buffers").at(buffer).at("byteLength").get<std::uint64_t>();
    if (offset > size || length > size - offset) {
      check.fail(place,
                 fmt::format("reaches beyond the end of buffers[{}] ({} bytes)", buffer, size));
    }
    check_meshopt(check, root, view, place);
  });
}

/// Indices and values of the elements that differ from the rest. tinygltf keeps their number and
/// offsets in ints, so they are limited to what an int holds.
void check_sparse(const JsonCheck& check, const Json& root, const Json& accessor,
                  const std::string& place, std::uint64_t element) {
  const Json* sparse = check.object(accessor, "sparse", place);
  if (sparse == nullptr) return;
  const std::string here = place + ".sparse";
  const std::uint64_t count = check.required_whole(
      *sparse, "count", here, 1, std::min(kMaxInt, accessor.at("count").get<std::uint64_t>()));
  for (const char* part : {"indices", "values"}) {
    const Json* object = check.object(*sparse, part, here);
    const std::string where = here + "." + part;
    if (object == nullptr) check.fail(where, "is missing");
    check.required_index(*object, "bufferView", where, "bufferViews");
    const std::uint64_t offset = check.whole(*object, "byteOffset", where, 0, kMaxInt, 0);
    std::uint64_t size = element;
    if (std::string_view(part) == "indices") {
      const std::uint64_t type = check.required_whole(*object, "componentType", where, 5121, 5125);
      if (type != 5121 && type != 5123 && type != 5125) {
        check.fail(where + ".componentType",
                   fmt::format("is {}, which is not an index type", type));
      }
      size = gltf_element_bytes(static_cast<int>(type), "SCALAR");
    }
    const auto view = object->at("bufferView").get<std::size_t>();
    check_range(check, where, {offset, size, size, count}, root.at("bufferViews").at(view), view);
  }
}

void check_accessors(const JsonCheck& check, const Json& root) {
  check.for_each("accessors", [&](const Json& accessor, const std::string& place) {
    const bool has_view = check.index(accessor, "bufferView", place, "bufferViews");
    const std::uint64_t offset = check.whole(accessor, "byteOffset", place, 0, kMaxBytes, 0);
    const std::uint64_t component =
        check.required_whole(accessor, "componentType", place, 5120, 5126);
    // Signed 32-bit integers: the one number of OpenGL in this range that glTF leaves out.
    if (component == 5124)
      check.fail(place + ".componentType", "is 5124, which glTF does not define");
    // No upper bound: without a buffer view there is none to be had, and check_unbacked() guards
    // whoever reads such an accessor.
    const std::uint64_t count = check.required_whole(accessor, "count", place, 1, kMaxBytes);
    check.boolean(accessor, "normalized", place);
    const std::string* type = check.string(accessor, "type", place);
    if (type == nullptr) check.fail(place + ".type", "is missing");
    const std::uint64_t element = gltf_element_bytes(static_cast<int>(component), *type);
    if (element == 0)
      check.fail(place + ".type", fmt::format("is \"{}\", which glTF does not define", *type));
    if (has_view) {
      const auto view_index = accessor.at("bufferView").get<std::size_t>();
      const Json& view = root.at("bufferViews").at(view_index);
      const std::uint64_t stride = view.value("byteStride", element);
      if (stride < element) {
        check.fail(place, fmt::format("has elements of {} bytes, more than the byteStride {} of "
                                      "bufferViews[{}]",
                                      element, stride, view_index));
      }
      check_range(check, place, {offset, stride, element, count}, view, view_index);
    }
    check_sparse(check, root, accessor, place, element);
  });
}

/// Which accessor an attribute may be of is judged by check_primitive(), once types are known.
void check_attributes(const JsonCheck& check, const Json& attributes, const std::string& place) {
  for (const auto& item : attributes.items()) {
    check.required_index(attributes, item.key().c_str(), place, "accessors");
  }
}

void check_meshes(const JsonCheck& check) {
  check.for_each("meshes", [&](const Json& mesh, const std::string& place) {
    check.string(mesh, "name", place);
    check.numbers(mesh, "weights", place, 0);
    if (check.find(mesh, "primitives") == nullptr) check.fail(place + ".primitives", "is missing");
    check.for_each_in(mesh, "primitives", place, [&](const Json& primitive, const std::string& at) {
      const Json* attributes = check.object(primitive, "attributes", at);
      if (attributes == nullptr) check.fail(at + ".attributes", "is missing");
      check_attributes(check, *attributes, at + ".attributes");
      check.index(primitive, "indices", at, "accessors");
      check.index(primitive, "material", at, "materials");
      check.whole(primitive, "mode", at, 0, 6, 4);
      check_draco(check, primitive, at);
      check.for_each_in(primitive, "targets", at, [&](const Json& target, const std::string& t) {
        check_attributes(check, target, t);
      });
    });
  });
}

/// One use of a texture by a material. The transform is checked because its numbers end in a
/// matrix; its texCoord overrides the one outside.
void check_texture_info(const JsonCheck& check, const Json& parent, const char* key,
                        const std::string& parent_place) {
  const Json* info = check.object(parent, key, parent_place);
  if (info == nullptr) return;
  const std::string place = parent_place + "." + key;
  check.required_index(*info, "index", place, "textures");
  check.whole(*info, "texCoord", place, 0, kMaxInt, 0);
  const Json* extensions = check.object(*info, "extensions", place);
  const Json* transform =
      extensions == nullptr ? nullptr : check.object(*extensions, "KHR_texture_transform", place);
  if (transform == nullptr) return;
  const std::string where = place + ".KHR_texture_transform";
  check.numbers(*transform, "offset", where, 2);
  check.number(*transform, "rotation", where);
  check.numbers(*transform, "scale", where, 2);
  check.whole(*transform, "texCoord", where, 0, kMaxInt, 0);
}

void check_materials(const JsonCheck& check) {
  check.for_each("materials", [&](const Json& material, const std::string& place) {
    check.string(material, "name", place);
    check.boolean(material, "doubleSided", place);
    check.numbers(material, "emissiveFactor", place, 3);
    for (const char* key : {"normalTexture", "occlusionTexture", "emissiveTexture"}) {
      check_texture_info(check, material, key, place);
    }
    if (const Json* pbr = check.object(material, "pbrMetallicRoughness", place); pbr != nullptr) {
      const std::string where = place + ".pbrMetallicRoughness";
      check.numbers(*pbr, "baseColorFactor", where, 4);
      check.number(*pbr, "metallicFactor", where);
      check.number(*pbr, "roughnessFactor", where);
      check_texture_info(check, *pbr, "baseColorTexture", where);
      check_texture_info(check, *pbr, "metallicRoughnessTexture", where);
    }
    check.object(material, "extensions", place);
  });
}

void check_textures(const JsonCheck& check) {
  check.for_each("textures", [&](const Json& texture, const std::string& place) {
    check.index(texture, "sampler", place, "samplers");
    check.index(texture, "source", place, "images");
    const Json* extensions = check.object(texture, "extensions", place);
    if (extensions == nullptr) return;
    // A material follows these to an image, whatever it can do with it then, so their indices must
    // hold.
    for (const std::string_view name : kImageExtensions) {
      const std::string key(name);
      const Json* extension = check.object(*extensions, key.c_str(), place);
      if (extension != nullptr) check.index(*extension, "source", place + "." + key, "images");
    }
  });
  check.for_each("samplers", [&](const Json& sampler, const std::string& place) {
    for (const char* key : {"wrapS", "wrapT"}) {
      const std::uint64_t wrap = check.whole(sampler, key, place, 0, kMaxInt, 10497);
      if (wrap != 10497 && wrap != 33071 && wrap != 33648) {
        check.fail(place + "." + key, fmt::format("is {}, which is not a wrap mode", wrap));
      }
    }
  });
  check.for_each("images", [&](const Json& image, const std::string& place) {
    check.index(image, "bufferView", place, "bufferViews");
    for (const char* key : {"uri", "mimeType", "name"}) check.string(image, key, place);
  });
}

/// A matrix per joint, or none at all. Joints are nodes anywhere in the file, in the scene or not,
/// so world transforms are made of all nodes.
void check_skins(const JsonCheck& check, const Json& root) {
  check.for_each("skins", [&](const Json& skin, const std::string& place) {
    const Json* joints = check.array(skin, "joints", place);
    if (joints == nullptr || joints->empty()) check.fail(place + ".joints", "is missing or empty");
    check.indices(skin, "joints", place, "nodes");
    check.index(skin, "skeleton", place, "nodes");
    if (!check.index(skin, "inverseBindMatrices", place, "accessors")) return;
    const Json& matrices =
        root.at("accessors").at(skin.at("inverseBindMatrices").get<std::size_t>());
    if (matrices.at("type") != "MAT4" || matrices.at("componentType") != 5126) {
      check.fail(place + ".inverseBindMatrices", "is not an accessor of float MAT4");
    }
    if (matrices.at("count").get<std::uint64_t>() < joints->size()) {
      check.fail(place + ".inverseBindMatrices", "has fewer matrices than the skin has joints");
    }
  });
}

void check_node(const JsonCheck& check, const Json& node, const std::string& place,
                std::vector<std::string>& warnings) {
  check.string(node, "name", place);
  check.index(node, "mesh", place, "meshes");
  check.index(node, "skin", place, "skins");
  check.index(node, "camera", place, "cameras");
  check.indices(node, "children", place, "nodes");
  check.numbers(node, "weights", place, 0);
  const bool matrix = check.numbers(node, "matrix", place, 16);
  const bool translation = check.numbers(node, "translation", place, 3);
  const bool rotation = check.numbers(node, "rotation", place, 4);
  const bool scale = check.numbers(node, "scale", place, 3);
  // The standard forbids both, since nothing says which would win.
  if (matrix && (translation || rotation || scale)) {
    check.fail(place, "has both a matrix and translation, rotation or scale");
  }
  if (!rotation) return;
  double square = 0;
  for (const Json& value : node.at("rotation")) square += value.get<double>() * value.get<double>();
  if (square < 1e-12) check.fail(place + ".rotation", "is zero, which is not a rotation");
  if (std::abs(square - 1) > 1e-3) {
    warnings.push_back(fmt::format("{}.rotation does not have unit length; normalised", place));
  }
}

/// Long ones are valid, but each costs its length again and again.
void check_name_lengths(const JsonCheck& check, const std::string& path) {
  for (const char* collection : {"nodes", "meshes", "materials", "images"}) {
    check.for_each(collection, [&](const Json& object, const std::string& place) {
      const std::string* name = check.string(object, "name", place);
      if (name == nullptr || name->size() <= kMaxNameBytes) return;
      refuse(path, "the name of {} has {} bytes; shorten it to at most {}", place, name->size(),
             kMaxNameBytes);
    });
  }
}

/// Every node has at most one parent and no node is its own ancestor.
std::vector<std::int64_t> check_forest(const JsonCheck& check, const Json& root) {
  std::vector<std::int64_t> parent(check.size_of("nodes"), -1);
  check.for_each("nodes", [&](const Json& node, const std::string& place) {
    const Json* children = check.find(node, "children");
    if (children == nullptr) return;
    const std::int64_t self = &node - &root.at("nodes").at(0);
    for (const Json& child : *children) {
      std::int64_t& slot = parent[child.get<std::size_t>()];
      if (slot >= 0) {
        check.fail(fmt::format("nodes[{}]", child.get<std::size_t>()),
                   fmt::format("has two parents, nodes[{}] and {}", slot, place));
      }
      slot = self;
    }
  });
  // From each node up to its root, marking the way with where it began: every node is passed once
  // as new, so this is linear; meeting the mark of this very walk again is a loop.
  std::vector<std::size_t> seen_from(parent.size(), parent.size());
  for (std::size_t start = 0; start < parent.size(); ++start) {
    std::size_t node = start;
    while (seen_from[node] == parent.size()) {
      seen_from[node] = start;
      if (parent[node] < 0) break;
      node = static_cast<std::size_t>(parent[node]);
      if (seen_from[node] == start) {
        check.fail(fmt::format("nodes[{}]", node), "is its own ancestor (a loop of nodes)");
      }
    }
  }
  return parent;
}

/// A scene lists roots only, each once: a node that were listed below another too would show its
/// meshes twice.
void check_scenes(const JsonCheck& check, const Json& root,
                  const std::vector<std::int64_t>& parent) {
  check.index(root, "scene", {}, "scenes");
  std::vector<const Json*> listed_by(parent.size(), nullptr);
  check.for_each("scenes", [&](const Json& scene, const std::string& place) {
    check.indices(scene, "nodes", place, "nodes");
    const Json* nodes = check.find(scene, "nodes");
    if (nodes == nullptr) return;
    for (const Json& value : *nodes) {
      const auto node = value.get<std::size_t>();
      if (parent[node] >= 0)
        check.fail(place, fmt::format("lists nodes[{}], which is not a root node", node));
      if (listed_by[node] == &scene) check.fail(place, fmt::format("lists nodes[{}] twice", node));
      listed_by[node] = &scene;
    }
  });
}

}  // namespace

bool is_splat_extension(std::string_view name) {
  return name.starts_with("KHR_gaussian_splatting") ||
         name == "KHR_spz_gaussian_splats_compression";  // a draft of it
}

bool is_image_extension(std::string_view name) {
  return std::find(kImageExtensions.begin(), kImageExtensions.end(), name) !=
         kImageExtensions.end();
}

// Columns of a matrix of small components are padded to four bytes, which only 2 x 2 and 3 x 3 of
// bytes and 3 x 3 of shorts notice. 0 for what is no type.
std::uint64_t gltf_element_bytes(int component_type, const std::string& type) {
  const std::uint64_t component = component_type <= 5121 ? 1 : component_type <= 5123 ? 2 : 4;
  if (type == "SCALAR") return component;
  if (type.size() != 4) return 0;
  const auto n = static_cast<std::uint64_t>(type[3] - '0');
  if (n < 2 || n > 4) return 0;
  if (type.starts_with("VEC")) return component * n;
  if (type.starts_with("MAT")) return (component * n + 3) / 4 * 4 * n;
  return 0;
}

std::uint64_t gltf_entry_count(const nlohmann::json& document) {
  std::uint64_t count = 0;
  for (const char* key : {"accessors", "bufferViews", "meshes", "nodes", "samplers", "scenes",
                          "skins", "textures", "images"}) {
    if (const auto it = document.find(key); it != document.end()) count += it->size();
  }
  if (const auto meshes = document.find("meshes"); meshes != document.end()) {
    for (const Json& mesh : *meshes) {
      for (const Json& primitive : mesh.at("primitives")) {
        const auto targets = primitive.find("targets");
        count += 1 + (targets == primitive.end() ? 0 : targets->size());
      }
    }
  }
  return count;
}

std::vector<std::string> check_gltf(const std::string& path, const nlohmann::json& document) {
  const JsonCheck check(path, document);
  if (!document.is_object()) check.fail("the document", "is not a JSON object");
  std::vector<std::string> warnings;
  // Each of these relies on what those before it have found sound.
  check_asset(check, path, document);
  check_extensions(check, path, document);
  check_buffers(check, document);
  check_accessors(check, document);
  // They are objects, which is all that a node needs of the cameras that it may name.
  check.for_each("cameras", [](const Json&, const std::string&) {});
  check_textures(check);
  check_materials(check);
  check_meshes(check);
  check.for_each("nodes", [&](const Json& node, const std::string& place) {
    check_node(check, node, place, warnings);
  });
  check_name_lengths(check, path);
  check_skins(check, document);
  check_scenes(check, document, check_forest(check, document));
  if (gltf_entry_count(document) > kMaxEntries || check.size_of("materials") > kMaxMaterials) {
    refuse(
        path,
        "more than {} nodes, meshes, accessors and the like, or more than {} materials; split the "
        "model",
        kMaxEntries, kMaxMaterials);
  }
  return warnings;
}

}  // namespace pounce::io
