// SPDX-License-Identifier: Apache-2.0
//
// The two formats of viewers in the browser: rows that are copied to the graphics card as they are.
//
//   .splat    one row after the other, 32 bytes each, nothing else: no header, no mark. All that
//             can be checked is that the size is a whole number of rows.
//   .ksplat   a header of 4096 bytes, headers of 1024 bytes for each section, then the sections:
//             lengths of the buckets that are not full, centres of all buckets, rows. Compressed
//             rows hold positions as 16 bits around the centre of their bucket. Buckets are filled
//             in order: first the full ones, then those of any length.
//
//   offset        header of a .ksplat              header of a section
//        0        u8 major, u8 minor               u32 Gaussians
//        4        u32 sections                     u32 Gaussians that there is room for
//        8                                         u32 rows of a full bucket
//       12                                         u32 buckets
//       16                                         float edge of a bucket
//       20        u16 level                        (at 24:) u32 range of a stored position
//       32                                         u32 full buckets, u32 others
//       36        float, float range of harmonics  (at 40:) u16 degree of harmonics
//
// Both are read where they are, 4096 rows at a time, so nothing is unpacked and any range can be
// read at once. Every offset comes from the headers of a .ksplat and is compared with the size of
// the file when these are read; the lengths of partly filled buckets are the only part that is kept
// in memory, and their number is limited.
//
// Neither format states its axes or how its scene was trained: both are read as stored.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "core/input_file.h"
#include "core/portable_math.h"
#include "io/problems.h"
#include "io/splats/batch.h"

namespace pounce::io {
namespace {

/// mean, sigma: 3 floats each; 4 bytes RGBA; 4 bytes WXYZ.
constexpr std::uint64_t kRecordBytes = 32;

class DotSplat : public BatchScene {
 public:
  DotSplat(const std::string& path, const Axes& axes);
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  std::unique_ptr<ReadFile> file_;
};

DotSplat::DotSplat(const std::string& path, const Axes& axes)
    : BatchScene(axes), file_(open_input(path)) {
  const std::uint64_t size = file_->size_bytes();
  // A file of another kind with a fitting size would be read as noise. So it is the ending that
  // decides, after all formats that have a mark (scene.cpp).
  if (size == 0 || size % kRecordBytes != 0) {
    refuse(path,
           "a .splat consists of records of {} bytes, but this file has {} bytes; it is truncated "
           "or in another format, export it again",
           kRecordBytes, size);
  }
  info_.format = ".splat";
  info_.splats = size / kRecordBytes;
  info_.files = {path};
}

std::uint64_t DotSplat::decode_bytes() const { return round_to_pages(kPieceRows * kRecordBytes); }

void DotSplat::decode(std::uint64_t first, std::uint64_t count, std::uint32_t, SplatBatch& batch,
                      const Take& take) const {
  PageVector<std::byte> raw(std::min(count, kPieceRows) * kRecordBytes);
  for (const std::uint64_t end = first + count; first < end;) {
    const std::uint64_t rows = std::min(end - first, kPieceRows);
    file_->read(first * kRecordBytes, std::span(raw).first(rows * kRecordBytes));
    for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i) {
        const std::byte* const at = &raw[(begin + i) * kRecordBytes];
        for (std::size_t k = 0; k < 3; ++k) {
          batch.mean[k][i] = value_at<float>(at + 4 * k);
          batch.sigma[k][i] = value_at<float>(at + 12 + 4 * k);
          batch.colour[k][i] = byte_at(at + 24 + k) / 255;
        }
        batch.alpha[i] = byte_at(at + 27) / 255;
        for (std::size_t k = 0; k < 4; ++k)
          // Of any length: BatchScene makes unit quaternions of them.
          batch.rotation[k][i] = (byte_at(at + 28 + k) - 128) / 128;
      }
      take(n);
    });
    first += rows;
  }
}

