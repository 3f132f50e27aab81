// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/mesh_writer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <initializer_list>
#include <limits>

#include "core/bounds.h"
#include "io/files/output_file.h"
#include "io/json/untrusted.h"
#include "io/problems.h"

namespace pounce::io {
namespace {

/// A material's own vertices, which follow those of the one before: a primitive that named all
/// would cost its reader all.
struct Primitive {
  std::uint64_t first_vertex = 0, vertices = 0;
  std::uint64_t first_triangle = 0;
  Box3f box;
};

struct Grouped {
  std::vector<Primitive> primitives;
  std::vector<std::uint32_t> order;                     ///< of the mesh's vertices
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< counted from their primitive's first
};

Grouped by_material(const PlainMesh& mesh) {
  Grouped out;
  std::vector<std::uint32_t> number(mesh.positions.size());
  std::vector<std::size_t> last_used(mesh.positions.size());  // by which material, from 1
  std::size_t material = 0, triangle = 0;
  for (const PlainMaterial& own : mesh.materials) {
    ++material;
    Primitive primitive{out.order.size(), 0, triangle, {}};
    for (const std::size_t end = triangle + own.triangles; triangle < end; ++triangle) {
      auto& corners = out.triangles.emplace_back(mesh.triangles[triangle]);
      for (std::uint32_t& v : corners) {
        if (last_used[v] != material) {
          last_used[v] = material;
          number[v] = static_cast<std::uint32_t>(primitive.vertices++);
          out.order.push_back(v);
          primitive.box.extend(mesh.positions[v]);
        }
        v = number[v];
      }
    }
    out.primitives.push_back(primitive);
  }
  return out;
}

}  // namespace

namespace {

constexpr const char* kStrength = "KHR_materials_emissive_strength";

/// The members of a material but its name; what is glTF's default is left out.
std::string text_of(const PlainLook& look) {
  std::string pbr;
  const auto add = [&](const std::string& member) {
    pbr += fmt::format("{}{}", pbr.empty() ? "" : ",", member);
  };
  if (look.base_color != PlainLook{}.base_color)
    add(fmt::format("\"baseColorFactor\":[{}]", fmt::join(look.base_color, ",")));
  if (look.metallic != 1) add(fmt::format("\"metallicFactor\":{}", look.metallic));
  if (look.roughness != 1) add(fmt::format("\"roughnessFactor\":{}", look.roughness));
  std::string text = fmt::format("\"pbrMetallicRoughness\":{{{}}}", pbr);
  if (look.emissive != PlainLook{}.emissive)
    text += fmt::format(",\"emissiveFactor\":[{}]", fmt::join(look.emissive, ","));
  if (look.emissive_strength != 1)
    text += fmt::format(",\"extensions\":{{\"{}\":{{\"emissiveStrength\":{}}}}}", kStrength,
                        look.emissive_strength);
  if (look.alpha_cutoff) {
    text += fmt::format(",\"alphaMode\":\"MASK\",\"alphaCutoff\":{}", *look.alpha_cutoff);
  } else if (look.blends) {
    text += ",\"alphaMode\":\"BLEND\"";
  }
  if (look.double_sided) text += ",\"doubleSided\":true";
  return text;
}

}  // namespace

// Written by hand, as the writer of Gaussians does it: the text is the same everywhere.
std::uint64_t write_glb(FILE* stream, const std::string& name, const PlainMesh& mesh) {
  const Grouped grouped = by_material(mesh);
  const std::uint64_t vertices = grouped.order.size();
  const std::array<std::uint64_t, 4> bytes{vertices * sizeof(Vec3f), vertices * sizeof(Vec3f),
                                           vertices * sizeof(Vec2f), mesh.triangles.size_bytes()};
  const std::uint64_t binary = bytes[0] + bytes[1] + bytes[2] + bytes[3];  // a multiple of four
  const Vec3d& o = mesh.origin;
  std::string materials, primitives, accessors;
  bool shines = false;
  const auto accessor = [](int view, std::uint64_t offset, int type, std::uint64_t count,
                           const char* shape) {
    return fmt::format("{{\"bufferView\":{}{},\"componentType\":{},\"count\":{},\"type\":\"{}\"",
                       view, offset == 0 ? "" : fmt::format(",\"byteOffset\":{}", offset), type,
                       count, shape);
  };
  for (std::size_t k = 0; k < mesh.materials.size(); ++k) {
    const PlainMaterial& material = mesh.materials[k];
    const Primitive& own = grouped.primitives[k];
    const char* const comma = k == 0 ? "" : ",";
    materials += fmt::format("{}{{\"name\":{},{}}}", comma, json_quoted(material.name),
                             text_of(material.look));
    shines = shines || material.look.emissive_strength != 1;
    primitives += fmt::format(
        "{}{{\"attributes\":{{\"POSITION\":{},\"NORMAL\":{},\"TEXCOORD_0\":{}}},"
        "\"indices\":{},\"material\":{}}}",
        comma, 4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3, k);
    const Box3f& box = own.box;
    accessors +=
        fmt::format("{}{},\"min\":[{},{},{}],\"max\":[{},{},{}]}},{}}},{}}},{}}}", comma,
                    accessor(0, own.first_vertex * sizeof(Vec3f), 5126, own.vertices, "VEC3"),
                    box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z,
                    accessor(1, own.first_vertex * sizeof(Vec3f), 5126, own.vertices, "VEC3"),
                    accessor(2, own.first_vertex * sizeof(Vec2f), 5126, own.vertices, "VEC2"),
                    accessor(3, own.first_triangle * 3 * sizeof(std::uint32_t), 5125,
                             3 * material.triangles, "SCALAR"));
  }
  std::string json = fmt::format(
      "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"pounce\"}},{}\"scene\":0,"
      "\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{{\"mesh\":0{}}}],\"materials\":[{}],"
      "\"meshes\":[{{\"primitives\":[{}]}}],\"accessors\":[{}],\"bufferViews\":[",
      shines ? fmt::format("\"extensionsUsed\":[\"{}\"],", kStrength) : "",
      o == Vec3d{} ? "" : fmt::format(",\"translation\":[{},{},{}]", o.x, o.y, o.z), materials,
      primitives, accessors);
  std::uint64_t at = 0;
  constexpr std::array<std::size_t, 3> kStrides{sizeof(Vec3f), sizeof(Vec3f), sizeof(Vec2f)};
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    // Said where several primitives share it.
    const std::string stride = k < kStrides.size() && mesh.materials.size() > 1
                                   ? fmt::format(",\"byteStride\":{}", kStrides[k])
                                   : "";
    json += fmt::format("{}{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{}{},\"target\":{}}}",
                        k == 0 ? "" : ",", at, bytes[k], stride, k < 3 ? 34962 : 34963);
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
  const auto put_in_order = [&](const auto& of_vertex) {
    for (const std::uint32_t v : grouped.order) put(std::as_bytes(of_vertex.subspan(v, 1)));
  };
  put_in_order(mesh.positions);
  put_in_order(mesh.normals);
  put_in_order(mesh.uvs);
  put(std::as_bytes(std::span(grouped.triangles)));
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
