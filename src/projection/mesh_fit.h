// SPDX-License-Identifier: Apache-2.0
//
// Does a mesh lie at a target, or would it if it were moved? Asked of places strewn over both.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "core/job_space.h"
#include "core/vec.h"
#include "surface/strewn_places.h"

namespace pounce::projection {

/// Places that are asked, and those of the source that answer.
inline constexpr std::size_t kTargetPlaces = 256, kSourcePlaces = 4096;

/// How a target is to be moved: p becomes linear * (p - centre) + centre + shift.
struct Pose {
  std::array<Vec3d, 3> columns{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  ///< scale times a rotation
  Vec3d centre, shift;
  Vec3d point(Vec3d p) const { return direction(p - centre) + centre + shift; }
  Vec3d direction(Vec3d d) const { return columns[0] * d.x + columns[1] * d.y + columns[2] * d.z; }
};

/// The same as its parts: scale, then axes, then a turn about the centre, then the shift.
struct PoseParts {
  double scale = 1;
  Axes axes;  ///< that it comes near to; those of the file, if it turns by little
  double degrees = 0;
  Vec3d about;  ///< the axis of the turn, of unit length
};
PoseParts parts_of(const Pose& pose);

struct MeshFit {
  /// How near the source lies to the target's places, over how near it does to them moved by
  /// `better`: 0..1, 1 without that.
  double fit = 1;
  /// In which the source lies at the target's surface, where it does much better than as they are.
  std::optional<Pose> better;
  bool opposed = false;  ///< the normals of one side look the other way
  /// Then, of a closed surface: are they those that look inward?
  bool target_inward = false, source_inward = false;
  /// That lie next to the source as they are, and as `better` has them, 0..1 of the places.
  double lie_near = 0, would_lie_near = 0;
};

/// `diagonal`: of the target. The places of the source should be several times those of the target.
MeshFit fit_of(std::span<const surface::Place> target, std::span<const surface::Place> source,
               double diagonal);

}  // namespace pounce::projection
