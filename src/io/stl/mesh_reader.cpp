// SPDX-License-Identifier: Apache-2.0
//
// STL: triangles and nothing else. Corners at exactly the same place are one vertex; normals are
// made as for an OBJ without them, since those in the file are flat and often zero.
//
//   binary   80 bytes of anything, the number of triangles, then 50 bytes each: a normal, three
//            corners, two bytes that are not read. Little endian
//   text     solid NAME, facet normal x y z, outer loop, vertex x y z (three times), endloop,
//            endfacet, endsolid; several solids are parts of one mesh
//
// Neither has a mark: binary files may begin with "solid", too. What has exactly the size that its
// number of triangles asks for is binary.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "core/input_file.h"
#include "io/files/number_stream.h"
#include "io/obj/numbers.h"
#include "io/obj/obj_text.h"
#include "io/ply/triple_set.h"
#include "io/problems.h"
#include "io/read_mesh.h"
#include "mesh/vertex_frames.h"

namespace pounce::io {
namespace {

constexpr double kSmoothAngleDeg = 60;  // as of an OBJ
constexpr std::uint64_t kHeadBytes = 84, kTriangleBytes = 50;
/// Of a text: three corners of "vertex 0 0 0" and their end of line.
constexpr std::uint64_t kLeastTextBytes = 39;

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return out;
}

/// The number of triangles of a binary STL; nothing for a text.
std::optional<std::uint64_t> binary_triangles(const std::string& path) {
  const auto file = open_input(path);
  const std::uint64_t size = file->size_bytes();
  if (size == 0) refuse(path, "the file is empty; export it again");
  std::array<std::byte, kHeadBytes> head{};
  file->read(0, std::span(head).first(std::min<std::uint64_t>(size, kHeadBytes)));
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  std::uint32_t count = 0;
  std::memcpy(&count, head.data() + 80, sizeof count);
  const std::uint64_t wanted = kHeadBytes + kTriangleBytes * count;
  if (size >= kHeadBytes && size == wanted) return count;
  const std::size_t first = std::min(text.find_first_not_of(" \t\r\n"), text.size());
  if (lower(text.substr(first, 5)) == "solid") return std::nullopt;
  if (size < kHeadBytes)
    refuse(path, "the file has {} bytes, fewer than an STL; export it again", size);
  if (size < wanted) {
    refuse(path,
           "truncated: its {} triangles take {} bytes, but the file has {}; copy or export it "
           "again",
           count, wanted, size);
  }
  return count;  // something follows, which some programs write
}

class StlReader {
 public:
  StlReader(const std::string& path, const MeshReading& reading)
      : path_(path), origin_(reading.origin) {
    mesh_.path = path;
    mesh_.files = {path};
  }

  mesh::Mesh read();

 private:
  void read_binary(std::uint64_t triangles);
  void read_text();
  void read_corner(NumberStream& text);
  void end_facet(const NumberStream& text);
  void add_corner(Vec3d position);

  std::string path_;
  const Vec3d origin_;
  mesh::Mesh mesh_;
  mesh::PartsBuilder parts_;
  TripleSet places_;
  std::array<std::uint32_t, 3> corners_{};
  std::size_t corner_count_ = 0;
  bool facet_done_ = false;  ///< of a text: has the facet at hand its three corners?
};

void StlReader::add_corner(Vec3d position) {
  const Vec3f p(position - origin_);
  if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
    refuse(path_,
           "triangle {} has a corner that is not a finite number, or too large for a float; "
           "export it again",
           mesh_.triangles.size());
  }
  const std::uint32_t number = places_.number_of(place_key(p));
  if (number == mesh_.positions.size()) mesh_.positions.push_back(p);
  corners_[corner_count_++] = number;
  if (corner_count_ < 3) return;
  corner_count_ = 0;
  mesh_.triangles.push_back(corners_);
}

void StlReader::read_binary(std::uint64_t triangles) {
  NumberStream stream(path_, kHeadBytes);
  mesh_.triangles.reserve(triangles);
  parts_.start(0, {"default"});
  for (std::uint64_t t = 0; t < triangles; ++t) {
    const std::span<const std::byte> raw = stream.bytes(kTriangleBytes);
    std::array<float, 12> numbers{};
    std::memcpy(numbers.data(), raw.data(), sizeof numbers);
    for (std::size_t corner = 1; corner < 4; ++corner) {
      const float* const p = &numbers[3 * corner];
      add_corner(Vec3d(Vec3f{p[0], p[1], p[2]}));
    }
  }
}

