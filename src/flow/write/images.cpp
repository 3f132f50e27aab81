// SPDX-License-Identifier: Apache-2.0
//
// Assemble, pad, write: result blocks become image files.
//
// A row of blocks is decoded in parallel into 64 rows of texels, the padder turns them into
// finished rows `padding` rows later, and a second pipeline stage encodes these while the next row
// of blocks is assembled. Finished rows leave in stripes of at most 16, also at the end, where all
// that the padder holds is ready at once. Everything is in order from top to bottom, so an image of
// any height needs the same memory.
//
// Many narrow stripes, not a few wide ones: the next row of blocks begins as soon as there is room
// for one of its stripes, not when all of an earlier row of blocks is encoded.
#include "flow/write/images.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <optional>
#include <utility>

#include "flow/write/image_file.h"
#include "io/codec/sample.h"
#include "io/image/write.h"
#include "pounce/error.h"
#include "shading/pad_seams.h"
#include "store/pack/codec.h"

namespace pounce::flow {
namespace {

using mesh::kBlockEdge;

constexpr std::uint64_t kMostTokens = 8;
constexpr std::uint32_t kStripeRows = 16;

/// A stripe of rows that are ready for the encoders.
struct Rows {
  std::uint32_t count = 0, covered_count = 0;
  PageVector<std::byte> texels;
  PageVector<std::byte> covered;  ///< 0 or the depth's 1, one sample per texel
};

io::ImageWriteSpec colour_spec(const planning::ImageOutput& output,
                               const shading::TexelFormat& format) {
  return {output.lattice.width,
          output.lattice.height,
          format.channels,
          format.depth,
          format.linear,
          format.has_alpha,
          format.premultiplied || (output.onto && output.onto->premultiplied),
          output.channel_names,
          output.chromaticities,
          output.tagged,
          output.layout,
          output.job,
          output.hits_note};
}

io::ImageWriteSpec coverage_spec(const planning::ImageOutput& output) {
  return {output.lattice.width,
          output.lattice.height,
          1,
          io::writable_depth(output.coverage_path, Depth::u8),
          false,
          false,
          false,
          {},
          {},
          true,
          output.coverage_layout,
          output.job};
}

/// One byte, 0 or 1, for each of the first `count` bits.
void expand_mask(const std::uint8_t* bits, std::uint32_t count, std::uint8_t* bytes) {
  for (std::uint32_t x = 0; x < count; x += 8) {
    // The multiplication puts a copy of the bits into every byte, the mask leaves one bit in each:
    // byte i keeps bit i, which the addition carries to the top of its byte unless it is 0.
    const std::uint64_t copies = (bits[x / 8] * 0x0101010101010101ULL) & 0x8040201008040201ULL;
    const std::uint64_t ones = ((copies + 0x7F7F7F7F7F7F7F7FULL) & 0x8080808080808080ULL) >> 7;
    std::memcpy(bytes + x, &ones, std::min(count - x, 8U));
  }
}

/// The results of one image on their way to its file. The lease covers all of it and is the first
/// to be taken: image_least_bytes() must count whatever is added here.
class ImageAssembler {
 public:
  ImageAssembler(job::JobContext& job, const planning::ImageOutput& output,
                 const shading::TexelFormat& format, const store::PackReader& results,
                 const std::vector<store::ChunkRef>& blocks, const KnownEncodings& known,
                 WriteFile* sink)
      : job_(job),
        output_(output),
        format_(format),
        results_(results),
        blocks_(blocks),
        lease_(job.budget, image_least_bytes(output, format), "writing " + output.path),
        padder_(output.lattice.width, output.lattice.height, output.padding,
                static_cast<std::uint32_t>(format.texel_bytes()), kBlockEdge) {
    const bool writes_colours = !output.path.empty() && !output.painted;
    if (output.onto && writes_colours) {
      painter_.emplace(*output.onto, format,
                       ImageSize{output.lattice.width, output.lattice.height});
    }
    looks_at_alpha_ = sink != nullptr && format.has_alpha;
    if (sink != nullptr) {
      colours_.emplace(job, *sink, colour_spec(output, format), known.colours);
    } else if (writes_colours) {
      colours_.emplace(job, output.path, colour_spec(output, format), known.colours);
    }
    if (!output.coverage_path.empty())
      coverage_.emplace(job, output.coverage_path, coverage_spec(output), known.coverage);
  }

