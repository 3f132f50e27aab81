// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/gltf/gltf_file.h"
#include "io/model/model_writer.h"

namespace pounce::io {

/// Primitives that must not show a written material: it needs UVs that they lack. They get a copy
/// of the material as it was.
struct MaterialCopy {
  std::size_t material = 0;  ///< the original
  std::size_t index = 0;     ///< of the copy
};
/// A primitive that gets another material.
struct PrimitiveMaterial {
  std::size_t mesh = 0, primitive = 0, material = 0;
};

/// Where the new textures go in the arrays of a document.
struct ModelSlots {
  struct Texture {
    std::size_t texture = 0, image = 0;
    std::optional<std::size_t> view;  ///< of a .glb, the buffer view that becomes the new image's
  };
  std::vector<Texture> textures;  ///< by ModelRequest::textures
  std::vector<MaterialCopy> copies;
  std::vector<PrimitiveMaterial> primitives;
  /// Buffer views whose bytes nobody needs any more, sorted. Some of them have a new use.
  std::vector<std::size_t> free_views;
};

/// Decides it. A slot is used again only when nothing else in the document refers to it; extensions
/// and extras that are not known here are taken to refer to every number they hold.
ModelSlots find_slots(const nlohmann::json& document, const ModelRequest& request);

/// Bytes of an output file: a part of a file, of memory, or zeros.
struct ModelPiece {
  std::shared_ptr<const ReadFile> file;
  std::shared_ptr<const std::vector<std::byte>> bytes;
  std::uint64_t offset_bytes = 0, size_bytes = 0;
};

/// One buffer as it will be written.
struct ModelBuffer {
  std::string path;  ///< its file; "" = the BIN chunk, or left as the target has it
  std::vector<ModelPiece> pieces;
  std::uint64_t size_bytes = 0;
  std::size_t origin = 0;  ///< the target's buffer whose entry it takes over
  bool is_new = false;     ///< there is no such buffer
  bool is_kept = false;    ///< the entry stays as it is: a data URI, or no data at all

  void append(const ModelPiece& piece);
  /// Zeros up to a multiple of `alignment`.
  void align(std::uint64_t alignment);
};

/// Where a buffer view will be.
struct ViewPlace {
  std::size_t buffer = 0;
  std::uint64_t offset_bytes = 0, size_bytes = 0;
};

/// The buffers of a model output. A .glb has all of them in its BIN chunk, one after the other; a
/// .gltf has each in a file of its own, except data URIs, which stay. Bytes of `slots.free_views`
/// that no other view reads are left out, in steps of 16 bytes, so that all alignments stay.
class ModelBuffers {
 public:
  /// Throws Error(input) where a buffer's file is missing.
  ModelBuffers(const GltfFile& target, const ModelSlots& slots, const std::string& output);

  std::vector<ModelBuffer>& buffers() { return buffers_; }
  const std::vector<ModelBuffer>& buffers() const { return buffers_; }
  /// Where a place of the target's buffer has gone.
  ViewPlace moved(std::size_t buffer, std::uint64_t offset, std::uint64_t size) const;
  /// The target's view, moved; of one in slots.free_views, what is left of it.
  ViewPlace view(std::size_t index) const;
  /// More bytes at the end of the first buffer.
  ViewPlace append(const ModelPiece& piece);
  /// Files that are read.
  const std::vector<std::string>& inputs() const { return inputs_; }

 private:
  struct Hole {
    std::uint64_t begin = 0, size = 0;
  };
  struct Origin {
    std::size_t buffer = 0;
    std::uint64_t base = 0;
    std::vector<Hole> holes;  ///< sorted, apart
  };

  void find_holes(const ModelSlots& slots);
  void add_kept(std::size_t index);
  void add_pieces(std::size_t index, ModelBuffer& to);

  const GltfFile& target_;
  std::vector<Origin> origins_;
  std::vector<ModelBuffer> buffers_;
  std::map<std::size_t, bool> emptied_;  ///< free views whose bytes are gone
  std::vector<std::string> inputs_;
};

// --- the JSON ------------------------------------------------------------------------------------

/// An image of the target that is not replaced, at its new place.
struct MovedImage {
  std::string uri;  ///< of a .gltf: its file, as the JSON names it
  std::string mime_type;
  ViewPlace place;  ///< of a .glb
};

/// What becomes of the JSON besides materials and textures.
struct DocumentParts {
  const ModelRequest& request;
  const ModelSlots& slots;
  const ModelBuffers& buffers;
  std::vector<std::string> buffer_uris;  ///< by ModelBuffers::buffers(); "" = the BIN chunk
  std::vector<ViewPlace> image_places;   ///< of a .glb, by ModelRequest::textures
  std::vector<std::string> image_uris;   ///< of a .gltf, by ModelRequest::textures
  std::map<std::size_t, MovedImage> moved_images;
};

/// The target's JSON with the new textures. `text` is what `document` was read from.
std::string edit_model_json(std::string_view text, const nlohmann::json& document,
                            const DocumentParts& parts);

}  // namespace pounce::io
