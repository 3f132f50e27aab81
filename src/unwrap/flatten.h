// SPDX-License-Identifier: Apache-2.0
//
// A patch of triangles, bent in space, laid into the plane as rigidly as possible.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "core/vec.h"
#include "unwrap/unwrap.h"

namespace pounce::unwrap {

/// A part of a surface: triangles over points of its own.
struct Patch {
  std::vector<Vec3d> points;
  std::vector<Triangle> triangles;  ///< counter-clockwise, seen from where they face
};

/// Where each point lies in the plane, v downwards, in space's units. Every triangle keeps its
/// shape as far as its neighbours let it: local rotations and one linear system in turns (Liu et
/// al., "A Local/Global Approach to Mesh Parameterization", 2008), from how the patch looks along
/// `axis`, a unit vector. Triangles may overlap or lie on their faces where it curves too much.
/// `poll` is called now and then and may throw.
std::vector<Vec2d> lay_flat(const Patch& patch, Vec3d axis, const std::function<void()>& poll);

/// How a triangle is deformed: the larger of the most that a length in it grows and the most that
/// one shrinks, 1 for none, infinity for one that lies on its face. One without area in space: 1.
double stretch_of(const Patch& patch, std::span<const Vec2d> flat, const Triangle& triangle);

}  // namespace pounce::unwrap