  WrittenImage run() {
    std::uint32_t next = 0;
    // A pipeline forgets the tokens under way when a stage throws, so they are not what owns rows.
    // They leave in order, so those under way are neighbours: each has its own slot.
    std::array<Rows, kMostTokens> slots;
    tbb::parallel_pipeline(
        kMostTokens,
        tbb::make_filter<void, Rows*>(tbb::filter_mode::serial_in_order,
                                      [&](tbb::flow_control& flow) -> Rows* {
                                        Rows& slot = slots[next++ % kMostTokens];
                                        if (make_stripe(slot)) return &slot;
                                        flow.stop();
                                        return nullptr;
                                      }) &
            tbb::make_filter<Rows*, void>(tbb::filter_mode::serial_in_order, [&](Rows* rows) {
              write(*rows);
              *rows = {};
            }));
    const WorkTimer encoding(job_.clock, "encode");
    // The mask first: an image that is painted over in place must be the last that is missing.
    WrittenImage image;
    for (std::optional<ImageFile>* const file : {&coverage_, &colours_}) {
      if (!*file) continue;
      if (auto whole = (*file)->finish()) image.files.push_back(std::move(whole));
    }
    image.texels = painter_
                       ? WrittenTexels{painter_->filled(), painter_->clipped(), painter_->paints()}
                       : WrittenTexels{padder_.filled(), 0, true, has_holes_, has_veils_};
    return image;
  }

 private:
  /// The next stripe; false: there are no more. While the padder's delay builds up a stripe has no
  /// finished rows, only some of the mask.
  bool make_stripe(Rows& out) {
    // What is ready leaves before more is pushed, which the padder demands.
    if (padder_.ready_rows() == 0 && mask_left_ == 0) {
      if (next_row_ == output_.lattice.height) return false;
      push_row_of_blocks();
    }
    take_mask(out);
    pop(std::min(kStripeRows, padder_.ready_rows()), out);
    return true;
  }

  void push_row_of_blocks() {
    const std::uint32_t width = output_.lattice.width;
    const std::uint32_t block_row = next_row_ / kBlockEdge;
    const std::uint32_t rows =
        std::min<std::uint32_t>(kBlockEdge, output_.lattice.height - next_row_);
    const std::size_t texel = format_.texel_bytes();
    PageVector<std::byte> texels(std::size_t{rows} * width * texel);
    PageVector<std::uint8_t> covered(std::size_t{rows} * width);
    const std::uint32_t across = (width + kBlockEdge - 1) / kBlockEdge;
    tbb::parallel_for(std::uint32_t{0}, across, [&](std::uint32_t bx) {
      const store::ChunkRef& chunk = blocks_[std::size_t{block_row} * across + bx];
      if (chunk.raw_bytes == 0) return;
      const shading::ResultBlock block = read_block(chunk);
      const std::uint32_t columns = std::min<std::uint32_t>(kBlockEdge, width - bx * kBlockEdge);
      for (std::uint32_t y = 0; y < rows; ++y) {
        const std::size_t to = std::size_t{y} * width + std::size_t{bx} * kBlockEdge;
        std::memcpy(texels.data() + to * texel, block.texels.data() + y * kBlockEdge * texel,
                    columns * texel);
        expand_mask(block.mask.data() + y * kBlockEdge / 8, columns, covered.data() + to);
        // A model's material must state whether its texture has holes (write/model.cpp), and nobody
        // sees the texels again. Threads only ever set the two flags.
        if (looks_at_alpha_)
          look_at_alpha(columns, texels.data() + to * texel, covered.data() + to);
      }
    });
    if (coverage_) {
      // The mask is of covered texels, before padding. It needs no rows below and leaves at once,
      // so in a stripe it is ahead of the colours.
      store_mask(covered, mask_);
      mask_rows_ = mask_left_ = rows;
    }
    const std::uint32_t step =
        output_.stripe_rows == 0 ? rows : std::min(output_.stripe_rows, rows);
    for (std::uint32_t y = 0; y < rows; y += step) {
      const std::uint32_t count = std::min(step, rows - y);
      padder_.push(count, texels.data() + std::size_t{y} * width * texel,
                   covered.data() + std::size_t{y} * width);
    }
    next_row_ += rows;
  }

