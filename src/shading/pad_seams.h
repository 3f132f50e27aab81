// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace pounce::shading {

/// Streaming chart padding: every texel that is not covered and has a covered texel within `radius`
/// (Euclidean distance between centres, dx*dx + dy*dy <= radius*radius) gets the value of the
/// nearest covered texel by (distance, y, x); others become 0. Exact, in integers. Rows go in from
/// top to bottom in pieces of any size and come out `radius` rows later; what is ready must be
/// popped before the next push. Memory is O(width * radius) whatever the height. Not thread-safe.
class SeamPadder {
 public:
  /// Distances are kept in 16 bits; a larger radius throws Error(usage).
  static constexpr std::uint32_t kLargestRadius = 16384;
  /// What a texel that pop() hands out is.
  static constexpr std::uint8_t kEmpty = 0, kCovered = 1, kFilled = 2;

  SeamPadder(std::uint32_t width, std::uint32_t height, std::uint32_t radius,
             std::uint32_t texel_bytes, std::uint32_t largest_push_rows);
  ~SeamPadder();
  /// Bytes the object holds at its peak.
  static std::uint64_t memory_bytes(std::uint32_t width, std::uint32_t radius,
                                    std::uint32_t texel_bytes, std::uint32_t largest_push_rows);
  /// texels: rows * width * texel_bytes; covered: rows * width, 0 or 1. rows <= largest_push_rows.
  void push(std::uint32_t rows, const std::byte* texels, const std::uint8_t* covered);
  std::uint32_t ready_rows()
      const;  ///< rows that pop() can hand out now (all, after the last push)
  void pop(std::uint32_t rows, std::byte* texels);
  /// As above, and what each texel is.
  void pop(std::uint32_t rows, std::byte* texels, std::uint8_t* kinds);
  std::uint64_t filled() const;  ///< texels filled so far

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pounce::shading
