// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace pounce::io {

/// The same names, but none empty (number 3 becomes "material_3") and none twice: a later one gets
/// "_2", "_3",
/// ... appended until it is new. Deterministic.
std::vector<std::string> unique_material_names(std::vector<std::string> names);

}  // namespace pounce::io
