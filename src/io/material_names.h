// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace pounce::io {

/// More than these are no sensible model: each costs memory in every stage.
inline constexpr std::size_t kMaxMaterials = 1 << 15;

/// The same names, but none empty (number 3 becomes "material_3") and none twice: a later one gets
/// "_2", "_3",
/// ... appended until it is new. Deterministic.
std::vector<std::string> unique_material_names(std::vector<std::string> names);

}  // namespace pounce::io
