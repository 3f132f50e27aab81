// SPDX-License-Identifier: Apache-2.0
#include "write_glb.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <span>
#include <utility>

#include "core/bounds.h"
#include "pounce/error.h"

namespace pounce::fixture {
namespace {

constexpr int kFloat = 5126, kUnsignedInt = 5125;   // glTF component types
constexpr int kVertices = 34962, kIndices = 34963;  // glTF buffer view targets
constexpr std::uint32_t kGlbMagic = 0x46546C67U, kJsonChunk = 0x4E4F534AU,
                        kBinaryChunk = 0x004E4942U;

std::uint64_t padded(std::uint64_t size_bytes) { return (size_bytes + 3) / 4 * 4; }

GlbWriter::Json vec_json(Vec3f v) { return {v.x, v.y, v.z}; }

/// Bounds of all positions as stored. Rows in parallel; minima and maxima do not depend on the
/// order.
Box3f grid_bounds(const GridMesh& mesh) {
  Box3f bounds;
  for (const GridChart& chart : mesh) {
    std::vector<Box3f> rows(chart.rows + 1);
    tbb::parallel_for(std::uint32_t{0}, chart.rows + 1, [&](std::uint32_t row) {
      for (std::uint32_t column = 0; column <= chart.columns; ++column) {
        rows[row].extend(Vec3f(chart.point(column, row).position));
      }
    });
    for (const Box3f& row : rows) bounds.extend(row);
  }
  return bounds;
}

std::size_t vertex_floats(const GridMesh& mesh) { return 6 + 2 * mesh.front().uv_sets.size(); }

/// Position, normal and UVs of every grid point, some rows at a time.
void write_grid_vertices(const GridMesh& mesh, OutputFile& out) {
  constexpr std::uint32_t kRowsAtOnce = 32;
  const std::size_t floats = vertex_floats(mesh);
  std::vector<float> buffer;
  for (const GridChart& chart : mesh) {
    const std::size_t row_floats = (std::size_t{chart.columns} + 1) * floats;
    for (std::uint32_t first = 0; first <= chart.rows; first += kRowsAtOnce) {
      const std::uint32_t count = std::min(kRowsAtOnce, chart.rows + 1 - first);
      buffer.resize(row_floats * count);
      tbb::parallel_for(std::uint32_t{0}, count, [&](std::uint32_t i) {
        float* f = buffer.data() + i * row_floats;
        for (std::uint32_t column = 0; column <= chart.columns; ++column) {
          const SurfacePoint point = chart.point(column, first + i);
          const Vec3f p(point.position), n(point.normal);
          for (const float value : {p.x, p.y, p.z, n.x, n.y, n.z}) *f++ = value;
          for (const UvFrame& frame : chart.uv_sets) {
            const Vec2d uv = frame.to_uv({column * 1.0, (first + i) * 1.0});
            *f++ = static_cast<float>(uv.x);
            *f++ = static_cast<float>(uv.y);
          }
        }
      });
      out.append(buffer.data(), buffer.size() * sizeof(float));
    }
  }
}

void write_grid_indices(const GridMesh& mesh, OutputFile& out) {
  std::uint32_t base = 0;
  std::vector<std::uint32_t> row_indices;
  for (const GridChart& chart : mesh) {
    const std::uint32_t stride = chart.columns + 1;
    for (std::uint32_t row = 0; row < chart.rows; ++row) {
      row_indices.clear();
      for (std::uint32_t column = 0; column < chart.columns; ++column) {
        const std::uint32_t upper = base + row * stride + column, lower = upper + stride;
        row_indices.insert(row_indices.end(),
                           {upper, lower, lower + 1, upper, lower + 1, upper + 1});
      }
      out.append(row_indices.data(), row_indices.size() * sizeof(std::uint32_t));
    }
    base += static_cast<std::uint32_t>(chart.vertex_count());
  }
}

}  // namespace

GlbWriter::GlbWriter() {
  json_["asset"] = {{"version", "2.0"}, {"generator", "pounce-fixture"}};
  json_["scene"] = 0;
  json_["scenes"] = Json::array({{{"nodes", Json::array()}}});
}

std::size_t GlbWriter::add_view(std::uint64_t size_bytes, MakePiece make, int target) {
  Json view{{"buffer", 0}, {"byteOffset", binary_bytes_}, {"byteLength", size_bytes}};
  if (target != 0) view["target"] = target;
  json_["bufferViews"].push_back(std::move(view));
  binary_bytes_ += padded(size_bytes);
  pieces_.push_back({size_bytes, std::move(make)});
  return json_["bufferViews"].size() - 1;
}

std::size_t GlbWriter::add_accessor(std::size_t view, std::uint64_t offset_bytes,
                                    int component_type, std::uint64_t count, const char* type) {
  Json accessor{{"bufferView", view}};
  if (offset_bytes != 0) accessor["byteOffset"] = offset_bytes;
  accessor["componentType"] = component_type;
  accessor["count"] = count;
  accessor["type"] = type;
  json_["accessors"].push_back(std::move(accessor));
  return json_["accessors"].size() - 1;
}

std::size_t GlbWriter::add_texture(Json image) {
  if (!json_.contains("samplers")) {
    json_["samplers"] = Json::array({{{"wrapS", 10497}, {"wrapT", 10497}}});  // repeat
  }
  json_["images"].push_back(std::move(image));
  json_["textures"].push_back({{"sampler", 0}, {"source", json_["images"].size() - 1}});
  return json_["textures"].size() - 1;
}

std::size_t GlbWriter::add_embedded_texture(const std::string& path) {
  const std::size_t view = add_view(
      file_size_bytes(path), [path](OutputFile& out) { append_file(path, out); }, 0);
  return add_texture(
      {{"bufferView", view}, {"mimeType", path.ends_with(".png") ? "image/png" : "image/jpeg"}});
}

std::size_t GlbWriter::add_external_texture(const std::string& uri) {
  return add_texture({{"uri", uri}});
}

std::size_t GlbWriter::add_material(const std::string& name, int base_color_texture) {
  Json surface{{"metallicFactor", 0}};
  if (base_color_texture >= 0) surface["baseColorTexture"] = {{"index", base_color_texture}};
  json_["materials"].push_back({{"name", name}, {"pbrMetallicRoughness", std::move(surface)}});
  return json_["materials"].size() - 1;
}

std::size_t GlbWriter::add_mesh(const std::string& name) {
  json_["meshes"].push_back({{"name", name}, {"primitives", Json::array()}});
  json_["nodes"].push_back({{"name", name}, {"mesh", json_["meshes"].size() - 1}});
  const std::size_t node = json_["nodes"].size() - 1;
  json_["scenes"][0]["nodes"].push_back(node);
  return node;
}

GlbWriter::Json& GlbWriter::new_primitive(int material) {
  Json primitive{{"attributes", Json::object()}};
  if (material >= 0) primitive["material"] = material;
  Json& primitives = json_["meshes"].back()["primitives"];
  primitives.push_back(std::move(primitive));
  return primitives.back();
}

void GlbWriter::add_primitive(const GridMesh& mesh, int material) {
  std::uint64_t vertices = 0, triangles = 0;
  for (const GridChart& chart : mesh) {
    vertices += chart.vertex_count();
    triangles += chart.triangle_count();
  }
  const std::uint64_t stride = vertex_floats(mesh) * sizeof(float);
  if (vertices * stride + triangles * 12 > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorKind::usage,
                fmt::format("{} triangles do not fit into a GLB of 4 GiB; ask for "
                            "fewer",
                            triangles));
  }
  const std::size_t view = add_view(
      vertices * stride, [&mesh](OutputFile& out) { write_grid_vertices(mesh, out); }, kVertices);
  json_["bufferViews"][view]["byteStride"] = stride;
  Json& attributes = new_primitive(material)["attributes"];
  attributes["POSITION"] = add_accessor(view, 0, kFloat, vertices, "VEC3");
  const Box3f bounds = grid_bounds(mesh);
  json_["accessors"].back()["min"] = vec_json(bounds.lo);
  json_["accessors"].back()["max"] = vec_json(bounds.hi);
  attributes["NORMAL"] = add_accessor(view, 12, kFloat, vertices, "VEC3");
  for (std::size_t k = 0; k < mesh.front().uv_sets.size(); ++k) {
    attributes[fmt::format("TEXCOORD_{}", k)] =
        add_accessor(view, 24 + 8 * k, kFloat, vertices, "VEC2");
  }
  const std::size_t indices = add_view(
      triangles * 12, [&mesh](OutputFile& out) { write_grid_indices(mesh, out); }, kIndices);
  json_["meshes"].back()["primitives"].back()["indices"] =
      add_accessor(indices, 0, kUnsignedInt, triangles * 3, "SCALAR");
}

