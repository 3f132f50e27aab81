// SPDX-License-Identifier: Apache-2.0
//
// From a stored block's triangles to facets that can be hit and patches that can be found.
//
// All set-up is in double precision from the mesh's own numbers, rounded once. A large triangle is
// clipped to its block's window of texels, so that a patch's box is no larger than the surface that
// it stands for there; a small or thin one is a patch as it is. Finer windows cull more, and cost
// more than that saves (docs/decisions/080). The tolerance lets a hit lie up to one texel
// outside the triangle: two tessellations of one surface do not meet exactly at open borders. It
// never exceeds the triangle's own size, so stretched texels do not overhang their triangle.
//
// A facet is computed from its triangle alone. A triangle that is stored in several blocks, or is
// decoded again for another piece, gives the same bits each time: the search takes a minimum over
// all copies that it meets, and must get the same one whichever they are.
#include "surface/source_block.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace pounce::surface {
namespace {

struct Setup {
  Vec3d corners[3];
  std::array<Vec2d, 3> texels;
  Vec3d normal;  // not oriented
  double tolerance = 0;
};

Vec3d position(const store::GeometryBlock& block, std::size_t triangle, std::size_t corner) {
  return Vec3d(block.positions[block.triangles[triangle][corner]]);
}

void store(float (&out)[3], Vec3d v) {
  out[0] = static_cast<float>(v.x);
  out[1] = static_cast<float>(v.y);
  out[2] = static_cast<float>(v.z);
}

/// The surface's normals, and how far from the plane's they lean. A mean of unit vectors within a
/// cone of less than 90 degrees stays in it; of wider ones it may point anywhere.
void set_shading(const std::array<Vec3d, 3>& normals, Facet& facet) {
  constexpr double kRounding = 1e-5, kAny = 4;
  const Vec3d plane{facet.n[0], facet.n[1], facet.n[2]};
  double lean = 0;
  std::array<Vec3d, 3> shading;
  for (std::size_t k = 0; k < 3; ++k) {
    const double size = length(normals[k]);
    shading[k] = size > 0 ? normals[k] : plane;  // where a mesh says nothing, its plane does
    const Vec3d unit = size > 0 ? normals[k] * (1 / size) : plane;
    lean = std::max(lean, dot(unit, plane) > 0 ? length(unit - plane) + kRounding : kAny);
  }
  facet.lean = static_cast<float>(lean);
  store(facet.s, shading[0]);
  store(facet.s1, shading[1] - shading[0]);
  store(facet.s2, shading[2] - shading[0]);
}

Facet make_facet(const store::GeometryBlock& block, std::size_t triangle,
                 const mesh::Lattice& lattice, const Setup& s) {
  Facet facet{};
  const Vec3d e1 = s.corners[1] - s.corners[0];
  const Vec3d e2 = s.corners[2] - s.corners[0];
  const Vec3d across1 = cross(e2, s.normal);
  const Vec3d across2 = cross(s.normal, e1);
  // The dual basis of the edges in the plane: g1 . e1 = 1 and g1 . e2 = 0, and the reverse for g2.
  // So two dot products turn a point of the plane into barycentrics.
  const Vec3d g1 = across1 * (1.0 / dot(e1, across1));
  const Vec3d g2 = across2 * (1.0 / dot(e2, across2));
  // The front is where the vertex normals point; the winding alone decides where they say nothing.
  std::array<Vec3d, 3> normals;
  for (std::size_t k = 0; k < 3; ++k)
    normals[k] = Vec3d(block.normals[block.triangles[triangle][k]]);
  const Vec3d shading = normals[0] + normals[1] + normals[2];
  store(facet.n, dot(shading, s.normal) < 0 ? s.normal * -1.0 : s.normal);
  set_shading(normals, facet);
  store(facet.m, s.corners[0]);
  store(facet.g1, g1);
  store(facet.g2, g2);
  store(facet.e1, e1);
  store(facet.e2, e2);
  facet.reach[0] = static_cast<float>(s.tolerance * length(g1 + g2));  // 1 / height = |gradient|
  facet.reach[1] = static_cast<float>(s.tolerance * length(g1));
  facet.reach[2] = static_cast<float>(s.tolerance * length(g2));
  facet.tolerance = static_cast<float>(s.tolerance);
  facet.id = static_cast<std::int32_t>(block.ids[triangle]);
  facet.page = static_cast<std::int32_t>(block.page);
  if (lattice.width != 0) {
    // Whole and fractional part apart: UVs that repeat an image lead far from 0, where single
    // precision would round the fraction away.
    const auto& t = s.texels;
    facet.base[0] = static_cast<std::int32_t>(std::floor(t[0].x));
    facet.base[1] = static_cast<std::int32_t>(std::floor(t[0].y));
    facet.frac[0] = static_cast<float>(t[0].x - std::floor(t[0].x));
    facet.frac[1] = static_cast<float>(t[0].y - std::floor(t[0].y));
    facet.du[0] = static_cast<float>(t[1].x - t[0].x);
    facet.du[1] = static_cast<float>(t[2].x - t[0].x);
    facet.dv[0] = static_cast<float>(t[1].y - t[0].y);
    facet.dv[1] = static_cast<float>(t[2].y - t[0].y);
  }
  return facet;
}

FacetAttributes make_attributes(const store::GeometryBlock& block, std::size_t triangle) {
  std::array<Vec3d, 3> tangents;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& t = block.tangents[block.triangles[triangle][k]];
    tangents[k] = Vec3d{1.0 * t[0], 1.0 * t[1], 1.0 * t[2]} * (1.0 / 32767);
  }
  FacetAttributes out{};
  store(out.t, tangents[0]);
  store(out.t1, tangents[1] - tangents[0]);
  store(out.t2, tangents[2] - tangents[0]);
  out.handedness = block.tangents[block.triangles[triangle][0]][3] < 0 ? -1.0F : 1.0F;
  std::array<Vec4f, 3> colours;
  colours.fill({1, 1, 1, 1});
  for (std::size_t k = 0; k < 3 && !block.colours.empty(); ++k)
    colours[k] = block.colours[block.triangles[triangle][k]];
  const auto samples = [](const Vec4f& c) { return std::array{c.x, c.y, c.z, c.w}; };
  for (std::size_t i = 0; i < 4; ++i) {
    out.c[i] = samples(colours[0])[i];
    out.c1[i] = samples(colours[1])[i] - out.c[i];
    out.c2[i] = samples(colours[2])[i] - out.c[i];
  }
  return out;
}

