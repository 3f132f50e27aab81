// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "core/file.h"
#include "core/job_space.h"
#include "core/vec.h"
#include "io/splats/scene.h"
#include "store/blocks/splat_block.h"
#include "store/blocks/splat_store.h"

namespace pounce::io {

/// Gaussians as the decoder of a format leaves them, a column per value: linear, in the file's
/// axes, of any value that the file can hold. About 60 KiB, to be kept on the heap.
struct SplatBatch {
  static constexpr std::size_t kRows = 256;  // 17 columns of them stay in the first-level cache
  using Column = std::array<float, kRows>;

  std::array<Column, 3> mean{}, sigma{}, colour{};
  std::array<Column, 4> rotation{};  ///< w, x, y, z, of any length
  Column alpha{};
  std::array<Column, 3> normal{};                  ///< of any length; zeros = none
  std::array<Column, 3 * store::kMostLobes> sh{};  ///< 3 k + channel, coefficient k from 0
};

/// What most formats store: logarithms of sigma, logits of alpha, the harmonic of degree 0 in place
/// of the colour. In place, for the first `rows`.
void exponential(SplatBatch::Column& column, std::size_t rows);
void logistic(SplatBatch::Column& column, std::size_t rows);
void colour_of_dc(SplatBatch::Column& column, std::size_t rows);

/// What turning (or mirroring) space does to spherical harmonics of degrees 1 to 3: the turned
/// coefficients show in direction M d what the old ones showed in direction d. Immutable.
class ShRotation {
 public:
  /// From the images of x, y and z, which are orthonormal.
  explicit ShRotation(const std::array<Vec3d, 3>& columns);
  explicit ShRotation(const Axes& axes);

  /// values[k * stride] for k < lobes (3, 8 or 15): the coefficients of one channel of one
  /// Gaussian.
  void apply(float* values, std::size_t stride, std::uint32_t lobes) const;

 private:
  std::array<std::array<float, 3>, 3> degree_1_;
  std::array<std::array<float, 5>, 5> degree_2_;
  std::array<std::array<float, 7>, 7> degree_3_;
};

/// A matrix as U diag(sigma) V^T; columns of U and V are orthonormal, sigma >= 0.
struct Decomposed {
  std::array<Vec3d, 3> u;
  std::array<double, 3> sigma;
  std::array<Vec3d, 3> v;
};
/// By Jacobi rotations of columns, which keep small singular values as exact as large ones.
Decomposed decompose(std::array<Vec3d, 3> columns);

/// Where a file places a group of Gaussians: any affine map. Means are mapped, covariances become
/// M Sigma M^T, harmonics turn with what is a rotation (or reflection) in M. Immutable.
class SplatPlacement {
 public:
  /// By the images of x, y and z, and of the origin.
  SplatPlacement(const std::array<Vec3d, 3>& columns, Vec3d offset);
  /// In place, for the first `rows`.
  void apply(SplatBatch& batch, std::size_t rows, std::uint32_t lobes) const;

 private:
  void turn(SplatBatch& batch, std::size_t i) const;
  void shear(SplatBatch& batch, std::size_t i) const;

  std::array<Vec3d, 3> columns_;
  Vec3d offset_;
  Decomposed parts_;
  bool is_identity_ = false, is_similarity_ = false;
  std::array<double, 4> rotation_{1, 0, 0, 0};  ///< of a similarity, its reflection left out
  ShRotation harmonics_;
};

/// A scene whose format gives batches: what is left to a format is where its values are. Which
/// Gaussians can be used is decided here, by the same rules for every format.
class BatchScene : public SplatScene {
 public:
  void prepare(const ScratchFolder&, const std::function<void()>&) override {}
  std::uint64_t prepare_bytes() const override { return 0; }
  std::uint64_t unpacked_bytes() const override { return 0; }
  void read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
            store::SplatCounts& filtered) const final;
  std::uint64_t read_bytes() const final;

