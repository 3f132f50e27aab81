// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/job_space.h"
#include "core/vec.h"
#include "pounce/options.h"

namespace pounce::mesh {

/// glTF's texture wrap modes.
enum class Wrap : std::uint8_t { repeat, mirror, clamp };

/// Affine map of UV coordinates (KHR_texture_transform): u' = a u + b v + c, v' = d u + e v + f,
/// in glTF's convention (v down).
struct UvTransform {
  double a = 1, b = 0, c = 0, d = 0, e = 1, f = 0;
  bool operator==(const UvTransform&) const = default;
};

/// Where the bytes of an encoded image are. Exactly one of: a file or byte range of a file (`path`,
/// with `size_bytes` == 0 for the whole file), or bytes in memory (a data URI).
struct ImageRef {
  std::string path;
  std::uint64_t offset_bytes = 0;
  std::uint64_t size_bytes = 0;
  std::shared_ptr<const std::vector<std::byte>> bytes;
  std::string label;      ///< for messages: "head.glb image 2 \"skin\"", "skin.png"
  std::string mime_type;  ///< "" when unknown
  std::string
      problem;  ///< not empty: cannot be read, and why (unsupported extension, missing file)
  bool missing = false;  ///< the problem is that the file is not there
  /// Of an EXR: the layer or channels that are meant, "diffuse", "diffuse.R,G,B"; "": those that
  /// io::choose_channels() says.
  std::string channels;
};

/// A texture as a material uses it.
struct TextureBinding {
  std::uint32_t image = 0;   ///< index into Mesh::images
  std::uint32_t uv_set = 0;  ///< index into Mesh::uv_sets
  UvTransform transform;
  Wrap wrap_u = Wrap::repeat;
  Wrap wrap_v = Wrap::repeat;
};

/// A texture that no channel takes: heights, one of an extension.
struct OtherTexture {
  std::string slot;         ///< as the file names it: "map_Bump"
  std::uint32_t image = 0;  ///< index into Mesh::images
};

struct Material {
  std::string name;  ///< "default" for primitives without one
  /// By Channel; nothing where the material has no such texture.
  std::array<std::optional<TextureBinding>, kChannelCount> textures;
  /// By Channel: baseColorFactor rgba (linear), (0, roughnessFactor, metallicFactor, 1), (1,1,1,1)
  /// for occlusion, emissiveFactor rgb1 (linear), (scale,scale,1,1) for normal.
  std::array<std::array<float, 4>, kChannelCount> factors{
      {{1, 1, 1, 1}, {0, 1, 1, 1}, {1, 1, 1, 1}, {0, 0, 0, 1}, {1, 1, 1, 1}}};
  /// What the factors above have no room for; a model output copies them with the texture.
  float occlusion_strength = 1, emissive_strength = 1;
  bool double_sided = false;
  bool is_opaque = false;  ///< its alpha means nothing, by the file (glTF's alphaMode OPAQUE)
  std::optional<float> alpha_cutoff;  ///< its alpha is a mask, by the file (alphaMode MASK)
  bool is_pbr = false;                ///< roughness and metallic factors are the file's; not of OBJ
  std::vector<OtherTexture> other_textures;
};

/// The names that triangles can be selected by. A part is a set of names that some triangles share:
/// node and mesh of a glTF file, object and groups of an OBJ file. Triangles are in file order, so
/// their parts are runs.
struct Parts {
  struct Run {
    std::uint32_t first_triangle = 0;  ///< to the next run's, the last one to the end
    std::uint32_t part = 0;            ///< index into part_names
    bool operator==(const Run&) const = default;
  };
  std::vector<std::string> names;                      ///< each once, in order of appearance
  std::vector<std::vector<std::uint32_t>> part_names;  ///< by part: indices into names
  std::vector<Run> runs;                               ///< first_triangle ascending, from 0

