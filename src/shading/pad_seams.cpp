// SPDX-License-Identifier: Apache-2.0
#include "shading/pad_seams.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "pounce/error.h"

// The nearest covered texel of every uncovered one, exactly and in one pass over the rows.
//
// Squared distance is dx^2 + dy^2, so the search splits. In a column only the nearest covered texel
// above and the nearest below can win; with g the nearer of the two distances (above wins a tie:
// smaller y), a column c offers a texel x of the row the value (x - c)^2 + g(c)^2: a parabola over
// the row. Wanted is the lower envelope of these parabolas. Two of them cross once, and where they
// are equal (row, column) decides, so there is one first x at which the right one wins; found in
// integers, the envelope is exact, ties included. It is built with a stack, each column pushed and
// popped at most once (Felzenszwalb and Huttenlocher's distance transform).
//
// The columns at the ends of an uncovered run are covered (g = 0) and beat everything beyond them,
// so runs are independent, and a row without uncovered texels costs its copies.
//
// Kept: the rows that are not final yet (a row is final when `radius` more have come), how far
// below the next covered texel is for the rows being made final, and per column the last covered
// texel's value.
//
// Measured at 4096^2, 60 % covered, RGB, one core: charts of 300 texels 9 ns per empty texel at
// radius 32 (20 at 128, where three times as many get a value), charts of 40 texels 31, speckles of
// 3 texels (10 % covered) 40; a row without empty texels 1 ns per texel.
namespace pounce::shading {
namespace {

/// Rows made final together: the pass upwards visits `radius` rows more than these.
constexpr std::uint32_t kLeastBatch = 64;

std::uint32_t batch_rows(std::uint32_t radius, std::uint32_t largest_push_rows) {
  return std::max(1U, std::min(largest_push_rows, std::max(kLeastBatch, radius)));
}

/// A column's offer to the texels of a row.
struct Parabola {
  std::int32_t column;
  std::int32_t height;  ///< rows to the covered texel: negative above, positive below
  std::int32_t start;   ///< first x at which it beats those before it
};

/// The first x at which q, right of p, beats p.
std::int32_t first_won(const Parabola& p, const Parabola& q) {
  const std::int64_t apart = q.column - p.column;
  const std::int64_t numerator = apart * (std::int64_t{q.column} + p.column) +
                                 std::int64_t{q.height} * q.height -
                                 std::int64_t{p.height} * p.height;
  // q needs 2 x apart >= numerator, and > where a tie goes to p: that of the smaller row, or else
  // the left one.
  const std::int64_t needed = numerator + (p.height <= q.height ? 1 : 0);
  if (apart == 1) return static_cast<std::int32_t>((needed + 1) >> 1);
  const std::int64_t divisor = 2 * apart;
  const std::int64_t quotient = needed / divisor;
  return static_cast<std::int32_t>(quotient + (needed % divisor > 0 ? 1 : 0));
}

}  // namespace

struct SeamPadder::Impl {
  Impl(std::uint32_t width_texels, std::uint32_t height_texels, std::uint32_t radius_texels,
       std::uint32_t bytes, std::uint32_t most_rows)
      : width(width_texels),
        height(height_texels),
        radius(radius_texels),
        texel_bytes(bytes),
        largest_push_rows(most_rows) {}

  const std::uint32_t width, height, radius, texel_bytes, largest_push_rows;
  std::uint32_t capacity = 0;                       // rows in the ring
  std::uint32_t pushed = 0, final = 0, popped = 0;  // rows so far
  std::uint64_t filled = 0;
  std::vector<std::byte> texels;      // ring
  std::vector<std::uint8_t> covered;  // ring
  std::vector<std::int16_t> below;    // rows to the next covered texel below, per row of the batch
  std::vector<std::int16_t> below_now;  // the same for the row the pass upwards has reached
  std::vector<std::int16_t>
      above;  // rows to the last covered texel above, for the row being filled
  std::vector<std::byte> above_texels;  // its value
  std::vector<std::int32_t> reach;      // by height: the largest dx within the radius
  std::vector<Parabola> envelope;
  std::vector<std::pair<std::int32_t, std::int32_t>> filled_runs;  // of the row being filled

