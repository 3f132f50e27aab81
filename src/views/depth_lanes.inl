// SPDX-License-Identifier: Apache-2.0
//
// Triangles drawn one after the other into a view's depths: rows of pixels are lanes first, which
// tells where each begins and ends, then the pixels of a row are. Of a pixel's depths the least
// stays, so their order is nobody's concern. Included inside POUNCE_ISA_NAMESPACE, after
// double_lanes.inl.

/// 0, 1, 2 and so on.
inline Doubles counted() {
  IntRegister lane;
  for (std::size_t i = 0; i < kGroup; ++i) lane[i] = static_cast<std::int32_t>(i);
  return doubles_of(lane);
}
inline Doubles greater(const Doubles& a, double b) { return greater(a, doubles(b)); }
inline Doubles lesser(const Doubles& a, double b) { return lesser(a, doubles(b)); }

/// Of numbers from -1 to kBeyond.
constexpr double kBeyond = 1e9;
inline Doubles ceil_of(const Doubles& v) {
  const Doubles whole = doubles_of(truncated(v));
  return where_less(whole, v, whole + 1.0, whole);
}
inline Doubles floor_of(const Doubles& v) {
  const Doubles whole = doubles_of(truncated(v));
  return where_less(v, whole, whole - 1.0, whole);
}

using Samples = std::uint16_t __attribute__((vector_size(2 * kGroup)));

static_assert(kGroup - 1 <= TargetDepths::kBehind);

/// `count` samples from `at` on become what is less, themselves or the depth. May rewrite those
/// behind as they are.
inline void lower(std::uint16_t* at, std::int32_t count, double depth, double per_pixel) {
  const Doubles lanes = counted();
  for (std::int32_t i = 0; i < count; i += static_cast<std::int32_t>(kGroup)) {
    const Doubles own = depth + (static_cast<double>(i) + lanes) * per_pixel;
    const IntRegister steps = truncated(lesser(greater(own, 0.0), double{kMostDepth}));
    const IntRegister left = IntRegister{} + (count - i);
    const IntRegister lane = truncated(lanes);
    const auto nearer =
        __builtin_convertvector(lane < left ? steps : IntRegister{} + kNoDepth, Samples);
    Samples there;
    std::memcpy(&there, at + i, sizeof there);
    there = nearer < there ? nearer : there;
    std::memcpy(at + i, &there, sizeof there);
  }
}

/// A share of a triangle's corner, affine in the pixel, is 0 on a line.
struct ShareLine {
  double x, per_y;  ///< where it is in a row
};
/// One that is the same along each row.
struct ShareLevel {
  double share, per_y;
};

void draw(const DepthTriangle& triangle, TargetDepths& out) {
  const DepthTriangle::Corner &a = triangle.corners[0], &b = triangle.corners[1],
                              &c = triangle.corners[2];
  const auto least = [](double u, double v, double w) { return std::min(std::min(u, v), w); };
  const auto most = [](double u, double v, double w) { return std::max(std::max(u, v), w); };
  const auto ceiling = [](double v) { return v > 0 ? std::ceil(std::min(v, kBeyond)) : 0; };
  const double x0 = ceiling(least(a.x, b.x, c.x)), y0 = ceiling(least(a.y, b.y, c.y));
  const double x1 = std::min(most(a.x, b.x, c.x), out.row - 1.0),
               y1 = std::min(most(a.y, b.y, c.y), out.rows() - 1.0);
  if (!(x0 <= x1 && y0 <= y1)) return;
  const double area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  if (!(std::abs(area) > 0)) return;
  // Shares of b and c, and the depth, are affine in x and y.
  const double bx = (c.y - a.y) / area, by = -(c.x - a.x) / area, cx = -(b.y - a.y) / area,
               cy = (b.x - a.x) / area;
  const double depth_x = bx * (b.depth - a.depth) + cx * (c.depth - a.depth),
               depth_y = by * (b.depth - a.depth) + cy * (c.depth - a.depth);
  constexpr double kOutside = 1e-9;  // what lies on an edge belongs to both sides
  // On shares that rise all right of the line is inside, on those that fall all left of it.
  ShareLine from[3], to[3];
  ShareLevel levels[3];
  int froms = 0, tos = 0, flat = 0;
  const auto add = [&](double at_a, double per_x, double per_y) {
    const ShareLine line{a.x - (at_a + kOutside) / per_x, -per_y / per_x};
    if (per_x > 0) from[froms++] = line;
    if (per_x < 0) to[tos++] = line;
    if (per_x == 0) levels[flat++] = {at_a, per_y};
  };
  add(0, bx, by);
  add(0, cx, cy);
  add(1, -(bx + cx), -(by + cy));
  for (double y = y0; y <= y1; y += static_cast<double>(kGroup)) {
    const Doubles down = y + counted() - a.y;
    Doubles low = doubles(x0), high = doubles(x1);
    for (int i = 0; i < froms; ++i) low = greater(from[i].x + from[i].per_y * down, low);
    for (int i = 0; i < tos; ++i) high = lesser(to[i].x + to[i].per_y * down, high);
    for (int i = 0; i < flat; ++i) {
      high = where_less(levels[i].share + levels[i].per_y * down, doubles(-kOutside), doubles(-1),
                        high);
    }
    low = ceil_of(lesser(low, kBeyond));
    high = floor_of(greater(high, -1.0));
    alignas(64) double depths[kGroup];
    alignas(64) std::int32_t firsts[kGroup], counts[kGroup];
    store(depths, a.depth + depth_y * down + depth_x * (low - a.x) + 0.5);
    const IntRegister first = truncated(low);
    store_register(firsts, first);
    store_register(counts, truncated(high) - first + 1);
    const int rows = static_cast<int>(std::min(y1 - y + 1, static_cast<double>(kGroup)));
    for (int r = 0; r < rows; ++r) {
      if (counts[r] <= 0) continue;
      const std::size_t at = (static_cast<std::size_t>(y) + static_cast<std::size_t>(r)) * out.row +
                             static_cast<std::size_t>(firsts[r]);
      lower(out.samples.data() + at, counts[r], depths[r], depth_x);
      if (triangle.faces) lower(out.facing.data() + at, counts[r], depths[r], depth_x);
    }
  }
}

void draw_depths(std::span<const DepthTriangle> triangles, TargetDepths& out) {
  for (const DepthTriangle& triangle : triangles) draw(triangle, out);
}
