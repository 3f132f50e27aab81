// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/page_pool.h"
#include "io/files/output_file.h"
#include "io/image/read.h"
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

/// What an earlier run has encoded of an image and of its coverage; null: nobody wants to know.
struct KnownEncodings {
  io::EncodedBlocks *colours = nullptr, *coverage = nullptr;
};

/// A written image.
struct WrittenImage {
  WrittenTexels texels;
  /// Whole and without their names: they must get these in this order.
  std::vector<std::unique_ptr<io::OutputFile>> files;
};

/// Assembles result blocks into rows, pads charts, writes the image (and its coverage) in order.
/// With a `sink` the image goes to its end instead, as PNG.
WrittenImage write_image(job::JobContext& job, const planning::ImageOutput& output,
                         const shading::TexelFormat& format, const store::PackReader& results,
                         const std::vector<store::ChunkRef>& blocks, const KnownEncodings& known,
                         WriteFile* sink = nullptr);

/// What the levels of such an image take on disk until it is whole.
std::uint64_t levels_bytes(const planning::ImageOutput& output, const shading::TexelFormat& format);
/// What writing such an image needs at once.
std::uint64_t image_least_bytes(const planning::ImageOutput& output,
                                const shading::TexelFormat& format);

// --- painting over -------------------------------------------------------------------------------

/// Paints finished rows over an image that is read beside them, from top to bottom.
class OntoPainter {
 public:
  OntoPainter(const planning::OntoImage& onto, const shading::TexelFormat& format, ImageSize size);
  /// `texels`: new samples of the next `rows` rows, turned into what is written; `kinds`: what the
  /// padder says they are.
  void paint(std::uint32_t rows, const std::uint8_t* kinds, std::byte* texels);
  std::uint64_t filled() const { return filled_; }  ///< padding that was painted
  /// Samples of the old image that stay and that the output's depth cannot hold.
  std::uint64_t clipped() const { return clipped_; }
  bool paints() const { return paints_; }  ///< is any texel so far painted?
  /// Its own, and what the padder says of a stripe of 64 rows.
  static std::uint64_t memory_bytes(const planning::OntoImage& onto, std::uint32_t width);

 private:
  void convert_old(std::size_t count);
  void paint_rows(std::uint32_t rows, const std::uint8_t* kinds, std::byte* texels);

  const planning::OntoImage& onto_;
  shading::TexelFormat format_, painted_format_, onto_format_, mask_format_;
  std::uint32_t width_;
  io::ImageReader image_;
  std::optional<io::ImageReader> mask_;
  std::optional<mesh::UvOccupancy::Rows> occupied_rows_;
  PageVector<std::byte> old_raw_, old_, mask_raw_;
  PageVector<float> weights_;
  PageVector<std::uint8_t> occupied_;
  std::uint64_t filled_ = 0, clipped_ = 0;
  bool paints_ = false;
};

}  // namespace pounce::flow
