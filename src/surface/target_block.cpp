// SPDX-License-Identifier: Apache-2.0
//
// The target's projection maps, evaluated from the stored triangles.
//
// Position and (unnormalised) normal are affine in the texel on each triangle, so a map texel costs
// a few multiplications instead of stored bytes. Each triangle is evaluated from an anchor near the
// block, set up in double precision, so that a triangle of thousands of texels loses nothing far
// from its corners.
//
// A texel's centre may lie on the edge of two triangles, within rounding: the raster gives it to
// one of them. Its ray starts a little inside of that one, so that the search sees what the raster
// decided (docs/decisions/015-own-surface-first.md).
//
// A surface's packets are cut inside of 8x8 windows of the image, and within a window by where
// texels are on the surface. A packet therefore depends on its block alone, never on how the target
// is cut into tiles and pieces. That must hold: the coarsest triangle of a packet sets the steps in
// which all its keys count, so a packet of other texels could break ties differently. Of Gaussians
// nothing depends on who shares a packet, so texels of charts that meet in a window are packed with
// what lies near them in the rest of the block (Order::in_space).
#include "surface/target_block.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <utility>

#include "surface/chart_fragments.h"

namespace pounce::surface {
namespace {

constexpr int kWindow = 8;              // texels a group spans
constexpr int kHalfWindow = 4;          // texels a packet spans
constexpr float kSpread = 16.0F;        // texel edges beyond which texels are of two clusters
constexpr std::uint32_t kWindows = 64;  // of a block
constexpr std::size_t kOwnGroup = 48;   // texels of a window that lie together: enough for a group
constexpr int kMostClusters = 4;  // per window; what is left then shares packets, however far apart
constexpr double kLargestInset = 1.0 / 16;  // texels: never enough to be seen

/// A vector that is affine in the texel, at the anchor and by how much it changes per texel.
struct Affine3d {
  Vec3d at, u, v;
};

/// Of one triangle: what makes affine maps of values at its corners, around an anchor in texels.
class TriangleFrame {
 public:
  TriangleFrame(const store::GeometryBlock& block, const mesh::Lattice& lattice,
                std::size_t triangle)
      : corners_(block.triangles[triangle]),
        texels_(block.texel_corners(lattice, triangle)),
        area_(mesh::doubled_area(texels_[0], texels_[1], texels_[2])) {
    const auto& t = texels_;
    const auto [low_x, high_x] = std::minmax({t[0].x, t[1].x, t[2].x});
    const auto [low_y, high_y] = std::minmax({t[0].y, t[1].y, t[2].y});
    const double middle_x = block.x * double{mesh::kBlockEdge} + mesh::kBlockEdge / 2;
    const double middle_y = block.y * double{mesh::kBlockEdge} + mesh::kBlockEdge / 2;
    // Whole texels, so that the distance of a texel to its anchor is exact.
    anchor_ = {std::round(std::clamp(middle_x, low_x, high_x)),
               std::round(std::clamp(middle_y, low_y, high_y))};
    x_ = static_cast<float>(anchor_.x - block.x * double{mesh::kBlockEdge});
    y_ = static_cast<float>(anchor_.y - block.y * double{mesh::kBlockEdge});
  }

  /// False: it owns no texel, and there are no maps.
  bool has_area() const { return area_ != 0; }
  const std::array<Vec2d, 3>& texels() const { return texels_; }
  Vec2d anchor() const { return anchor_; }
  /// The anchor in texels of the block.
  float x() const { return x_; }
  float y() const { return y_; }

  Affine3d map(const std::vector<Vec3f>& values) const {
    const auto& t = texels_;
    const Vec3d a(values[corners_[0]]), b(values[corners_[1]]), c(values[corners_[2]]);
    const double x1 = t[1].x - t[0].x, y1 = t[1].y - t[0].y, x2 = t[2].x - t[0].x,
                 y2 = t[2].y - t[0].y;
    // Cramer's rule: what a value that is given at the three corners changes by, per texel.
    const Vec3d e1 = b - a, e2 = c - a;
    const Vec3d u = (e1 * y2 - e2 * y1) * (1.0 / area_);
    const Vec3d v = (e2 * x1 - e1 * x2) * (1.0 / area_);
    return {a + u * (anchor_.x - t[0].x) + v * (anchor_.y - t[0].y), u, v};
  }