/// A convex polygon of at most 3 + 4 corners, as (texel coordinates, barycentrics of corners 1 and
/// 2).
struct ClippedCorner {
  Vec2d texel;
  double w1, w2;
};

/// Keeps what lies on the inner side of one window edge: sign * (coordinate - limit) >= 0.
void clip(std::vector<ClippedCorner>& polygon, bool by_x, double limit, double sign,
          std::vector<ClippedCorner>& scratch) {
  scratch.clear();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const ClippedCorner& a = polygon[i];
    const ClippedCorner& b = polygon[(i + 1) % polygon.size()];
    const double da = sign * ((by_x ? a.texel.x : a.texel.y) - limit);
    const double db = sign * ((by_x ? b.texel.x : b.texel.y) - limit);
    if (da >= 0) scratch.push_back(a);
    if ((da < 0) != (db < 0)) {
      const double k = da / (da - db);
      scratch.push_back(
          {{a.texel.x + k * (b.texel.x - a.texel.x), a.texel.y + k * (b.texel.y - a.texel.y)},
           a.w1 + k * (b.w1 - a.w1),
           a.w2 + k * (b.w2 - a.w2)});
    }
  }
  polygon.swap(scratch);
}

Patch bounded(const Setup& s, std::span<const ClippedCorner> polygon, std::uint32_t facet) {
  const auto place = [&](const ClippedCorner& c) {
    return s.corners[0] + (s.corners[1] - s.corners[0]) * c.w1 +
           (s.corners[2] - s.corners[0]) * c.w2;
  };
  Patch patch;
  patch.facet = facet;
  for (const ClippedCorner& corner : polygon) patch.box.extend(Vec3f(place(corner)));
  const Box3f& box = patch.box;
  patch.centre = (box.lo + box.hi) * 0.5F;
  double farthest = 0;
  for (const ClippedCorner& corner : polygon)
    farthest = std::max(farthest, length(place(corner) - Vec3d(patch.centre)));
  // Coordinates are floats: a few of their last places cover every rounding on the way to a hit.
  const float largest = std::max({std::abs(box.lo.x), std::abs(box.lo.y), std::abs(box.lo.z),
                                  std::abs(box.hi.x), std::abs(box.hi.y), std::abs(box.hi.z)});
  const float margin = static_cast<float>(s.tolerance) + 4e-7F * largest;
  patch.radius = static_cast<float>(farthest) + margin;
  patch.box = box.grown(margin);
  return patch;
}

