// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "mesh/mesh.h"

namespace pounce::io {

/// The encoded bytes of one image, wherever they are: a file, a range of a file, or memory. Nothing
/// is held beyond what is asked for. Not thread-safe.
class ByteSource {
 public:
  /// Throws Error(input) naming image.label if the bytes cannot be reached, or image.problem says
  /// so.
  explicit ByteSource(const mesh::ImageRef& image);
  ~ByteSource();
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  std::uint64_t size_bytes() const { return size_bytes_; }
  const std::string& label() const { return label_; }
  /// Up to `count` bytes from `offset`; fewer only at the end, or after an error (see failure()).
  /// noexcept because C libraries call it.
  std::size_t read_at(std::uint64_t offset, void* out, std::size_t count) noexcept;
  /// errno of the first read that failed, 0 if none did.
  int failure() const { return failure_; }
  /// Called with (offset, bytes) after every read through stream().
  std::function<void(std::uint64_t, const std::byte*, std::size_t)> watcher;
  /// A C stream over the bytes (libjpeg wants one); owned by the caller, who closes it before this
  /// object dies.
  FILE* stream();

 private:
  std::string label_;
  std::shared_ptr<const std::vector<std::byte>> memory_;
  int descriptor_ = -1;
  std::uint64_t offset_bytes_ = 0;
  std::uint64_t size_bytes_ = 0;
  int failure_ = 0;
};

}  // namespace pounce::io
