// SPDX-License-Identifier: Apache-2.0
#include "io/files/asset_folder.h"

#include <algorithm>
#include <system_error>

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

/// Where a path leads, as far as it exists.
fs::path resolved(const fs::path& path) {
  std::error_code error;
  fs::path out = fs::weakly_canonical(path, error);
  // What cannot be looked at cannot be opened, either.
  return error ? fs::absolute(path, error).lexically_normal() : out;
}

}  // namespace

AssetFolder::AssetFolder(const std::string& mesh_path, bool allow_external) {
  if (allow_external) return;
  const fs::path named = fs::path(mesh_path).parent_path();
  folders_ = {resolved(named.empty() ? "." : named), resolved(mesh_path).parent_path()};
}

bool AssetFolder::holds(const std::string& path) const {
  if (folders_.empty()) return true;
  const fs::path file = resolved(path);
  return std::any_of(folders_.begin(), folders_.end(), [&](const fs::path& folder) {
    const auto rest = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
    return rest.first == folder.end();
  });
}

}  // namespace pounce::io
