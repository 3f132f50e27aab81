// SPDX-License-Identifier: Apache-2.0
#include "unwrap/mask.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <tuple>

namespace pounce::unwrap {
namespace {

/// Rows of cells, a bit each.
class Bits {
 public:
  Bits(std::size_t width, std::size_t height)
      : words_(width / 64 + 1), height_(height), bits_(words_ * height) {}

  std::size_t height() const { return height_; }
  std::span<std::uint64_t> operator[](std::size_t row) {
    return {bits_.data() + row * words_, words_};
  }
  /// Bits [first, last) of a row are set.
  void set(std::size_t row, std::size_t first, std::size_t last) {
    const std::span<std::uint64_t> bits = (*this)[row];
    for (std::size_t word = first / 64; word * 64 < last; ++word) {
      const std::size_t from = std::max(first, word * 64) - word * 64,
                        to = std::min(last, word * 64 + 64) - word * 64;
      bits[word] |= (to == 64 ? ~0ULL : (1ULL << to) - 1) & ~((1ULL << from) - 1);
    }
  }
  /// Each row becomes what it and the one `below` have in common; there are so many rows less.
  void intersect(std::size_t below) {
    for (std::size_t i = 0; i + below * words_ < bits_.size(); ++i)
      bits_[i] &= bits_[i + below * words_];
    height_ -= below;
    bits_.resize(height_ * words_);
  }

 private:
  std::size_t words_, height_;
  std::vector<std::uint64_t> bits_;
};

/// What is within `far` of a stretch of line.
class Around {
 public:
  Around(Vec2d a, Vec2d b, double far)
      : low_(a.y <= b.y ? a : b), high_(a.y <= b.y ? b : a), far_(far) {
    const Vec2d along = high_ - low_;
    const double length = std::sqrt(along.x * along.x + along.y * along.y);
    if (length > 0) aside_ = {along.y * (far / length), -along.x * (far / length)};
  }
  /// From where to where it reaches between two heights; from > to: nowhere.
  std::pair<double, double> reach(double y0, double y1) const {
    if (high_.y + far_ < y0 || low_.y - far_ > y1) return {1, 0};
    return {-side(-1, y0, y1), side(1, y0, y1)};
  }

 private:
  /// How far it reaches to one side: most at the height of the end that is farther there.
  double side(double sign, double y0, double y1) const {
    const Vec2d& farther = sign * high_.x > sign * low_.x ? high_ : low_;
    const double y = std::clamp(farther.y, y0, y1);
    // Where the straight part of its border on that side begins and ends; discs are around the
    // ends.
    const Vec2d from = low_ + aside_ * sign;
    const double off = y - from.y, height = high_.y - low_.y;
    if (height > 0 && off >= 0 && off <= height)
      return sign * (from.x + (high_.x - low_.x) * (off / height));
    const Vec2d& end = height > 0 ? (off < 0 ? low_ : high_) : farther;
    const double up = y - end.y;
    return sign * end.x + std::sqrt(std::max(0.0, far_ * far_ - up * up));
  }

  Vec2d low_, high_;
  double far_;
  Vec2d aside_;  ///< to the right of it, seen with y upwards
};

Level level_of(Bits& bits, std::uint32_t rows) {
  Level level;
  level.rows = rows;
  std::vector<std::uint32_t> longest;
  for (std::size_t row = 0; row < bits.height(); row += rows) {
    level.windows.append(bits[row]);
    std::uint32_t most = 0;
    for (const Run& run : level.windows[longest.size()]) most = std::max(most, run.length());
    if (most > 0) level.order.push_back(static_cast<std::uint32_t>(longest.size()));
    longest.push_back(most);
  }
  std::stable_sort(level.order.begin(), level.order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return longest[a] > longest[b]; });
  return level;
}

}  // namespace

void Rows::append(std::span<const std::uint64_t> bits) {
  const auto end = static_cast<std::uint32_t>(64 * bits.size());
  // The next bit from `x` on that is set; with all bits in `flip`, that is not.
  const auto next = [&](std::uint32_t x, std::uint64_t flip) {
    while (x < end) {
      const std::uint64_t left = (bits[x / 64] ^ flip) >> (x % 64);
      if (left != 0) return x + static_cast<std::uint32_t>(std::countr_zero(left));
      x = (x / 64 + 1) * 64;
    }
    return end;
  };
  for (std::uint32_t x = next(0, 0); x < end;) {
    const std::uint32_t last = next(x, ~0ULL);
    runs_.push_back({x, last});
    x = next(last, 0);
  }
  ends_.push_back(static_cast<std::uint32_t>(runs_.size()));
}

