// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "support/gltf_builder.h"

namespace pounce::test {

/// Writes geometry, normals and UV set 0 of a mesh as OBJ. Floats keep all their bits, except that
/// v is turned over.
inline void write_obj(const std::string& path, const mesh::Mesh& mesh) {
  std::FILE* const file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) throw std::runtime_error("cannot write " + path);
  for (const Vec3f& p : mesh.positions)
    std::fprintf(file, "v %.9g %.9g %.9g\n", double{p.x}, double{p.y}, double{p.z});
  for (const Vec2f& uv : mesh.uv_sets.at(0))
    std::fprintf(file, "vt %.9g %.9g\n", double{uv.x}, 1.0 - double{uv.y});
  for (const Vec3f& n : mesh.normals)
    std::fprintf(file, "vn %.9g %.9g %.9g\n", double{n.x}, double{n.y}, double{n.z});
  for (const auto& t : mesh.triangles) {
    const unsigned a = t[0] + 1, b = t[1] + 1, c = t[2] + 1;
    std::fprintf(file, "f %u/%u/%u %u/%u/%u %u/%u/%u\n", a, a, a, b, b, b, c, c, c);
  }
  std::fclose(file);
}

/// Writes geometry, normals and UV set 0 of a mesh as GLB, bit for bit.
inline void write_glb(const std::string& path, const mesh::Mesh& mesh) {
  std::vector<float> positions, normals, uvs;
  std::vector<std::uint32_t> indices;
  for (const Vec3f& p : mesh.positions) positions.insert(positions.end(), {p.x, p.y, p.z});
  for (const Vec3f& n : mesh.normals) normals.insert(normals.end(), {n.x, n.y, n.z});
  for (const Vec2f& uv : mesh.uv_sets.at(0)) uvs.insert(uvs.end(), {uv.x, uv.y});
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  GltfBuilder file;
  const int p = file.add(positions, "VEC3"), n = file.add(normals, "VEC3"),
            uv = file.add(uvs, "VEC2");
  file.primitive({{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", uv}}, file.add(indices, "SCALAR"));
  file.write_glb(path);
}

}  // namespace pounce::test
