// SPDX-License-Identifier: Apache-2.0
//
// Charts are placed one after the other, large ones first, each in the lowest place that is free,
// in the best of some turns. What is free is known row by row, as runs of cells, so that small
// charts go into the hollows of large ones and into their holes. Many heights are ruled out at
// once, by what several rows of a chart have in common; where a row has no run that is long enough,
// a look at its longest one says so.
//
// How large all of them may be is found by trying: in several orders, and by several rules of what
// is low, since none is the best for all meshes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "unwrap/charts.h"
#include "unwrap/mask.h"

namespace pounce::unwrap {
namespace {

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

constexpr std::size_t kTurns = 24, kQuarter = kTurns / 4;
/// Cosines and sines of the first quarter of these.
constexpr std::array<std::array<double, 2>, kQuarter> kSlants{
    {{1, 0},
     {0.9659258262890683, 0.25881904510252074},
     {0.8660254037844386, 0.5},
     {0.7071067811865476, 0.7071067811865476},
     {0.5, 0.8660254037844386},
     {0.25881904510252074, 0.9659258262890683}}};
/// So many charts, the largest ones, may be tried in all of them, the others in quarters.
constexpr std::size_t kSlanted = 400;
constexpr std::size_t kCells = 4096;  ///< along the image

struct Shape {
  Outline outline;
  std::array<Turn, kTurns> turns;
  bool is_slanted = false;
  double area = 0;
  Box box;  ///< lying
};

/// Of two places the lower one is where the chart's middle is lower; by `lean`, more of its end or,
/// below 0, of its beginning.
struct Rule {
  std::size_t order = 0;
  double lean = 0;
  std::size_t turns = 2;  ///< one in so many is tried
};

constexpr std::array<double, 3> kLeans{0, 0.5, -0.5};
/// Steps of the scale: down until all have room, and up at last.
constexpr double kDown = 0.98, kFinest = 1.003;
constexpr double kReach = 0.025;                   ///< what tries may add to the fill
constexpr std::size_t kPlaced = 4000, kTries = 6;  ///< charts that are placed by these; the fewest

class Packer {
 public:
  Packer(std::span<const Chart> charts, const Options& options, const std::function<void()>& poll)
      : poll_(poll),
        size_(options.size),
        tiles_(options.tiles),
        masks_most_(options.masks_bytes),
        cells_{static_cast<double>(options.size) / kCells, kCells, options.gutter / 2.0} {
    for (const Chart& chart : charts) {
      poll_();
      Shape& shape = shapes_.emplace_back();
      shape.outline = outline_of(chart);
      const Turn turn = shape.outline.best_turn();
      for (std::size_t k = 0; k < kTurns; ++k) {
        const Vec2d slanted = turn.of({kSlants[k % kQuarter][0], kSlants[k % kQuarter][1]});
        shape.turns[k] = Turn{slanted.x, slanted.y}.quarter(static_cast<int>(k / kQuarter));
      }
      shape.area = area_of(chart);
      shape.box = shape.outline.box(turn);
      area_ += shape.area;
      around_ += shape.outline.length();
      longest_ = std::max(longest_, shape.box.width());
    }
    sort_by([](const Shape& shape) { return shape.box.width() * shape.box.height(); });
    sort_by([](const Shape& shape) { return shape.area; });
    sort_by([](const Shape& shape) { return shape.box.width() + shape.box.height(); });
    const std::size_t slanted = kSlanted / tiles_;  // in vain in most tiles
    for (std::size_t i = 0; i < std::min(slanted, orders_[0].size()); ++i)
      shapes_[orders_[0][i]].is_slanted = true;
  }

  Packing best(double wanted, double than) {
    Packing packing;
    packing.charts.resize(shapes_.size());
    if (!(area_ > 0)) return packing;
    if (!(than > 0 ? begin_larger(than, packing) : begin(packing))) return {};
    constexpr std::array<double, 2> kUp{1.01, 1.005};
    for (const double up : kUp) {
      if (fill_of(packing) >= wanted - 2 * kReach) go_up({}, up, packing);
    }
    packing.rough = packing.scale;
    if (fill_of(packing) < wanted - kReach) return packing;
    // The more charts the longer a try takes, and the less it changes.
    const std::size_t tries = std::clamp(kPlaced / (shapes_.size() * tiles_), kTries, 6 * kTries);
    for (std::size_t trial = 0; trial < tries; ++trial) {
      const std::size_t leans = trial / orders_.size(), turns = leans / kLeans.size();
      const Rule rule{trial % orders_.size(), kLeans[leans % kLeans.size()],
                      turns % 2 == 0 ? 1 : kQuarter};
      while (go_up(rule, kFinest, packing)) {
      }
    }
    return packing;
  }

