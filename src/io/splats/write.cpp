// SPDX-License-Identifier: Apache-2.0
#include "io/splats/write.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/directions.h"
#include "core/portable_math.h"
#include "io/files/file_ending.h"
#include "io/splats/gltf_write.h"
#include "io/splats/ply_write.h"
#include "io/splats/spz_write.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::uint64_t kCopyBytes = 256 << 10;
/// A nameless file's buffer.
constexpr std::uint64_t kColumnBytes = 256 << 10;
/// The stream's buffer of 256 KiB; of an SPZ what zlib holds (262), what comes out of it (64), and
/// a piece's places in fixed point (192).
constexpr std::uint64_t kFinishBytes = 832 << 10;

/// Bytes per row of the columns that a format keeps.
std::vector<std::uint32_t> splat_columns(SplatOutput kind, std::uint32_t lobes) {
  constexpr std::uint32_t kPlyFloats = 17, kVector = 3 * sizeof(float);
  switch (kind) {
    case SplatOutput::ply:
      return {(kPlyFloats + 3 * lobes) * std::uint32_t{sizeof(float)}};
    case SplatOutput::spz: {
      std::vector<std::uint32_t> bytes{kVector, 1, 3, 3, 3};  // places become fixed point later
      if (lobes > 0) bytes.push_back(3 * lobes);
      return bytes;
    }
    case SplatOutput::glb:
      break;
  }
  std::vector<std::uint32_t> bytes{kVector, 4 * sizeof(float), kVector, sizeof(float), kVector};
  bytes.insert(bytes.end(), lobes, kVector);
  return bytes;
}

std::uint64_t sum(const std::vector<std::uint32_t>& values) {
  return std::accumulate(values.begin(), values.end(), std::uint64_t{0});
}

/// Of a disc without any thickness: its logarithm would be infinite.
constexpr float kLeastSigma = 1e-20F;
/// Alpha 0 and 1 have infinite logits. exp(-10) is a 22000th.
constexpr float kLargestLogit = 10;

}  // namespace

float log_sigma(float sigma) {
  return static_cast<float>(log_same(static_cast<double>(std::max(sigma, kLeastSigma))));
}

float logit(float alpha) {
  if (!(alpha > 0)) return -kLargestLogit;
  if (alpha >= 1) return kLargestLogit;
  const auto a = static_cast<double>(alpha);
  return std::clamp(static_cast<float>(log_same(a / (1 - a))), -kLargestLogit, kLargestLogit);
}

float dc_of(float colour) {
  return static_cast<float>((static_cast<double>(colour) - 0.5) / kShDegree0);
}

std::optional<SplatOutput> splat_output(const std::string& path) {
  const std::string ending = lower_ending(path);
  if (ending == ".ply") return SplatOutput::ply;
  if (ending == ".spz") return SplatOutput::spz;
  if (ending == ".glb") return SplatOutput::glb;
  return std::nullopt;
}

SplatWriterCost splat_writer_cost(SplatOutput kind, std::uint32_t lobes) {
  const std::vector<std::uint32_t> columns = splat_columns(kind, lobes);
  const std::uint64_t files = kind == SplatOutput::ply ? 0 : columns.size();
  return {files * kColumnBytes + kCopyBytes + kFinishBytes, sum(columns)};
}

void check_splat_count(const std::string& path, std::uint64_t splats, std::uint32_t lobes) {
  const SplatOutput kind = splat_output(path).value();
  const auto refuse_beyond = [&](std::uint64_t most, const std::string& why) {
    if (splats > most) throw Error(ErrorKind::input, fmt::format("{}: {}", path, why));
  };
  if (kind == SplatOutput::spz) {
    constexpr std::uint64_t kMost = 0x7FFFFFFF;
    refuse_beyond(kMost,
                  "an SPZ holds no more than 2^31 - 1 Gaussians; write a .ply, or fewer with "
                  "--count");
  }
  if (kind == SplatOutput::glb) {
    constexpr std::uint64_t kMostJsonBytes = 16 << 10;
    const std::uint64_t most = (std::numeric_limits<std::uint32_t>::max() - kMostJsonBytes) /
                               sum(splat_columns(kind, lobes));
    refuse_beyond(most, fmt::format("a .glb is no larger than 4 GiB, which is {} Gaussians of this "
                                    "kind; write a .ply or .spz, or fewer with --count",
                                    most));
  }
}

