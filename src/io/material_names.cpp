// SPDX-License-Identifier: Apache-2.0
#include "io/material_names.h"

#include <map>
#include <set>

namespace pounce::io {

std::vector<std::string> unique_material_names(std::vector<std::string> names) {
  std::set<std::string> taken;
  std::map<std::string, std::size_t> last_suffix;  // so that a million equal names stay cheap
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i].empty()) names[i] = "material_" + std::to_string(i);
    const std::string base = names[i];
    while (!taken.insert(names[i]).second) {
      std::size_t& suffix = last_suffix[base];
      suffix = suffix == 0 ? 2 : suffix + 1;
      names[i] = base + "_" + std::to_string(suffix);
    }
  }
  return names;
}

}  // namespace pounce::io