constexpr std::uint64_t kFileHeaderBytes = 4096, kSectionHeaderBytes = 1024, kCentreBytes = 12;
constexpr std::uint32_t kMostSections = 4096;
constexpr std::uint64_t kMostPartialBuckets = 1 << 18;  // of all sections: 2 MiB of starts
constexpr std::uint64_t kMostRowBytes = 44 + 4 * 24;
/// Coefficients per channel by degree.
constexpr std::array<std::uint32_t, 3> kLobes{0, 3, 8};

class KsplatScene : public BatchScene {
 public:
  /// Reads all headers: where they and the file's size disagree, the file is refused.
  KsplatScene(const std::string& path, const Axes& axes);
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  struct Section {
    std::uint64_t first = 0, count = 0;  ///< of its Gaussians in the file
    std::uint64_t centres_at = 0, rows_at = 0;
    std::uint64_t buckets = 0, full_rows = 0, bucket_rows = 0;
    std::uint32_t lobes = 0, row_bytes = 0;
    float step = 0, range = 0;  ///< position = (stored - range) * step + bucket centre
    /// Rows in front of each bucket that is not full, and behind the last.
    std::vector<std::uint64_t> partial_starts;

    std::uint64_t bucket_of(std::uint64_t row) const;
  };

  [[noreturn]] void fail(const std::string& what) const;
  void read_section(std::uint64_t header_at, std::uint64_t& data_at);
  void read_partial_buckets(std::uint64_t at, std::uint64_t count, Section& section);
  void decode_section(const Section& section, std::uint64_t first, std::uint64_t count,
                      std::uint32_t lobes, SplatBatch& batch, const Take& take) const;
  void decode_row(const Section& section, const std::byte* row, const float* centre,
                  std::uint32_t lobes, std::size_t i, SplatBatch& batch) const;
  float harmonic(const std::byte* from, std::size_t index) const;

  std::unique_ptr<ReadFile> file_;
  std::string path_;
  unsigned level_ = 0;
  float least_harmonic_ = 0, most_harmonic_ = 0;
  std::vector<Section> sections_;
};

// Full buckets are found by dividing, the others by where they begin.
std::uint64_t KsplatScene::Section::bucket_of(std::uint64_t row) const {
  if (row < full_rows) return row / bucket_rows;
  const auto after = std::upper_bound(partial_starts.begin(), partial_starts.end(), row);
  return full_rows / bucket_rows + static_cast<std::uint64_t>(after - partial_starts.begin()) - 1;
}

void KsplatScene::fail(const std::string& what) const {
  refuse(path_, "{}; export it again, for example with splat-transform {} SCENE.ply", what, path_);
}

KsplatScene::KsplatScene(const std::string& path, const Axes& axes)
    : BatchScene(axes), file_(open_input(path)), path_(path) {
  const std::uint64_t size = file_->size_bytes();
  if (size < kFileHeaderBytes) fail("the .ksplat header is truncated");
  const auto major = read_value<std::uint8_t>(*file_, 0),
             minor = read_value<std::uint8_t>(*file_, 1);
  if (major != 0 || minor < 1)
    fail(fmt::format("has .ksplat version {}.{}, but only 0.1 is supported", major, minor));
  // Writers leave the number of sections in use at 0; those beyond it are empty.
  const auto sections = read_value<std::uint32_t>(*file_, 4);
  level_ = read_value<std::uint16_t>(*file_, 20);
  if (level_ > 2) fail(fmt::format("has compression level {}, but only 0 to 2 are known", level_));
  if (sections > kMostSections)
    fail(fmt::format("has {} sections, but at most {} are allowed", sections, kMostSections));
  // The range of harmonics that are stored as bytes (level 2).
  least_harmonic_ = read_value<float>(*file_, 36);
  most_harmonic_ = read_value<float>(*file_, 40);
  // Files of before these fields hold zeros; writers of then used this range.
  if (least_harmonic_ == 0) least_harmonic_ = -1.5F;
  if (most_harmonic_ == 0) most_harmonic_ = 1.5F;
  std::uint64_t data_at = kFileHeaderBytes + kSectionHeaderBytes * sections;
  if (data_at > size) fail("its section headers are truncated");
  // In order, since each section begins where the one before it ends.
  for (std::uint32_t k = 0; k < sections; ++k)
    read_section(kFileHeaderBytes + kSectionHeaderBytes * k, data_at);
  if (info_.splats == 0) fail("the .ksplat holds no Gaussians");
  info_.format = fmt::format(".ksplat (level {})", level_);
  info_.files = {path};
}

