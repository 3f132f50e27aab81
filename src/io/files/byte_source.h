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
  /// Throws Error(storage) naming image.label and the file if it is not there or cannot be opened,
  /// Error(input) if there is nothing in it or image.problem says so.
  explicit ByteSource(const mesh::ImageRef& image);
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  /// A range of the bytes as they are stored, or what is seen in its place.
  struct Piece {
    std::uint64_t offset_bytes = 0, size_bytes = 0;
    std::vector<std::byte> instead;  ///< not empty: size_bytes of them
  };
  /// From here on these pieces, none of them empty, one after another are all there is.
  void show_only(std::vector<Piece> pieces);

  std::uint64_t size_bytes() const { return size_bytes_; }
  const std::string& label() const { return label_; }
  /// Up to `count` bytes from `offset`; fewer only at the end, or after an error (see failure()).
  /// noexcept because C libraries call it.
  std::size_t read_at(std::uint64_t offset, void* out, std::size_t count) noexcept;
  /// errno of the first read that failed, 0 if none did.
  int failure() const { return failure_; }
  /// Throws Error(storage) with file and reason if a read failed.
  void check() const;
  /// Called with (offset, bytes) after every read through stream().
  std::function<void(std::uint64_t, const std::byte*, std::size_t)> watcher;
  /// A C stream over the bytes (libjpeg wants one); owned by the caller, who closes it before this
  /// object dies.
  FILE* stream();

 private:
  /// Closes what it holds.
  class Descriptor {
   public:
    Descriptor() = default;
    ~Descriptor();
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    void reset(int number) { number_ = number; }
    int get() const { return number_; }

   private:
    int number_ = -1;
  };

  void open(const mesh::ImageRef& image);
  std::size_t read_stored(std::uint64_t offset, char* out, std::size_t count) noexcept;
  [[noreturn]] void fail(const char* what, int reason) const;

  std::string label_, path_;
  std::shared_ptr<const std::vector<std::byte>> memory_;
  Descriptor descriptor_;
  std::uint64_t offset_bytes_ = 0;
  std::uint64_t size_bytes_ = 0;
  int failure_ = 0;
  std::vector<Piece> pieces_;          ///< empty: all that is stored
  std::vector<std::uint64_t> starts_;  ///< of the pieces, in what is shown
};

}  // namespace pounce::io