 private:
  template <class F>
  void sort_by(const F& size) {
    std::vector<std::size_t>& order = orders_.emplace_back(shapes_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return size(shapes_[a]) > size(shapes_[b]);
    });
  }
  double fill_of(const Packing& packing) const {
    return area_ * packing.scale * packing.scale / (size_ * size_ * tiles_);
  }
  /// What fills nearly all of the image, gutters and all: the root of a quadratic equation.
  double first_scale() const {
    constexpr double kFull = 0.95, kPi = 3.14159265358979;
    const double half = cells_.half + cells_.step;
    const double along = half * around_ / 2,
                 spare = kFull * size_ * size_ * tiles_ -
                         kPi * half * half * static_cast<double>(shapes_.size());
    const double least = 0.01 * size_ * std::sqrt(tiles_ / area_);
    if (!(spare > 0)) return least;
    return std::max(least, (std::sqrt(along * along + area_ * spare) - along) / area_);
  }
  /// The scale at which the longest box is as long as the image.
  double most() const {
    return (size_ - 2 * cells_.half) * 0.998 / longest_;  // cells are whole
  }
  /// In steps down until all have room.
  bool begin(Packing& packing) {
    double scale = std::min(first_scale(), most());
    if (!(scale > 0)) return false;
    const double least = scale / 100;
    for (; scale >= least; scale *= kDown) {
      if (!place_all({}, scale, packing.charts)) continue;
      packing.scale = scale;
      return true;
    }
    return false;
  }
  /// In steps up, from a little more than that; false: they have no room even there.
  bool begin_larger(double than, Packing& packing) {
    constexpr double kLarger = 1.01;
    constexpr int kTrials = 3;
    packing.scale = than * kLarger;
    if (packing.scale > most()) return false;
    for (int trial = 0; trial < kTrials; ++trial) {
      if (!place_all({}, packing.scale, packing.charts)) continue;
      while (go_up({}, 1 / kDown, packing)) {
      }
      return true;
    }
    return false;
  }
  bool go_up(const Rule& rule, double up, Packing& packing) {
    if (!place_all(rule, packing.scale * up, placed_)) return false;
    packing.scale *= up;
    packing.charts.swap(placed_);
    return true;
  }

  const Mask& mask(std::size_t chart, std::size_t turn, double scale) {
    if (scale != masks_scale_) {
      masks_.clear();
      masks_bytes_ = 0;
      masks_.resize(shapes_.size());
      masks_scale_ = scale;
    }
    const Shape& shape = shapes_[chart];
    if (masks_[chart].empty()) masks_[chart].resize(kTurns);
    std::unique_ptr<const Mask>& own = masks_[chart][turn];
    if (own) return *own;
    // Cells of the second half are those of the first, whether these are kept or not.
    mask_ = turn < kTurns / 2 ? mask_of(shape.outline, shape.turns[turn], scale, cells_)
                              : half_turned(mask(chart, turn - kTurns / 2, scale), cells_);
    const std::uint64_t bytes = mask_.bytes();
    if (masks_bytes_ + bytes > masks_most_) return mask_;
    masks_bytes_ += bytes;
    own = std::make_unique<const Mask>(std::move(mask_));
    return *own;
  }

  struct Place {
    std::size_t x = 0, y = 0;
  };
  /// The lowest place that is free, the leftmost of these, if there is one in a tile that ends by
  /// `end`.
  std::optional<Place> find(const Mask& mask, std::size_t tile, std::size_t end) {
    if (mask.levels.empty() || mask.height > end) return std::nullopt;
    first_row_ = tile * cells_.count;
    places_.resize(mask.levels.size() + 1);
    places_[0].assign(1, {0, static_cast<std::uint32_t>(cells_.count - mask.width + 1)});
    return find(mask, 0, {0, end - mask.height + 1});
  }
  struct Heights {
    std::size_t first, last;
  };
  /// At these heights, by windows of this level first and then of the next one.
  std::optional<Place> find(const Mask& mask, std::size_t level, Heights heights) {
    const Level& own = mask.levels[level];
    for (std::size_t y = heights.first; y < heights.last; y += own.rows) {
      if (!has_room(own, level, y)) continue;
      if (level + 1 == mask.levels.size()) return Place{places_[level + 1].front().first, y};
      const auto found = find(mask, level + 1, {y, std::min(y + own.rows, heights.last)});
      if (found) return found;
    }
    return std::nullopt;
  }
  /// Leaves of places_[level] those where all windows have room, in places_[level + 1].
  bool has_room(const Level& level, std::size_t number, std::size_t y) {
    std::vector<Run>& places = places_[number + 1];
    places = places_[number];
    for (const std::uint32_t window : level.order) {
      // The row that is beside some row of the window at each of the heights.
      const FreeRow& row =
          free_[first_row_ + y + level.rows - 1 + level.first + window * level.rows];
      for (const Run& run : level.windows[window]) {
        if (row.longest() < run.length()) return false;
        row.keep_places(places, run, kept_);
        places.swap(kept_);
        if (places.empty()) return false;
      }
    }
    return true;
  }

