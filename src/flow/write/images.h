// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "io/image/write.h"
#include "job/job_context.h"
#include "planning/image_output.h"
#include "shading/result_block.h"
#include "store/pack/pack.h"

namespace pounce::flow {

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
WrittenTexels write_image(job::JobContext& job, const planning::ImageOutput& output,
                          const shading::TexelFormat& format, const store::PackReader& results,
                          const std::vector<store::ChunkRef>& blocks, WriteFile* sink = nullptr);

/// What the levels of such an image take on disk until it is whole.
std::uint64_t levels_bytes(const planning::ImageOutput& output, const shading::TexelFormat& format);
/// What writing such an image needs at once.
std::uint64_t image_least_bytes(const planning::ImageOutput& output,
                                const shading::TexelFormat& format);

}  // namespace pounce::flow