void add_patch(const store::GeometryBlock& block, const Setup& s, bool whole, std::uint32_t facet,
               std::vector<Patch>& patches) {
  // No heap for whole triangles: dense meshes have millions.
  const std::array<ClippedCorner, 3> triangle{
      ClippedCorner{s.texels[0], 0, 0}, {s.texels[1], 1, 0}, {s.texels[2], 0, 1}};
  if (whole) {
    patches.push_back(bounded(s, triangle, facet));
    return;
  }
  std::vector<ClippedCorner> polygon, scratch;
  // Windows meet without a gap: each is the half-open cell of texel coordinates, closed here.
  const double left = static_cast<double>(block.x) * mesh::kBlockEdge;
  const double top = static_cast<double>(block.y) * mesh::kBlockEdge;
  polygon.assign(triangle.begin(), triangle.end());
  clip(polygon, true, left, 1, scratch);
  clip(polygon, true, left + mesh::kBlockEdge, -1, scratch);
  clip(polygon, false, top, 1, scratch);
  clip(polygon, false, top + mesh::kBlockEdge, -1, scratch);
  // A window that a triangle only touches gives a polygon without area, and a patch that finds the
  // facet once more. That is harmless: the winner is a minimum.
  if (!polygon.empty()) patches.push_back(bounded(s, polygon, facet));
}

}  // namespace

SourceBlock make_source_block(const store::GeometryBlock& block, const mesh::Lattice& lattice,
                              bool with_attributes) {
  SourceBlock out;
  out.facets.reserve(block.triangles.size());
  if (with_attributes) out.attributes.reserve(block.triangles.size());
  std::vector<Patch> patches;
  patches.reserve(block.triangles.size());
  for (std::size_t i = 0; i < block.triangles.size(); ++i) {
    Setup s;
    for (std::size_t k = 0; k < 3; ++k) s.corners[k] = position(block, i, k);
    const Vec3d doubled = cross(s.corners[1] - s.corners[0], s.corners[2] - s.corners[0]);
    const double doubled_area = length(doubled);
    // An area so small that its reciprocal is infinite gives no normal either.
    if (!(doubled_area > 0) || !std::isfinite(1.0 / doubled_area)) {
      ++out.degenerate;
      continue;
    }
    s.normal = doubled * (1.0 / doubled_area);
    s.tolerance = std::sqrt(doubled_area / 2);
    bool whole = true;
    if (lattice.width != 0) {
      s.texels = block.texel_corners(lattice, i);
      whole = mesh::is_whole(s.texels, lattice);
      const double texel_area = std::abs(mesh::doubled_area(s.texels[0], s.texels[1], s.texels[2]));
      // One source texel in space is the root of (area in space / area in texels).
      if (texel_area > 0) s.tolerance = std::min(s.tolerance, std::sqrt(doubled_area / texel_area));
    }
    const Facet facet = make_facet(block, i, lattice, s);
    // A needle may have an area, and still a height so small that a gradient exceeds single
    // precision.
    if (!std::isfinite(facet.g1[0] + facet.g1[1] + facet.g1[2] + facet.g2[0] + facet.g2[1] +
                       facet.g2[2])) {
      ++out.degenerate;
      continue;
    }
    add_patch(block, s, whole, static_cast<std::uint32_t>(out.facets.size()), patches);
    out.facets.push_back(facet);
    if (with_attributes) out.attributes.push_back(make_attributes(block, i));
  }
  out.patches.assign(patches.begin(), patches.end());  // no larger than a lease for so many
  return out;
}

}  // namespace pounce::surface