  /// Of u8 and u16, which a sink's PNG holds.
  void look_at_alpha(std::uint32_t count, const std::byte* texels, const std::uint8_t* covered) {
    const std::size_t texel = format_.texel_bytes(), sample = texel / format_.channels;
    const std::uint32_t full = sample == 1 ? 255 : 65535;
    for (std::uint32_t x = 0; x < count; ++x) {
      if (covered[x] == 0) continue;
      std::uint16_t alpha = 0;  // the lowest byte first
      std::memcpy(&alpha, texels + x * texel + texel - sample, sample);
      if (alpha < full) has_holes_ = true;
      if (alpha > 0 && alpha < full) has_veils_ = true;
    }
  }

  void take_mask(Rows& out) {
    if (mask_left_ == 0) return;
    const std::size_t row_bytes = mask_.size() / mask_rows_;
    out.covered_count = std::min(kStripeRows, mask_left_);
    const auto from = mask_.begin() + std::ptrdiff_t((mask_rows_ - mask_left_) * row_bytes);
    out.covered.assign(from, from + std::ptrdiff_t(out.covered_count * row_bytes));
    mask_left_ -= out.covered_count;
  }

  void pop(std::uint32_t rows, Rows& out) {
    out.count = rows;
    out.texels.resize(std::size_t{rows} * output_.lattice.width * format_.texel_bytes());
    if (painter_) {
      // The painter reads the old image beside these rows, so every row must pass it exactly once,
      // in order.
      PageVector<std::uint8_t> kinds(std::size_t{rows} * output_.lattice.width);
      padder_.pop(rows, out.texels.data(), kinds.data());
      painter_->paint(rows, kinds.data(), out.texels.data());
    } else {
      padder_.pop(rows, out.texels.data());
      if (output_.is_normal_map) flatten_empty(out.texels);
    }
  }

  /// No direction is stored as zeros, so these texels are empty.
  void flatten_empty(PageVector<std::byte>& texels) const {
    shading::TexelFormat vector = format_;
    vector.channels = 3;
    vector.has_alpha = false;
    std::array<std::byte, 12> flat{};
    shading::store_texel(vector, {.v = {0.5, 0.5, 1}, .channels = 3}, flat.data());
    const std::size_t size = vector.texel_bytes();
    const std::array<std::byte, 12> empty{};
    for (std::size_t at = 0; at < texels.size(); at += format_.texel_bytes()) {
      if (std::memcmp(texels.data() + at, empty.data(), size) == 0)
        std::memcpy(texels.data() + at, flat.data(), size);
    }
  }

  /// 0 and 1 as the mask's format holds them.
  void store_mask(const PageVector<std::uint8_t>& covered, PageVector<std::byte>& samples) const {
    const shading::TexelFormat mask{1, coverage_spec(output_).depth, false, false, false, false};
    std::array<std::byte, 4> one{};
    shading::store_texel(mask, {.v = {1}, .channels = 1}, one.data());
    const std::size_t size = mask.texel_bytes();
    samples.assign(covered.size() * size, std::byte{});
    for (std::size_t i = 0; i < covered.size(); ++i) {
      if (covered[i] != 0) std::memcpy(samples.data() + i * size, one.data(), size);
    }
  }

  shading::ResultBlock read_block(const store::ChunkRef& chunk) {
    shading::ResultBlock block;
    shading::decode(results_.read(chunk, store::ChunkKind::block), chunk.raw_bytes, format_,
                    job_.compressor(), results_.name(), block);
    return block;
  }

