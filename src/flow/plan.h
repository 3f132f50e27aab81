// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "flow/build_stores.h"
#include "flow/write_images.h"
#include "io/image_read.h"
#include "mesh/mesh.h"

namespace pounce::flow {

/// One channel of the job: its images on the source side, its format on the output side.
struct ChannelPlan {
  Channel channel = Channel::base_color;
  ImageSize size;  ///< of the output
  texture::TexelFormat format;
  /// By source page (the materials, then the same again for triangles without UVs): which image
  /// (index into Plan::columns), or -1 for the constant.
  std::vector<int> page_column;
  std::vector<texture::TexelValue> page_constant;
  std::vector<ImageOutput> images;  ///< by target page
};

/// An image that some channel needs, with the wrap modes it is sampled with.
struct ColumnPlan {
  mesh::ImageRef image;
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
  io::ImageInfo info;
};

/// Channels that share their sampling groups (the same lattice for every source page) and their
/// output size: one search serves them all.
struct PassPlan {
  GeometryRequest source, target;
  std::vector<std::size_t> channels;  ///< into Plan::channels
};

struct Plan {
  std::vector<ChannelPlan> channels;
  std::vector<ColumnPlan> columns;
  std::vector<PassPlan> passes;
  float max_distance = 0;   ///< in the target's units
  float smallest_edge = 0;  ///< see TargetBlock
  std::vector<std::string> warnings;
  std::vector<std::string> outputs;  ///< every file that will be written
};

/// Decides what a transfer does, from the two meshes and the headers of the images: channels,
/// sizes, passes, output names. Throws what a user must hear before any work is done: missing UVs,
/// textures or folders, names that clash, formats that cannot hold the result.
Plan make_plan(const TransferOptions& options, const mesh::Mesh& source, const mesh::Mesh& target);

/// What asks for the most memory, and how much the whole job needs at least.
struct LeastMemory {
  std::uint64_t bytes = 0;
  std::string why;
};
LeastMemory least_memory(const Plan& plan, const mesh::Mesh& source, const mesh::Mesh& target,
                         unsigned threads, std::uint64_t tile_cap_bytes);

/// The target's triangles by page, and the pages' names; shared with maps().
struct TargetPages {
  std::vector<std::string> names;
  std::vector<std::uint32_t> triangle_page;
};
TargetPages target_pages(const mesh::Mesh& target, bool by_material,
                         std::vector<std::string>& warnings);

/// Length of the diagonal of the target's bounding box.
double diagonal(const mesh::Mesh& mesh);

}  // namespace pounce::flow
