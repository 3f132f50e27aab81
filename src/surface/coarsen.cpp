// SPDX-License-Identifier: Apache-2.0
//
// A dense block in fewer triangles.
//
// A scan has as many triangles as its image has texels, or more, and a transfer can tell no two of
// them apart: what it takes from the surface is where in the image to read. So windows of texels
// are laid over the block, from 8x8 down to 1x1. A window's corners are texel centres, evaluated on
// the triangles that cover them; its two halves are exact there and affine between. It replaces its
// triangles if these are one sheet that fills it, without gap, fold or overlap, and if nowhere, at
// no corner of the overlay of both tessellations, position or normal differ by more than the bounds
// below. Both are affine on each cell of that overlay, so between its corners they differ by less.
//
// A triangle goes when all texels of this block that it touches are replaced. The neighbouring
// block has it, too, and decides for its own texels. So surfaces overlap by a triangle where they
// meet, and there is no gap but for the bound, which the tolerance of hits spans.
//
// Each half of a window carries the number of a triangle that lies in this window and in no other,
// not even by a corner on the block's border. The winner of a search is the minimum of (key,
// number): two facets with one number would let the order of the batches decide.
//
// Sizes go from large to small and never overlap, so a sheet gets as few triangles as its curvature
// permits. A merge that minimizes an error would need fewer, but would need a bound of its own for
// how far a lookup moves (docs/decisions/022). Here the bound is what is tested.
#include "surface/coarsen.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "surface/window_part.h"

namespace pounce::surface {
namespace {

constexpr int kEdge = mesh::kBlockEdge;
constexpr int kPoints = kEdge + 1;           // across: windows of neighbouring blocks share theirs
constexpr int kLargestWindow = 8;            // texels; a power of two
constexpr double kPositionBound = 1.0 / 16;  // of the window's smallest texel edge
constexpr double kNormalBound = 1.0 / 8;     // 7 degrees
constexpr double kAreaBound = 1e-4;          // of the window: gaps and overlaps
constexpr std::size_t kMostTriangles = 2 * kEdge * kEdge;
constexpr std::uint32_t kNobody = 0xFFFFFFFF, kSeveral = 0xFFFFFFFE;

/// Something at a window's corners (x, y), and between them as its two halves have it.
struct TwoHalves {
  Vec3d at00, at10, at01, at11;
  Vec3d operator()(Vec2d p) const {
    // The halves meet where x = y. take() cuts the window along the same diagonal; if the two
    // differed, the bounds would be tested on a surface that is never stored.
    return p.x >= p.y ? at00 + (at10 - at00) * p.x + (at11 - at10) * p.y
                      : at00 + (at01 - at00) * p.y + (at11 - at01) * p.x;
  }
};

/// A triangle in the image: texel coordinates count from the block's first centre.
struct Footprint {
  std::array<Vec2d, 3> texels;
  Vec2d low, high;
  bool is_line() const { return mesh::doubled_area(texels[0], texels[1], texels[2]) == 0; }
};

/// What is kept of a footprint, for all sizes of windows: the block's texels that it touches. One
/// before the block is -1, one behind it kEdge + 1.
struct Reach {
  struct Interval {
    std::int8_t first = 0, last = 0;
    bool only_touches_last = false;  ///< ends where that texel begins
    Interval(double low, double high)
        : first(texel(low)), last(texel(high)), only_touches_last(high == std::floor(high)) {}
    /// The first texel that is not entered.
    int end() const { return last + (only_touches_last ? 0 : 1); }
    bool lies_in(int begin, int limit) const { return first >= begin && end() <= limit; }

   private:
    static_assert(kEdge + 1 <= INT8_MAX);
    static std::int8_t texel(double at) {
      return static_cast<std::int8_t>(std::clamp(std::floor(at), -1.0, kEdge + 1.0));
    }
  };
  Interval x, y;
  bool is_line = false;

  explicit Reach(const Footprint& f)
      : x(f.low.x, f.high.x), y(f.low.y, f.high.y), is_line(f.is_line()) {}
  bool lies_in_block() const { return x.lies_in(0, kEdge) && y.lies_in(0, kEdge); }
};

/// The same triangle in space.
struct Triangle : Footprint {
  std::array<Vec3d, 3> positions, normals;
  float handedness = 0;

