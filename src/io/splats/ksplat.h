// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/splats/batch.h"

namespace pounce::io {

/// A .ksplat of version 0.1: sections of Gaussians, each with its own buckets and degree of
/// harmonics (0 to 2), at compression level 0 (floats), 1 (halves) or 2 (harmonics in bytes).
class KsplatScene : public BatchScene {
 public:
  /// Reads all headers. Throws Error(input) where they and the file's size disagree,
  /// Error(storage).
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

}  // namespace pounce::io