  std::uint64_t size_bytes() const;
};

/// A file that a mesh names and that could not be read.
struct UnreadFile {
  std::string path;
  std::string cure;     ///< "cannot be read: put it back"
  std::string refused;  ///< why the system would not read a file that is there; empty: it is not so
};

/// A whole mesh file, flattened: node transforms applied (mirroring ones keep the winding outward),
/// every primitive triangulated, all in the file's own axes and units.
/// Invariants (readers guarantee): every index < vertex count, positions and UVs finite, normals
/// finite (unit, or zero where undefined), every uv set has one entry per vertex.
struct Mesh {
  std::string path;  ///< as given by the caller, for messages
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;  ///< one per vertex
  /// One per vertex: unit tangent and handedness (+1/-1) along +u of uv set 0, from the file or
  /// derived.
  std::vector<Vec4f> tangents;
  /// One per vertex: linear light of sRGB's primaries and alpha, which multiply the base colour;
  /// white where a primitive has none. Empty: none has, or they were not asked for.
  std::vector<Vec4f> colours;
  std::vector<bool> own_tangents;  ///< per vertex: is it from the file? Empty: none is
  /// uv_sets[k][vertex], v down as in glTF (OBJ's v is flipped when read): row 0 of an image is v =
  /// 0.
  std::vector<std::vector<Vec2f>> uv_sets;
  /// Per vertex of set k: does its primitive have this set at all? Empty = all vertices do.
  std::vector<std::vector<bool>> uv_present;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< file order
  std::vector<std::uint32_t> triangle_material;         ///< index into materials
  /// Triangles that select() left out but was told to keep: they still own their part of the
  /// images.
  std::vector<std::array<std::uint32_t, 3>> rest;
  std::vector<std::uint32_t> rest_material;
  /// In the file: glTF's COLOR_0 of a type that colours have, "v x y z r g b".
  bool has_vertex_colours = false;
  Parts parts;                      ///< what --source-mesh and --target-mesh look at
  std::vector<Material> materials;  ///< never empty when there are triangles
  std::vector<ImageRef> images;
  std::vector<std::string> warnings;
  std::vector<std::string> notes;  ///< what was done that may not be meant
  /// Every file that was read for this mesh, images aside: buffers of glTF, material files of OBJ.
  std::vector<std::string> files;
  std::vector<UnreadFile> unread_files;  ///< material files that it names

  bool has_uv(std::size_t uv_set, std::uint32_t vertex) const {
    return uv_set < uv_sets.size() && (uv_present[uv_set].empty() || uv_present[uv_set][vertex]);
  }
  /// Adds a copy of each of these vertices, with all that it has; no triangle uses them yet. What
  /// the mesh has not (an array that is empty) stays so.
  void append_copies(const std::vector<std::uint32_t>& originals);
  /// Bytes this mesh holds in memory.
  std::uint64_t size_bytes() const;
};

/// Makes Parts while a file is read.
class PartsBuilder {
 public:
  /// From triangle `first_triangle` on, the triangles have these names (without repetitions, empty
  /// ones left out). Called in order; where no triangle follows, it leaves no trace.
  void start(std::uint32_t first_triangle, const std::vector<std::string>& names);
  /// `triangles`: how many there are.
  Parts finish(std::uint32_t triangles);

 private:
  void end_run(std::uint32_t triangles);

  Parts parts_;
  std::map<std::string, std::uint32_t> name_index_;
  std::map<std::vector<std::uint32_t>, std::uint32_t> part_index_;
  std::vector<std::uint64_t> last_use_;  ///< by name: the run that had it last
  std::uint64_t uses_ = 0;               ///< runs so far
  std::vector<std::string> names_;
  std::uint32_t first_ = 0;
};

/// Turns a mesh: positions, normals and tangents. Axes that mirror also change the winding of the
/// triangles and the handedness of the tangents, so that normals still face outwards and textures
/// still read the same way. Exact.
void orient(Mesh& mesh, const Axes& axes);

/// Triangles whose corners lie, in the same order around, exactly where those of one before them in
/// the file do, with other UVs or another material: nothing of them is ever seen. Needs two bytes
/// for each triangle; up to 24 where most of them coincide.
std::uint64_t count_coincident(const Mesh& mesh);

// --- what takes part -----------------------------------------------------------------------------

/// Which triangles of a mesh take part. Patterns as in a shell: * any characters, ? one, [a-c] one
/// of these, \ takes the next character as it is; upper and lower case differ. A name that equals
/// the pattern matches, too, whatever characters it has. Several patterns: any of them.
struct Selection {
  std::vector<std::string> meshes;     ///< of Parts::names; empty = all
  std::vector<std::string> materials;  ///< of material names; empty = all
  bool everything() const { return meshes.empty() && materials.empty(); }
};

/// Does the pattern match the name?
bool matches(const std::string& pattern, const std::string& name);

/// Leaves only the triangles whose part and material are both selected, in file order; vertices,
/// materials and images stay. A pattern that matches nothing while another one does is a warning of
/// the mesh. Throws Error(input) if no triangle is left: it lists the names that there are.
/// `side` is "source" or "target", for messages that name the option. `keep_rest`: the other
/// triangles go to Mesh::rest.
void select(Mesh& mesh, const Selection& selection, const std::string& side,
            bool keep_rest = false);

}  // namespace pounce::mesh
