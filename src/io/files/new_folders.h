// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace pounce::io {

/// Makes a folder and those above it that are missing. What it made and what is empty in the end
/// goes again, so that a job that fails leaves nothing.
class NewFolders {
 public:
  /// Throws Error(storage) naming the folder and the reason.
  explicit NewFolders(const std::string& folder) { make(folder); }
  ~NewFolders();
  NewFolders(const NewFolders&) = delete;
  NewFolders& operator=(const NewFolders&) = delete;
  /// Once more, where another job removed it.
  void make(const std::string& folder);

 private:
  bool make_missing(const std::string& folder, bool last);

  std::vector<std::string> made_;  ///< outermost first
};

/// The folder if it is there, else the nearest above it that is.
std::string existing_folder(const std::string& folder);

}  // namespace pounce::io
