// SPDX-License-Identifier: Apache-2.0
#include "views/slab.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

namespace pounce::views {
namespace {

/// Fewer are not worth a call: what they hide is read meanwhile.
constexpr std::size_t kBatch = 1024;

constexpr Order kBehindAll{kNoEnd, std::numeric_limits<std::uint64_t>::max()};

}  // namespace

Slab::Slab(std::size_t most) : most_(std::max<std::size_t>(most, 1)) { clear(); }

std::uint64_t Slab::most_bytes(std::size_t most) {
  return round_to_pages(2 * most * sizeof(Ellipse)) +
         round_to_pages(2 * most * sizeof(const Ellipse*)) +
         2 * round_to_pages(2 * most * sizeof(Place));
}

void Slab::clear() {
  ellipses_.clear();
  sorted_.clear();
  full_ = kBatch;
  after_ = {};
  below_ = kBehindAll;
}

void Slab::add(const Ellipse& ellipse) {
  if (ellipses_.size() == 2 * most_) cut();
  if (!wants(ellipse.order)) return;
  if (ellipses_.size() == ellipses_.capacity())
    ellipses_.reserve(std::min(2 * most_, std::max<std::size_t>(2 * ellipses_.size(), 1024)));
  ellipses_.push_back(ellipse);
}

void Slab::cut() {
  const auto end = ellipses_.begin() + static_cast<std::ptrdiff_t>(most_);
  std::nth_element(ellipses_.begin(), end, ellipses_.end(),
                   [](const Ellipse& a, const Ellipse& b) { return a.order < b.order; });
  below_ = end->order;
  ellipses_.resize(most_);
}

std::span<const Ellipse* const> Slab::nearer_than(std::uint32_t depth) {
  places_.clear();
  for (std::uint32_t i = 0; i < ellipses_.size(); ++i) {
    const std::uint32_t at = ellipses_[i].order.depth;
    if (at < depth) places_.push_back({at, i});
  }
  sort_places();
  sorted_.clear();
  for (const Place& place : places_) sorted_.push_back(&ellipses_[place.at]);
  return sorted_;
}

void Slab::drop() {
  if (sorted_.empty()) {
    full_ = 2 * ellipses_.size();  // asking in vain is dear
    return;
  }
  after_ = sorted_.back()->order;
  sorted_.clear();
  std::erase_if(ellipses_, [&](const Ellipse& e) { return e.order <= after_; });
  full_ = std::max(kBatch, 2 * ellipses_.size());
}

bool Slab::again() { return std::exchange(below_, kBehindAll) != kBehindAll; }

void Slab::sort_places() {
  // By eight bits of the depth after the other, from the lowest.
  constexpr std::size_t kDigits = 4, kValues = 256;
  const auto digit = [](const Place& place, std::size_t d) {
    return place.depth >> (8 * d) & (kValues - 1);
  };
  std::array<std::array<std::uint32_t, kValues>, kDigits> counts{};
  for (const Place& place : places_) {
    for (std::size_t d = 0; d < kDigits; ++d) ++counts[d][digit(place, d)];
  }
  others_.resize(places_.size());
  for (std::size_t d = 0; d < kDigits; ++d) {
    if (!places_.empty() && counts[d][digit(places_[0], d)] == places_.size()) continue;
    std::uint32_t first = 0;
    for (std::uint32_t& count : counts[d]) first += std::exchange(count, first);
    for (const Place& place : places_) others_[counts[d][digit(place, d)]++] = place;
    places_.swap(others_);
  }
  // What lies at one depth, by number.
  for (auto at = places_.begin(); at != places_.end();) {
    const auto first = at;
    while (at != places_.end() && at->depth == first->depth) ++at;
    if (at - first > 1) {
      std::sort(first, at, [&](const Place& a, const Place& b) {
        return ellipses_[a.at].order.number < ellipses_[b.at].order.number;
      });
    }
  }
}

}  // namespace pounce::views
