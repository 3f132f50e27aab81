// SPDX-License-Identifier: Apache-2.0
//
// Files with levels want the first level whole before the next one begins, while rows of all levels
// are computed together, as they pass (docs/decisions/034-levels.md). So smaller levels wait in one
// scratch file. Their rows arrive interleaved, hence the list of pieces per level; a piece is many
// rows of a small level, so that the file is not written a few bytes at a time.
//
// Without levels this is the writer alone.
#include "flow/write/image_file.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "io/codec/sample.h"
#include "job/kept_encodings.h"
#include "mesh/lattice.h"
#include "runtime/shared_work.h"
#include "store/blocks/colour_store.h"

namespace pounce::flow {
namespace {

/// Rows of small levels go to disk together.
constexpr std::size_t kPieceBytes = 64 << 10;

std::size_t row_bytes_of(const io::ImageWriteSpec& spec, std::uint32_t width) {
  return std::size_t{width} * spec.channels * store::depth_bytes(spec.depth);
}

std::uint32_t rows_together(std::size_t row_bytes, std::uint32_t height) {
  return static_cast<std::uint32_t>(
      std::clamp<std::size_t>(kPieceBytes / row_bytes, 1, std::max(height, 1U)));
}

/// Levels are made of colours times alpha, as renderers blend them.
io::ImageWriteSpec multiplied(io::ImageWriteSpec spec) {
  spec.premultiplied = spec.premultiplied || (spec.layout.mipmap && spec.has_alpha);
  return spec;
}

}  // namespace

ImageFile::ImageFile(job::JobContext& job, const std::string& path, const io::ImageWriteSpec& spec,
                     io::EncodedBlocks* known)
    : job_(job), spec_(spec), writer_(path, multiplied(spec), runtime::begin_work, known) {
  if (!spec.layout.mipmap) return;
  ImageSize size{spec.width, spec.height};
  levels_.emplace(size, spec.channels, spec.depth);
  for (std::uint32_t level = shading::level_count(size); level > 1; --level) {
    size = mesh::next_level_size(size);
    Level& kept = kept_.emplace_back();
    kept.row_bytes = row_bytes_of(spec, size.width);
    kept.rows_together = rows_together(kept.row_bytes, size.height);
    kept.waiting.resize(kept.row_bytes * kept.rows_together);
  }
  if (spec.has_alpha && !spec.premultiplied) row_.resize(row_bytes_of(spec, spec.width));
  if (!kept_.empty()) scratch_ = job.scratch_place().create();
}

ImageFile::ImageFile(job::JobContext& job, WriteFile& sink, const io::ImageWriteSpec& spec,
                     io::EncodedBlocks* known)
    : job_(job), spec_(spec), writer_(sink, spec, runtime::begin_work, known) {}

void ImageFile::write_rows(std::uint32_t count, const std::byte* rows) {
  if (!levels_) return writer_.write_rows(count, rows);
  const auto keep = [this](std::uint32_t level, const std::byte* row) { keep_row(level, row); };
  const std::size_t row_bytes = row_bytes_of(spec_, spec_.width);
  for (std::uint32_t i = 0; i < count; ++i, rows += row_bytes) {
    // Levels are made of the same samples that the first level stores, so a straight colour is
    // multiplied before both. The caller's rows stay as they are.
    const std::byte* row = rows;
    if (!row_.empty()) {
      std::memcpy(row_.data(), rows, row_bytes);
      io::multiply_by_alpha(spec_.depth, spec_.channels, spec_.width, row_.data());
      row = row_.data();
    }
    writer_.write_rows(1, row);
    levels_->push(1, row, keep);
  }
}

void ImageFile::keep_row(std::uint32_t level, const std::byte* row) {
  Level& kept = kept_[level - 1];
  std::memcpy(kept.waiting.data() + kept.waiting_rows * kept.row_bytes, row, kept.row_bytes);
  if (++kept.waiting_rows == kept.rows_together) spill(kept);
}

void ImageFile::spill(Level& level) {
  if (level.waiting_rows == 0) return;
  const std::size_t bytes = level.waiting_rows * level.row_bytes;
  level.pieces.push_back({scratch_->size_bytes(), level.waiting_rows});
  scratch_->append(std::span(level.waiting).first(bytes));
  level.waiting_rows = 0;
  spilled_bytes_ += bytes;
}

std::unique_ptr<io::OutputFile> ImageFile::finish() {
  // What waits last is shorter than a piece.
  for (Level& level : kept_) spill(level);
  if (scratch_ != nullptr) {
    const std::unique_ptr<ReadFile> scratch = scratch_->reader();
    for (Level& level : kept_) {
      writer_.next_level();
      write_level(*scratch, level);
    }
    job_.report.bytes_written += spilled_bytes_;
  }
  return writer_.finish();
}

void ImageFile::write_level(const ReadFile& scratch, Level& level) {
  for (const Piece& piece : level.pieces) {
    const auto rows = std::span(level.waiting).first(piece.rows * level.row_bytes);
    scratch.read(piece.offset_bytes, rows);
    writer_.write_rows(piece.rows, rows.data());
  }
}

std::uint64_t ImageFile::scratch_bytes(const io::ImageWriteSpec& spec) {
  if (!spec.layout.mipmap) return 0;
  std::uint64_t bytes = 0;
  for (ImageSize size{spec.width, spec.height}; size.width > 1 || size.height > 1;) {
    size = mesh::next_level_size(size);
    bytes += std::uint64_t{row_bytes_of(spec, size.width)} * size.height;
  }
  return bytes;
}

std::uint64_t ImageFile::memory_bytes(const std::string& path, const io::ImageWriteSpec& spec) {
  std::uint64_t bytes =
      io::ImageWriter::encoder_bytes(path, spec) +
      job::KeptEncodings::memory_bytes(io::ImageWriter::encoded_block_bytes(path, spec));
  if (!spec.layout.mipmap) return bytes;
  ImageSize size{spec.width, spec.height};
  // As the constructor allocates it, level by level, with lists that may have doubled while they
  // grew.
  bytes += shading::MipLevels::memory_bytes(size, spec.channels) +
           round_to_pages(row_bytes_of(spec, spec.width));
  while (size.width > 1 || size.height > 1) {
    size = mesh::next_level_size(size);
    const std::uint64_t row = row_bytes_of(spec, size.width);
    const std::uint64_t together = rows_together(row, size.height);
    bytes += round_to_pages(row * together) + (size.height / together + 1) * 2 * sizeof(Piece);
  }
  return bytes;
}

}  // namespace pounce::flow
