// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/bounds.h"
#include "core/page_pool.h"
#include "store/blocks/geometry_block.h"

namespace pounce::surface {

/// One source triangle, ready to be hit: the plane and the dual frame that all its Gaussians share.
///
/// A Gaussian of a mesh is one texel's footprint: mean on the surface, covariance = the texel's
/// Jacobian. On a triangle position is affine in the texel, so plane, barycentric gradients and
/// texel edges say all of that: the hit d = p + t n - m has barycentrics w1 = g1 . d, w2 = g2 . d
/// and texel coordinates base + frac + du1 w1 + du2 w2. Evaluated from the triangle alone, never
/// from a block or a tile, so that it is the same bits wherever it is stored.
struct Facet {
  float n[3];            ///< unit normal of the plane on the front side
  float lean;            ///< no unit normal of the surface is farther from n; 4: any may be
  float m[3];            ///< first corner
  float g1[3], g2[3];    ///< gradients of the barycentrics of corners 1 and 2
  float reach[3];        ///< how far below zero each barycentric may be: tolerance over height
  float tolerance;       ///< how far outside the triangle a hit still counts, in space
  float e1[3], e2[3];    ///< edges from corner 0 to corners 1 and 2
  float s[3];            ///< the surface's normal at corner 0, as the mesh shades it
  float s1[3], s2[3];    ///< what it changes by to corners 1 and 2: affine, not of unit length
  float frac[2];         ///< texel coordinates of corner 0, beyond base
  float du[2], dv[2];    ///< texel edges: x over corners 1 and 2, y over corners 1 and 2
  std::int32_t base[2];  ///< whole texels of corner 0's coordinates, not wrapped
  std::int32_t id;       ///< triangle number in file order: ties go to the smaller
  std::int32_t page;     ///< whose image
};

/// What of a facet lies in its block, with a tight box: a whole small triangle, or a large one
/// inside the block's window of texels.
struct Patch {
  Box3f box;     ///< holds every hit that counts
  Vec3f centre;  ///< and so does this sphere: rays are culled against it
  float radius = 0;
  std::uint32_t facet = 0;
};

/// What else a facet's corners have: each at corner 0, and what it changes by to corners 1 and 2.
struct FacetAttributes {
  float t[3], t1[3], t2[3];  ///< tangent, as the mesh has it: affine, not of unit length
  float handedness;          ///< +1 or -1, as glTF has it
  float c[4], c1[4], c2[4];  ///< colour, linear light and alpha; white where the mesh has none
};

/// A block of the source as projection uses it.
struct SourceBlock {
  PageVector<Facet> facets;
  PageVector<Patch> patches;
  PageVector<FacetAttributes> attributes;  ///< by facet, where they are asked for
  std::uint32_t degenerate = 0;            ///< triangles without area in space: left out

  /// Bytes of a decoded block, known from the index before it is read.
  static std::uint64_t decoded_bytes(std::uint64_t facets, std::uint64_t patches,
                                     bool with_attributes = false) {
    return round_to_pages(facets * sizeof(Facet)) + round_to_pages(patches * sizeof(Patch)) +
           (with_attributes ? round_to_pages(facets * sizeof(FacetAttributes)) : 0) +
           sizeof(SourceBlock);
  }
};

/// Sets up the facets and patches of a stored block, and on demand its facets' attributes.
/// `lattice` is its page's.
SourceBlock make_source_block(const store::GeometryBlock& block, const mesh::Lattice& lattice,
                              bool with_attributes = false);

}  // namespace pounce::surface
