// SPDX-License-Identifier: Apache-2.0
#include "mesh/parts.h"

#include <utility>

namespace pounce::mesh {

std::uint64_t Parts::size_bytes() const {
  std::uint64_t total = names.capacity() * sizeof(std::string) +
                        part_names.capacity() * sizeof(part_names[0]) +
                        runs.capacity() * sizeof(Run);
  for (const auto& name : names) total += name.capacity();
  for (const auto& part : part_names) total += part.capacity() * sizeof(part[0]);
  return total;
}

void PartsBuilder::start(std::uint32_t first_triangle, const std::vector<std::string>& names) {
  end_run(first_triangle);
  names_ = names;
  first_ = first_triangle;
}

void PartsBuilder::end_run(std::uint32_t triangles) {
  if (triangles == first_) return;
  std::vector<std::uint32_t> key;
  ++uses_;
  for (const std::string& name : names_) {
    if (name.empty()) continue;
    const auto [at, fresh] =
        name_index_.try_emplace(name, static_cast<std::uint32_t>(parts_.names.size()));
    if (fresh) parts_.names.push_back(name);
    last_use_.resize(parts_.names.size(), 0);
    if (std::exchange(last_use_[at->second], uses_) != uses_) key.push_back(at->second);
  }
  const auto [at, fresh] =
      part_index_.try_emplace(key, static_cast<std::uint32_t>(parts_.part_names.size()));
  if (fresh) parts_.part_names.push_back(key);
  if (parts_.runs.empty() || parts_.runs.back().part != at->second)
    parts_.runs.push_back({first_, at->second});
}

Parts PartsBuilder::finish(std::uint32_t triangles) {
  end_run(triangles);
  parts_.names.shrink_to_fit();
  parts_.part_names.shrink_to_fit();
  parts_.runs.shrink_to_fit();
  return std::move(parts_);
}

}  // namespace pounce::mesh
