// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "core/file.h"
#include "core/job_space.h"
#include "core/vec.h"
#include "io/ply/ply_header.h"
#include "io/splats/batch.h"

namespace pounce::io {

/// What is read of a point, in this order.
enum class PointValue : std::uint8_t { x, y, z, red, green, blue, alpha, nx, ny, nz };
inline constexpr std::size_t kPointValues = 10;

/// Where a value is in its row, and what makes it the value that is meant: scale * stored + shift.
struct PointColumn {
  PlyType type = PlyType::f32;
  std::uint32_t offset = 0;
  double scale = 1, shift = 0;
};

/// Rows of points in a file: all of one length, binary, little endian.
struct PointRows {
  std::uint64_t at = 0, count = 0, stride = 0;
  std::array<std::optional<PointColumn>, kPointValues> columns;  ///< places and colours are there
  /// Is a row one that its file itself takes back? Null: none is.
  bool (*is_withheld)(const std::byte* row) = nullptr;

  std::optional<PointColumn>& operator[](PointValue v) {
    return columns[static_cast<std::size_t>(v)];
  }
};

/// What makes a colour of that type a fraction: integers are parts of their type's largest.
double fraction_of(PlyType type);

/// A coloured point cloud. Gaussians have one size, about the spacing, until
/// gaussian::make_discs() has seen their neighbours. Where the cloud lies far from 0 its info has
/// an origin, which places are counted from.
class PointScene : public BatchScene {
 public:
  // The file's own buffer and a piece of rows; then a sample and its coordinates.
  std::uint64_t prepare_bytes() const override;
  /// Throws Error(input) where convert() does.
  void prepare(const ScratchFolder& folder, const std::function<void()>& poll) override;
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 protected:
  PointScene(const std::string& path, const Axes& axes)
      : BatchScene(axes), path_(path), axes_(axes) {
    info_.are_points = true;
    info_.model = store::SplatModel::flat;
    info_.files = {path};
  }
  static constexpr std::uint64_t kPieceBytes = 256 << 10;

  /// The rows, as they are in the file; then, of a box in which most of the cloud is, in the file's
  /// axes, its origin.
  void set_rows(std::unique_ptr<ReadFile> file, const PointRows& rows);
  void set_origin(const Box3f& box);
  /// Where most of these are, without the outermost hundredth at each end: what scanners and
  /// programs put at 0 for "nothing" is not where a cloud is.
  static Box3f middle_of(std::array<std::vector<double>, 3>& places);
  /// The same of a sample of the rows.
  Box3f middle_box() const;
  /// Up to 65,536 rows evenly from the file: f(row).
  void for_sample(const std::function<void(const std::byte* row)>& f) const;
  /// A stored value as it is meant.
  static double value(const PointColumn& column, const std::byte* row);
  /// Where rows cannot be read as they are: makes such rows, whose places are counted from the
  /// origin, and calls set_rows().
  virtual void convert(const ScratchFolder&, const std::function<void()>&) {}

  const std::string path_;
  const Axes axes_;
  PointRows rows_;

 private:
  std::uint64_t piece_rows() const {
    return std::max<std::uint64_t>(kPieceBytes / rows_.stride, 1);
  }
  float usual_size();

  std::unique_ptr<ReadFile> file_;
  float size_ = 1;
};

/// Is a PLY a coloured point cloud: vertices with a place and a colour, which are no Gaussians, and
/// no faces? False for a damaged header.
bool is_point_ply(const ReadFile& file, const std::string& path);

/// A coloured point cloud as scanners, CloudCompare, MeshLab and photogrammetry write it: x y z,
/// red green blue (r g b, diffuse_red ...) and, if they are there, alpha and nx ny nz, of any
/// scalar type, as text or as binary of either byte order. Floats are colours of 0..1. What is not
/// binary little endian, or has lists in its rows, is converted into a scratch file by prepare().
/// Throws Error(input) naming file, what is wrong, and the cure, Error(storage).
std::unique_ptr<SplatScene> open_point_ply(const std::string& path, const Axes& axes);

/// True if the file begins as a LAS file does.
bool is_las(const ReadFile& file);

/// A LAS of version 1.2 to 1.4 with colours (point formats 2, 3, 5, 7, 8 and 10), not compressed.
/// Points that are withheld, or classified as noise, are transparent. Throws Error(input) naming
/// file, what is wrong (LAZ, no colours, a damaged header), and the cure, Error(storage).
std::unique_ptr<SplatScene> open_las(const std::string& path, const Axes& axes);

}  // namespace pounce::io
