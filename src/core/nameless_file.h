// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <string>

namespace pounce {

/// A scratch file for what is read by a path: it has no name in its folder and goes with the
/// process, but within it there is a path that opens it. Not thread-safe until it is written.
class NamelessFile {
 public:
  /// Throws Error(storage), also where /proc, which has the path, is not mounted.
  explicit NamelessFile(const std::string& folder);
  ~NamelessFile();
  NamelessFile(const NamelessFile&) = delete;
  NamelessFile& operator=(const NamelessFile&) = delete;

  FILE* stream() { return stream_; }
  /// What was written so far can be read by path(). Throws Error(storage) where a write failed.
  void flush();
  /// For this process alone, as long as the object is there.
  const std::string& path() const { return path_; }

 private:
  std::string folder_, path_;
  FILE* stream_ = nullptr;
};

}  // namespace pounce
