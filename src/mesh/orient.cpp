// SPDX-License-Identifier: Apache-2.0
#include "mesh/orient.h"

#include <utility>

namespace pounce::mesh {

void orient(Mesh& mesh, const Axes& axes) {
  if (axes == Axes{}) return;
  for (Vec3f& position : mesh.positions) position = axes.apply(position);
  for (Vec3f& normal : mesh.normals) normal = axes.apply(normal);
  const bool mirrors = axes.mirrors();
  for (Vec4f& tangent : mesh.tangents) {
    const Vec3f t = axes.apply(Vec3f{tangent.x, tangent.y, tangent.z});
    tangent = {t.x, t.y, t.z, mirrors ? -tangent.w : tangent.w};
  }
  if (!mirrors) return;
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

}  // namespace pounce::mesh
