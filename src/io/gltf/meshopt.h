// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>

#include "io/json/untrusted.h"

namespace pounce::io {

inline constexpr const char* kMeshopt = "EXT_meshopt_compression";

/// What the extension says of a buffer view: where its packed bytes are and what they become.
struct MeshoptView {
  enum class Mode { attributes, triangles, indices };
  enum class Filter { none, octahedral, quaternion, exponential };

  std::size_t buffer = 0;
  std::uint64_t offset_bytes = 0, packed_bytes = 0;
  std::uint64_t stride = 0, count = 0;
  Mode mode = Mode::attributes;
  Filter filter = Filter::none;

  std::uint64_t bytes() const { return stride * count; }
};

/// Checks the extension of a view, if it has it: modes, strides and filters that go together, its
/// range within its buffer, a count that so few packed bytes can stand for. Throws Error(input).
void check_meshopt(const JsonCheck& check, const nlohmann::json& root, const nlohmann::json& view,
                   const std::string& place);

/// Of a checked view; nothing where it is not packed.
std::optional<MeshoptView> meshopt_view(const nlohmann::json& view);

/// Fills `out`, which has the size of the view. Throws std::invalid_argument with the reason.
void unpack_meshopt(const MeshoptView& view, std::span<const std::byte> packed,
                    std::span<std::byte> out);

}  // namespace pounce::io
