// SPDX-License-Identifier: Apache-2.0
//
// Charts are placed one after the other, the longest first, each in the lowest place that is free,
// in the best of four turns. What is free is known cell by cell, so that small charts go into the
// hollows of large ones and into their holes. A cell is a bit: where a run of cells is blocked is
// found for a whole row at once. How large all of them may be is found by trying.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "unwrap/charts.h"

namespace pounce::unwrap {
namespace {

struct Turn {
  double cosine = 1, sine = 0;
  Vec2d of(Vec2d p) const { return {cosine * p.x - sine * p.y, sine * p.x + cosine * p.y}; }
  Turn quarter(int times) const {
    Turn turn = *this;
    for (; times > 0; --times) turn = {-turn.sine, turn.cosine};
    return turn;
  }
};

struct Box {
  Vec2d low{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Vec2d high{-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  void extend(Vec2d p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  double width() const { return high.x - low.x; }
  double height() const { return high.y - low.y; }
};

Box box_of(const Chart& chart, const Turn& turn) {
  Box box;
  for (const Vec2d p : chart.corners) box.extend(turn.of(p));
  return box;
}

/// The turn, by less than a quarter, in which the chart's box is smallest, and lies.
Turn best_turn(const Chart& chart) {
  constexpr int kTurns = 24;
  Turn best;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kTurns; ++k) {
    // Tangents of half angles, so that no function of the library decides.
    const double t = 0.41421356237309505 * k / kTurns;
    const Turn turn{(1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)};
    for (const Turn& own : {turn, Turn{turn.sine, turn.cosine}}) {  // up to 45 degrees, and beyond
      const Box box = box_of(chart, own);
      const double area = box.width() * box.height();
      if (!(area < least)) continue;
      least = area;
      best = box.width() >= box.height() ? own : own.quarter(1);
    }
  }
  return best;
}

/// A row of cells, a bit each.
using Bits = std::vector<std::uint64_t>;

/// Bits [first, last) are set.
void set_bits(Bits& bits, std::size_t first, std::size_t last) {
  for (std::size_t word = first / 64; word * 64 < last; ++word) {
    const std::size_t from = std::max(first, word * 64) - word * 64,
                      to = std::min(last, word * 64 + 64) - word * 64;
    bits[word] |= (to == 64 ? ~0ULL : (1ULL << to) - 1) & ~((1ULL << from) - 1);
  }
}

/// bits |= bits moved down by `by`: bit i has what bit i + by had, too.
void add_moved_down(Bits& bits, std::size_t by) {
  const std::size_t words = by / 64, rest = by % 64;
  for (std::size_t w = 0; w + words < bits.size(); ++w) {
    std::uint64_t moved = bits[w + words] >> rest;
    if (rest > 0 && w + words + 1 < bits.size()) moved |= bits[w + words + 1] << (64 - rest);
    bits[w] |= moved;
  }
}

/// Which cells a chart covers in one of its turns, gutter and all: runs of each row.
struct Mask {
  struct Run {
    std::uint32_t first, last;
  };
  std::vector<std::vector<Run>> rows;
  std::size_t width = 0;
  Vec2d origin;  ///< of its turned corners, in texels: where the first cell begins
};

struct Shape {
  const Chart* chart = nullptr;
  std::array<Turn, 4> turns;
  double length = 0;
};

class Packer {
 public:
  Packer(std::span<const Chart> charts, const Options& options, const std::function<void()>& poll)
      : charts_(charts),
        poll_(poll),
        size_(options.size),
        step_(std::max(1.0, options.size / 1024.0)),
        cells_(static_cast<std::size_t>(options.size / step_)),
        half_(options.gutter / 2.0) {
    for (const Chart& chart : charts) {
      Shape shape;
      shape.chart = &chart;
      const Turn turn = best_turn(chart);
      for (int k = 0; k < 4; ++k) shape.turns[static_cast<std::size_t>(k)] = turn.quarter(k);
      shape.length = box_of(chart, turn).width();
      shapes_.push_back(shape);
    }
    order_.resize(charts.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      return shapes_[a].length > shapes_[b].length;
    });
  }

  Packing best() const {
    double area = 0;
    for (const Chart& chart : charts_) {
      for (std::size_t i = 0; i < chart.corners.size(); i += 3) {
        const Vec2d a = chart.corners[i], b = chart.corners[i + 1], c = chart.corners[i + 2];
        area += std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)) / 2;
      }
    }
    Packing packing;
    packing.charts.resize(charts_.size());
    if (!(area > 0)) return packing;
    // From what would fill nine tenths down until it fits; then between the last two.
    constexpr double kFirst = 0.95, kDown = 0.93;
    constexpr int kHalvings = 3;
    double scale = kFirst * size_ / std::sqrt(area), above = scale;
    std::vector<Placement> placed;
    const double least = scale / 100;
    for (; !place_all(scale, placed); scale *= kDown) {
      above = scale;
      if (scale < least) return {};
    }
    packing = {scale, placed};
    for (int round = 0; round < kHalvings; ++round) {
      const double between = (packing.scale + above) / 2;
      if (place_all(between, placed)) {
        packing = {between, placed};
      } else {
        above = between;
      }
    }
    return packing;
  }