std::unique_ptr<SplatWriter> open_splat_writer(const std::string& path, const SplatFileFacts& facts,
                                               const ScratchFolder& folder) {
  switch (splat_output(path).value()) {
    case SplatOutput::ply:
      return std::make_unique<SplatPlyWriter>(path, facts);
    case SplatOutput::spz:
      return std::make_unique<SpzWriter>(path, facts, folder);
    case SplatOutput::glb:
      break;
  }
  return std::make_unique<GltfSplatWriter>(path, facts, folder);
}

void SplatTally::add(const SplatTally& other) {
  box.extend(other.box);
  for (std::size_t e = 0; e < sizes.size(); ++e) sizes[e] += other.sizes[e];
  too_small += other.too_small;
  too_large += other.too_large;
  too_far += other.too_far;
  clipped += other.clipped;
  normals += other.normals;
}

SplatWriter::SplatWriter(const std::string& path, const SplatFileFacts& facts, SplatOutput kind,
                         const ScratchFolder* folder)
    : path_(path),
      facts_(facts),
      added_(kind == SplatOutput::glb ? Vec3d{} : facts.origin),
      file_(path),
      column_bytes_(splat_columns(kind, facts.lobes)) {
  if (added_ != Vec3d{}) {
    const double farthest = std::max({std::abs(added_.x), std::abs(added_.y), std::abs(added_.z)});
    constexpr double kLastPlace = std::numeric_limits<float>::epsilon();
    notes_.push_back(
        fmt::format("{}: places are written in single precision, in steps of about {:.1g} this far "
                    "from 0; a .glb holds them in full, by a node's translation",
                    path_, farthest * kLastPlace));
  }
  if (folder == nullptr) return;
  for (std::size_t k = 0; k < column_bytes_.size(); ++k) files_.push_back(folder->create());
}

std::uint64_t SplatWriter::row_bytes() const { return sum(column_bytes_); }

void SplatWriter::refuse(const std::string& what) const {
  throw Error(ErrorKind::input, fmt::format("{}: {}", path_, what));
}

void SplatWriter::place(store::SplatRows& rows) const {
  if (added_ == Vec3d{}) return;
  for (store::Splat& s : rows.splats) s.mean = Vec3f(Vec3d(s.mean) + added_);
}

SplatPiece SplatWriter::encode(const store::SplatRows& rows) const {
  SplatPiece piece;
  piece.rows = rows.splats.size();
  piece.bytes.resize(piece.rows * row_bytes());
  std::vector<std::byte*> columns;
  std::byte* at = piece.bytes.data();
  for (const std::uint32_t bytes : column_bytes_) {
    columns.push_back(at);
    at += piece.rows * bytes;
  }
  for (const store::Splat& s : rows.splats) {
    piece.tally.box.extend(s.mean);
    ++piece.tally.sizes[std::bit_cast<std::uint32_t>(store::size_of(s)) >> 23 & 255];
    piece.tally.normals += s.normal != Vec3f{} ? 1 : 0;
  }
  encode_columns(rows, columns, piece.tally);
  return piece;
}

void SplatWriter::append(const SplatPiece& piece) {
  if (piece.rows == 0) return;  // a part of a source of which nothing is wanted
  check_splat_count(path_, rows_ + piece.rows, facts_.lobes);
  const std::byte* at = piece.bytes.data();
  for (std::size_t k = 0; k < column_bytes_.size(); ++k) {
    const std::span<const std::byte> bytes(at, piece.rows * column_bytes_[k]);
    files_.empty() ? put(bytes) : files_[k]->append(bytes);
    at += bytes.size();
  }
  rows_ += piece.rows;
  tally_.add(piece.tally);
}

void SplatWriter::put(std::span<const std::byte> bytes) {
  std::fwrite(bytes.data(), 1, bytes.size(), file_.stream());
  file_.check();  // a full disk ends the job now, not after the last row
}

void SplatWriter::for_column(std::size_t column, const std::function<void()>& poll,
                             const std::function<void(std::span<const std::byte>)>& take) const {
  const std::uint64_t row = column_bytes_[column], size = rows_ * row;
  PageVector<std::byte> piece(std::min(size, kCopyBytes / row * row));  // whole rows
  const auto from = files_[column]->reader();
  for (std::uint64_t at = 0; at < size; at += piece.size()) {
    const auto part = std::span(piece).first(std::min<std::uint64_t>(piece.size(), size - at));
    from->read(at, part);
    take(part);
    poll();
  }
}

}  // namespace pounce::io
