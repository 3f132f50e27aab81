// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "io/files/asset_file.h"
#include "io/gltf/meshopt.h"
#include "io/json/untrusted.h"

namespace pounce::io {

/// The bytes behind one entry of "buffers". Nothing is read before it is asked for.
struct GltfBuffer {
  std::string path;                ///< file that holds the bytes; "" when they are in `bytes`
  std::uint64_t offset_bytes = 0;  ///< where they start in that file
  std::uint64_t size_bytes = 0;    ///< as declared; the document's checks keep every view within it
  std::shared_ptr<const std::vector<std::byte>> bytes;  ///< a decoded data URI
  std::shared_ptr<ReadFile> file;
  std::string problem;   ///< not empty: cannot be read, and why
  bool refused = false;  ///< by the system (open files, permissions), not by what the file holds
};

/// A chunk of a GLB that is neither JSON nor BIN: what it means is not known here.
struct GlbChunk {
  std::uint32_t type = 0;
  std::uint64_t offset_bytes = 0, size_bytes = 0;
};

/// A .gltf or .glb opened: its JSON, checked by check_gltf(), and a way to its buffers. Geometry
/// and images stay in the files until they are read piece by piece. Reading is thread-safe.
class GltfFile {
 public:
  /// Throws Error(storage) where `path` cannot be read, Error(input) where it is not valid glTF 2.
  /// With `allow_external` its URIs may lead anywhere (see AssetFolder).
  GltfFile(const std::string& path, bool allow_external);

  const std::string& path() const { return path_; }
  const nlohmann::json& document() const { return document_; }
  const std::vector<GltfBuffer>& buffers() const { return buffers_; }
  std::vector<std::string>& warnings() { return warnings_; }

  /// Fills `out` from `offset` of a buffer view (offset + size within the view: the caller has
  /// checked). One that is packed (EXT_meshopt_compression) is unpacked whole, and stays.
  void read_view(std::size_t view, std::uint64_t offset, std::span<std::byte> out) const;

  static bool is_data_uri(std::string_view uri);
  /// Where a relative URI of this file leads, percent-decoded; nothing for other schemes (http:,
  /// ...). The file need not exist, nor be one that may be looked at.
  std::string resolve(const std::string& uri) const;
  /// May this file, which a URI led to, be read?
  bool may_read(const std::string& path) const { return folder_.holds(path); }

  /// What mesh_cost() needs: bytes of JSON text without data URIs, of buffers decoded from data
  /// URIs, and of the text of images' data URIs.
  std::uint64_t json_bytes() const { return json_bytes_; }
  std::uint64_t inline_bytes() const { return inline_bytes_; }
  std::uint64_t image_text_bytes() const { return image_text_bytes_; }
  /// What unpacking all packed views takes, at most.
  std::uint64_t unpacking_bytes() const { return unpacking_bytes_; }
  /// Is the extension one that the file cannot be read without?
  bool requires_extension(std::string_view name) const;
  /// Bytes of geometry and images that the file can possibly describe.
  std::uint64_t total_buffer_bytes() const;

  /// The JSON as the file has it, read again, without a byte order mark.
  std::string json_text() const;
  std::uint64_t json_text_bytes() const { return json_text_bytes_; }
  /// JsonSize::long_bytes of its JSON: a part of json_bytes().
  std::uint64_t long_string_bytes() const { return long_string_bytes_; }
  /// Is buffer 0 the BIN chunk of a GLB?
  bool has_bin_buffer() const { return !buffers_.empty() && buffers_[0].path == path_; }
  const std::vector<GlbChunk>& other_chunks() const { return other_chunks_; }

 private:
  void find_chunks(const ReadFile& file);
  void open_buffer(std::size_t index, nlohmann::json& buffer);
  void measure_packed();
  void read_buffer(std::size_t index, std::uint64_t start, std::span<std::byte> out) const;
  std::span<const std::byte> unpacked(std::size_t view, const MeshoptView& packed) const;
  void parse(const std::string& text);

  std::string path_;
  AssetFolder folder_;
  nlohmann::json document_;
  std::vector<GltfBuffer> buffers_;
  std::vector<std::string> warnings_;
  std::vector<GlbChunk> other_chunks_;
  std::uint64_t json_offset_ = 0, json_text_bytes_ = 0, long_string_bytes_ = 0;
  bool has_bin_chunk_ = false;
  std::uint64_t bin_offset_ = 0, bin_bytes_ = 0;
  std::uint64_t json_bytes_ = 0, inline_bytes_ = 0, image_text_bytes_ = 0;
  std::uint64_t unpacking_bytes_ = 0;
  mutable std::mutex unpacking_;
  mutable std::map<std::size_t, std::vector<std::byte>> unpacked_;  ///< by view
};

/// What a file says may become so much memory: a base, and so much for each byte that it has.
inline constexpr std::uint64_t kExpandedBase = 256U << 20;
inline constexpr std::uint64_t kExpandedPerByte = 256;

/// The size of a file's JSON, found without reading it into memory; of a damaged file, anything.
JsonSize gltf_json_size(const std::string& path);

/// A data URI taken apart. Throws std::invalid_argument with the reason.
struct DataUri {
  std::string mime_type;
  std::vector<std::byte> bytes;
};
DataUri decode_data_uri(std::string_view uri);

/// The parts of a checked document that tinygltf shall type: no buffers and images, which it would
/// load. Throws Error(input) where it cannot understand them all.
tinygltf::Model load_model(const GltfFile& file);

// What understanding JSON takes: its text, its tree, the text again, tinygltf's tree and model.
// Measured with 300,000 entries of one kind: 38 bytes per byte of accessors, 1.2 kB per empty node.
inline constexpr std::uint64_t kTypedBytesPerJsonByte = 44;
/// Of a long string: measured are 4.7 (an extra) to 5.6 copies (the name of the generator).
inline constexpr std::uint64_t kCopiesOfLongStrings = 8;
inline constexpr std::uint64_t kBytesPerEntry = 1200;

}  // namespace pounce::io
