// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/page_pool.h"
#include "io/image/read.h"
#include "planning/image_output.h"

namespace pounce::flow {

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
