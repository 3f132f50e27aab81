// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "flow/job_context.h"
#include "flow/write/onto.h"
#include "io/image/write.h"
#include "mesh/lattice.h"
#include "store/pack/pack.h"
#include "texture/result_block.h"

namespace pounce::flow {

/// One output image: which results go into it and how it is finished.
struct ImageOutput {
  std::string path;           ///< "" = no colour image
  std::string coverage_path;  ///< "" = no coverage mask
  mesh::Lattice lattice;      ///< its size
  bool keep = false;          ///< it is there already and stays as it is
  io::ImageLayout layout, coverage_layout;
  /// --tile-size or --mipmap was given, and the layouts are the same without it.
  bool usual_tiles = false, usual_levels = false;
  std::string job;  ///< see JobHash; "" until it is known
  std::uint32_t padding = 0;
  /// A tangent-space normal map: texels that nothing covers or fills are flat (0, 0, 1), not black,
  /// which is no direction. Their alpha, if there is one, stays 0.
  bool is_normal_map = false;
  std::vector<std::string> channel_names;
  std::optional<Chromaticities> chromaticities;
  bool tagged = true;             ///< see io::ImageWriteSpec
  std::optional<OntoImage> onto;  ///< --onto
  std::uint32_t stripe_rows = 0;  ///< rows handed to the padder at once; 0 = a row of blocks
};

/// What became of texels on their way into an image.
struct WrittenTexels {
  std::uint64_t filled = 0;   ///< texels that padding filled
  std::uint64_t clipped = 0;  ///< old samples that stay and that the output's depth cannot hold
  bool any_fresh = true;      ///< false: a mask let nothing of the results into the image
  /// Of an image with alpha that went into a sink: is any covered texel's below 1, and any between
  /// 0 and 1?
  bool has_holes = false, has_veils = false;
};

/// Assembles result blocks into rows, pads charts, writes the image (and its coverage) in order and
/// renames it into place. With a `sink` the image goes to its end instead, as PNG.
WrittenTexels write_image(JobContext& job, const ImageOutput& output,
                          const texture::TexelFormat& format, const store::PackReader& results,
                          const std::vector<store::ChunkRef>& blocks, WriteFile* sink = nullptr);

/// What the levels of such an image take on disk until it is whole.
std::uint64_t levels_bytes(const ImageOutput& output, const texture::TexelFormat& format);
/// What writing such an image needs at once.
std::uint64_t image_least_bytes(const ImageOutput& output, const texture::TexelFormat& format);

}  // namespace pounce::flow