 private:
  Mask mask_of(const Shape& shape, std::size_t turn, double scale) const {
    const Turn& own = shape.turns[turn];
    const Box box = box_of(*shape.chart, own);
    Mask mask;
    mask.origin = {box.low.x * scale - half_, box.low.y * scale - half_};
    const auto cells = [&](double length) {
      return static_cast<std::size_t>((length * scale + 2 * half_) / step_) + 1;
    };
    mask.width = cells(box.width());
    if (mask.width > cells_ || cells(box.height()) > cells_) {
      mask.width = cells_ + 1;  // which find() refuses
      return mask;
    }
    std::vector<Bits> rows(cells(box.height()), Bits(mask.width / 64 + 1));
    const auto cell = [&](double at, double origin, std::size_t count) {
      return std::min(static_cast<std::size_t>(std::max((at - origin) / step_, 0.0)), count - 1);
    };
    const std::vector<Vec2d>& corners = shape.chart->corners;
    for (std::size_t i = 0; i < corners.size(); i += 3) {
      std::array<Vec2d, 3> p;
      for (std::size_t k = 0; k < 3; ++k) p[k] = own.of(corners[i + k]) * scale;
      const auto [low, high] = std::minmax({p[0].y, p[1].y, p[2].y});
      const std::size_t last = cell(high + half_, mask.origin.y, rows.size());
      for (std::size_t y = cell(low - half_, mask.origin.y, rows.size()); y <= last; ++y) {
        // What of the triangle lies in this row, which is as high as the gutter makes it.
        const double y0 = mask.origin.y + static_cast<double>(y) * step_ - half_,
                     y1 = y0 + step_ + 2 * half_;
        const auto [x0, x1] = span_between(p.data(), y0, y1);
        if (x0 <= x1)
          set_bits(rows[y], cell(x0 - half_, mask.origin.x, mask.width),
                   cell(x1 + half_, mask.origin.x, mask.width) + 1);
      }
    }
    for (const Bits& row : rows) {
      std::vector<Mask::Run>& runs = mask.rows.emplace_back();
      for (std::uint32_t x = 0; x < mask.width; ++x) {
        if ((row[x / 64] >> (x % 64) & 1) == 0) continue;
        if (runs.empty() || runs.back().last != x) runs.push_back({x, x});
        ++runs.back().last;
      }
    }
    return mask;
  }

  /// The lowest place that is free, the leftmost of these; false: there is none below `end`.
  bool find(const std::vector<Bits>& taken, const Mask& mask, std::size_t end, std::size_t& at_x,
            std::size_t& at_y) const {
    if (mask.width > cells_) return false;
    Bits blocked(taken.front().size()), grown;
    for (std::size_t y = 0; y + mask.rows.size() <= end; ++y) {
      std::fill(blocked.begin(), blocked.end(), 0);
      // From the left no chart may begin later than this.
      set_bits(blocked, cells_ - mask.width + 1, cells_);
      bool is_full = false;
      for (std::size_t row = 0; row < mask.rows.size() && !is_full; ++row) {
        for (const Mask::Run& run : mask.rows[row]) {
          grown = taken[y + row];
          std::size_t have = 1;
          const std::size_t wanted = run.last - run.first;
          for (; have < wanted; have += std::min(have, wanted - have))
            add_moved_down(grown, std::min(have, wanted - have));
          add_moved(grown, run.first, blocked);
        }
        is_full = all_set(blocked);
      }
      if (is_full) continue;
      for (std::size_t x = 0; x < cells_; ++x) {
        if ((blocked[x / 64] >> (x % 64) & 1) != 0) continue;
        at_x = x;
        at_y = y;
        return true;
      }
    }
    return false;
  }
  /// to |= from moved down by `by`.
  static void add_moved(const Bits& from, std::size_t by, Bits& to) {
    const std::size_t words = by / 64, rest = by % 64;
    for (std::size_t w = 0; w + words < from.size(); ++w) {
      std::uint64_t moved = from[w + words] >> rest;
      if (rest > 0 && w + words + 1 < from.size()) moved |= from[w + words + 1] << (64 - rest);
      to[w] |= moved;
    }
  }
  bool all_set(const Bits& bits) const {
    for (std::size_t w = 0; w < cells_ / 64; ++w) {
      if (bits[w] != ~0ULL) return false;
    }
    return cells_ % 64 == 0 || (bits[cells_ / 64] | ~0ULL << cells_ % 64) == ~0ULL;
  }

  bool place_all(double scale, std::vector<Placement>& placed) const {
    placed.assign(charts_.size(), {});
    std::vector<Bits> taken(cells_, Bits(cells_ / 64 + 2));
    for (const std::size_t chart : order_) {
      poll_();
      std::size_t best_turn = 4, best_x = 0, best_y = 0, best_end = cells_ + 1;
      std::array<Mask, 4> masks;
      for (std::size_t turn = 0; turn < 4; ++turn) {
        masks[turn] = mask_of(shapes_[chart], turn, scale);
        std::size_t x = 0, y = 0;
        if (!find(taken, masks[turn], std::min(best_end - 1, cells_), x, y)) continue;
        best_turn = turn;
        best_x = x;
        best_y = y;
        best_end = y + masks[turn].rows.size();
      }
      if (best_turn == 4) return false;
      const Mask& mask = masks[best_turn];
      for (std::size_t row = 0; row < mask.rows.size(); ++row) {
        for (const Mask::Run& run : mask.rows[row])
          set_bits(taken[best_y + row], best_x + run.first, best_x + run.last);
      }
      const Turn& turn = shapes_[chart].turns[best_turn];
      placed[chart] = {turn.cosine,
                       turn.sine,
                       {static_cast<double>(best_x) * step_ - mask.origin.x,
                        static_cast<double>(best_y) * step_ - mask.origin.y}};
    }
    return true;
  }

  std::span<const Chart> charts_;
  const std::function<void()>& poll_;
  double size_, step_;
  std::size_t cells_;
  double half_;  ///< of the gutter
  std::vector<Shape> shapes_;
  std::vector<std::size_t> order_;
};

}  // namespace

Packing pack(std::span<const Chart> charts, const Options& options,
             const std::function<void()>& poll) {
  return Packer(charts, options, poll).best();
}

}  // namespace pounce::unwrap
