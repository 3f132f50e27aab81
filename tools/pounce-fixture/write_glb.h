// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "grid_chart.h"
#include "output_file.h"

namespace pounce::fixture {

/// A few triangles held in memory, for small and odd inputs. Empty lists are left out of the file.
struct SmallMesh {
  std::vector<Vec3f> positions, normals;
  std::vector<std::vector<Vec2f>> uv_sets;  ///< v down
  std::vector<std::uint32_t> indices;
};

/// Collects what a GLB holds and writes it from start to end: nothing of a large mesh or image is
/// ever in memory, as every piece of the binary chunk is made (or read from its file) while it is
/// written. Typical use: images, materials, primitives, then write(). Not thread-safe.
class GlbWriter {
 public:
  using Json = nlohmann::ordered_json;
  using MakePiece = std::function<void(OutputFile&)>;

  GlbWriter();
  /// The whole document; change it freely before write().
  Json& json() { return json_; }

  /// The encoded image file `path`, copied into the binary chunk by write(); returns the texture's
  /// index (one sampler, repeat, per texture). The file must stay until then.
  std::size_t add_embedded_texture(const std::string& path);
  /// A texture in a file of its own, as its URI.
  std::size_t add_external_texture(const std::string& uri);
  /// A material with this baseColor texture (none: -1), roughness 1, metallic 0; returns its index.
  std::size_t add_material(const std::string& name, int base_color_texture);
  /// One mesh with a node in the scene; primitives go into the latest mesh. Returns the node's
  /// index.
  std::size_t add_mesh(const std::string& name);
  /// All charts as one indexed primitive with interleaved vertices. `mesh` must live until write().
  void add_primitive(const GridMesh& mesh, int material);
  void add_primitive(SmallMesh mesh, int material);

  /// Writes the file. Throws Error(storage), or Error(usage) above 4 GiB, which GLB cannot hold.
  void write(const std::string& path);

 private:
  std::size_t add_view(std::uint64_t size_bytes, MakePiece make, int target);
  std::size_t add_accessor(std::size_t view, std::uint64_t offset_bytes, int component_type,
                           std::uint64_t count, const char* type);
  Json& new_primitive(int material);
  std::size_t add_texture(Json image);

  struct Piece {
    std::uint64_t size_bytes;
    MakePiece make;
  };
  Json json_;
  std::vector<Piece> pieces_;
  std::uint64_t binary_bytes_ = 0;
};

}  // namespace pounce::fixture
