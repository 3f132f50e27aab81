// SPDX-License-Identifier: Apache-2.0
//
// Painting over: the rows of an output and of the image below it meet.
//
// Padding is part of the picture (a chart's rim must not show the old colour when a renderer blends
// across it), but it must not run into what is no gutter: the part of a chart that found no source,
// or charts that were not selected. So a padded texel is painted only where no triangle of the
// whole target owns it, and, like every other, only as far as the mask lets it.
//
// Old and new image meet in the output's format. A weight of 0 leaves the old samples as they are,
// a weight of 1 the new ones, bit for bit (docs/decisions/013-painting-over.md): rows that nothing
// touches come out as they went in, if the formats are the same.
#include "flow/write/onto.h"

#include <algorithm>
#include <cstring>

#include "io/image/sample.h"
#include "io/image/write.h"
#include "pounce/error.h"
#include "shading/pad_seams.h"

namespace pounce::flow {
namespace {

constexpr std::uint32_t kRowsTogether = 16;
constexpr std::uint32_t kMostTexelBytes = 16;

shading::TexelFormat format_of(const io::ImageInfo& info, bool is_colour) {
  return {info.channels, info.depth, info.space().linear, is_colour, info.has_alpha, false};
}

}  // namespace

OntoPainter::OntoPainter(const planning::OntoImage& onto, const shading::TexelFormat& format,
                         ImageSize size)
    : onto_(onto), format_(format), width_(size.width), image_(onto.path, onto.allowed_formats) {
  onto_format_ = format_of(image_.info(), format.is_colour);
  if (onto.premultiplied) image_.keep_premultiplied();
  if (!onto.mask_path.empty()) {
    mask_.emplace(onto.mask_path, onto.allowed_formats);
    mask_format_ = format_of(mask_->info(), false);
  }
  if (onto.occupied) occupied_rows_.emplace(*onto.occupied, size.width, size.height);
  painted_format_ = format_;
  // What the source has nothing for stays as alpha does.
  painted_format_.has_alpha = format_.has_alpha || onto.keep_last;
  const std::size_t texels = std::size_t{kRowsTogether} * width_;
  old_raw_.resize(texels * onto_format_.texel_bytes());
  old_.resize(texels * format_.texel_bytes());
  if (mask_) mask_raw_.resize(texels * mask_format_.texel_bytes());
  weights_.resize(texels);
  occupied_.resize(texels);
}

void OntoPainter::paint(std::uint32_t rows, const std::uint8_t* kinds, std::byte* texels) {
  for (std::uint32_t y = 0; y < rows; y += kRowsTogether) {
    const std::size_t at = std::size_t{y} * width_;
    paint_rows(std::min(kRowsTogether, rows - y), kinds + at, texels + at * format_.texel_bytes());
  }
}

void OntoPainter::paint_rows(std::uint32_t rows, const std::uint8_t* kinds, std::byte* texels) {
  const std::size_t count = std::size_t{rows} * width_;
  image_.read_rows(rows, old_raw_.data());
  // The mask is a wish. What may be painted at all are covered texels, and padding where no
  // triangle of the whole target lies: all else has weight 0, whatever the mask says.
  std::fill_n(weights_.begin(), count, 1.0F);
  if (mask_) {
    mask_->read_rows(rows, mask_raw_.data());
    shading::mask_weights(mask_format_, mask_raw_.data(), count, weights_.data());
  }
  if (occupied_rows_) occupied_rows_->next(rows, occupied_.data());
  for (std::size_t i = 0; i < count; ++i) {
    const bool gutter = kinds[i] == shading::SeamPadder::kFilled && occupied_[i] == 0;
    if (kinds[i] != shading::SeamPadder::kCovered && !gutter) weights_[i] = 0;
    if (gutter && weights_[i] > 0) ++filled_;
    paints_ = paints_ || weights_[i] > 0;
  }
  convert_old(count);
  // Premultiplied colours mix with their alpha in one step. Where the old alpha stays, the new
  // colours are multiplied by that.
  shading::PaintAlpha alpha = onto_.alpha;
  if (onto_.premultiplied) {
    if (alpha == shading::PaintAlpha::keep)
      shading::copy_alpha(format_, old_.data(), count, texels);
    io::multiply_by_alpha(format_.depth, format_.channels, count, texels);
    alpha = shading::PaintAlpha::premultiplied;
  }
  shading::paint_over(painted_format_, alpha, weights_.data(), texels, count, old_.data());
  std::memcpy(texels, old_.data(), count * format_.texel_bytes());
}

/// The old samples in the output's format. Those that are painted over whole are not counted.
void OntoPainter::convert_old(std::size_t count) {
  for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
    const bool stays = weights_[begin] < 1;
    while (end < count && (weights_[end] < 1) == stays) ++end;
    const std::uint64_t clipped =
        shading::convert_texels(onto_format_, old_raw_.data() + begin * onto_format_.texel_bytes(),
                                format_, end - begin, old_.data() + begin * format_.texel_bytes());
    if (stays) clipped_ += clipped;
  }
}

std::uint64_t OntoPainter::memory_bytes(const planning::OntoImage& onto, std::uint32_t width) {
  const std::uint64_t rows = std::uint64_t{kRowsTogether} * width * (3 * kMostTexelBytes + 5);
  return onto.decoder_bytes + rows + 64ULL * width + (64 << 10);
}

}  // namespace pounce::flow
