// SPDX-License-Identifier: Apache-2.0
//
// Charts are placed one after the other, the largest first, each in the lowest place that is free,
// in the best of some turns. What is free is known row by row, as runs of cells, so that small
// charts go into the hollows of large ones and into their holes; where a row has no run that is
// long enough, a look at its longest one says so. How large all of them may be is found by trying.
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

/// Cells [first, last) of a row.
struct Run {
  std::uint32_t first, last;
  std::uint32_t length() const { return last - first; }
};

/// What is free of a row, from left to right.
class FreeRow {
 public:
  explicit FreeRow(std::uint32_t cells) : runs_{{0, cells}}, longest_(cells) {}

  std::uint32_t longest() const { return longest_; }
  /// Takes cells away that are all free.
  void take(Run run) {
    const auto at = find(run.first);
    const Run whole = *at;
    const Run left{whole.first, run.first}, right{run.last, whole.last};
    if (left.length() > 0 && right.length() > 0) {
      *at = left;
      runs_.insert(at + 1, right);
    } else if (left.length() > 0 || right.length() > 0) {
      *at = left.length() > 0 ? left : right;
    } else {
      runs_.erase(at);
    }
    longest_ = 0;
    for (const Run& own : runs_) longest_ = std::max(longest_, own.length());
  }
  /// Of places [first, last) of something, those where its `run` of this row is free.
  void keep_places(const std::vector<Run>& places, Run run, std::vector<Run>& kept) const {
    kept.clear();
    for (const Run& own : places) {
      for (auto at = find(own.first + run.first);
           at != runs_.end() && at->first < own.last + run.last; ++at) {
        if (at->length() < run.length() || at->last < run.last) continue;
        const std::uint32_t first = std::max(own.first, at->first - std::min(at->first, run.first)),
                            last = std::min(own.last, at->last - run.last + 1);
        if (first < last) kept.push_back({first, last});
      }
    }
  }

 private:
  /// The first that ends after this cell.
  std::vector<Run>::iterator find(std::uint32_t cell) {
    return std::partition_point(runs_.begin(), runs_.end(),
                                [cell](const Run& run) { return run.last <= cell; });
  }
  std::vector<Run>::const_iterator find(std::uint32_t cell) const {
    return std::partition_point(runs_.begin(), runs_.end(),
                                [cell](const Run& run) { return run.last <= cell; });
  }

  std::vector<Run> runs_;
  std::uint32_t longest_;
};

/// Which cells a chart covers in one of its turns, gutter and all: runs of each row.
struct Mask {
  std::vector<std::vector<Run>> rows;
  std::vector<std::uint32_t> hardest;  ///< rows, those first that find room most seldom
  std::size_t width = 0;
  double middle = 0;  ///< of its cells, from its first row
  Vec2d origin;       ///< of its turned corners, in texels: where the first cell begins
};

/// Cosine and sine of 0, 30 and 60 degrees.
constexpr std::array<std::array<double, 2>, 3> kSlants{
    {{1, 0}, {0.8660254037844386, 0.5}, {0.5, 0.8660254037844386}}};
constexpr std::size_t kFew = 400;
constexpr double kMostCells = 1024;

struct Shape {
  const Chart* chart = nullptr;
  std::vector<Turn> turns;
  double length = 0, size = 0;  ///< of its box: the longer side, and both
};