  /// Fills `batch` with the next rows of [first, first + count) and calls take(rows), again and
  /// again. Of the harmonics, `lobes` per channel are asked for; columns beyond the file's degree
  /// are left alone. Throws Error(input), Error(storage).
  using Take = std::function<void(std::size_t rows)>;
  virtual void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                      SplatBatch& batch, const Take& take) const = 0;
  /// What decode() takes beside the batch.
  virtual std::uint64_t decode_bytes() const = 0;

 protected:
  explicit BatchScene(const Axes& axes) : turn_(axes), turn_harmonics_(axes) {}
  /// The file itself says how its axes lie: `axes` are those of the constructor after that.
  void set_axes(const Axes& axes) {
    turn_ = axes;
    turn_harmonics_ = ShRotation(axes);
  }

 private:
  void append(const SplatBatch& batch, std::size_t rows, store::SplatRows& out,
              store::SplatCounts& filtered) const;
  void append_harmonics(const SplatBatch& batch, std::size_t row, store::SplatRows& out) const;

  Axes turn_;
  ShRotation turn_harmonics_;
};

/// Rows that a format reads at once; small enough for a stack of buffers.
inline constexpr std::uint64_t kPieceRows = 4096;

/// Calls f(begin, rows) for [0, count) in steps of a batch.
template <class F>
void for_batches(std::uint64_t count, const F& f) {
  for (std::uint64_t begin = 0; begin < count; begin += SplatBatch::kRows)
    f(begin, static_cast<std::size_t>(std::min<std::uint64_t>(SplatBatch::kRows, count - begin)));
}

/// A little-endian value anywhere in a buffer.
template <class T>
T value_at(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

template <class T>
T read_value(const ReadFile& file, std::uint64_t offset) {
  std::array<std::byte, sizeof(T)> raw;
  file.read(offset, raw);
  return value_at<T>(raw.data());
}

inline float byte_at(const std::byte* from) {
  return static_cast<float>(std::to_integer<unsigned>(*from));
}

/// The component of a unit quaternion that was left out because it is the largest, from the others.
inline float largest_of_four(float a, float b, float c) {
  return std::sqrt(std::max(0.0F, 1 - a * a - b * b - c * c));
}
/// The whole quaternion, in the order of the file: `rest` around the one at `largest`.
inline std::array<float, 4> with_largest(std::size_t largest, const std::array<float, 3>& rest) {
  std::array<float, 4> q;
  for (std::size_t k = 0, next = 0; k < 4; ++k)
    q[k] = k == largest ? largest_of_four(rest[0], rest[1], rest[2]) : rest[next++];
  return q;
}

/// The formats that are a file each here and a class that nobody else needs. They throw
/// Error(input) naming what is wrong with the headers, Error(storage).

/// A .splat: records of 32 bytes and nothing else; 8 bits for colour, opacity and rotation.
std::unique_ptr<SplatScene> open_dot_splat(const std::string& path, const Axes& axes);
/// A .ksplat of version 0.1: sections of Gaussians, each with its own buckets and degree of
/// harmonics (0 to 2), at compression level 0 (floats), 1 (halves) or 2 (harmonics in bytes).
std::unique_ptr<SplatScene> open_ksplat(const std::string& path, const Axes& axes);
/// A SOG of version 1 or 2, in a folder, by its meta.json or bundled: a pixel per Gaussian in
/// lossless WebP images. prepare() unpacks these row by row; the palette of harmonics, at most 3
/// MiB, stays in memory.
std::unique_ptr<SplatScene> open_sog(const std::string& path, const Axes& axes);
/// The Gaussians of a glTF scene: all primitives of KHR_gaussian_splatting that it shows, one after
/// the other, placed by their nodes. Values come from accessors, or from SPZ in a buffer view, in
/// which `poll` is called as SpzScene calls it. Refused by name: another kernel, another
/// compression; more JSON than a scene can need.
std::unique_ptr<SplatScene> open_splat_gltf(const std::string& path, const Axes& axes,
                                            const std::function<void()>& poll);
/// Does a .gltf or .glb, whatever its name, hold a primitive of KHR_gaussian_splatting? Looks for
/// the word first, so that a mesh costs no more than one reading of its JSON.
bool is_splat_gltf(const std::string& path);

}  // namespace pounce::io