  Triangle(const Footprint& footprint, const mesh::Mesh& mesh,
           const std::array<std::uint32_t, 3>& corners)
      : Footprint(footprint) {
    for (std::size_t k = 0; k < 3; ++k) {
      positions[k] = Vec3d(mesh.positions[corners[k]]);
      normals[k] = Vec3d(mesh.normals[corners[k]]);
    }
    if (!mesh.tangents.empty()) handedness = mesh.tangents[corners[0]].w;
  }
  Vec3d position(double w1, double w2) const { return mixed(positions, w1, w2); }
  Vec3d normal(double w1, double w2) const { return mixed(normals, w1, w2); }
  bool is_degenerate() const {
    const Vec3d doubled = cross(positions[1] - positions[0], positions[2] - positions[0]);
    return !(dot(doubled, doubled) > 0);
  }

 private:
  static Vec3d mixed(const std::array<Vec3d, 3>& v, double w1, double w2) {
    return v[0] + (v[1] - v[0]) * w1 + (v[2] - v[0]) * w2;
  }
};

/// A window while it may replace its triangles.
struct Window {
  std::int16_t x = 0, y = 0;
  std::array<std::uint16_t, 4> points{};  ///< at (0, 0), (1, 0), (0, 1) and (1, 1)
  float handedness = 0;                   ///< of tangents; 0: none seen yet
  double bound = 0;                       ///< of positions
  double area = 0;                        ///< that triangles fill, of 1
  double winding = 0;                     ///< their common sign
  std::array<std::uint32_t, 2> ids{};     ///< of triangles that lie in it and nowhere else
};

/// How many triangles lie in a window, and the first two.
struct Inside {
  std::uint32_t count = 0;
  std::array<std::uint32_t, 2> ids{};
};

class Coarsener {
 public:
  Coarsener(const mesh::Mesh& mesh, const mesh::Lattice& lattice,
            std::span<const mesh::BinEntry> entries)
      : mesh_(mesh), lattice_(lattice), entries_(entries) {
    first_ = {double{kEdge} * entries[0].x, double{kEdge} * entries[0].y};
    out_.points.reserve(kPoints * kPoints);
    out_.triangles.reserve(kMostTriangles);
    reaches_.reserve(entries_.size());
  }

  CoarseSurface run() {
    claim_points();
    for (int edge = kLargestWindow; edge >= 1; edge /= 2) replace_windows(edge);
    out_.replaced.resize(entries_.size());
    for (std::size_t i = 0; i < entries_.size(); ++i) out_.replaced[i] = is_replaced(i) ? 1 : 0;
    return std::move(out_);
  }

 private:
  static std::size_t point(int x, int y) {
    return static_cast<std::size_t>(y) * kPoints + static_cast<std::size_t>(x);
  }
  static std::size_t texel(int x, int y) {
    return static_cast<std::size_t>(y) * kEdge + static_cast<std::size_t>(x);
  }
  const std::array<std::uint32_t, 3>& corners(std::size_t i) const {
    return mesh_.triangles[entries_[i].instance.triangle];
  }

  Footprint footprint(std::size_t i) const {
    return footprint(mesh::texel_corners(mesh_, lattice_, entries_[i].instance));
  }
  Footprint footprint(const std::array<Vec2d, 3>& texel_corners) const {
    Footprint f;
    for (std::size_t k = 0; k < 3; ++k) f.texels[k] = texel_corners[k] - first_;
    std::tie(f.low.x, f.high.x) = std::minmax({f.texels[0].x, f.texels[1].x, f.texels[2].x});
    std::tie(f.low.y, f.high.y) = std::minmax({f.texels[0].y, f.texels[1].y, f.texels[2].y});
    return f;
  }

  /// Which triangle covers each point: exactly one, if it is to be a corner. And what each reaches.
  void claim_points() {
    // The row and the column behind the block's last texel are claimed as well: the windows at its
    // border have corners there. A point on an edge that two triangles share goes to one of them by
    // the raster's rule, so a second claim means that the surface overlaps itself in UV space.
    claims_.fill(kNobody);
    const auto x0 = static_cast<std::int64_t>(first_.x), y0 = static_cast<std::int64_t>(first_.y);
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const auto texels = mesh::texel_corners(mesh_, lattice_, entries_[i].instance);
      reaches_.emplace_back(footprint(texels));
      mesh::raster_triangle(
          texels, {x0, y0, x0 + kPoints, y0 + kPoints},
          [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
            for (std::int64_t x = begin; x < end; ++x) {
              std::uint32_t& claim =
                  claims_[point(static_cast<int>(x - x0), static_cast<int>(y - y0))];
              claim = claim == kNobody ? static_cast<std::uint32_t>(i) : kSeveral;
            }
          });
    }
  }