Rows Rows::half_turned(std::uint32_t width) const {
  Rows turned;
  for (std::size_t i = runs_.size(); i-- > 0;)
    turned.runs_.push_back({width - runs_[i].last, width - runs_[i].first});
  for (std::size_t row = size(); row-- > 0;) turned.ends_.push_back(ends_.back() - ends_[row]);
  return turned;
}

Mask mask_of(const Outline& outline, const Turn& turn, double scale, const Cells& cells) {
  const Box box = outline.box(turn);
  Mask mask;
  mask.origin = {box.low.x * scale - cells.half, box.low.y * scale - cells.half};
  const auto count = [&](double length) {
    return static_cast<std::size_t>((length * scale + 2 * cells.half) / cells.step) + 1;
  };
  mask.width = count(box.width());
  mask.height = count(box.height());
  if (mask.width > cells.count || mask.height > cells.count) return mask;
  Bits bits(mask.width, mask.height);
  const auto column = [&](double x) {
    return std::min(static_cast<std::size_t>(std::max(x, 0.0)), mask.width - 1);
  };
  const auto row = [&](double y) {
    return std::min(static_cast<std::size_t>(std::max(y, 0.0)), mask.height - 1);
  };
  // From here on a cell is 1 along.
  const double far = cells.half / cells.step;
  struct Crossing {
    std::size_t row;
    double x;
    int way;
  };
  std::vector<Crossing> crossings;  // of the middles of rows
  for (const auto& [from, to] : outline.edges) {
    const Vec2d a = (turn.of(from) * scale - mask.origin) * (1 / cells.step),
                b = (turn.of(to) * scale - mask.origin) * (1 / cells.step);
    const Around around(a, b, far);
    const auto [low, high] = std::minmax(a.y, b.y);
    for (std::size_t y = row(low - far); y <= row(high + far); ++y) {
      const double y0 = static_cast<double>(y);
      const auto [x0, x1] = around.reach(y0, y0 + 1);
      if (x0 <= x1) bits.set(y, column(x0), column(x1) + 1);
      const double middle = y0 + 0.5;
      if ((a.y <= middle) == (b.y <= middle)) continue;
      crossings.push_back(
          {y, a.x + (b.x - a.x) * ((middle - a.y) / (b.y - a.y)), a.y <= middle ? 1 : -1});
    }
  }
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return std::tie(a.row, a.x, a.way) < std::tie(b.row, b.x, b.way);
  });
  int turns = 0;  // around the middle of a row, from one crossing to the next
  for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
    turns += crossings[i].way;
    if (turns != 0)
      bits.set(crossings[i].row, column(crossings[i].x), column(crossings[i + 1].x) + 1);
  }
  // Windows of one row, of 4, of 16 and of 64.
  constexpr std::uint32_t kMostRows = 64;
  for (std::uint32_t rows = 1; rows <= kMostRows && (rows == 1 || 3 * rows <= mask.height);
       rows *= 4) {
    if (rows > 1) {
      bits.intersect(rows / 4);
      bits.intersect(rows / 2);
    }
    mask.levels.push_back(level_of(bits, rows));
  }
  std::reverse(mask.levels.begin(), mask.levels.end());
  double sum = 0, moment = 0;
  for (std::size_t y = 0; y < mask.height; ++y) {
    for (const Run& run : mask.rows()[y]) {
      sum += run.length();
      moment += static_cast<double>(y) * run.length();
    }
  }
  mask.middle = moment / sum;
  return mask;
}

Mask half_turned(const Mask& mask, const Cells& cells) {
  Mask turned = mask;
  for (Level& level : turned.levels) {
    level.first = static_cast<std::uint32_t>(mask.height - level.windows.size() * level.rows);
    level.windows = level.windows.half_turned(static_cast<std::uint32_t>(mask.width));
    for (std::uint32_t& window : level.order)
      window = static_cast<std::uint32_t>(level.windows.size()) - 1 - window;
  }
  turned.middle = static_cast<double>(mask.height) - 1 - mask.middle;
  turned.origin = {-mask.origin.x - static_cast<double>(mask.width) * cells.step,
                   -mask.origin.y - static_cast<double>(mask.height) * cells.step};
  return turned;
}

std::uint64_t Mask::bytes() const {
  std::uint64_t sum = sizeof(Mask);
  for (const Level& level : levels)
    sum += sizeof(Level) + level.windows.bytes() + level.order.capacity() * sizeof(std::uint32_t);
  return sum;
}

}  // namespace pounce::unwrap
