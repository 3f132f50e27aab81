// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>

#include "skip.h"

namespace pounce::test {

/// The folder of real input data: $POUNCE_TEST_DATA, else ../shared/data beside the repository;
/// nothing where neither is there. A test case that gets nothing is skipped (skip.h) and returns.
inline std::optional<std::filesystem::path> test_data() {
  if (const char* given = std::getenv("POUNCE_TEST_DATA"); given != nullptr && *given != '\0') {
    if (std::filesystem::is_directory(given)) return std::filesystem::path(given);
  } else if (const auto beside = std::filesystem::path(POUNCE_SOURCE_DIR) / "../shared/data";
             std::filesystem::is_directory(beside)) {
    return beside.lexically_normal();
  }
  skip("test data (set POUNCE_TEST_DATA)");
  return std::nullopt;
}

/// A fresh folder that is removed with this object.
class TempFolder {
 public:
  TempFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "pounce-test-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make a temporary folder");
    path_ = name;
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

}  // namespace pounce::test