// Sections follow each other without gaps: `data_at` is where this one begins, and becomes where
// the next one does. Room for rows counts, not the rows that are filled.
void KsplatScene::read_section(std::uint64_t header_at, std::uint64_t& data_at) {
  std::array<std::byte, 42> raw;
  file_->read(header_at, raw);
  const auto u32 = [&](std::size_t at) { return value_at<std::uint32_t>(&raw[at]); };
  Section section;
  section.first = info_.splats;
  section.count = u32(0);
  const std::uint64_t most_rows = u32(4), full = u32(32), partial = u32(36);
  const auto degree = value_at<std::uint16_t>(&raw[40]);
  section.bucket_rows = u32(8);
  section.buckets = u32(12);
  // 0 stands for the usual range, which depends on the level.
  section.range = static_cast<float>(u32(24) == 0 ? (level_ == 0 ? 1 : 32767) : u32(24));
  section.step = value_at<float>(&raw[16]) / 2 / section.range;
  if (degree >= kLobes.size())
    fail(fmt::format("has spherical harmonics of degree {}, but at most 2 is allowed", degree));
  section.lobes = kLobes[degree];
  const std::uint32_t harmonic_bytes = level_ == 0 ? 4 : level_ == 1 ? 2 : 1;
  section.row_bytes = (level_ == 0 ? 44U : 24U) + 3 * section.lobes * harmonic_bytes;
  if (section.count > most_rows) fail("a section has more Gaussians than its capacity");
  section.centres_at = data_at + 4 * partial;
  section.rows_at = section.centres_at + kCentreBytes * section.buckets;
  const std::uint64_t end = section.rows_at + most_rows * section.row_bytes;
  if (end > file_->size_bytes()) {
    fail(fmt::format("a section states {} Gaussians of {} bytes, beyond the end of the file",
                     most_rows, section.row_bytes));
  }
  // Level 0 has no buckets: bucket_rows may be 0 there, and is divided by all the same.
  section.full_rows = std::min(full * section.bucket_rows, section.count);
  section.bucket_rows = std::max<std::uint64_t>(section.bucket_rows, 1);
  if (level_ > 0 && full + partial > section.buckets)
    fail("a section has fewer buckets than it fills");
  if (level_ > 0 && section.count > 0) read_partial_buckets(data_at, partial, section);
  data_at = end;
  info_.splats += section.count;
  info_.sh_degree = std::max<std::uint32_t>(info_.sh_degree, degree);
  sections_.push_back(std::move(section));
}

void KsplatScene::read_partial_buckets(std::uint64_t at, std::uint64_t count, Section& section) {
  std::uint64_t before = count;
  for (const Section& other : sections_) before += other.partial_starts.size();
  if (before > kMostPartialBuckets) fail("has more partly filled buckets than possible");
  std::vector<std::uint32_t> lengths(count);
  file_->read(at, std::as_writable_bytes(std::span(lengths)));
  // Empty buckets are refused: a piece of rows then meets no more buckets than it has rows, which
  // bounds what decode_section() reads of their centres.
  section.partial_starts = {section.full_rows};
  for (const std::uint32_t length : lengths) {
    if (length == 0) fail("has an empty bucket");
    section.partial_starts.push_back(section.partial_starts.back() + length);
  }
  if (section.partial_starts.back() < section.count)
    fail("its buckets do not contain all Gaussians of their section");
}

std::uint64_t KsplatScene::decode_bytes() const {
  return round_to_pages(kPieceRows * kMostRowBytes) +
         round_to_pages((kPieceRows + 1) * kCentreBytes) +
         kMostPartialBuckets * sizeof(std::uint64_t);
}