  std::byte* row_texels(std::uint32_t y) {
    return texels.data() + std::size_t{y % capacity} * width * texel_bytes;
  }
  std::uint8_t* row_covered(std::uint32_t y) {
    return covered.data() + std::size_t{y % capacity} * width;
  }

  void make_final(std::uint32_t end);
  void measure_below(std::uint32_t end);
  void fill_row(std::uint32_t y, const std::int16_t* below_row);
  void fill_run(std::uint32_t y, std::int32_t begin, std::int32_t end,
                const std::int16_t* below_row);
  void add_to_envelope(Parabola offer);
  template <std::size_t kTexelBytes>
  void copy_segments(std::uint32_t y, std::int32_t begin, std::int32_t end);
  void remember_row(std::uint32_t y);
};

/// Fills `below` for the rows [final, end).
//
// The pass upwards. It begins `radius` rows below the batch, as far as any row of it may look, and
// carries each column's distance along. The larger the batch, the less often the rows below it are
// visited again.
void SeamPadder::Impl::measure_below(std::uint32_t end) {
  const auto none = static_cast<std::int16_t>(radius + 1);
  std::fill(below_now.begin(), below_now.end(), none);
  const std::uint32_t bottom =
      static_cast<std::uint32_t>(std::min<std::uint64_t>(pushed, std::uint64_t{end} + radius));
  for (std::uint32_t y = bottom; y-- > final;) {
    const std::uint8_t* const row = row_covered(y);
    for (std::uint32_t x = 0; x < width; ++x) {
      // The distance grows with every row and saturates one beyond the radius. covered - 1 is all
      // ones or all zeros: without a branch, the loop becomes vectors.
      const auto further = static_cast<std::int16_t>(std::min(below_now[x], none) + 1);
      below_now[x] = static_cast<std::int16_t>(further & (row[x] - 1));  // 0 where covered
    }
    if (y < end)
      std::copy(below_now.begin(), below_now.end(),
                below.begin() + std::ptrdiff_t{y - final} * width);
  }
}

void SeamPadder::Impl::make_final(std::uint32_t end) {
  const std::uint32_t batch = batch_rows(radius, largest_push_rows);
  while (final < end) {
    const std::uint32_t stop = std::min(end, final + batch);
    measure_below(stop);
    for (std::uint32_t y = final; y < stop; ++y) {
      fill_row(y, below.data() + std::size_t{y - final} * width);
      remember_row(y);
      // Nothing looks at this row's flags any more, so they can tell what became of it.
      for (const auto& [from, to] : filled_runs)
        std::memset(row_covered(y) + from, kFilled, static_cast<std::size_t>(to - from));
    }
    final = stop;
  }
}

void SeamPadder::Impl::fill_row(std::uint32_t y, const std::int16_t* below_row) {
  filled_runs.clear();
  const std::uint8_t* const row = row_covered(y);
  const std::uint8_t* const row_end = row + width;
  for (const std::uint8_t* at = row; at < row_end;) {
    const auto* const begin = static_cast<const std::uint8_t*>(
        std::memchr(at, 0, static_cast<std::size_t>(row_end - at)));
    if (begin == nullptr) return;
    const auto* end = static_cast<const std::uint8_t*>(
        std::memchr(begin, 1, static_cast<std::size_t>(row_end - begin)));
    if (end == nullptr) end = row_end;
    fill_run(y, static_cast<std::int32_t>(begin - row), static_cast<std::int32_t>(end - row),
             below_row);
    at = end;
  }
}

void SeamPadder::Impl::add_to_envelope(Parabola offer) {
  // -1 stands for "from the start of the row": every column of the run is at or after it.
  offer.start = -1;
  while (!envelope.empty()) {
    offer.start = first_won(envelope.back(), offer);
    if (offer.start > envelope.back().start) break;
    envelope.pop_back();  // beaten before it begins
    offer.start = -1;
  }
  envelope.push_back(offer);
}

/// Gives the uncovered texels [begin, end) of row y their values.
void SeamPadder::Impl::fill_run(std::uint32_t y, std::int32_t begin, std::int32_t end,
                                const std::int16_t* below_row) {
  std::memset(row_texels(y) + static_cast<std::size_t>(begin) * texel_bytes, 0,
              static_cast<std::size_t>(end - begin) * texel_bytes);
  envelope.clear();
  if (begin > 0) add_to_envelope({begin - 1, 0, 0});
  const auto most = static_cast<std::int16_t>(radius);
  for (std::int32_t x = begin; x < end; ++x) {
    // `above` still is the distance from the row before.
    const auto up = static_cast<std::int16_t>(above[static_cast<std::size_t>(x)] + 1);
    const std::int16_t down = below_row[x];
    if (std::min(up, down) > most) continue;
    add_to_envelope({x, up <= down ? -up : down, 0});
  }
  if (end < static_cast<std::int32_t>(width)) add_to_envelope({end, 0, 0});
  switch (texel_bytes) {
    case 1:
      return copy_segments<1>(y, begin, end);
    case 2:
      return copy_segments<2>(y, begin, end);
    case 3:
      return copy_segments<3>(y, begin, end);
    case 4:
      return copy_segments<4>(y, begin, end);
    case 6:
      return copy_segments<6>(y, begin, end);
    case 8:
      return copy_segments<8>(y, begin, end);
    case 12:
      return copy_segments<12>(y, begin, end);
    case 16:
      return copy_segments<16>(y, begin, end);
    default:
      return copy_segments<0>(y, begin, end);
  }
}

/// Copies each parabola's texel to the part of [begin, end) that it wins and reaches. kTexelBytes
/// 0: any size.
template <std::size_t kTexelBytes>
void SeamPadder::Impl::copy_segments(std::uint32_t y, std::int32_t begin, std::int32_t end) {
  const std::size_t bytes = kTexelBytes == 0 ? texel_bytes : kTexelBytes;
  std::byte* const row = row_texels(y);
  for (std::size_t i = 0; i < envelope.size(); ++i) {
    const Parabola& p = envelope[i];
    // The envelope ignores the radius, which only cuts: a texel whose nearest is too far has no
    // other.
    const std::int32_t far = reach[static_cast<std::size_t>(std::abs(p.height))];
    const std::int32_t from = std::max({begin, p.start, p.column - far});
    const std::int32_t next = i + 1 < envelope.size() ? envelope[i + 1].start : end;
    const std::int32_t to = std::min({end, next, p.column + far + 1});
    if (from >= to) continue;
    const std::byte* const source_row =
        p.height < 0 ? above_texels.data() : row_texels(y + static_cast<std::uint32_t>(p.height));
    const std::byte* const source = source_row + static_cast<std::size_t>(p.column) * bytes;
    for (std::int32_t x = from; x < to; ++x)
      std::memcpy(row + static_cast<std::size_t>(x) * bytes, source, bytes);
    filled += static_cast<std::uint64_t>(to - from);
    filled_runs.emplace_back(from, to);
  }
}

/// Brings `above` and its values to row y: what the rows below will see.
void SeamPadder::Impl::remember_row(std::uint32_t y) {
  const std::uint8_t* const row = row_covered(y);
  // Only covered texels go on, never what was filled: values would creep on from row to row.
  const auto most = static_cast<std::int16_t>(radius);
  for (std::uint32_t x = 0; x < width; ++x) {
    const auto further = static_cast<std::int16_t>(std::min(above[x], most) + 1);
    above[x] = static_cast<std::int16_t>(further & (row[x] - 1));
  }
  const std::byte* const values = row_texels(y);
  const std::uint8_t* const row_end = row + width;
  for (const std::uint8_t* at = row; at < row_end;) {
    const auto* const begin = static_cast<const std::uint8_t*>(
        std::memchr(at, 1, static_cast<std::size_t>(row_end - at)));
    if (begin == nullptr) return;
    const auto* end = static_cast<const std::uint8_t*>(
        std::memchr(begin, 0, static_cast<std::size_t>(row_end - begin)));
    if (end == nullptr) end = row_end;
    std::memcpy(above_texels.data() + static_cast<std::size_t>(begin - row) * texel_bytes,
                values + static_cast<std::size_t>(begin - row) * texel_bytes,
                static_cast<std::size_t>(end - begin) * texel_bytes);
    at = end;
  }
}

SeamPadder::SeamPadder(std::uint32_t width, std::uint32_t height, std::uint32_t radius,
                       std::uint32_t texel_bytes, std::uint32_t largest_push_rows)
    : impl_(std::make_unique<Impl>(width, height, radius, texel_bytes, largest_push_rows)) {
  if (radius > kLargestRadius) {
    throw Error(ErrorKind::usage, fmt::format("a padding of {} texels is too wide; {} is the most",
                                              radius, kLargestRadius));
  }
  Impl& self = *impl_;
  // Rows that still may change, and one push of new ones.
  self.capacity = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(height, std::uint64_t{radius} + largest_push_rows));
  self.texels.resize(std::size_t{self.capacity} * width * texel_bytes);
  self.covered.resize(std::size_t{self.capacity} * width);
  self.below.resize(std::size_t{batch_rows(radius, largest_push_rows)} * width);
  self.below_now.resize(width);
  self.above.assign(width, static_cast<std::int16_t>(radius + 1));
  self.above_texels.resize(std::size_t{width} * texel_bytes);
  self.envelope.reserve(std::size_t{width} + 2);
  self.filled_runs.reserve(std::size_t{width} + 2);
  for (std::uint32_t g = 0; g <= radius; ++g) {
    const std::uint32_t square =
        radius * radius - g * g;  // at most 2^28: the root of it in double is exact
    self.reach.push_back(static_cast<std::int32_t>(std::sqrt(static_cast<double>(square))));
  }
}

