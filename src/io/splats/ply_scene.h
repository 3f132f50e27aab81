// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "io/ply/ply_header.h"
#include "io/splats/batch.h"
#include "store/blocks/splat_store.h"

namespace pounce::io {

/// What the header of a splat PLY says, checked against the size of the file.
struct SplatPlyHeader {
  std::uint64_t splats = 0;   ///< rows
  std::uint64_t rows_at = 0;  ///< where the first row begins
  std::uint32_t row_bytes = 0;
  std::vector<PlyColumn> columns;  ///< in the file's order, all of them
  std::uint32_t sh_degree = 0;     ///< 0..4, by the number of f_rest columns
  store::SplatModel model = store::SplatModel::standard;

  /// Null where there is no such column.
  const PlyColumn* find(const std::string& name) const;
};

/// Is a column of that name part of a Gaussian? Any other means what its writer likes.
bool is_splat_column(std::string_view name);

/// Does this PLY hold Gaussians, in whatever form? Else it is a mesh, a point cloud, or damaged.
bool holds_splats(const ReadFile& file, const std::string& path);

/// Is it a SuperSplat compressed PLY: an element "vertex" that has packed positions?
bool is_compressed_ply(const ReadFile& file, const std::string& path);

/// A 3DGS PLY as trainers write it. Sigma = exp(scale_i), alpha = 1 / (1 + exp(-opacity)), colour =
/// 0.5 + C0 f_dc; of f_rest, which is channel by channel in the file, degrees 1 to 3.
class SplatPly : public BatchScene {
 public:
  /// Reads and checks the header: binary little endian, columns in any order, splat columns of any
  /// scalar type but i16, other elements beside the Gaussians. Throws Error(input) naming the file,
  /// what it holds instead (a mesh, a point cloud, text or big-endian data, fewer bytes than
  /// announced) and the cure, Error(storage).
  explicit SplatPly(const std::string& path, const Axes& axes = {});

  const SplatPlyHeader& header() const { return header_; }

  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  std::uint64_t piece_rows() const;
  void find_columns(const std::string& path);

  std::unique_ptr<ReadFile> file_;
  SplatPlyHeader header_;
  std::array<PlyColumn, 17> columns_;  ///< of what a Gaussian has; without a name: not in the file
  std::vector<PlyColumn> harmonics_;   ///< as SplatBatch::sh
};

/// SuperSplat's compressed PLY: 16 bytes per Gaussian, quantised between the bounds of its chunk of
/// 256, and a byte per coefficient of the harmonics. Throws Error(input) naming file, what is
/// missing or wrong, and the cure, Error(storage).
std::unique_ptr<SplatScene> open_compressed_ply(const std::string& path, const Axes& axes);

}  // namespace pounce::io
