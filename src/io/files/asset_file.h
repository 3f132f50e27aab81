// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/hash.h"
#include "mesh/mesh.h"
#include "pounce/error.h"

namespace pounce::io {

/// ".glb" of "Head.GLB": what says of a file that is text what it means.
inline std::string lower_ending(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return ending;
}

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

/// Error(storage) of a file that is not there, for callers that can do without it; one that is
/// there and cannot be read is another matter.
class MissingFile : public Error {
 public:
  explicit MissingFile(const std::string& message) : Error(ErrorKind::storage, message) {}
};

/// The encoded bytes of one image, wherever they are: a file, a range of a file, or memory. Nothing
/// is held beyond what is asked for. Not thread-safe.
class ByteSource {
 public:
  /// Throws Error(storage) naming image.label and the file if it is not there or cannot be opened,
  /// Error(input) if there is nothing in it or image.problem says so.
  explicit ByteSource(const mesh::ImageRef& image);
  /// So many bytes from `offset_bytes` of a file that is open, which it closes; `path` is its name,
  /// for messages.
  ByteSource(std::string label, std::string path, int descriptor, std::uint64_t offset_bytes,
             std::uint64_t size_bytes);
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
  const std::string& path() const { return path_; }
  /// A descriptor of what is stored, for another process, and what of that is the image. Bytes in
  /// memory are copied into a file without a name. It stays this object's. Throws Error(budget).
  int share();
  struct Range {
    std::uint64_t offset_bytes = 0, size_bytes = 0;
  };
  Range range() const { return {memory_ ? 0 : offset_bytes_, size_bytes_}; }
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

/// 128-bit content hash of the encoded bytes of an image, streamed in 1 MiB pieces. Throws
/// Error(storage) if they cannot be read, Error(input) if they are fewer than they were.
Hash128 hash_image(const mesh::ImageRef& image);

}  // namespace pounce::io