  /// False: one finds no room. It goes sooner the next time.
  bool place_all(const Rule& rule, double scale, std::vector<Placement>& placed) {
    placed.assign(shapes_.size(), {});
    used_.assign(tiles_, 0);
    free_.assign(cells_.count * tiles_, FreeRow(static_cast<std::uint32_t>(cells_.count)));
    std::vector<std::size_t>& order = orders_[rule.order];
    for (std::size_t i = 0; i < order.size(); ++i) {
      poll_();
      if (place(order[i], rule, scale, placed[order[i]])) continue;
      const auto at = order.begin() + static_cast<std::ptrdiff_t>(i);
      std::rotate(order.begin() + static_cast<std::ptrdiff_t>(i / 2), at, at + 1);
      return false;
    }
    return true;
  }
  bool place(std::size_t chart, const Rule& rule, double scale, Placement& placed) {
    // The emptiest tile first: it has room more often than others, and all fill alike.
    tile_order_.resize(tiles_);
    std::iota(tile_order_.begin(), tile_order_.end(), 0U);
    std::stable_sort(tile_order_.begin(), tile_order_.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return used_[a] < used_[b]; });
    for (const std::uint32_t tile : tile_order_) {
      if (!place(chart, tile, rule, scale, placed)) continue;
      used_[tile] += shapes_[chart].area;
      return true;
    }
    return false;
  }
  bool place(std::size_t chart, std::uint32_t tile, const Rule& rule, double scale,
             Placement& placed) {
    std::optional<std::size_t> best;
    Place at;
    double lowest = 2 * static_cast<double>(cells_.count);
    const auto look = [&](std::size_t turn) {
      const Mask& own = mask(chart, turn, scale);
      const double offset = own.middle + rule.lean * (static_cast<double>(own.height) - own.middle);
      if (!(offset < lowest)) return;
      const auto below = static_cast<std::size_t>(lowest - offset) + own.height;
      const std::optional<Place> found = find(own, tile, std::min(below, cells_.count));
      if (!found || !(static_cast<double>(found->y) + offset < lowest)) return;
      best = turn;
      at = *found;
      lowest = static_cast<double>(found->y) + offset;
    };
    const std::size_t step = shapes_[chart].is_slanted ? rule.turns : kQuarter;
    for (std::size_t turn = 0; turn < kTurns; turn += step) look(turn);
    if (!best) return false;
    const Mask& own = mask(chart, *best, scale);
    for (std::size_t row = 0; row < own.height; ++row) {
      for (const Run& run : own.rows()[row])
        free_[first_row_ + at.y + row].take({static_cast<std::uint32_t>(at.x) + run.first,
                                             static_cast<std::uint32_t>(at.x) + run.last});
    }
    const Turn& turn = shapes_[chart].turns[*best];
    placed = {turn.cosine,
              turn.sine,
              {static_cast<double>(at.x) * cells_.step - own.origin.x,
               static_cast<double>(at.y) * cells_.step - own.origin.y},
              tile};
    return true;
  }

  const std::function<void()>& poll_;
  double size_;
  const std::uint32_t tiles_;
  const std::uint64_t masks_most_;
  Cells cells_;
  std::vector<Shape> shapes_;
  double area_ = 0, around_ = 0, longest_ = 0;  ///< of all together; of the one box
  std::vector<std::vector<std::size_t>> orders_;
  double masks_scale_ = 0;
  std::vector<std::vector<std::unique_ptr<const Mask>>> masks_;  ///< of each chart in its turns
  std::uint64_t masks_bytes_ = 0;
  Mask mask_;  ///< one that is not kept
  std::vector<Placement> placed_;
  std::vector<FreeRow> free_;  ///< tile by tile
  std::vector<double> used_;   ///< by tile: area
  std::vector<std::uint32_t> tile_order_;
  std::size_t first_row_ = 0;             ///< of the tile where find() looks
  std::vector<std::vector<Run>> places_;  ///< of find(): those that are left, by level
  std::vector<Run> kept_;
};

}  // namespace

Packing pack(std::span<const Chart> charts, const Options& options, double wanted, double than,
             const std::function<void()>& poll) {
  return Packer(charts, options, poll).best(wanted, than);
}

}  // namespace pounce::unwrap
