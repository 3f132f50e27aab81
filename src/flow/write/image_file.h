// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/files/output_file.h"
#include "io/image/write.h"
#include "job/job_context.h"
#include "shading/mip_levels.h"

namespace pounce::flow {

/// An image file while its rows come, from top to bottom. Its smaller levels, where it has any, are
/// made on the way and wait in a scratch file: files want the first level whole before the next.
/// Leases nothing: its memory_bytes() are the caller's to lease. Not thread-safe.
class ImageFile {
 public:
  /// `known`: see io::ImageWriter.
  ImageFile(job::JobContext& job, const std::string& path, const io::ImageWriteSpec& spec,
            io::EncodedBlocks* known);
  /// As PNG to the end of `sink`.
  ImageFile(job::JobContext& job, WriteFile& sink, const io::ImageWriteSpec& spec,
            io::EncodedBlocks* known);
  ImageFile(const ImageFile&) = delete;
  ImageFile& operator=(const ImageFile&) = delete;

  void write_rows(std::uint32_t count, const std::byte* rows);
  /// See io::ImageWriter::finish().
  std::unique_ptr<io::OutputFile> finish();

  static std::uint64_t memory_bytes(const std::string& path, const io::ImageWriteSpec& spec);
  /// What its levels take on disk until it is whole.
  static std::uint64_t scratch_bytes(const io::ImageWriteSpec& spec);

 private:
  /// Rows of a level in the scratch file.
  struct Piece {
    std::uint64_t offset_bytes = 0;
    std::uint32_t rows = 0;
  };
  struct Level {
    std::size_t row_bytes = 0;
    std::uint32_t rows_together = 0;  ///< of a piece
    std::vector<Piece> pieces;
    PageVector<std::byte> waiting;  ///< rows of the next piece
    std::uint32_t waiting_rows = 0;
  };

  void keep_row(std::uint32_t level, const std::byte* row);
  void spill(Level& level);
  void write_level(const ReadFile& scratch, Level& level);

  job::JobContext& job_;
  const io::ImageWriteSpec spec_;
  io::ImageWriter writer_;
  std::optional<shading::MipLevels> levels_;
  std::vector<Level> kept_;  ///< from level 1
  std::unique_ptr<WriteFile> scratch_;
  std::uint64_t spilled_bytes_ = 0;
  PageVector<std::byte> row_;  ///< times alpha
};

}  // namespace pounce::flow