void GlbWriter::add_primitive(SmallMesh small, int material) {
  const auto mesh = std::make_shared<const SmallMesh>(std::move(small));
  new_primitive(material);
  const auto add = [&](const auto& list, const char* type, int component_type, int target) {
    const auto bytes = std::as_bytes(std::span(list));
    const std::size_t view = add_view(
        bytes.size(), [mesh, bytes](OutputFile& out) { out.append(bytes.data(), bytes.size()); },
        target);
    return add_accessor(view, 0, component_type, list.size(), type);
  };
  const auto primitive = [&]() -> Json& { return json_["meshes"].back()["primitives"].back(); };
  primitive()["attributes"]["POSITION"] = add(mesh->positions, "VEC3", kFloat, kVertices);
  Box3f bounds;
  for (const Vec3f p : mesh->positions) bounds.extend(p);
  json_["accessors"].back()["min"] = vec_json(bounds.lo);
  json_["accessors"].back()["max"] = vec_json(bounds.hi);
  if (!mesh->normals.empty()) {
    primitive()["attributes"]["NORMAL"] = add(mesh->normals, "VEC3", kFloat, kVertices);
  }
  for (std::size_t k = 0; k < mesh->uv_sets.size(); ++k) {
    primitive()["attributes"][fmt::format("TEXCOORD_{}", k)] =
        add(mesh->uv_sets[k], "VEC2", kFloat, kVertices);
  }
  if (!mesh->indices.empty()) {
    primitive()["indices"] = add(mesh->indices, "SCALAR", kUnsignedInt, kIndices);
  }
}

