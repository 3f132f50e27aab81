// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "core/file.h"
#include "core/job_space.h"
#include "io/splats/scene.h"

namespace pounce::io {

/// Is a PLY a coloured point cloud: vertices with a place and a colour, which are no Gaussians, and
/// no faces? False for a damaged header.
bool is_point_ply(const ReadFile& file, const std::string& path);

/// A coloured point cloud as scanners, CloudCompare, MeshLab and photogrammetry write it: x y z,
/// red green blue (r g b, diffuse_red ...) and, if they are there, alpha and nx ny nz, of any scalar
/// type, as text or as binary of either byte order. Integer colours are fractions of their type's
/// largest, floats are 0..1. What is not binary little endian, or has lists in its rows, is
/// converted into a scratch file by prepare(). Gaussians have one size, about the spacing, until
/// gaussian::make_discs() has seen their neighbours. Throws Error(input) naming file, what is wrong,
/// and the cure, Error(storage).
std::unique_ptr<SplatScene> open_point_ply(const std::string& path, const Axes& axes);

}  // namespace pounce::io
