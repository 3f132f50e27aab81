// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "mesh/mesh.h"
#include "pounce/error.h"

namespace pounce::io {

/// Throws Error(input): "<path>: <text>". The text says what was found and what to do about it.
template <class... Args>
[[noreturn]] void refuse(const std::string& path, fmt::format_string<Args...> text,
                         Args&&... args) {
  throw Error(ErrorKind::input, path + ": " + fmt::format(text, std::forward<Args>(args)...));
}

/// Collects what is wrong with a mesh file but no reason to refuse it. A file may be wrong in a
/// million places: beyond the first hundred, which is more than anybody reads, they are counted.
class MeshWarnings {
 public:
  /// Warnings go to `mesh`, which must outlive this, each after the name of the file.
  explicit MeshWarnings(mesh::Mesh& mesh) : mesh_(mesh) {}

  template <class... Args>
  void add(fmt::format_string<Args...> text, Args&&... args) {
    if (mesh_.warnings.size() == kMost) {
      ++more_;
      return;
    }
    const std::string said = fmt::format(text, std::forward<Args>(args)...);
    mesh_.warnings.push_back(mesh_.path + ": " + said);
  }
  /// To be called once, at the end.
  void finish() {
    if (more_ > 0)
      mesh_.warnings.push_back(fmt::format("{}: {} more warnings, not shown", mesh_.path, more_));
  }

 private:
  static constexpr std::size_t kMost = 100;

  mesh::Mesh& mesh_;
  std::uint64_t more_ = 0;
};

}  // namespace pounce::io
