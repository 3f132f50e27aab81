// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/files/output_file.h"

namespace pounce::io {

/// One Gaussian as a 3DGS PLY without view dependence holds it.
struct SplatPlyRow {
  float position[3];
  float normal[3];
  float dc[3];        ///< (sRGB-coded colour - 0.5) / C0
  float opacity;      ///< logit of alpha
  float scale[3];     ///< natural logarithms of the standard deviations
  float rotation[4];  ///< quaternion w, x, y, z
};
static_assert(sizeof(SplatPlyRow) == 68);

/// The constant of the spherical harmonics of degree 0: colour = 0.5 + C0 * dc.
inline constexpr double kDegree0 = 0.28209479177387814;

/// Writes a 3DGS PLY (binary little endian, the column order of its first trainer) row by row in
/// constant memory; it appears whole or not at all. Throws Error(storage). Not thread-safe.
class SplatPlyWriter {
 public:
  explicit SplatPlyWriter(const std::string& path);
  void write(std::span<const SplatPlyRow> rows);
  std::uint64_t rows() const { return rows_; }
  /// Says in the header how many rows there are; nothing can be written afterwards.
  void commit();

 private:
  void write_header();

  OutputFile file_;
  std::uint64_t rows_ = 0;
};

}  // namespace pounce::io
