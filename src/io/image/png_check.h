// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace pounce::io {

/// Follows the bytes of a PNG from start to end in pieces of any size and verifies what decoders
/// leave out: the checksum of every chunk that makes pixels, the last IDAT included, and that IEND
/// is there.
class PngCheck {
 public:
  /// The bytes at `offset`; what was seen before is skipped, what would leave a gap is ignored.
  void see(std::uint64_t offset, const std::byte* bytes, std::size_t count);
  /// First byte not seen yet.
  std::uint64_t position() const { return position_; }
  bool finished() const { return finished_; }  ///< IEND was seen
  /// "" or what is wrong.
  const std::string& problem() const { return problem_; }

 private:
  void step(const std::byte* bytes, std::size_t count);
  void end_of_header();
  void end_of_checksum();

  enum class Part { signature, header, data, checksum };
  Part part_ = Part::signature;
  std::uint64_t position_ = 0;
  std::uint32_t left_ = 8;    ///< bytes of this part to come
  std::uint32_t crc_ = 0;     ///< over the chunk's type and data
  std::uint32_t number_ = 0;  ///< big-endian number being gathered
  std::uint32_t length_ = 0;  ///< of the chunk's data
  std::array<char, 4> type_{};
  bool finished_ = false;
  std::string problem_;
};

}  // namespace pounce::io
