// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/splats/batch.h"
#include "io/splats/vp8l.h"

namespace pounce::io {

/// A SOG of version 1 or 2, in a folder, by its meta.json or bundled: a pixel per Gaussian in
/// lossless WebP images. prepare() unpacks these row by row; the palette of harmonics, at most 3
/// MiB, stays in memory.
class SogScene : public BatchScene {
 public:
  /// Reads meta.json and the headers of the images. Throws Error(input) where they are damaged or
  /// do not belong together, Error(storage).
  SogScene(const std::string& path, const Axes& axes);

  void prepare(const ScratchFolder& folder, const std::function<void()>& poll) override;
  std::uint64_t prepare_bytes() const override;
  std::uint64_t unpacked_bytes() const override;
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  enum Column : std::size_t { kMeansLow, kMeansHigh, kScales, kQuats, kSh0, kLabels };
  static constexpr std::size_t kColumns = 6;
  struct Image {
    std::shared_ptr<ReadFile> file;
    std::string name;
    Vp8lHeader header;
  };
  /// What a byte of a channel means.
  using Codebook = std::array<float, 256>;
  using Json = nlohmann::json;

  [[noreturn]] void fail(const std::string& what) const;
  Json open_meta(const std::string& path);
  Image open_image(const std::string& name) const;
  void read_meta(const Json& meta);
  void read_version_1(const Json& meta);
  void read_version_2(const Json& meta);
  void read_palette(const Json& meta);
  const Json& object(const Json& parent, const char* key) const;
  std::string file_name(const Json& part, const std::string& place, std::size_t index) const;
  std::vector<double> numbers(const Json& part, const std::string& place, const char* key,
                              std::size_t count) const;
  Codebook codebook(const Json& part, const std::string& place, float nothing) const;
  void unpack(const Image& image, const ScratchFolder& folder, const std::function<void()>& poll);
  void unpack_palette(const ScratchFolder& folder, const std::function<void()>& poll);
  void decode_row(const std::array<const std::byte*, kColumns>& row, std::size_t i,
                  std::uint32_t lobes, SplatBatch& batch) const;

  std::string path_, folder_;          ///< the folder; "" = in the archive
  std::shared_ptr<ReadFile> archive_;  ///< null = files in a folder
  struct Entry {
    std::string name;
    std::uint64_t at, bytes;
  };
  std::vector<Entry> entries_;  ///< beside meta.json in the archive
  std::string meta_name_;

  unsigned version_ = 2;
  std::array<Image, kColumns> images_;
  Image centroids_;
  std::array<double, 3> means_low_{}, means_span_{};
  std::array<Codebook, 3> scales_{}, colours_{};  ///< by channel
  Codebook alphas_{}, harmonics_{};
  bool has_palette_ = false;
  std::uint32_t lobes_ = 0;
  std::uint64_t palette_entries_ = 0;
  PageVector<std::uint8_t> palette_;  ///< entry by entry, 3 * lobes_ indices of harmonics_ each
  std::unique_ptr<WriteFile> scratch_;
  std::unique_ptr<ReadFile> unpacked_;
};

}  // namespace pounce::io
