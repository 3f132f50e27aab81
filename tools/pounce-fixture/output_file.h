// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace pounce::fixture {

/// A file written from its start to its end through a small buffer, under a temporary name beside
/// `path` that commit() renames; without commit() the destructor removes it. Throws Error(storage)
/// with path and reason. Not thread-safe.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void append(const void* bytes, std::size_t size_bytes);
  void append(std::string_view text) { append(text.data(), text.size()); }
  std::uint64_t size_bytes() const { return size_bytes_; }
  void commit();

 private:
  [[noreturn]] void fail(const char* what) const;

  std::string path_, temporary_;
  std::FILE* file_ = nullptr;
  std::uint64_t size_bytes_ = 0;
};

/// Makes `folder` (and those above it). Throws Error(storage).
void make_folder(const std::string& folder);

/// Appends the whole file `path` to `out` in pieces of 256 KiB. Throws Error(storage).
void append_file(const std::string& path, OutputFile& out);

/// A file's size in bytes. Throws Error(storage).
std::uint64_t file_size_bytes(const std::string& path);

/// Removes the file with this name when it goes out of scope.
class RemoveAtEnd {
 public:
  explicit RemoveAtEnd(std::string path) : path_(std::move(path)) {}
  ~RemoveAtEnd() { std::remove(path_.c_str()); }
  RemoveAtEnd(const RemoveAtEnd&) = delete;
  RemoveAtEnd& operator=(const RemoveAtEnd&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace pounce::fixture
