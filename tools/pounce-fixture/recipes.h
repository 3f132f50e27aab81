// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace pounce::fixture {

/// One function per subcommand. Each writes its files (folders are made), returns their paths in
/// the order written, and makes the same bytes from the same arguments. Throws Error(usage) for
/// arguments that make no sense and Error(storage) for files that cannot be written.
using Paths = std::vector<std::string>;

struct HeadOptions {
  std::string folder;
  std::uint64_t triangles =
      10000;  ///< of the source; the targets get about 1.3 and 0.8 times as many
  std::uint32_t texture_size = 1024;  ///< of the source's square texture
  std::uint32_t target_size = 1024;   ///< of the truth image
  bool glb = true, obj = false;
  std::string texture_format =
      "png";  ///< png or jpg (embedded in the GLB); exr or tif (a file beside it)
};
/// head_src with its texture, head_same (the same surface, other triangles and UVs) with its truth,
/// and head_other (another head).
Paths make_head(const HeadOptions& options);

struct ShellOptions {
  std::string folder;
  std::uint32_t texture_size = 512;
};
/// A bent plate two texels thick: its two sides carry different colours. shell_src, shell_target
/// and truth.
Paths make_shell(const ShellOptions& options);

/// A model with three textures of different size, UV set and transform, a target, and a truth per
/// channel.
Paths make_channels(const std::string& folder);

struct OneTexelOptions {
  std::string folder;
  std::string mesh_format = "glb";   ///< glb or obj
  std::string image_format = "png";  ///< png, jpg, exr or tif
};
/// The smallest job: a textured quad and a target quad.
Paths make_one_texel(const OneTexelOptions& options);

struct PlainOptions {
  std::string path;  ///< .glb or .obj
  std::uint64_t triangles = 10000;
  std::uint32_t texture_size = 0;  ///< 0: no texture
  std::uint32_t uv_tiles = 1;      ///< several: a set of textures beside the mesh, one per tile
};
Paths make_sphere(const PlainOptions& options);
Paths make_plane(const PlainOptions& options);

struct SplatOptions {
  std::string path;             ///< .ply or .spz; its folder is made
  std::string shape = "head";   ///< head or sphere
  std::uint64_t count = 81200;  ///< rows, all kinds together; at most 1e9
  unsigned sh_degree = 0;       ///< 0 to 3
  std::uint64_t seed = 1;
  double noise = 0.4;      ///< sigma of the means along the normal, in spacings of the splats
  double needles = 0.08;   ///< part of the surface's splats
  double interior = 0.24;  ///< parts of all splats
  double floaters = 0.015;
  double haze = 0.02;
  std::uint64_t broken = 0;       ///< rows of each kind of breakage
  bool points = false;            ///< places and colours alone, of the surface: a scanner's cloud
  std::uint32_t target_size = 0;  ///< of the truth image; 0: no target and no truth
  /// The target is moved so far along its normals, in percent of its diagonal; positive is outward.
  /// The truth stays what the surface itself has.
  double target_offset = 0;
};
/// A splat scene as training leaves it behind, as a PLY or SPZ of any size in constant memory; and
/// a target of the same surface (STEM_target.glb) with the exact answer (STEM_target.truth.png).
Paths make_splats(const SplatOptions& options);

/// A folder of odd inputs, each named by what is odd about it.
Paths make_odd(const std::string& folder);

}  // namespace pounce::fixture
