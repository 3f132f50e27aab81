// SPDX-License-Identifier: Apache-2.0
//
// A normal map's vector means a direction in its source's frame. It goes from there into space, and
// from space into the target's frame, so that a renderer of the target sees the same direction:
//
//   v = 2 texel - 1               times the material's scale in x and y
//   d = T v.x + B v.y + N v.z     the source's frame at the hit, as MikkTSpace says: between the
//                                 corners, not normalised, B = handedness N x T
//   d turned from N to N'         the least turn, unless the shape is baked: where a coarse and a
//                                 fine surface differ, a normal map's flat texel stays flat
//   v' = (T' B' N')^-1 d          the target's frame, the same way; then of unit length
//
// Texels are blended before that: within a chart frames change slowly.
#include "shading/shape_output.h"

namespace pounce::shading {

TexelValue transferred_normal(const ShapeOutput& shape, int page, TexelValue map,
                              const TangentFrame& source, const TangentFrame& target) {
  const double scale = shape.scales[static_cast<std::size_t>(page)];
  const double y_scale = shape.source_y == NormalY::up ? scale : -scale;
  const Vec3d coded{map.v[0], map.v[1], map.v[2]};
  const Vec3d v{(2 * coded.x - 1) * scale, (2 * coded.y - 1) * y_scale, 2 * coded.z - 1};
  const TangentFrame from = usable(source);
  Vec3d direction = in_space(from, v);
  if (!shape.keeps_shape)
    direction = turned(direction, unit_vector(from.normal), unit_vector(target.normal));
  Vec3d out = in_frame(target, direction);
  if (out == Vec3d{}) out = {0, 0, 1};  // of a texel that says nothing
  if (shape.output_y == NormalY::down) out.y = -out.y;
  map.v[0] = (out.x + 1) / 2;
  map.v[1] = (out.y + 1) / 2;
  map.v[2] = (out.z + 1) / 2;
  return map;
}

TexelValue baked_value(const ShapeOutput& shape, const HitPoint& at) {
  if (shape.channel == Channel::height) return {.v = {at.height}, .channels = 1};
  if (shape.channel == Channel::vertex_color) {
    TexelValue value{at.colour, 4, true, true, false};
    if (shape.input) apply(*shape.input, value);
    return value;
  }
  const Vec3d p = at.position + shape.origin;
  return {.v = {p.x, p.y, p.z}, .channels = 3};
}

}  // namespace pounce::shading