  void write(const Rows& rows) {
    {
      const WorkTimer encoding(job_.clock, "encode");
      if (colours_ && rows.count > 0) colours_->write_rows(rows.count, rows.texels.data());
      if (coverage_ && rows.covered_count > 0)
        coverage_->write_rows(rows.covered_count, rows.covered.data());
    }
    job_.meter.advance(rows.count);
  }

  job::JobContext& job_;
  const planning::ImageOutput& output_;
  const shading::TexelFormat& format_;
  const store::PackReader& results_;
  const std::vector<store::ChunkRef>& blocks_;
  runtime::Lease lease_;
  shading::SeamPadder padder_;
  std::uint32_t next_row_ = 0;  ///< that the padder gets
  PageVector<std::byte> mask_;  ///< of the row of blocks that was pushed last
  std::uint32_t mask_rows_ = 0, mask_left_ = 0;
  bool looks_at_alpha_ = false;
  std::atomic<bool> has_holes_ = false, has_veils_ = false;
  std::optional<OntoPainter> painter_;
  std::optional<ImageFile> colours_, coverage_;
};

}  // namespace

WrittenImage write_image(job::JobContext& job, const planning::ImageOutput& output,
                         const shading::TexelFormat& format, const store::PackReader& results,
                         const std::vector<store::ChunkRef>& blocks, const KnownEncodings& known,
                         WriteFile* sink) {
  return ImageAssembler(job, output, format, results, blocks, known, sink).run();
}

std::uint64_t levels_bytes(const planning::ImageOutput& output,
                           const shading::TexelFormat& format) {
  return ImageFile::scratch_bytes(colour_spec(output, format)) +
         (output.coverage_path.empty() ? 0 : ImageFile::scratch_bytes(coverage_spec(output)));
}

std::uint64_t image_least_bytes(const planning::ImageOutput& output,
                                const shading::TexelFormat& format) {
  const std::uint64_t width = output.lattice.width;
  const std::uint64_t texel = format.texel_bytes();
  // One row of blocks with its coverage, a stripe for each token, the padder's ring, and what
  // paints and encodes. Nothing grows with the height.
  const std::uint64_t mask =
      output.coverage_path.empty() ? 0 : store::depth_bytes(coverage_spec(output).depth);
  const std::uint64_t row_of_blocks = round_to_pages(kBlockEdge * width * (texel + 1 + mask));
  const std::uint64_t stripe = round_to_pages(kStripeRows * width * (texel + mask));
  std::uint64_t bytes =
      row_of_blocks + kMostTokens * stripe +
      shading::SeamPadder::memory_bytes(output.lattice.width, output.padding,
                                        static_cast<std::uint32_t>(texel), kBlockEdge) +
      (256 << 10);
  if (output.onto) bytes += OntoPainter::memory_bytes(*output.onto, output.lattice.width);
  if (!output.path.empty())
    bytes += ImageFile::memory_bytes(output.path, colour_spec(output, format));
  if (!output.coverage_path.empty()) {
    bytes += ImageFile::memory_bytes(output.coverage_path, coverage_spec(output));
  }
  return bytes;
}

// --- painting over -------------------------------------------------------------------------------
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

namespace {

constexpr std::uint32_t kRowsTogether = 16;
constexpr std::uint32_t kMostTexelBytes = 16;

shading::TexelFormat format_of(const io::ImageInfo& info, bool is_colour) {
  return {info.channels, info.depth, info.space().linear, is_colour, info.has_alpha, false};
}

}  // namespace

OntoPainter::OntoPainter(const planning::OntoImage& onto, const shading::TexelFormat& format,
                         ImageSize size)
    : onto_(onto), format_(format), width_(size.width), image_(onto.path, onto.trust) {
  onto_format_ = format_of(image_.info(), format.is_colour);
  if (onto.premultiplied) image_.keep_premultiplied();
  if (!onto.mask_path.empty()) {
    mask_.emplace(onto.mask_path, onto.trust);
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