SeamPadder::~SeamPadder() = default;

std::uint64_t SeamPadder::memory_bytes(std::uint32_t width, std::uint32_t radius,
                                       std::uint32_t texel_bytes, std::uint32_t largest_push_rows) {
  const std::uint64_t ring = (std::uint64_t{radius} + largest_push_rows) * (texel_bytes + 1);
  const std::uint64_t rows = batch_rows(radius, largest_push_rows) * std::uint64_t{2} + 4 +
                             texel_bytes + sizeof(Parabola) +
                             sizeof(std::pair<std::int32_t, std::int32_t>);
  return (ring + rows) * width + std::uint64_t{radius} * 8 + 4096;
}

void SeamPadder::push(std::uint32_t rows, const std::byte* texels, const std::uint8_t* covered) {
  Impl& self = *impl_;
  if (rows > self.largest_push_rows || rows > self.height - self.pushed ||
      self.pushed + rows - self.popped > self.capacity) {
    throw Error(ErrorKind::internal,
                fmt::format("SeamPadder: {} rows pushed after {}, {} of them popped", rows,
                            self.pushed, self.popped));
  }
  for (std::uint32_t i = 0; i < rows; ++i, ++self.pushed) {
    const std::size_t row_bytes = std::size_t{self.width} * self.texel_bytes;
    std::memcpy(self.row_texels(self.pushed), texels + i * row_bytes, row_bytes);
    std::memcpy(self.row_covered(self.pushed), covered + std::size_t{i} * self.width, self.width);
  }
  if (self.pushed == self.height) {
    self.make_final(self.height);
  } else if (self.pushed > self.radius) {
    self.make_final(self.pushed - self.radius);
  }
}

std::uint32_t SeamPadder::ready_rows() const { return impl_->final - impl_->popped; }

void SeamPadder::pop(std::uint32_t rows, std::byte* texels) { pop(rows, texels, nullptr); }

void SeamPadder::pop(std::uint32_t rows, std::byte* texels, std::uint8_t* kinds) {
  Impl& self = *impl_;
  if (rows > ready_rows()) {
    throw Error(ErrorKind::internal,
                fmt::format("SeamPadder: {} rows popped of {}", rows, ready_rows()));
  }
  const std::size_t row_bytes = std::size_t{self.width} * self.texel_bytes;
  for (std::uint32_t i = 0; i < rows; ++i, ++self.popped) {
    std::memcpy(texels + i * row_bytes, self.row_texels(self.popped), row_bytes);
    if (kinds != nullptr)
      std::memcpy(kinds + std::size_t{i} * self.width, self.row_covered(self.popped), self.width);
  }
}

std::uint64_t SeamPadder::filled() const { return impl_->filled; }

}  // namespace pounce::shading
