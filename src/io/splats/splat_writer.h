// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "core/file.h"
#include "core/page_pool.h"
#include "core/vec.h"
#include "io/files/output_file.h"
#include "store/blocks/splat_block.h"
#include "store/blocks/splat_store.h"

namespace pounce::io {

/// The formats that Gaussians are written in, by the ending of the output.
enum class SplatOutput { ply, spz, glb };
/// Nothing for another ending.
std::optional<SplatOutput> splat_output(const std::string& path);

/// What writing takes: from beginning to end, and per row of a piece that is encoded.
struct SplatWriterCost {
  std::uint64_t fixed_bytes = 0, row_bytes = 0;
};
SplatWriterCost splat_writer_cost(SplatOutput kind, std::uint32_t lobes);

/// Throws Error(input), with the cure, where so many Gaussians are too many for the format that the
/// ending of `path` names.
void check_splat_count(const std::string& path, std::uint64_t splats, std::uint32_t lobes);

/// What a file of Gaussians says beside them.
struct SplatFileFacts {
  std::uint32_t lobes = 0;  ///< coefficients per Gaussian and channel, one of store::kLobesOfDegree
  store::SplatModel model = store::SplatModel::standard;
  bool is_linear = false;  ///< colours are linear light, not sRGB-coded
  Vec3d origin = {};       ///< was subtracted from the means; in the file they have it again
};

/// What a format has to know of all Gaussians before it can be finished.
struct SplatTally {
  Box3f box;  ///< of the means
  /// Gaussians by the binary exponent of their largest standard deviation, as single precision
  /// codes it: entry e has those of 2^(e - 127) to 2^(e - 126).
  std::array<std::uint64_t, 256> sizes{};
  std::uint64_t too_small = 0, too_large = 0, too_far = 0;  ///< for the format
  std::uint64_t clipped = 0;  ///< colours or harmonics beyond what it holds
  std::uint64_t normals = 0;  ///< Gaussians that have one
  void add(const SplatTally& other);
};

/// Consecutive Gaussians as a file has them: its columns, one behind the other.
struct SplatPiece {
  std::uint64_t rows = 0;
  PageVector<std::byte> bytes;
  SplatTally tally;
};

/// A file of Gaussians on its way, in memory that does not grow with their number: what a format
/// stores attribute by attribute waits in nameless files. It appears whole or not at all. Throws
/// Error(storage), and Error(input) where the format cannot hold these Gaussians, with the cure.
class SplatWriter {
 public:
  virtual ~SplatWriter() = default;

  /// Moves rows to where the file has them: to be called before encode(). Thread-safe.
  void place(store::SplatRows& rows) const;
  /// What rows become; their lobes are those of the facts. Thread-safe.
  SplatPiece encode(const store::SplatRows& rows) const;
  /// Appends what encode() made, in order. Not thread-safe.
  void append(const SplatPiece& piece);
  /// Finishes the file; nothing can be written afterwards. Calls `poll` often; what it throws ends
  /// the work, and there is no file.
  virtual void commit(const std::function<void()>& poll) = 0;

  std::uint64_t rows() const { return rows_; }
  /// Bytes in nameless files.
  std::uint64_t scratch_bytes() const { return files_.empty() ? 0 : rows_ * row_bytes(); }
  /// What was changed to fit into the format; complete after commit().
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// What the format has no place for.
  const std::vector<std::string>& notes() const { return notes_; }

 protected:
  /// Columns of splat_columns(). With `folder` they go to nameless files there, else there is one
  /// and it goes to the file.
  SplatWriter(const std::string& path, const SplatFileFacts& facts, SplatOutput kind,
              const ScratchFolder* folder);
  /// columns[k]: where rows.splats.size() rows of column k go.
  virtual void encode_columns(const store::SplatRows& rows, std::span<std::byte* const> columns,
                              SplatTally& tally) const = 0;
  /// A nameless file's bytes from the beginning to the end of what was appended, piece by piece.
  void for_column(std::size_t column, const std::function<void()>& poll,
                  const std::function<void(std::span<const std::byte>)>& take) const;
  void put(std::span<const std::byte> bytes);
  std::uint64_t row_bytes() const;
  const std::vector<std::uint32_t>& column_bytes() const { return column_bytes_; }
  /// Throws Error(input): "<path>: <what>".
  [[noreturn]] void refuse(const std::string& what) const;

  const std::string path_;
  const SplatFileFacts facts_;
  const Vec3d added_;  ///< to means: the origin, where the format has no other place for it
  OutputFile file_;
  SplatTally tally_;
  std::uint64_t rows_ = 0;
  std::vector<std::string> warnings_, notes_;

 private:
  const std::vector<std::uint32_t> column_bytes_;
  std::vector<std::unique_ptr<WriteFile>> files_;  ///< by column
};

/// Begins a file whose format its ending names; `folder` is for nameless files. Throws
/// Error(input) where the facts cannot be said in the format.
std::unique_ptr<SplatWriter> open_splat_writer(const std::string& path, const SplatFileFacts& facts,
                                               const ScratchFolder& folder);

/// What a 3DGS file keeps for a standard deviation, an opacity and a colour.
float log_sigma(float sigma);
float logit(float alpha);
float dc_of(float colour);

/// An SPZ of version 2, in gzip without a time: 24 bits per coordinate with as many of them behind
/// the point as the scene's extent leaves (20 at most), a byte for everything else.
std::unique_ptr<SplatWriter> open_spz_writer(const std::string& path, const SplatFileFacts& facts,
                                             const ScratchFolder& folder);

/// Permutes and flips an ellipsoid's axes so that its rotation turns as little as possible: of the
/// 24 ways the one with the largest w, which is at least 0.85. The ellipsoid stays the same.
void turn_least(store::Splat& splat);

}  // namespace pounce::io
