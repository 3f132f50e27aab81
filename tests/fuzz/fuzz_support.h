// SPDX-License-Identifier: Apache-2.0
//
// What every fuzz target needs: a folder in memory, a verdict on how a reader ends, and a count of
// the memory that it takes meanwhile.
#pragma once

#include <sanitizer/allocator_interface.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include "pounce/error.h"

namespace pounce::fuzz {

/// Ends the process, which is a finding, unless what a reader promises is so.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "a promise is broken: %s\n", what);
  std::abort();
}

/// Runs `work`. It may end or throw Error that blames the input; whatever else leaves it is a
/// finding.
template <class Work>
void attempt(const Work& work) {
  try {
    work();
  } catch (const Error& e) {
    require(e.kind() != ErrorKind::internal, e.what());
    require(*e.what() != '\0', "an error says what is wrong");
  }
}

/// A folder of this process, in memory where the system has such a place; gone with the process.
class Folder {
 public:
  Folder() {
    const bool in_memory = std::filesystem::is_directory("/dev/shm");
    std::string name = in_memory ? "/dev/shm" : std::filesystem::temp_directory_path().string();
    name += "/pounce-fuzz-XXXXXX";
    if (mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string path(const std::string& name) const { return path_ + "/" + name; }
  /// Makes the file anew; returns its path.
  std::string write(const std::string& name, std::string_view bytes) const {
    const std::string file_path = path(name);
    std::FILE* const file = std::fopen(file_path.c_str(), "wb");
    if (file == nullptr) std::abort();
    std::setvbuf(file, nullptr, _IONBF, 0);
    if (std::fwrite(bytes.data(), 1, bytes.size(), file) != bytes.size()) std::abort();
    std::fclose(file);
    return file_path;
  }

 private:
  std::string path_;
};

/// The most bytes that were allocated at once since start(), beyond those at that time.
class PeakMemory {
 public:
  static void start() {
    static const bool installed =
        __sanitizer_install_malloc_and_free_hooks(
            [](const volatile void*, std::size_t size) {
              const std::int64_t now = live_ += static_cast<std::int64_t>(size);
              if (now > peak_) peak_ = now;
            },
            [](const volatile void* at) {
              live_ -= static_cast<std::int64_t>(__sanitizer_get_allocated_size(at));
            }) != 0;
    require(installed, "allocations can be counted");
    live_ = 0;
    peak_ = 0;
  }
  static std::uint64_t bytes() { return static_cast<std::uint64_t>(peak_.load()); }

 private:
  static inline std::atomic<std::int64_t> live_{0}, peak_{0};
};

/// An input of two files: what is before and behind a line "%%".
struct Parts {
  std::string_view first, second;
  bool has_second = false;
};
inline Parts split(std::string_view input) {
  constexpr std::string_view kLine = "\n%%\n";
  const std::size_t at = input.find(kLine);
  if (at == std::string_view::npos) return {input, {}, false};
  return {input.substr(0, at), input.substr(at + kLine.size()), true};
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace pounce::fuzz
