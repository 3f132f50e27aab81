// SPDX-License-Identifier: Apache-2.0
#include "io/files/new_folders.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "pounce/error.h"

namespace pounce::io {
namespace fs = std::filesystem;

void NewFolders::make(const std::string& folder) {
  constexpr int kMostTries = 100;
  for (int tries = 1; !make_missing(folder, tries == kMostTries); ++tries) {
  }
}

/// False where another process removed meanwhile what was made or found, if that is not the `last`
/// try.
bool NewFolders::make_missing(const std::string& folder, bool last) {
  std::vector<std::string> missing;
  std::error_code ignored;
  for (fs::path path = folder; !path.empty() && !fs::exists(path, ignored);) {
    missing.push_back(path.string());
    const fs::path above = path.parent_path();
    if (above == path) break;  // the root, which nobody may look at
    path = above;
  }
  for (auto path = missing.rbegin(); path != missing.rend(); ++path) {
    if (::mkdir(path->c_str(), 0777) == 0) {
      made_.push_back(*path);
    } else if (errno == ENOENT && !last) {
      return false;
    } else if (errno != EEXIST) {  // another process may be as fast
      throw Error(ErrorKind::storage,
                  fmt::format("{}: cannot create the folder: {}", *path, std::strerror(errno)));
    }
  }
  return true;
}

NewFolders::~NewFolders() {
  for (auto path = made_.rbegin(); path != made_.rend(); ++path) ::rmdir(path->c_str());
}

std::string existing_folder(const std::string& folder) {
  std::error_code ignored;
  fs::path path = folder.empty() ? "." : folder;
  while (path != "." && !fs::exists(path, ignored)) {
    const fs::path above = path.parent_path();
    path = above.empty() || above == path ? "." : above;
  }
  return path.string();
}

}  // namespace pounce::io
