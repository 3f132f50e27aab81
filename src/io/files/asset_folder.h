// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pounce::io {

/// The folder of a mesh file, and whether what the file names lies in it: a model from elsewhere
/// must not bring files of this machine into a job's results. What counts is where a name really
/// leads, all symbolic links followed; a mesh that is itself a link has two folders, that of the
/// link and that of the file.
class AssetFolder {
 public:
  AssetFolder(const std::string& mesh_path, bool allow_external);
  /// May this file be read? True for all if external files are allowed.
  bool holds(const std::string& path) const;

 private:
  std::vector<std::filesystem::path> folders_;  ///< empty: all are allowed
};

/// What is wrong with a file that the folder does not hold; goes on after "the file ... " or the
/// like.
inline constexpr const char* kOutsideProblem =
    "lies outside of the folder of the mesh; --allow-external lets it be read";

}  // namespace pounce::io
