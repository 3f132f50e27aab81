// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/mesh_writer.h"

#include <fmt/format.h>

#include <cstdio>
#include <initializer_list>
#include <limits>

#include "core/bounds.h"
#include "io/files/output_file.h"
#include "io/json/untrusted.h"
#include "io/problems.h"

namespace pounce::io {

// Written by hand, as the writer of Gaussians does it: the text is the same everywhere.
std::uint64_t write_glb(FILE* stream, const std::string& name, const PlainMesh& mesh) {
  Box3f box;
  for (const Vec3f p : mesh.positions) box.extend(p);
  const std::uint64_t vertices = mesh.positions.size();
  const std::array<std::uint64_t, 4> bytes{vertices * sizeof(Vec3f), vertices * sizeof(Vec3f),
                                           vertices * sizeof(Vec2f), mesh.triangles.size_bytes()};
  const std::uint64_t binary = bytes[0] + bytes[1] + bytes[2] + bytes[3];  // a multiple of four
  const Vec3d& o = mesh.origin;
  std::string materials, primitives, indices;
  std::uint64_t first = 0;  // of its triangles
  for (std::size_t k = 0; k < mesh.materials.size(); ++k) {
    const PlainMaterial& material = mesh.materials[k];
    const char* const comma = k == 0 ? "" : ",";
    materials += fmt::format(
        "{}{{\"name\":{},\"pbrMetallicRoughness\":{{\"metallicFactor\":0}}{}}}", comma,
        json_quoted(material.name), material.double_sided ? ",\"doubleSided\":true" : "");
    primitives += fmt::format(
        "{}{{\"attributes\":{{\"POSITION\":0,\"NORMAL\":1,\"TEXCOORD_0\":2}},"
        "\"indices\":{},\"material\":{}}}",
        comma, 3 + k, k);
    indices += fmt::format(
        ",{{\"bufferView\":3,{}\"componentType\":5125,\"count\":{},\"type\":"
        "\"SCALAR\"}}",
        first == 0 ? "" : fmt::format("\"byteOffset\":{},", first * 12), 3 * material.triangles);
    first += material.triangles;
  }
  std::string json = fmt::format(
      "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"pounce\"}},\"scene\":0,"
      "\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{{\"mesh\":0{}}}],\"materials\":[{}],"
      "\"meshes\":[{{\"primitives\":[{}]}}],",
      o == Vec3d{} ? "" : fmt::format(",\"translation\":[{},{},{}]", o.x, o.y, o.z), materials,
      primitives);
  const auto accessor = [&](std::size_t k, const char* shape) {
    return fmt::format("{{\"bufferView\":{},\"componentType\":5126,\"count\":{},\"type\":\"{}\"", k,
                       vertices, shape);
  };
  json += fmt::format(
      "\"accessors\":[{},\"min\":[{},{},{}],\"max\":[{},{},{}]}},{}}},{}}}{}],\"bufferViews\":[",
      accessor(0, "VEC3"), box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z,
      accessor(1, "VEC3"), accessor(2, "VEC2"), indices);
  std::uint64_t at = 0;
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    json += fmt::format("{}{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{},\"target\":{}}}",
                        k == 0 ? "" : ",", at, bytes[k], k < 3 ? 34962 : 34963);
    at += bytes[k];
  }
  json += fmt::format("],\"buffers\":[{{\"byteLength\":{}}}]}}", binary);
  json.resize((json.size() + 3) / 4 * 4, ' ');  // chunks begin at multiples of four
  const std::uint64_t total = 12 + 8 + json.size() + 8 + binary;
  if (total > std::numeric_limits<std::uint32_t>::max())
    refuse(name, "a .glb is limited to 4 GiB; ask for fewer triangles");
  const auto put = [&](std::span<const std::byte> part) {
    if (!part.empty()) std::fwrite(part.data(), 1, part.size(), stream);
  };
  const auto put_numbers = [&](std::initializer_list<std::uint64_t> numbers) {
    for (const std::uint64_t number : numbers) {
      const auto value = static_cast<std::uint32_t>(number);
      put(std::as_bytes(std::span(&value, 1)));
    }
  };
  put_numbers({0x46546C67, 2, total});     // "glTF"
  put_numbers({json.size(), 0x4E4F534A});  // "JSON"
  put(std::as_bytes(std::span(json)));
  put_numbers({binary, 0x004E4942});  // "BIN"
  put(std::as_bytes(mesh.positions));
  put(std::as_bytes(mesh.normals));
  put(std::as_bytes(mesh.uvs));
  put(std::as_bytes(mesh.triangles));
  return total;
}

std::uint64_t write_glb(const std::string& path, const PlainMesh& mesh) {
  OutputFile file(path);
  const std::uint64_t bytes = write_glb(file.stream(), path, mesh);
  file.check();
  file.commit();
  return bytes;
}

}  // namespace pounce::io