 private:
  const std::array<std::uint16_t, 3> corners_;
  const std::array<Vec2d, 3> texels_;
  const double area_;
  Vec2d anchor_;
  float x_ = 0, y_ = 0;
};

/// Where in a row of a block the run that begins there ends: of texels of one owner.
std::uint32_t end_of_run(const std::uint16_t* row, std::uint32_t begin) {
  constexpr std::uint32_t kAtOnce = 4;
  std::uint32_t end = begin + 1;
  // Runs are long where the surface is not dense.
  for (; end + kAtOnce <= mesh::kBlockEdge; end += kAtOnce) {
    if (std::memcmp(row + end, row + end - 1, kAtOnce * sizeof *row) != 0) break;
  }
  while (end < mesh::kBlockEdge && row[end] == row[begin]) ++end;
  return end;
}

/// Where on its triangle a texel is, that many texels from the anchor.
Vec3f position_at(Vec3f p, Vec3f pu, Vec3f pv, float dx, float dy) {
  return p + (pu * dx + pv * dy);
}

/// Two to four times the largest coordinate of a triangle's corners. Not so small that what is
/// divided by its step would be infinite.
float coarseness_of(const store::GeometryBlock& block, std::size_t triangle) {
  float largest = 0;
  for (const std::uint16_t corner : block.triangles[triangle]) {
    const Vec3f& p = block.positions[corner];
    largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  }
  return std::ldexp(1.0F, std::clamp(std::ilogb(largest), -100, 124) + 2);
}

}  // namespace

TargetBlock::TargetBlock(const store::GeometryBlock& block, const mesh::Lattice& lattice,
                         float smallest_edge, Start start)
    : owner_(block.owner),
      triangles_(block.triangles.size()),
      edges_(start == Start::inset ? block.triangles.size() : 0) {
  if (!block.records.empty()) read_records(block, smallest_edge, start);
  for (std::size_t i = 0; i < block.triangles.size(); ++i) {
    Affine& a = triangles_[i];
    a.per_texel = 1.0F / smallest_edge;
    const TriangleFrame frame(block, lattice, i);
    if (!frame.has_area()) continue;
    const Affine3d position = frame.map(block.positions), normal = frame.map(block.normals);
    a.p = Vec3f(position.at);
    a.pu = Vec3f(position.u);
    a.pv = Vec3f(position.v);
    a.n = Vec3f(normal.at);
    a.nu = Vec3f(normal.u);
    a.nv = Vec3f(normal.v);
    a.x = frame.x();
    a.y = frame.y();
    const double edge = std::sqrt(length(cross(position.u, position.v)));
    a.per_texel = 1.0F / std::max(static_cast<float>(edge), smallest_edge);
    a.coarseness = coarseness_of(block, i);
    if (start == Start::inset) edges_[i] = make_edges(frame.texels(), frame.anchor());
  }
}

TargetBlock::Edges TargetBlock::make_edges(const std::array<Vec2d, 3>& t, Vec2d anchor) {
  const double area = mesh::doubled_area(t[0], t[1], t[2]);
  double around = 0;
  std::array<Vec3d, 3> lines;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2d from = t[k], along = t[(k + 1) % 3] - from;
    const double size = std::sqrt(along.x * along.x + along.y * along.y);
    const double scale = (area < 0 ? -1 : 1) / size;
    around += size;
    const double x = -along.y * scale, y = along.x * scale;
    lines[k] = {x, y, x * (anchor.x - from.x) + y * (anchor.y - from.y)};
  }
  Edges out;
  // Doubled area over circumference is the radius of the inscribed circle. A start farther inside
  // than that would leave the triangle by another edge.
  out.most = static_cast<float>(std::min(kLargestInset, std::abs(area) / around));
  // The fourth lane is no edge: what it holds is above any start, so it never asks for a move.
  out.at_anchor[3] = 1;
  for (int k = 0; k < 3; ++k) {
    const Vec3d& line = lines[static_cast<std::size_t>(k)];
    out.x[k] = static_cast<float>(line.x);
    out.y[k] = static_cast<float>(line.y);
    out.at_anchor[k] = static_cast<float>(line.z);
  }
  return out;
}

