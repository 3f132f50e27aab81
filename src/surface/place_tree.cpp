// SPDX-License-Identifier: Apache-2.0
#include "surface/place_tree.h"

#include <algorithm>

namespace pounce::surface {
namespace {

/// What is as small is looked through.
constexpr std::size_t kLeaf = 8;

float along(Vec3f v, std::uint8_t axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

}  // namespace

struct PlaceTree::Query {
  Vec3f point, normal;
  float facing;
  float least;  ///< square of the distance
  const Node* best = nullptr;

  void look(const Node& node) {
    const Vec3f to = node.place.position - point;
    const float square = dot(to, to);
    if (square > least || (square == least && (best == nullptr || node.number > best->number)))
      return;
    if (dot(node.place.normal, normal) < facing) return;
    least = square;
    best = &node;
  }
};

PlaceTree::PlaceTree(std::span<const Place> places) : nodes_(places.size()) {
  for (std::size_t i = 0; i < places.size(); ++i)
    nodes_[i] = {places[i], static_cast<std::uint32_t>(i), 0};
  split(0, nodes_.size());
}

void PlaceTree::split(std::size_t first, std::size_t last) {
  if (last - first <= kLeaf) return;
  Vec3f low = nodes_[first].place.position, high = low;
  for (std::size_t i = first; i < last; ++i) {
    const Vec3f p = nodes_[i].place.position;
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const Vec3f size = high - low;
  const std::uint8_t axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const std::size_t middle = first + (last - first) / 2;
  const auto at = [&](std::size_t i) { return nodes_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(first), at(middle), at(last), [axis](const Node& a, const Node& b) {
    return along(a.place.position, axis) < along(b.place.position, axis);
  });
  nodes_[middle].axis = axis;
  split(first, middle);
  split(middle + 1, last);
}

void PlaceTree::search(std::size_t first, std::size_t last, Query& query) const {
  if (last - first <= kLeaf) {
    for (std::size_t i = first; i < last; ++i) query.look(nodes_[i]);
    return;
  }
  const std::size_t middle = first + (last - first) / 2;
  const Node& node = nodes_[middle];
  const float beyond = along(query.point, node.axis) - along(node.place.position, node.axis);
  // The side of the point first: what is found there makes the other one's bound small.
  if (beyond < 0) {
    search(first, middle, query);
  } else {
    search(middle + 1, last, query);
  }
  query.look(node);
  if (beyond * beyond > query.least) return;
  if (beyond < 0) {
    search(middle + 1, last, query);
  } else {
    search(first, middle, query);
  }
}

const Place* PlaceTree::nearest(Vec3f point, Vec3f normal, float facing, float most) const {
  Query query{point, normal, facing, most * most};
  search(0, nodes_.size(), query);
  return query.best != nullptr ? &query.best->place : nullptr;
}

}  // namespace pounce::surface