  /// Makes the point, if it is not yet there.
  std::uint16_t surface_point(int x, int y) {
    // Windows that share a corner share this point, so they meet there exactly.
    std::uint16_t& known = points_[point(x, y)];
    if (known != 0) return static_cast<std::uint16_t>(known - 1);
    const std::size_t i = claims_[point(x, y)];
    const Triangle t(footprint(i), mesh_, corners(i));
    const Vec2d p{static_cast<double>(x), static_cast<double>(y)};
    const double all = mesh::doubled_area(t.texels[0], t.texels[1], t.texels[2]);
    // Rounding may put the point just outside of its triangle; clamped weights keep it on the
    // surface.
    const double w1 = std::clamp(mesh::doubled_area(t.texels[0], p, t.texels[2]) / all, 0.0, 1.0);
    const double w2 =
        std::clamp(mesh::doubled_area(t.texels[0], t.texels[1], p) / all, 0.0, 1 - w1);
    SurfacePoint made{Vec3f(t.position(w1, w2)), Vec3f(t.normal(w1, w2)), {}, {}};
    const double w[3] = {1 - w1 - w2, w1, w2};
    Vec2d uv;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f corner = mesh_.uv_sets[lattice_.uv_set][corners(i)[k]];
      uv = uv + Vec2d{corner.x * w[k], corner.y * w[k]};
    }
    made.uv = {static_cast<float>(uv.x), static_cast<float>(uv.y)};
    if (!mesh_.tangents.empty()) {
      Vec3d sum;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec4f& tangent = mesh_.tangents[corners(i)[k]];
        sum = sum + Vec3d{tangent.x, tangent.y, tangent.z} * w[k];
      }
      const Vec3f unit(length(sum) > 0 ? sum * (1 / length(sum)) : sum);
      made.tangent = {unit.x, unit.y, unit.z, t.handedness};
    }
    out_.points.push_back(made);
    known = static_cast<std::uint16_t>(out_.points.size());
    return static_cast<std::uint16_t>(known - 1);
  }

  /// One size of windows: all that may be are tried, triangle by triangle.
  void replace_windows(int edge) {
    const int across = kEdge / edge;
    std::vector<std::optional<Window>> windows(static_cast<std::size_t>(across * across));
    if (open_windows(edge, windows) == 0) return;
    // open_windows() has ruled out what it could without looking at the surface. Only the windows
    // left are compared in space.
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      std::optional<Triangle> t;  // only where a window is left to be compared
      visit_touched(i, edge, [&](std::size_t at) {
        std::optional<Window>& window = windows[at];
        if (!window) return;
        if (!t) t.emplace(footprint(i), mesh_, corners(i));
        if (!agrees(*t, *window, edge)) window.reset();
      });
    }
    // All parts have one orientation by now, and each point has one owner. Still both tests are
    // needed: points say nothing of a gap between them, and equal areas do not tell a gap plus an
    // overlap of its size from a sheet.
    for (const std::optional<Window>& window : windows) {
      if (window && std::abs(window->area - 1) <= kAreaBound) take(*window, edge);
    }
  }

  /// Those with two triangles to take the numbers of. Returns how many.
  std::size_t open_windows(int edge, std::vector<std::optional<Window>>& windows) {
    const int across = kEdge / edge;
    std::vector<Inside> inside(windows.size());
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const Reach& reach = reaches_[i];
      const int x = window_at(reach.x.first, edge), y = window_at(reach.y.first, edge);
      // What ends at the border of the block may be another's, too.
      if (x < 0 || y < 0 || !reach.x.lies_in(x * edge, (x + 1) * edge) ||
          !reach.y.lies_in(y * edge, (y + 1) * edge) || reach.x.last >= kEdge ||
          reach.y.last >= kEdge || reach.is_line) {
        continue;
      }
      Inside& of = inside[static_cast<std::size_t>(y * across + x)];
      if (of.count < 2) of.ids[of.count] = entries_[i].instance.triangle;
      ++of.count;
    }
    std::size_t open = 0;
    for (int y = 0; y < across; ++y) {
      for (int x = 0; x < across; ++x) {
        const auto at = static_cast<std::size_t>(y * across + x);
        if (inside[at].count < 2) continue;
        windows[at] = open_window(x * edge, y * edge, edge);
        if (!windows[at]) continue;
        windows[at]->ids = inside[at].ids;
        ++open;
      }
    }
    return open;
  }

  /// Calls visit(index) for each window of this size that the triangle touches.
  template <class Visit>
  void visit_touched(std::size_t i, int edge, const Visit& visit) const {
    const Reach& reach = reaches_[i];
    // Of most triangles the texels say all: narrow ones that do not leave the block sideways.
    if (reach.x.first < 0 || reach.x.last > kEdge || reach.x.last - reach.x.first > 2 * edge - 2)
      return visit_touched(footprint(i), edge, visit);
    const int across = kEdge / edge;
    const int x1 = std::min(window_at(reach.x.last, edge), across - 1),
              y1 = std::min(window_at(reach.y.last, edge), across - 1);
    for (int y = std::max(window_at(reach.y.first, edge), 0); y <= y1; ++y) {
      for (int x = window_at(reach.x.first, edge); x <= x1; ++x)
        visit(static_cast<std::size_t>(y * across + x));
    }
  }
  /// The window of that size that a texel is in; -1 for one before the block.
  static int window_at(int texel, int edge) { return texel < 0 ? -1 : texel / edge; }
  template <class Visit>
  static void visit_touched(const Footprint& f, int edge, const Visit& visit) {
    const int across = kEdge / edge;
    const auto first = [&](double low) {
      return static_cast<int>(std::max(std::floor(low / edge), 0.0));
    };
    const auto last = [&](double high) {
      return static_cast<int>(std::min(std::floor(high / edge), across - 1.0));
    };
    const bool is_small = f.high.x - f.low.x < 2 * edge;  // its rectangle will do
    for (int y = first(f.low.y); y <= last(f.high.y); ++y) {
      const mesh::Extent row =
          is_small ? mesh::Extent{f.low.x, f.high.x}
                   : mesh::extent_between(f.texels, double{1} * y * edge, (y + 1.0) * edge);
      if (row.low > row.high) continue;
      for (int x = first(row.low); x <= last(row.high); ++x)
        visit(static_cast<std::size_t>(y * across + x));
    }
  }

  std::optional<Window> open_window(int x0, int y0, int edge) {
    if (taken_[texel(x0, y0)]) return std::nullopt;
    for (int y = y0; y <= y0 + edge; ++y) {
      for (int x = x0; x <= x0 + edge; ++x) {
        if (claims_[point(x, y)] >= kSeveral) return std::nullopt;
      }
    }
    Window window;
    window.x = static_cast<std::int16_t>(x0), window.y = static_cast<std::int16_t>(y0);
    window.points = {surface_point(x0, y0), surface_point(x0 + edge, y0),
                     surface_point(x0, y0 + edge), surface_point(x0 + edge, y0 + edge)};
    const TwoHalves p = at_corners(window, &SurfacePoint::position);
    const double smallest = std::min({length(p.at10 - p.at00), length(p.at01 - p.at00),
                                      length(p.at11 - p.at10), length(p.at11 - p.at01)});
    window.bound = kPositionBound * smallest / edge;
    return window;
  }

  TwoHalves at_corners(const Window& window, Vec3f SurfacePoint::*what) const {
    const auto at = [&](std::size_t i) { return Vec3d(out_.points[window.points[i]].*what); };
    return {at(0), at(1), at(2), at(3)};
  }

  /// Adds a triangle's part in the window. False: they differ too much.
  bool agrees(const Triangle& t, Window& window, int edge) const {
    if (t.is_degenerate()) return false;  // left out later, and counted
    const double scale = 1.0 / edge;      // a power of two
    Polygon part;
    for (std::size_t k = 0; k < 3; ++k) {
      part.add({{(t.texels[k].x - window.x) * scale, (t.texels[k].y - window.y) * scale},
                k == 1 ? 1.0 : 0.0,
                k == 2 ? 1.0 : 0.0});
    }
    if (t.low.x < window.x) part = part.clipped(&Vec2d::x, 0, 1);
    if (t.high.x > window.x + edge) part = part.clipped(&Vec2d::x, 1, -1);
    if (t.low.y < window.y) part = part.clipped(&Vec2d::y, 0, 1);
    if (t.high.y > window.y + edge) part = part.clipped(&Vec2d::y, 1, -1);
    if (part.size() == 0) return true;
    const double area = part.area();
    window.area += std::abs(area);
    // Opposite signs are a fold, or two charts that meet. The two halves have one winding and one
    // handedness to give.
    if (area * window.winding < 0 || t.handedness * window.handedness < 0) return false;
    if (area != 0) window.winding = area;
    if (t.handedness != 0) window.handedness = t.handedness;
    const TwoHalves positions = at_corners(window, &SurfacePoint::position);
    const TwoHalves normals = at_corners(window, &SurfacePoint::normal);
    const auto is_near = [&](const Corner& corner) {
      const Vec3d off = t.position(corner.w1, corner.w2) - positions(corner.at);
      const Vec3d turned = t.normal(corner.w1, corner.w2) - normals(corner.at);
      return dot(off, off) <= window.bound * window.bound &&
             dot(turned, turned) <= kNormalBound * kNormalBound;
    };
    // The corners of the overlay are those of the part and the points where its outline crosses the
    // diagonal. No other point needs a test.
    for (std::size_t i = 0; i < part.size(); ++i) {
      const Corner &a = part[i], &b = part[(i + 1) % part.size()];
      if (!is_near(a)) return false;
      const double da = a.at.x - a.at.y, db = b.at.x - b.at.y;  // the halves meet where it is 0
      if (da * db < 0 && !is_near(Polygon::between(a, b, da / (da - db)))) return false;
    }
    return true;
  }

  void take(const Window& window, int edge) {
    for (int y = window.y; y < window.y + edge; ++y) {
      for (int x = window.x; x < window.x + edge; ++x) taken_[texel(x, y)] = true;
    }
    // Wound as the triangles were: where normals are ambiguous, the winding decides which side is
    // the front. The third point is at (0, 1) and the fourth at (1, 1), hence the order of the
    // names.
    const auto [a, b, d, c] = window.points;
    if (window.winding > 0) {
      out_.triangles.push_back({{a, b, c}, window.ids[0]});
      out_.triangles.push_back({{a, c, d}, window.ids[1]});
    } else {
      out_.triangles.push_back({{a, c, b}, window.ids[0]});
      out_.triangles.push_back({{a, d, c}, window.ids[1]});
    }
  }

  /// Are all texels of the block replaced that the triangle may touch?
  bool is_replaced(std::size_t i) const {
    const Reach& reach = reaches_[i];
    if (!reach.lies_in_block()) {
      const Footprint f = footprint(i);
      if (mesh::is_whole(f.texels, lattice_) && !mesh::is_tiny(f.texels))
        return false;  // no other block has it
    }
    for (int y = first_touched(reach.y); y <= last_touched(reach.y); ++y) {
      for (int x = first_touched(reach.x); x <= last_touched(reach.x); ++x) {
        if (!taken_[texel(x, y)]) return false;
      }
    }
    return true;
  }
  static int first_touched(const Reach::Interval& reach) {
    return std::clamp<int>(reach.first, 0, kEdge - 1);
  }
  static int last_touched(const Reach::Interval& reach) {
    return std::max(std::clamp(reach.end(), 0, kEdge) - 1, first_touched(reach));
  }

  const mesh::Mesh& mesh_;
  const mesh::Lattice& lattice_;
  const std::span<const mesh::BinEntry> entries_;
  Vec2d first_;                                            ///< the block's first texel centre
  std::vector<Reach> reaches_;                             ///< of each entry
  std::array<std::uint32_t, kPoints * kPoints> claims_{};  ///< into entries_
  std::array<std::uint16_t, kPoints * kPoints> points_{};  ///< into out_.points, plus 1
  std::array<bool, kEdge * kEdge> taken_{};
  CoarseSurface out_;
};

}  // namespace

bool is_dense(std::uint64_t triangles) { return 4 * triangles >= std::uint64_t{kEdge} * kEdge; }

CoarseSurface coarsen(const mesh::Mesh& mesh, const mesh::Lattice& lattice,
                      std::span<const mesh::BinEntry> entries) {
  return Coarsener(mesh, lattice, entries).run();
}

std::uint64_t coarsen_bytes(std::uint64_t triangles) {
  // Each triangle has a byte in `replaced`, then every container at its largest. The caller leases
  // this before it knows how many windows will fit.
  return triangles * (sizeof(Reach) + 1) + kPoints * kPoints * sizeof(SurfacePoint) +
         kMostTriangles * sizeof(CoarseTriangle) +
         std::uint64_t{kEdge} * kEdge * (sizeof(std::optional<Window>) + sizeof(Inside)) +
         sizeof(Coarsener);
}

}  // namespace pounce::surface
