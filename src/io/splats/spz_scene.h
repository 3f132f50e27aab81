// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/splats/batch.h"

namespace pounce::io {

/// Does this file begin as an SPZ does, in gzip or not?
bool is_spz(const ReadFile& file);

/// An SPZ of version 1 to 4. Its attributes lie one behind the other, compressed, so prepare()
/// unpacks them; a file that is not compressed is read where it is.
class SpzScene : public BatchScene {
 public:
  /// Reads the header, in gzip too. Throws Error(input) beginning with `name`: where it is damaged,
  /// of an unknown version, or announces more Gaussians than its bytes can hold.
  /// Calls `poll` often where extensions are to be found behind the Gaussians.
  SpzScene(std::unique_ptr<ReadFile> file, const std::string& name, const Axes& axes,
           const std::function<void()>& poll);

  void prepare(const ScratchFolder& folder, const std::function<void()>& poll) override;
  std::uint64_t prepare_bytes() const override;
  std::uint64_t unpacked_bytes() const override;
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;
  std::uint32_t version() const { return version_; }
  /// How its axes lie by its own word, such as "RUB"; empty where it does not say.
  const std::string& own_axes() const { return own_axes_; }

 private:
  /// In the file's order.
  enum Block : std::size_t { kPositions, kAlphas, kColours, kScales, kRotations, kHarmonics };
  static constexpr std::size_t kBlocks = 6;
  struct Stream {
    std::uint64_t offset_bytes = 0, size_bytes = 0;
  };

  [[noreturn]] void fail(const std::string& what) const;
  void read_header(std::span<const std::byte, 16> raw);
  void read_contents();
  void find_extensions(const std::function<void()>& poll);
  void unpack_gzip(WriteFile& to, const std::function<void()>& poll);
  void unpack_streams(WriteFile& to, const std::function<void()>& poll) const;
  void read_extensions(std::span<const std::byte> records);
  void assume_axes();
  std::uint64_t block_bytes(std::size_t block) const { return info_.splats * row_bytes_[block]; }
  std::uint64_t content_bytes() const;

  std::unique_ptr<ReadFile> file_;
  std::string name_;
  Axes axes_;
  std::uint32_t version_ = 0;
  unsigned fraction_bits_ = 0;
  bool is_gzip_ = false, has_extensions_ = false;
  std::string own_axes_;
  std::array<std::uint64_t, kBlocks> row_bytes_{}, at_{};  ///< of a block in the unpacked file
  std::vector<Stream> streams_;                            ///< of version 4
  std::unique_ptr<WriteFile> scratch_;
  std::unique_ptr<ReadFile> unpacked_;
};

}  // namespace pounce::io