class Packer {
 public:
  Packer(std::span<const Chart> charts, const Options& options, const std::function<void()>& poll)
      : charts_(charts),
        poll_(poll),
        size_(options.size),
        step_(std::max(1.0, options.size / kMostCells)),
        cells_(static_cast<std::size_t>(options.size / step_)),
        half_(options.gutter / 2.0) {
    for (const Chart& chart : charts) {
      Shape shape;
      shape.chart = &chart;
      const Turn turn = best_turn(chart);
      // Few charts leave large gaps, and are worth more trying.
      for (std::size_t k = 0; k < (charts.size() <= kFew ? kSlants.size() : 1); ++k) {
        const auto [cosine, sine] = kSlants[k];
        const Vec2d slanted = turn.of({cosine, sine});
        for (int quarter = 0; quarter < 4; ++quarter)
          shape.turns.push_back(Turn{slanted.x, slanted.y}.quarter(quarter));
      }
      const Box box = box_of(chart, turn);
      shape.length = box.width();
      shape.size = box.width() + box.height();
      shapes_.push_back(shape);
    }
    order_.resize(charts.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      return shapes_[a].size > shapes_[b].size;
    });
  }

  Packing best() {
    double area = 0;
    for (const Chart& chart : charts_) area += area_of(chart);
    Packing packing;
    packing.charts.resize(charts_.size());
    if (!(area > 0)) return packing;
    // From what would fill nine tenths down until it fits; then up again in small steps, where a
    // chart that finds no room goes sooner the next time and all are tried again a few times.
    constexpr double kFirst = 0.95, kDown = 0.95, kUp = 1.008;
    double longest = 0;
    for (const Shape& shape : shapes_) longest = std::max(longest, shape.length);
    const double room = (size_ - 2 * half_) * 0.998;  // cells are whole
    double scale = std::min(kFirst * size_ / std::sqrt(area), room / longest);
    if (!(scale > 0)) return {};
    const double least = scale / 100;
    while (place_all(scale, packing.charts) < order_.size()) {
      scale *= kDown;
      if (scale < least) return {};
    }
    packing.scale = scale;
    const int tries = charts_.size() <= kFew ? 12 : 2;
    std::vector<Placement> placed;
    for (int trial = 0; trial < tries; ++trial) {
      const std::size_t failed = place_all(packing.scale * kUp, placed);
      if (failed == order_.size()) {
        packing = {packing.scale * kUp, placed};
        trial = -1;
        continue;
      }
      std::rotate(order_.begin() + static_cast<std::ptrdiff_t>(failed / 2),
                  order_.begin() + static_cast<std::ptrdiff_t>(failed),
                  order_.begin() + static_cast<std::ptrdiff_t>(failed + 1));
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
      std::vector<Run>& runs = mask.rows.emplace_back();
      for (std::uint32_t x = 0; x < mask.width; ++x) {
        if ((row[x / 64] >> (x % 64) & 1) == 0) continue;
        if (runs.empty() || runs.back().last != x) runs.push_back({x, x});
        ++runs.back().last;
      }
    }
    double cells_sum = 0, moment = 0;
    for (std::size_t row = 0; row < mask.rows.size(); ++row) {
      for (const Run& run : mask.rows[row]) {
        cells_sum += run.last - run.first;
        moment += static_cast<double>(row) * (run.last - run.first);
      }
    }
    mask.middle = moment / cells_sum;
    mask.hardest.resize(mask.rows.size());
    std::iota(mask.hardest.begin(), mask.hardest.end(), 0U);
    const auto longest = [&](std::uint32_t row) {
      std::uint32_t most = 0;
      for (const Run& run : mask.rows[row]) most = std::max(most, run.last - run.first);
      return most;
    };
    std::vector<std::uint32_t> lengths;
    for (const std::uint32_t row : mask.hardest) lengths.push_back(longest(row));
    std::stable_sort(mask.hardest.begin(), mask.hardest.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return lengths[a] > lengths[b]; });
    return mask;
  }

  /// The lowest place that is free, the leftmost of these; false: there is none below `end`.
  bool find(const std::vector<FreeRow>& free, const Mask& mask, std::size_t end, std::size_t& at_x,
            std::size_t& at_y) {
    if (mask.width > cells_) return false;
    for (std::size_t y = 0; y + mask.rows.size() <= end; ++y) {
      places_.assign(1, {0, static_cast<std::uint32_t>(cells_ - mask.width + 1)});
      for (std::size_t i = 0; i < mask.rows.size() && !places_.empty(); ++i) {
        const std::size_t row = mask.hardest[i];
        const FreeRow& own = free[y + row];
        for (const Run& run : mask.rows[row]) {
          if (own.longest() < run.length()) {
            places_.clear();
            break;
          }
          own.keep_places(places_, run, kept_);
          places_.swap(kept_);
          if (places_.empty()) break;
        }
      }
      if (places_.empty()) continue;
      at_x = places_.front().first;
      at_y = y;
      return true;
    }
    return false;
  }

  /// The number in order_ of the first chart that finds no room; order_.size(): all do.
  std::size_t place_all(double scale, std::vector<Placement>& placed) {
    placed.assign(charts_.size(), {});
    std::vector<FreeRow> free(cells_, FreeRow(static_cast<std::uint32_t>(cells_)));
    for (std::size_t i = 0; i < order_.size(); ++i) {
      poll_();
      const std::size_t chart = order_[i];
      const std::vector<Turn>& turns = shapes_[chart].turns;
      std::size_t best_turn = turns.size(), best_x = 0, best_y = 0;
      double best_middle = cells_;
      Mask mask;
      for (std::size_t turn = 0; turn < turns.size(); ++turn) {
        Mask own = mask_of(shapes_[chart], turn, scale);
        std::size_t x = 0, y = 0;
        if (!(own.middle < best_middle)) continue;
        const auto below = static_cast<std::size_t>(best_middle - own.middle) + own.rows.size();
        if (!find(free, own, std::min(below, cells_), x, y)) continue;
        if (!(static_cast<double>(y) + own.middle < best_middle)) continue;
        best_turn = turn;
        best_x = x;
        best_y = y;
        best_middle = static_cast<double>(y) + own.middle;
        mask = std::move(own);
      }
      if (best_turn == turns.size()) return i;
      for (std::size_t row = 0; row < mask.rows.size(); ++row) {
        for (const Run& run : mask.rows[row])
          free[best_y + row].take({static_cast<std::uint32_t>(best_x) + run.first,
                                   static_cast<std::uint32_t>(best_x) + run.last});
      }
      const Turn& turn = turns[best_turn];
      placed[chart] = {turn.cosine,
                       turn.sine,
                       {static_cast<double>(best_x) * step_ - mask.origin.x,
                        static_cast<double>(best_y) * step_ - mask.origin.y}};
    }
    return order_.size();
  }

  std::span<const Chart> charts_;
  const std::function<void()>& poll_;
  double size_, step_;
  std::size_t cells_;
  double half_;  ///< of the gutter
  std::vector<Shape> shapes_;
  std::vector<std::size_t> order_;
  std::vector<Run> places_, kept_;  ///< of find()
};

}  // namespace

double share_of_box(const Chart& chart) {
  const Box box = box_of(chart, best_turn(chart));
  const double area = box.width() * box.height();
  return area > 0 ? area_of(chart) / area : 1;
}

Packing pack(std::span<const Chart> charts, const Options& options,
             const std::function<void()>& poll) {
  return Packer(charts, options, poll).best();
}

}  // namespace pounce::unwrap
