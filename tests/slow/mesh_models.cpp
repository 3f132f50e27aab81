// SPDX-License-Identifier: Apache-2.0
//
// Is a mesh file read as another decoder reads it? Run by tools/slow-models.sh, once for each
// model.
//
//   slow_models FILE CORNERS     compares, prints one line, ends with 1 if they differ
//
// CORNERS is what the other decoder made of it (decode_gltf.mjs, decode_faces.py): one letter, then
// floats x y z u v for each corner of each triangle, v down, NaN for u v where there are none.
//
//   o   triangles are in file order and begin with the same corner
//   p   the file has polygons, which decoders cut in their own ways: corners are compared as a set
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "io/read_mesh.h"
#include "pounce/error.h"

namespace {

using namespace pounce;

using Corner = std::array<float, 5>;  ///< x y z u v
/// Of the length of the box, and of UV space: what floats lose on the way to the place in space.
constexpr double kMostPositions = 2e-6, kMostUvs = 1e-6;

struct Corners {
  bool ordered = true;
  std::vector<Corner> list;
};

Corners load(const char* path) {
  std::ifstream in(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  Corners out;
  if (bytes.empty()) return out;
  out.ordered = bytes[0] == 'o';
  out.list.resize((bytes.size() - 1) / sizeof(Corner));
  std::memcpy(out.list.data(), bytes.data() + 1, out.list.size() * sizeof(Corner));
  return out;
}

std::vector<Corner> corners_of(const mesh::Mesh& mesh) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  std::vector<Corner> out;
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t v : triangle) {
      const Vec3f& p = mesh.positions[v];
      const bool has_uv = mesh.has_uv(0, v);
      out.push_back({p.x, p.y, p.z, has_uv ? mesh.uv_sets[0][v].x : kNan,
                     has_uv ? mesh.uv_sets[0][v].y : kNan});
    }
  }
  return out;
}

/// As a set: sorted, each once.
void sort_once(std::vector<Corner>& corners) {
  for (Corner& corner : corners) {
    for (float& number : corner) number = std::isnan(number) ? -1e30F : number;
  }
  std::sort(corners.begin(), corners.end());
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
}

double difference(float a, float b) {
  if (std::isnan(a) != std::isnan(b)) return std::numeric_limits<double>::infinity();
  return std::isnan(a) ? 0 : std::abs(static_cast<double>(a) - static_cast<double>(b));
}

/// The longest side of the box.
double length_of(const std::vector<Corner>& corners) {
  double longest = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [least, most] =
        std::minmax_element(corners.begin(), corners.end(),
                            [k](const Corner& a, const Corner& b) { return a[k] < b[k]; });
    longest = std::max(longest, static_cast<double>((*most)[k] - (*least)[k]));
  }
  return longest;
}

int compare(const char* path, const char* reference) {
  const mesh::Mesh mesh = io::read_mesh(path);
  std::vector<Corner> own = corners_of(mesh);
  Corners other = load(reference);
  const std::size_t triangles = mesh.triangles.size(), others = other.list.size() / 3;
  if (triangles != others || triangles == 0) {
    fmt::print("DIFFERS  {}: {} triangles, {} by the other decoder\n", path, triangles, others);
    return 1;
  }
  const double length = length_of(own);
  const bool has_uvs = std::any_of(other.list.begin(), other.list.end(),
                                   [](const Corner& corner) { return !std::isnan(corner[3]); });
  if (!other.ordered) {
    sort_once(own);
    sort_once(other.list);
  }
  double positions = own.size() == other.list.size() ? 0 : std::numeric_limits<double>::infinity();
  double uvs = 0;
  for (std::size_t i = 0; i < std::min(own.size(), other.list.size()); ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      positions = std::max(positions, difference(own[i][k], other.list[i][k]) / length);
    for (std::size_t k = 3; k < 5; ++k)
      uvs = std::max(uvs, difference(own[i][k], other.list[i][k]));
  }
  const bool equal = positions <= kMostPositions && uvs <= kMostUvs;
  fmt::print("{}  {}: {} triangles, positions within {:.2g} of the box, {}\n",
             equal ? "same   " : "DIFFERS", path, triangles, positions,
             has_uvs ? fmt::format("UVs within {:.2g}", uvs) : "no UVs");
  return equal ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3) {
    fmt::print(stderr, "usage: slow_models FILE CORNERS\n");
    return 2;
  }
  return compare(argv[1], argv[2]);
} catch (const pounce::Error& e) {
  fmt::print("REFUSED  {}\n", e.what());
  return 1;
}