Vec3f TargetBlock::position(std::uint32_t texel) const {
  if (has_records()) return records_[owner_[texel]].map.position;
  const Affine& a = triangles_[owner_[texel]];
  const float dx = static_cast<float>(texel % mesh::kBlockEdge) - a.x;
  const float dy = static_cast<float>(texel / mesh::kBlockEdge) - a.y;
  return position_at(a.p, a.pu, a.pv, dx, dy);
}

TargetBlock::Texel TargetBlock::texel(std::uint32_t texel) const {
  if (has_records()) return records_[owner_[texel]].map;
  const Affine& a = triangles_[owner_[texel]];
  const float dx = static_cast<float>(texel % mesh::kBlockEdge) - a.x;
  const float dy = static_cast<float>(texel / mesh::kBlockEdge) - a.y;
  Texel out;
  out.position = position_at(a.p, a.pu, a.pv, dx, dy);
  const Vec3f n = a.n + (a.nu * dx + a.nv * dy);
  const float squared = dot(n, n);
  out.normal = squared > 0 ? n * (1.0F / std::sqrt(squared)) : Vec3f{};
  out.per_texel = a.per_texel;
  return out;
}

/// One 8x8 window: its covered texels in packet order (4x4 after 4x4, so that packets are compact).
struct TargetBlock::Window {
  std::array<std::uint16_t, kWindow * kWindow> texels;
  std::size_t count = 0;
  bool one_triangle = true;
};

/// The texels of the first window, in packet order.
constexpr std::array<std::uint16_t, kWindow* kWindow> kWindowTexels = [] {
  std::array<std::uint16_t, kWindow * kWindow> texels{};
  for (unsigned i = 0; i < texels.size(); ++i) {
    const unsigned quarter = i / 16, inside = i % 16;
    const unsigned x = quarter % 2 * kHalfWindow + inside % kHalfWindow;
    const unsigned y = quarter / 2 * kHalfWindow + inside / kHalfWindow;
    texels[i] = static_cast<std::uint16_t>(y * mesh::kBlockEdge + x);
  }
  return texels;
}();

TargetBlock::Window TargetBlock::window(std::uint32_t index) const {
  Window window;
  const std::uint32_t origin = index / 8 * kWindow * mesh::kBlockEdge + index % 8 * kWindow;
  // Mostly all of it is covered: rows at once, in loops that become vectors.
  std::uint16_t others = 0, empty = 0;
  for (std::uint32_t y = 0; y < kWindow; ++y) {
    const std::uint16_t* const row = &owner_[origin + y * mesh::kBlockEdge];
    for (std::uint32_t x = 0; x < kWindow; ++x) {
      others = static_cast<std::uint16_t>(others | (row[x] ^ owner_[origin]));
      empty = static_cast<std::uint16_t>(empty | (row[x] == store::kNoTriangle ? 1 : 0));
    }
  }
  if (empty == 0) {
    for (std::size_t i = 0; i < kWindowTexels.size(); ++i)
      window.texels[i] = static_cast<std::uint16_t>(origin + kWindowTexels[i]);
    window.count = kWindowTexels.size();
    window.one_triangle = others == 0 && !has_records();
    return window;
  }
  for (const std::uint16_t inside : kWindowTexels) {
    const std::uint32_t at = origin + inside;
    if (!covered(at)) continue;
    window.texels[window.count++] = static_cast<std::uint16_t>(at);
    window.one_triangle =
        window.one_triangle && owner_[at] == owner_[window.texels[0]] && !has_records();
  }
  return window;
}

/// No texel of the window is near an edge of its owner, so none of their rays starts elsewhere.
bool TargetBlock::is_deep(const Window& window) const {
  if (edges_.empty()) return true;
  if (!window.one_triangle) return false;
  const std::uint32_t first = window.texels[0];
  const Affine& a = triangles_[owner_[first]];
  const Edges& edges = edges_[owner_[first]];
  const float start = start_of(owner_[first], a.coarseness);
  const float left = static_cast<float>(first % mesh::kBlockEdge / kWindow * kWindow) - a.x;
  const float top = static_cast<float>(first / mesh::kBlockEdge / kWindow * kWindow) - a.y;
  // An affine function on a square is least at a corner, so four tests answer for all texels.
  for (const float dx : {left, left + kWindow - 1}) {
    for (const float dy : {top, top + kWindow - 1}) {
      if (any_negative(edges.beyond(dx, dy, start))) return false;
    }
  }
  return true;
}