// A range may meet several sections: each gives its share, in the order of the file.
void KsplatScene::decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                         SplatBatch& batch, const Take& take) const {
  for (const Section& section : sections_) {
    const std::uint64_t from = std::max(first, section.first);
    const std::uint64_t end = std::min(first + count, section.first + section.count);
    if (from >= end) continue;
    for (auto& column : batch.sh) column.fill(0);  // sections differ in their degrees
    decode_section(section, from - section.first, end - from, lobes, batch, take);
  }
}

void KsplatScene::decode_section(const Section& section, std::uint64_t first, std::uint64_t count,
                                 std::uint32_t lobes, SplatBatch& batch, const Take& take) const {
  PageVector<std::byte> raw(std::min(count, kPieceRows) * section.row_bytes);
  PageVector<float> centres;
  for (const std::uint64_t end = first + count; first < end;) {
    const std::uint64_t rows = std::min(end - first, kPieceRows);
    file_->read(section.rows_at + first * section.row_bytes,
                std::span(raw).first(rows * section.row_bytes));
    const bool has_buckets = level_ > 0;
    const std::uint64_t bucket = has_buckets ? section.bucket_of(first) : 0;
    if (has_buckets) {  // no bucket is empty, so there are no more than rows
      centres.resize(3 * (section.bucket_of(first + rows - 1) + 1 - bucket));
      file_->read(section.centres_at + bucket * kCentreBytes,
                  std::as_writable_bytes(std::span(centres)));
    }
    for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i) {
        const std::uint64_t row = first + begin + i;
        const float* const centre =
            has_buckets ? &centres[3 * (section.bucket_of(row) - bucket)] : nullptr;
        decode_row(section, &raw[(begin + i) * section.row_bytes], centre, lobes, i, batch);
      }
      take(n);
    });
    first += rows;
  }
}

float KsplatScene::harmonic(const std::byte* from, std::size_t index) const {
  // Floats, halves, or bytes over the range that the header states.
  if (level_ == 0) return value_at<float>(from + 4 * index);
  if (level_ == 1) return half_to_float(value_at<std::uint16_t>(from + 2 * index));
  return least_harmonic_ + byte_at(from + index) / 255 * (most_harmonic_ - least_harmonic_);
}

void KsplatScene::decode_row(const Section& section, const std::byte* row, const float* centre,
                             std::uint32_t lobes, std::size_t i, SplatBatch& batch) const {
  const std::size_t width = level_ == 0 ? 4 : 2;  // of sigma and rotation
  const auto number = [&](const std::byte* at, std::size_t k) {
    return level_ == 0 ? value_at<float>(at + 4 * k)
                       : half_to_float(value_at<std::uint16_t>(at + 2 * k));
  };
  const std::byte* const sigma = row + 3 * width;
  const std::byte* const rotation = sigma + 3 * width;
  const std::byte* const colour = rotation + 4 * width;
  for (std::size_t k = 0; k < 3; ++k) {
    batch.mean[k][i] =
        centre == nullptr
            ? value_at<float>(row + 4 * k)
            : (value_at<std::uint16_t>(row + 2 * k) - section.range) * section.step + centre[k];
    batch.sigma[k][i] = number(sigma, k);
    batch.colour[k][i] = byte_at(colour + k) / 255;
  }
  for (std::size_t k = 0; k < 4; ++k) batch.rotation[k][i] = number(rotation, k);
  batch.alpha[i] = byte_at(colour + 3) / 255;
  // Degree by degree, and in each of them channel by channel.
  std::size_t stored = 0;
  for (std::size_t degree = 1; degree < kLobes.size(); ++degree) {
    if (kLobes[degree] > std::min(lobes, section.lobes)) break;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = kLobes[degree - 1]; k < kLobes[degree]; ++k)
        batch.sh[3 * k + c][i] = harmonic(colour + 4, stored++);
    }
  }
}

}  // namespace

std::unique_ptr<SplatScene> open_dot_splat(const std::string& path, const Axes& axes) {
  return std::make_unique<DotSplat>(path, axes);
}

std::unique_ptr<SplatScene> open_ksplat(const std::string& path, const Axes& axes) {
  return std::make_unique<KsplatScene>(path, axes);
}

}  // namespace pounce::io
