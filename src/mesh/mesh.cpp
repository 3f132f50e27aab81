// SPDX-License-Identifier: Apache-2.0
#include "mesh/mesh.h"

#include <set>

namespace pounce::mesh {
namespace {

template <class T>
std::uint64_t bytes_of(const std::vector<T>& items) {
  return items.capacity() * sizeof(T);
}

}  // namespace

void Mesh::append_copies(const std::vector<std::uint32_t>& originals) {
  const std::size_t total = positions.size() + originals.size();
  const auto extend = [&](auto& items) {
    items.reserve(total);
    for (const std::uint32_t vertex : originals) {
      const auto item = items[vertex];
      items.push_back(item);
    }
  };
  extend(positions);
  extend(normals);
  extend(tangents);
  for (auto& set : uv_sets) extend(set);
  for (auto& present : uv_present) {
    if (!present.empty()) extend(present);
  }
  if (!own_tangents.empty()) extend(own_tangents);
  if (!colours.empty()) extend(colours);
}

std::uint64_t Mesh::size_bytes() const {
  std::uint64_t total = sizeof(Mesh) + bytes_of(positions) + bytes_of(normals) +
                        bytes_of(tangents) + bytes_of(colours) + bytes_of(triangles) +
                        bytes_of(triangle_material) + bytes_of(rest) + bytes_of(rest_material) +
                        bytes_of(materials) + bytes_of(images) + bytes_of(warnings) +
                        parts.size_bytes() + bytes_of(files);
  for (const auto& set : uv_sets) total += bytes_of(set);
  for (const auto& present : uv_present) total += present.capacity() / 8;
  total += own_tangents.capacity() / 8;
  std::set<const void*> counted;  // images may share bytes
  for (const auto& image : images) {
    const bool is_new = image.bytes != nullptr && counted.insert(image.bytes.get()).second;
    if (is_new) total += image.bytes->capacity();
    total += image.path.capacity() + image.label.capacity() + image.problem.capacity();
  }
  return total;
}

}  // namespace pounce::mesh
