// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace pounce::io {

/// Checks a glTF document before anything trusts it: types and ranges of every property that pounce
/// or tinygltf reads, every index into another collection, buffer views within their buffers,
/// accessors (sparse parts included) within their views, the node graph (a forest of finite
/// transforms) and extensionsRequired (extensions of images and splats may be required: what has
/// them is left out by name where it would be needed). "min" and "max" of accessors are never used,
/// so never checked; what the bytes say is checked when they are read. Returns warnings. Throws
/// Error(input) naming the file and the place in it.
std::vector<std::string> check_gltf(const std::string& path, const nlohmann::json& document);

/// Does this extension of a primitive turn its points into Gaussian splats?
bool is_splat_extension(std::string_view name);

/// Does this extension of a texture name an image that stands for the plain one?
bool is_image_extension(std::string_view name);

/// Bytes of one element of an accessor as it lies in its buffer (matrix columns start at multiples
/// of 4). `component_type` and `type` are glTF's.
std::uint64_t gltf_element_bytes(int component_type, const std::string& type);

/// Entries of all collections (primitives and morph targets included, materials not) of a checked
/// document: each of them costs memory, however short its text.
std::uint64_t gltf_entry_count(const nlohmann::json& document);

}  // namespace pounce::io
