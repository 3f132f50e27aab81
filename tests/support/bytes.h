// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
#include "pounce/error.h"

namespace pounce::test {

/// Bytes that compress to about half: each holds four random bits.
inline std::vector<std::byte> random_bytes(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::byte> bytes(count);
  for (std::byte& b : bytes) b = static_cast<std::byte>(random() & 15u);
  return bytes;
}

/// A copy, to be compared and changed.
inline std::vector<std::byte> bytes_of(std::span<const std::byte> bytes) {
  return {bytes.begin(), bytes.end()};
}

inline std::vector<std::byte> read_whole(FileSystem& files, const std::string& path) {
  const auto file = files.open(path);
  std::vector<std::byte> bytes(file->size_bytes());
  file->read(0, bytes);
  return bytes;
}

/// Replaces the file at `path`.
inline void write_whole(FileSystem& files, const std::string& path,
                        std::span<const std::byte> bytes) {
  files.remove(path);
  const auto file = files.create(path);
  file->append(bytes);
  file->sync();
}

/// The kind of the Error that `action` throws; 0 if it throws none.
template <class Action>
int error_kind(const Action& action, std::string* message = nullptr) {
  try {
    action();
    return 0;
  } catch (const Error& e) {
    if (message != nullptr) *message = e.what();
    return static_cast<int>(e.kind());
  }
}

inline constexpr int kDamaged = static_cast<int>(ErrorKind::damaged_store);
inline constexpr int kStorage = static_cast<int>(ErrorKind::storage);

}  // namespace pounce::test