void GlbWriter::write(const std::string& path) {
  json_["buffers"] = Json::array({{{"byteLength", binary_bytes_}}});
  std::string text = json_.dump();
  text.resize(padded(text.size()), ' ');
  const std::uint64_t total = 12 + 8 + text.size() + 8 + binary_bytes_;
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(
        ErrorKind::usage,
        fmt::format("{}: would be {} bytes, but a GLB holds less than 4 GiB; ask for a smaller "
                    "texture or fewer triangles",
                    path, total));
  }
  OutputFile out(path);
  const auto word = [&out](std::uint64_t value) {
    const auto word32 = static_cast<std::uint32_t>(value);
    out.append(&word32, sizeof word32);
  };
  for (const std::uint64_t value : {std::uint64_t{kGlbMagic}, std::uint64_t{2}, total}) word(value);
  word(text.size());
  word(kJsonChunk);
  out.append(text);
  word(binary_bytes_);
  word(kBinaryChunk);
  constexpr std::array<char, 3> kZeros{};
  for (const Piece& piece : pieces_) {
    const std::uint64_t before = out.size_bytes();
    piece.make(out);
    if (out.size_bytes() - before != piece.size_bytes) {
      throw Error(ErrorKind::internal,
                  fmt::format("{}: a piece of the GLB changed its size", path));
    }
    out.append(kZeros.data(), padded(piece.size_bytes) - piece.size_bytes);
  }
  out.commit();
}

}  // namespace pounce::fixture