void TargetBlock::add_group(std::span<const std::uint16_t> texels, bool is_deep,
                            std::uint32_t block, PageVector<TexelPacket>& packets,
                            std::vector<PacketGroup>& groups) const {
  const auto first = static_cast<std::uint32_t>(packets.size());
  for (std::size_t i = 0; i < texels.size(); i += kLanes) {
    packets.emplace_back().block = block;
    fill(&texels[i], std::min<std::size_t>(kLanes, texels.size() - i), is_deep, packets.back());
  }
  groups.push_back({first, static_cast<std::uint32_t>(packets.size()) - first});
}

/// Is all of a full window near its first texel? What is affine in the texel is farthest away at a
/// corner, rounded as it is: four points of each owner answer for all of its texels. False where
/// owners reach beyond: their texels are asked one by one. `last_asked` says by triangle which
/// window, by `index`, asked it last: each is asked once.
bool TargetBlock::is_together(const Window& window, std::vector<std::uint8_t>& last_asked,
                              std::uint8_t index) const {
  if (window.count < window.texels.size() || has_records()) return false;
  const std::uint32_t first = window.texels[0];
  const Vec3f seed = position(first);
  const float seed_per_texel = per_texel(first);
  const float left = static_cast<float>(first % mesh::kBlockEdge),
              top = static_cast<float>(first / mesh::kBlockEdge);
  constexpr float kLast = kWindow - 1;
  for (const std::uint16_t texel : window.texels) {
    const std::uint16_t owner = owner_[texel];
    if (std::exchange(last_asked[owner], index) == index) continue;
    const Affine& a = triangles_[owner];
    const Four x = Four{left, left + kLast, left, left + kLast} - a.x,
               y = Four{top, top, top + kLast, top + kLast} - a.y;
    const auto away = [&](float p, float pu, float pv, float from) {
      const Four d = p + (pu * x + pv * y) - from;
      return d < 0 ? -d : d;
    };
    const Four dx = away(a.p.x, a.pu.x, a.pv.x, seed.x), dy = away(a.p.y, a.pu.y, a.pv.y, seed.y),
               dz = away(a.p.z, a.pu.z, a.pv.z, seed.z);
    const Four farther = dx < dy ? dy : dx;
    const Four spread = (farther < dz ? dz : farther) * std::min(seed_per_texel, a.per_texel);
    for (int i = 0; i < 4; ++i)
      if (!(spread[i] <= kSpread)) return false;
  }
  return true;
}

/// The first texel that is left is the seed, and takes what is near it, or all there is.
std::size_t TargetBlock::take_cluster(Window& rest, bool all,
                                      std::array<std::uint16_t, kWindow * kWindow>& out) const {
  if (all || rest.one_triangle) {
    out = rest.texels;
    return std::exchange(rest.count, 0);
  }
  const Vec3f seed = position(rest.texels[0]);
  const float seed_per_texel = per_texel(rest.texels[0]);
  std::size_t near = 0, far = 0;
  for (std::size_t i = 0; i < rest.count; ++i) {
    const Vec3f d = position(rest.texels[i]) - seed;
    const float spread = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
    const bool is_near =
        i == 0 || spread * std::min(seed_per_texel, per_texel(rest.texels[i])) <= kSpread;
    (is_near ? out[near++] : rest.texels[far++]) = rest.texels[i];
  }
  rest.count = far;
  return near;
}

void TargetBlock::make_packets(std::uint32_t block_index, PageVector<TexelPacket>& packets,
                               std::vector<PacketGroup>& groups, Order order) const {
  if (order == Order::in_space) return make_packets_in_space(block_index, packets, groups);
  std::array<std::uint16_t, kWindow * kWindow> together;
  std::vector<std::uint8_t> last_asked(triangles_.size(), kWindows);
  for (std::uint32_t w = 0; w < kWindows; ++w) {
    Window rest = window(w);
    if (rest.count == 0) continue;
    const bool deep = is_deep(rest);
    if (!rest.one_triangle && is_together(rest, last_asked, static_cast<std::uint8_t>(w))) {
      add_group(rest.texels, deep, block_index, packets, groups);
      continue;
    }
    // One group of packets per cluster: usually all of the window, one each where charts meet. A
    // packet across two charts would have a bundle as wide as their distance, and every patch in
    // between would be a candidate. The last cluster takes the rest however far apart:
    // most_packets() depends on that bound.
    for (int cluster = 1; rest.count > 0; ++cluster) {
      const std::size_t count = take_cluster(rest, cluster >= kMostClusters, together);
      add_group({together.data(), count}, deep, block_index, packets, groups);
    }
  }
}