void StlReader::read_corner(NumberStream& text) {
  if (facet_done_)
    refuse(path_, "line {}: a facet of more than three corners; export it as triangles",
           text.line());
  std::array<double, 3> place{};
  for (double& number : place) {
    const std::string word(text.word());
    const auto value = to_double(word);
    if (!value) {
      refuse(path_, "line {}: a vertex holds \"{}\", which is not a finite number; export it again",
             text.line(), word.substr(0, 40));
    }
    number = *value;
  }
  add_corner({place[0], place[1], place[2]});
  facet_done_ = corner_count_ == 0;
}

void StlReader::read_text() {
  NumberStream text(path_);
  constexpr std::array<std::string_view, 5> kPassed{"normal", "outer", "loop", "endloop", "facet"};
  for (std::string_view found = text.word(); !found.empty(); found = text.word()) {
    const std::string word = lower(found);
    if (word == "vertex") {
      read_corner(text);
    } else if (word == "solid") {
      const std::string name = text.rest_of_line();
      parts_.start(static_cast<std::uint32_t>(mesh_.triangles.size()),
                   {name.empty() ? "default" : name});
    } else if (word == "endsolid") {
      text.rest_of_line();
    } else if (word == "normal") {
      for (int k = 0; k < 3; ++k) text.word();
    } else if (word == "endfacet") {
      end_facet(text);
    } else if (std::find(kPassed.begin(), kPassed.end(), word) == kPassed.end()) {
      refuse(path_, "line {} holds \"{}\", which is not STL; the file is damaged, export it again",
             text.line(), word.substr(0, 40));
    }
  }
  if (corner_count_ != 0)
    refuse(path_, "truncated: it ends within a facet; copy or export it again");
}

void StlReader::end_facet(const NumberStream& text) {
  if (!facet_done_)
    refuse(path_, "line {}: a facet of fewer than three corners; export it again", text.line());
  facet_done_ = false;
}

mesh::Mesh StlReader::read() {
  const auto triangles = binary_triangles(path_);
  triangles ? read_binary(*triangles) : read_text();
  if (mesh_.triangles.empty()) refuse(path_, "no triangles; export a model with a surface");
  const auto count = static_cast<std::uint32_t>(mesh_.triangles.size());
  mesh_.parts = parts_.finish(count);
  mesh_.triangle_material.assign(count, 0);
  mesh_.materials.emplace_back().name = "default";
  const std::size_t vertices = mesh_.positions.size();
  places_ = TripleSet();
  std::vector<std::uint32_t> position_of(vertices);
  for (std::uint32_t v = 0; v < vertices; ++v) position_of[v] = v;
  mesh_.normals.assign(vertices, Vec3f{});
  mesh_.tangents.assign(vertices, Vec4f{});
  mesh::smooth_normals(mesh_, position_of, static_cast<std::uint32_t>(vertices),
                       std::vector<bool>(vertices, true), kSmoothAngleDeg);
  mesh::repair_normals(mesh_);
  mesh::complete_tangents(mesh_);
  return std::move(mesh_);
}

}  // namespace

mesh::Mesh read_stl(const std::string& path, const MeshReading& reading) {
  return StlReader(path, reading).read();
}

// How many corners lie together is not known before, and smoothing may part them again: three
// vertices for each triangle.
MeshCost stl_cost(const std::string& path) {
  const auto binary = binary_triangles(path);
  const std::uint64_t triangles =
      binary ? *binary : open_input(path)->size_bytes() / kLeastTextBytes + 1;
  const std::uint64_t vertices = 3 * triangles;
  constexpr std::uint64_t kPerVertex = 12 + 12 + 16;
  MeshCost cost;
  cost.kept_bytes = vertices * kPerVertex + triangles * 16 + (2U << 20);
  const std::uint64_t smoothing = vertices * (8 + 8 + 3 * 16 + 3 * 4) + triangles * (12 + 12);
  cost.peak_bytes = cost.kept_bytes + std::max(TripleSet::bytes(vertices), smoothing) + (4U << 20);
  return cost;
}

}  // namespace pounce::io