std::size_t TargetBlock::count_packets(Order order) const {
  const auto texels = std::count_if(owner_.begin(), owner_.end(),
                                    [](auto owner) { return owner != store::kNoTriangle; });
  PageVector<TexelPacket> packets;
  packets.reserve(most_packets(static_cast<std::uint32_t>(texels)));
  std::vector<PacketGroup> groups;
  make_packets(0, packets, groups, order);
  return packets.size();
}

static_assert(ChartFragments::most_bytes(store::kTexelsPerBlock) <= TargetBlock::kPackingBytes);

void TargetBlock::make_packets_in_space(std::uint32_t block_index, PageVector<TexelPacket>& packets,
                                        std::vector<PacketGroup>& groups) const {
  const auto add = [&](std::span<const std::uint16_t> texels) {
    add_group(texels, true, block_index, packets, groups);
  };
  assert(edges_.empty());  // all rays start at their texels, as in windows without edges
  const std::size_t before = packets.size();
  std::size_t texels = 0;
  ChartFragments fragments;
  std::array<std::uint16_t, kWindow * kWindow> together;
  for (std::uint32_t w = 0; w < kWindows; ++w) {
    Window rest = window(w);
    texels += rest.count;
    while (rest.count > 0) {
      const std::span<const std::uint16_t> cluster(together.data(),
                                                   take_cluster(rest, false, together));
      if (cluster.size() >= kOwnGroup) {
        add(cluster);
      } else {
        fragments.add(cluster);
      }
    }
  }
  const std::size_t most = most_packets(static_cast<std::uint32_t>(texels));
  fragments.join(*this, most - (packets.size() - before), add);
}

std::vector<TexelAxes> TargetBlock::axes() const {
  std::vector<TexelAxes> axes;
  if (has_records()) return axes;
  axes.reserve(triangles_.size());
  for (const Affine& a : triangles_) axes.push_back({a.pu, a.pv});
  return axes;
}

std::vector<Box3f> texel_boxes(const store::GeometryBlock& block, const mesh::Lattice& lattice) {
  // Boxes hold texels, not triangles. A triangle may reach far beyond this block, and its own box
  // would request source blocks that none of these texels can meet.
  struct Positions {
    Vec3f p, pu, pv;
    float x = 0, y = 0;
    Box3f box;
  };
  assert(block.owner.size() == store::kTexelsPerBlock);
  std::vector<Positions> triangles(block.triangles.size());
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const TriangleFrame frame(block, lattice, i);
    if (!frame.has_area()) continue;
    const Affine3d position = frame.map(block.positions);
    triangles[i] = {Vec3f(position.at), Vec3f(position.u), Vec3f(position.v),
                    frame.x(),          frame.y(),         {}};
  }
  for (std::uint32_t y = 0; y < mesh::kBlockEdge; ++y) {
    const std::uint16_t* const row = &block.owner[y * mesh::kBlockEdge];
    // A row's run of one triangle is a straight segment: its ends bound it.
    for (std::uint32_t begin = 0, end; begin < mesh::kBlockEdge; begin = end) {
      end = end_of_run(row, begin);
      if (row[begin] == store::kNoTriangle) continue;
      Positions& t = triangles[row[begin]];
      for (const std::uint32_t x : {begin, end - 1})
        t.box.extend(
            position_at(t.p, t.pu, t.pv, static_cast<float>(x) - t.x, static_cast<float>(y) - t.y));
    }
  }
  std::vector<Box3f> boxes;
  boxes.reserve(triangles.size());
  for (const Positions& t : triangles)
    if (!t.box.empty()) boxes.push_back(t.box);
  return boxes;
}

}  // namespace pounce::surface
